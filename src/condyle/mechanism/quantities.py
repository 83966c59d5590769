"""The kinds of number a mechanism file holds, how each becomes SI, and how large it may be.

A file states every length in its `length_unit`; all else is SI already. The unit stands in the
type of a field, so that reading a file is one validation with the context `{"per_metre": 1000.0}`
for millimetres. Without a context (in Python) numbers are taken as SI.

Beyond the bounds here no machine was ever built, and products of such numbers overflow.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any, get_args

from pydantic import (
    AfterValidator,
    Field,
    PlainValidator,
    TypeAdapter,
    ValidationInfo,
    WithJsonSchema,
)
from pydantic.fields import FieldInfo

from ..errors import InputError, shown

PER_METRE = {"m": 1.0, "mm": 1000.0}
LONGEST, SHORTEST = 1e5, 1e-9  # metres; the shortest of those that must be positive
LARGEST, SMALLEST = 1e6, 1e-18  # of all else, in SI; the smallest of what is not zero
SLOWEST = 1e-9  # rad/s or m/s, of a speed below which friction fades
LARGEST_LIMIT = 1e12  # N m, N, rad/s or m/s: for "no limit", as some files have it
NAME_CHARACTERS, NAME_BYTES = 80, 160  # with an ending it names a file and a column


def per_metre(info: ValidationInfo) -> float:
    """How many of the file's lengths are in a metre."""
    return (info.context or {}).get("per_metre", 1.0)


def _unit(info: ValidationInfo) -> str:
    return "mm" if per_metre(info) == 1000.0 else "m"


def _within(value: float, least: float, most: float, unit: str) -> None:
    if abs(value) > most:
        raise ValueError(f"expected at most {most:g}{unit}, got {value:g}")
    if 0 < abs(value) < least:
        raise ValueError(f"expected at least {least:g}{unit}, got {value:g}")


@dataclass(frozen=True)
class Range:
    """What a kind of number may be, SI: low <= x <= high, |x| <= most, and 0 or |x| >= least.

    above:     x > 0;  direction: one of a vector that is not zero.
    """

    low: float = -math.inf
    high: float = math.inf
    least: float = 0.0
    most: float = math.inf
    above: bool = False
    direction: bool = False


_BOUNDS: dict[Callable[..., Any], tuple[float, float]] = {}  # least and most of a validator


def range_of(kind: Any) -> Range:
    """The range of a type of this file, or of its entries, or of a field of a table."""
    found: dict[str, Any] = {}
    _collect(kind, found)
    return Range(**found)


def _collect(kind: Any, found: dict[str, Any]) -> None:
    for item in (*getattr(kind, "__metadata__", ()), *getattr(kind, "metadata", ())):
        if isinstance(item, FieldInfo):
            _collect(item, found)
        for name, bound in (("ge", "low"), ("le", "high")):
            if (value := getattr(item, name, None)) is not None:
                found[bound] = value
        if getattr(item, "gt", None) == 0:
            found["above"] = True
        function = getattr(item, "func", None)
        if function in _BOUNDS:
            found["least"], found["most"] = _BOUNDS[function]
        found |= {"direction": True} if function is _nonzero else {}
    for part in (getattr(kind, "annotation", None), *get_args(kind)[:1]):
        if part is not None:
            _collect(part, found)


def _bounded(unit: str, least: float = 0.0, most: float = LARGEST) -> AfterValidator:
    """Refuses a number that is out of all proportion."""

    def check(value: float) -> float:
        _within(value, least, most, f" {unit}".rstrip())
        return value

    _BOUNDS[check] = least, most
    return AfterValidator(check)


def _in_metres(least: float = 0.0) -> AfterValidator:
    def convert(value: float, info: ValidationInfo) -> float:
        scale = per_metre(info)
        _within(value, least * scale, LONGEST * scale, f" {_unit(info)}")
        # Division rounds once: 13.215 mm becomes the double nearest to 0.013215.
        return value / scale

    _BOUNDS[convert] = least, LONGEST
    return AfterValidator(convert)


def _curvature(value: float, info: ValidationInfo) -> float:
    scale = per_metre(info)
    _within(value, 0.0, LARGEST / scale, f" per {_unit(info)}")
    return value * scale


_BOUNDS[_curvature] = 0.0, LARGEST


# Printable for Unicode, and drawn by no font: fillers, blank Braille, joiners, selectors.
_INVISIBLE = re.compile(
    "[\u034f\u115f\u1160\u17b4\u17b5\u180b-\u180f\u2800\u3164\ufe00-\ufe0f\uffa0"
    "\U000e0100-\U000e01ef]"
)


def _name(value: str) -> str:
    if value != value.strip() or any(c in ',;"' or not c.isprintable() for c in value):
        raise ValueError("a name has no comma, semicolon, quote, control character or outer space")
    if found := _INVISIBLE.search(value):
        raise ValueError(f"a name has no invisible characters; this one has U+{ord(found[0]):04X}")
    if len(value) > NAME_CHARACTERS or len(value.encode()) > NAME_BYTES:
        raise ValueError(
            f"a name has at most {NAME_CHARACTERS} characters ({NAME_BYTES} bytes), since files "
            f"and columns are called by it; got {len(value)}"
        )
    return value


def _interval(value: tuple[float, float], info: ValidationInfo) -> tuple[float, float]:
    if not value[0] < value[1]:
        scale = per_metre(info)
        low, high = (f"{v * scale:.9g}" for v in value)
        raise ValueError(
            f"expected [lower, upper] with lower < upper, got [{low}, {high}] {_unit(info)}"
        )
    return value


def _nonzero(value: tuple[float, float, float]) -> tuple[float, float, float]:
    if not any(value):
        raise ValueError("a direction cannot be the zero vector")
    if max(map(abs, value)) < 1 / LARGEST:
        raise ValueError(f"a direction needs an entry of at least {1 / LARGEST:g}")
    return value


def listed(value: Any) -> Any:
    """A numpy array is as good as a list, unless it has units: those of the file are SI."""
    if hasattr(value, "units") or hasattr(value, "unit"):
        raise InputError(f"expected plain numbers, in SI units; got {shown(value)}, with a unit")
    return value.tolist() if hasattr(value, "tolist") else value


def _end(value: float) -> float:
    if math.isfinite(value):
        _within(value, SMALLEST, LARGEST_LIMIT, "")
    return value


def _rising(value: tuple[float, float]) -> tuple[float, float]:
    low, high = value
    if not low < high or low == math.inf or high == -math.inf:
        raise ValueError(
            f"expected [least, greatest] with least < greatest, got [{low:g}, {high:g}]"
        )
    return value


def _effort_limit(value: Any) -> Any:
    """A number, or least and greatest; each complains of what it is meant to be."""
    value = listed(value)
    if not isinstance(value, list | tuple):
        return _SIZE.validate_python(value)
    if len(value) != 2:
        raise ValueError(f"expected a number or [least, greatest], got {len(value)} entries")
    return _RANGE.validate_python(value)


def _pull_only(value: float | tuple[float, float]) -> float | tuple[float, float]:
    if isinstance(value, tuple) and value[0] < 0:
        raise ValueError(
            f"a cable can only pull: its least force cannot be negative, got {value[0]:g}"
        )
    return value


_number: Callable[..., Any] = Field(strict=True, allow_inf_nan=False)
_Any = Annotated[float, _number]
_Above = Annotated[_Any, Field(gt=0)]
_NotBelow = Annotated[_Any, Field(ge=0)]

Number = Annotated[_Any, _bounded("")]
Acceleration = Annotated[_Any, _bounded("m/s^2")]
Fraction = Annotated[_Any, Field(ge=0, le=1)]
Pennation = Annotated[_NotBelow, Field(lt=math.pi / 2)]
Strain = Annotated[_NotBelow, _bounded("", 1e-3)]
Mass = Annotated[_Above, _bounded("kg", SMALLEST)]
MassOrNone = Annotated[_NotBelow, _bounded("kg", SMALLEST)]
Moment = Annotated[_Above, _bounded("kg m^2", SMALLEST)]
MomentOrNone = Annotated[_NotBelow, _bounded("kg m^2", SMALLEST)]
Product = Annotated[_Any, _bounded("kg m^2")]
Limit = Annotated[_Above, _bounded("", SMALLEST, LARGEST_LIMIT)]
_End = Annotated[float, Field(strict=True), AfterValidator(_end)]
_SIZE: TypeAdapter[Any] = TypeAdapter(Limit)
_RANGE: TypeAdapter[Any] = TypeAdapter(Annotated[tuple[_End, _End], AfterValidator(_rising)])
_EITHER = WithJsonSchema({"anyOf": [_SIZE.json_schema(), _RANGE.json_schema()]})
Length = Annotated[_Any, _in_metres()]
PositiveLength = Annotated[_Above, _in_metres(SHORTEST)]
NonNegativeLength = Annotated[_NotBelow, _in_metres()]
Curvature = Annotated[_Any, AfterValidator(_curvature)]
Gear = Annotated[_Above, _bounded("", SMALLEST)]
Loss = Annotated[_NotBelow, _bounded("", SMALLEST)]
SmoothingSpeed = Annotated[_Above, _bounded("rad/s or m/s", SLOWEST)]
Coefficient = Annotated[_NotBelow, _bounded("", SMALLEST)]
EffortLimit = Annotated[float | tuple[float, float], PlainValidator(_effort_limit), _EITHER]
PullLimit = Annotated[EffortLimit, AfterValidator(_pull_only)]
Vector = tuple[Number, Number, Number]
Gravity = tuple[Acceleration, Acceleration, Acceleration]
Point = tuple[Length, Length, Length]
Direction = Annotated[Vector, AfterValidator(_nonzero)]
Interval = Annotated[tuple[Length, Length], AfterValidator(_interval)]
Name = Annotated[str, Field(min_length=1), AfterValidator(_name)]
