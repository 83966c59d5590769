"""What `identify` is asked for: the numbers that are unknown, what is known of them, the noise."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, StrictBool, model_validator

from ..errors import InputError, did_you_mean
from ..mechanism.study_file import File, Finite, Numbers, Positive, Seed, StudyFile
from ..mechanism.table import Table

Values = Annotated[tuple[Finite, ...] | Finite, Numbers]
Prior = Annotated[tuple[Values, Values], Numbers]
HeldBack = Annotated[float, Field(strict=True, ge=0, lt=0.9)]


class NumbersStudy(StudyFile):
    """Unknown numbers of a mechanism's file, and what is known of them."""

    numbers: tuple[str, ...] = Field(
        min_length=1, description='unknown numbers by path, such as "platform.mass"'
    )
    prior: dict[str, Prior] = Field(
        default={}, description="path -> [mean, standard deviation], of a vector two lists"
    )

    @model_validator(mode="after")
    def _among_numbers(self) -> Self:
        for name in ("shared", "prior", "tolerance"):
            for path in getattr(self, name, ()):
                if path not in self.numbers:
                    raise ValueError(
                        f"{name}: {path} is not among numbers.{did_you_mean(path, self.numbers)}"
                    )
        return self

    def priors(self, nominal: np.ndarray, paths: Sequence[str]) -> tuple[np.ndarray, np.ndarray]:
        """Means and standard deviations, (U,) each; infinite where nothing is known.

        Args: nominal: the file's own, (U,);  paths: which of `numbers` each is of.
        """
        mean, spread, owner = nominal.copy(), np.full(len(nominal), np.inf), np.array(paths)
        for path, size in getattr(self, "tolerance", {}).items():
            spread[owner == path] = size
        for path, given in self.prior.items():
            own = np.flatnonzero(owner == path)
            for into, values in zip((mean, spread), map(np.ravel, given), strict=True):
                if values.size not in (1, own.size):
                    raise InputError(
                        f"prior: {path} has {own.size} numbers; expected as many, or one, for its "
                        f"mean and its deviation, got {values.size}"
                    )
                into[own] = values
            if (spread[own] <= 0).any():
                raise InputError(
                    f"prior.{path}: expected [mean, standard deviation above 0], got a deviation "
                    f"of {spread[own].min():g}; leave a known number out of numbers"
                )
        return mean, spread


class Noise(Table):
    """Standard deviations of what was measured; without: from what smoothing removes."""

    effort: Positive | None = Field(default=None, description="of efforts [N m or N]")
    encoder: Positive | None = Field(default=None, description="of joint readings [rad or m]")


class FitOptions(Table):
    """How the log is read and fitted."""

    smooth: Positive = Field(default=10.0, description="cut-off of the low-pass filter [Hz]")
    trim: Finite | None = Field(
        default=None, ge=0, description="left out at both ends [s]; default: 1.5 periods of smooth"
    )
    delay: StrictBool | Literal["channel"] = Field(
        default=False,
        description='fit a delay of the efforts behind the encoders [s]; "channel": of each',
    )
    gain: StrictBool = Field(default=False, description="fit the error of each effort's gain")
    bias: StrictBool = Field(default=False, description="fit a constant error of each effort")
    robust: StrictBool = Field(
        default=False, description="replace readings far off their neighbours before smoothing"
    )
    validate_: HeldBack | File = Field(
        default=0.25, alias="validate", description="share of the log's end, or the file of a log"
    )
    load_point: str | None = Field(
        default=None, description="where the load acts: a point by name, or x,y,z in {M} [m]"
    )
    seed: Seed = 1


class FitStudy(NumbersStudy):
    """Unknown numbers of a mechanism's file, and how they are fitted."""

    shared: tuple[str, ...] = Field(
        default=(), description="of these a star stands for one number, not one a chain"
    )
    noise: Noise = Noise()
    options: FitOptions = FitOptions()

    @model_validator(mode="after")
    def _starred(self) -> Self:
        for path in self.shared:
            if "*" not in path:
                raise ValueError(f"shared: {path} has no star; leave it out")
        return self
