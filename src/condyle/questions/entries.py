"""The kinds of number that tables of a scenario hold, and what such tables are bound to."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import AfterValidator, Field, ValidationInfo

from ..errors import InputError
from ..mechanism.mechanism import Mechanism
from ..mechanism.quantities import Number

LARGEST = 1e12  # of a gain, SI
SLOWEST = 1e-3  # Hz
FASTEST = 1e6  # Hz


def _file(value: str, info: ValidationInfo) -> str:
    """A file named in a scenario stands where the scenario says: next to it."""
    folder = (info.context or {}).get("folder")
    path = Path(value) if folder is None else Path(folder) / value
    if not path.is_file():
        raise ValueError(f'there is no file "{path}"')
    return str(path)


def _bounded(value: float) -> float:
    if abs(value) > LARGEST:
        raise ValueError(f"expected at most {LARGEST:g}, got {value:g}")
    return value


_number: Any = Field(strict=True, allow_inf_nan=False)
_Plain = Annotated[float, _number, AfterValidator(_bounded)]
File = Annotated[str, Field(min_length=1, strict=True), AfterValidator(_file)]
Gain = Annotated[_Plain, Field(ge=0)]
Positive = Annotated[_Plain, Field(gt=0)]
Frequency = Annotated[float, _number, Field(ge=SLOWEST, le=FASTEST)]
Count = Annotated[int, Field(strict=True, ge=0, le=1000)]
# One for all, or one each.
Gains = Gain | tuple[Gain, ...]
Signed = _Plain | tuple[_Plain, ...]
Vector = tuple[Number, Number, Number]


@dataclass(frozen=True)
class Machine:
    """What a table of a scenario is bound to.

    independent: names of the coordinates q.
    place:       (name or None) -> which point of the platform a load or a law is meant to be at.
    tabled:      (file) -> a load's times (N,) [s] and wrenches (N, 6) [N, N m].
    """

    mechanism: Mechanism
    independent: Sequence[str]
    place: Callable[[str | None], str]
    tabled: Callable[[str], tuple[np.ndarray, np.ndarray]]

    @property
    def chains(self) -> Sequence[str]:
        """Names of the chains."""
        return self.mechanism.chain_names

    def point(self, name: str | None) -> tuple[str, np.ndarray]:
        """A point's name, and where it is in {M}, (3,) [m]."""
        name = self.place(name)
        return name, np.array(self.mechanism.platform.points[name], dtype=float)


def each(given: float | Sequence[float], names: Iterable[str], what: str) -> np.ndarray:
    """One number for all of `names`, or one each.

    Raises: InputError: for another count.
    """
    names, values = list(names), np.atleast_1d(np.asarray(given, dtype=float))
    if values.size not in (1, len(names)):
        raise InputError(
            f"{what}: expected one number, or {len(names)}: one for each of "
            f"{', '.join(names)}; got {values.size}"
        )
    return np.broadcast_to(values, len(names)).copy()


def unit(direction: Sequence[float]) -> np.ndarray:
    """The vector, of length 1."""
    return np.asarray(direction, dtype=float) / np.sqrt(np.sum(np.square(direction)))
