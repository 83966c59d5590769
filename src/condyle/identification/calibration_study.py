"""The study file of `calibrate`: geometric numbers, what was measured, and the two frames."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from ..markers.rigid import FEWEST
from ..mechanism.study_file import File, Finite, Label, LengthUnit, Numbers, Positive, Seed
from ..mechanism.table import Table
from .fit_study import HeldBack, NumbersStudy

Six = Annotated[tuple[Finite, Finite, Finite, Finite, Finite, Finite], Numbers]


class Frames(Table):
    """Where measured numbers stand: estimated from them, or given."""

    measuring: Six | Literal["estimate"] = Field(
        default="estimate",
        description="{S} in the measuring frame: x, y, z [m], alpha, beta, gamma [rad]",
    )
    target: Six | Literal["estimate"] = Field(
        default="estimate", description="the target's frame in {M}, likewise; of measured poses"
    )


class CalibrationNoise(Table):
    """Standard deviations of what was measured."""

    position: Positive = Field(default=5e-5, description="of places [m]")
    angle: Positive = Field(default=1e-3, description="of measured angles [rad]")
    encoder: Positive = Field(default=1e-4, description="of joint readings [rad or m]")


class Markers(Table):
    """A recording that saw markers on the platform while the rows' joints were read."""

    file: File = Field(description="C3D, TRC or a table; relative paths start at the study file")
    platform: Annotated[tuple[Label, ...], Field(min_length=1)] = Field(
        description="labels of markers on the platform; a point of the file by its own name"
    )
    fixed: tuple[Label, ...] = Field(
        default=(), description="3 or more on the base, whose motion is taken out"
    )
    unit: LengthUnit | None = Field(
        default=None, description="of lengths, in place of what the recording says"
    )
    window: Positive = Field(default=0.1, description="about a row's t that is averaged [s]")

    @model_validator(mode="after")
    def _apart(self) -> Self:
        if 0 < len(self.fixed) < FEWEST:
            raise ValueError(f"fixed: expected {FEWEST} markers or more, or none")
        labels = (*self.platform, *self.fixed)
        if len(set(labels)) < len(labels):
            raise ValueError("platform, fixed: a marker is given twice")
        return self


class CalibrationOptions(Table):
    """How rows are used."""

    validate_: HeldBack = Field(
        default=0.25, alias="validate", description="share of the rows that are held back"
    )
    seed: Seed = 1


class CalibrationStudy(NumbersStudy):
    """Unknown geometric numbers of a mechanism's file, and how they are found."""

    tolerance: dict[str, Positive] = Field(
        default={}, description="path -> standard deviation about the file's value"
    )
    frames: Frames = Frames()
    markers: Markers | None = Field(default=None, description="of a recording, for rows with t")
    noise: CalibrationNoise = CalibrationNoise()
    options: CalibrationOptions = CalibrationOptions()
