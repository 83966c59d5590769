"""The kinds of number a mechanism file holds, and how each becomes SI.

A file states every length in its `length_unit`; all else is SI already. The unit stands in the
type of a field, so that reading a file is one validation with the context `{"per_metre": 1000.0}`
for millimetres. Without a context (in Python) numbers are taken as SI.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationInfo

PER_METRE = {"m": 1.0, "mm": 1000.0}


def _per_metre(info: ValidationInfo) -> float:
    return (info.context or {}).get("per_metre", 1.0)


def _length(value: float, info: ValidationInfo) -> float:
    # Division rounds once: 13.215 mm becomes the double nearest to 0.013215.
    return value / _per_metre(info)


def _curvature(value: float, info: ValidationInfo) -> float:
    return value * _per_metre(info)


def _name(value: str) -> str:
    if value != value.strip() or any(c in ',;"' or not c.isprintable() for c in value):
        raise ValueError("a name has no comma, semicolon, quote or outer space")
    return value


def _interval(value: tuple[float, float]) -> tuple[float, float]:
    if not value[0] < value[1]:
        raise ValueError(f"expected [lower, upper] with lower < upper, got {list(value)}")
    return value


def _nonzero(value: tuple[float, float, float]) -> tuple[float, float, float]:
    if not any(value):
        raise ValueError("a direction cannot be the zero vector")
    return value


Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Positive = Annotated[Number, Field(gt=0)]
NonNegative = Annotated[Number, Field(ge=0)]
Fraction = Annotated[Number, Field(ge=0, le=1)]
Length = Annotated[Number, AfterValidator(_length)]
PositiveLength = Annotated[Positive, AfterValidator(_length)]
NonNegativeLength = Annotated[NonNegative, AfterValidator(_length)]
Curvature = Annotated[Number, AfterValidator(_curvature)]
Vector = tuple[Number, Number, Number]
Point = tuple[Length, Length, Length]
Direction = Annotated[Vector, AfterValidator(_nonzero)]
Interval = Annotated[tuple[Length, Length], AfterValidator(_interval)]
Name = Annotated[str, Field(min_length=1), AfterValidator(_name)]


class Table(BaseModel):
    """A table of the file: frozen, and with no key that it does not know."""

    model_config = ConfigDict(extra="forbid", frozen=True, populate_by_name=True)
