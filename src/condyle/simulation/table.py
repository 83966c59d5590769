"""What every table of a scenario is, and the kinds of number it holds."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from pydantic import AfterValidator, Field, ValidationInfo

from ..mechanism.quantities import (
    Direction,
    Length,
    Name,
    NonNegativeLength,
    Number,
    PositiveLength,
    listed,
)
from ..mechanism.table import Table

__all__ = [
    "Count",
    "Direction",
    "File",
    "Frequency",
    "Gain",
    "Gains",
    "Length",
    "Name",
    "NonNegativeLength",
    "Number",
    "Positive",
    "PositiveLength",
    "Table",
    "Vector",
    "listed",
]

LARGEST = 1e12  # of a gain, SI
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
Frequency = Annotated[float, _number, Field(gt=0, le=FASTEST)]
Count = Annotated[int, Field(strict=True, ge=0, le=1000)]
# One for all, or one each.
Gains = Gain | tuple[Gain, ...]
Vector = tuple[Number, Number, Number]
