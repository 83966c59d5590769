"""What `calibrate` is asked for: geometric numbers, what was measured, and the two frames."""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, Field, model_validator

from ..markers.rigid import FEWEST
from ..mechanism.study_file import Finite, StudyFile, numbers
from ..mechanism.table import FrozenTable, Table
from ..mechanism.table_schema import schema_of
from .fit_study import Positive, Prior

Six = Annotated[tuple[Finite, Finite, Finite, Finite, Finite, Finite], BeforeValidator(numbers)]


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


Label = Annotated[str, Field(min_length=1, max_length=200)]


class Markers(Table):
    """A recording that saw markers on the platform while the rows' joints were read."""

    file: Annotated[str, Field(min_length=1)] = Field(
        description="C3D, TRC or a table; relative paths start at the study file"
    )
    platform: Annotated[tuple[Label, ...], Field(min_length=1)] = Field(
        description="labels of markers on the platform; a point of the file by its own name"
    )
    fixed: tuple[Label, ...] = Field(
        default=(), description="3 or more on the base, whose motion is taken out"
    )
    unit: Literal["m", "cm", "mm", "um"] | None = Field(
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

    validate_: Annotated[float, Field(strict=True, ge=0, lt=0.9)] = Field(
        default=0.25, alias="validate", description="share of the rows that are held back"
    )
    seed: Annotated[int, Field(strict=True, ge=0)] = 1


class CalibrationStudy(StudyFile):
    """Unknown geometric numbers of a mechanism's file, and how they are found."""

    numbers: tuple[str, ...] = Field(
        min_length=1, description='unknown numbers by path, such as "chain.*.actuator.zero"'
    )
    prior: dict[str, Prior] = Field(
        default={}, description="path -> [mean, standard deviation], of a vector two lists"
    )
    tolerance: dict[str, Positive] = Field(
        default={}, description="path -> standard deviation about the file's value"
    )
    frames: Frames = Frames()
    markers: Markers | None = Field(default=None, description="of a recording, for rows with t")
    noise: CalibrationNoise = CalibrationNoise()
    options: CalibrationOptions = CalibrationOptions()

    @model_validator(mode="after")
    def _known(self) -> Self:
        for name in ("prior", "tolerance"):
            table = getattr(self, name)
            object.__setattr__(self, name, FrozenTable(table))
            for path in table:
                if path not in self.numbers:
                    raise ValueError(f"{name}: {path} is not among numbers")
        return self


def json_schema() -> dict[str, Any]:
    """The JSON schema of calibration studies, for editors."""
    return {**schema_of(CalibrationStudy), "title": "condyle calibration"}
