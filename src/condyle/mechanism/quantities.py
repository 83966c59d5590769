"""The kinds of number a mechanism file holds, how each becomes SI, and how large it may be.

A file states every length in its `length_unit`; all else is SI already. The unit stands in the
type of a field, so that reading a file is one validation with the context `{"per_metre": 1000.0}`
for millimetres. Without a context (in Python) numbers are taken as SI.

Beyond the bounds here no machine was ever built, and products of such numbers overflow.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, replace
from functools import cache
from typing import Annotated, Any, get_args, get_origin

from pydantic import (
    AfterValidator,
    BaseModel,
    Field,
    GetCoreSchemaHandler,
    PlainValidator,
    TypeAdapter,
    ValidationInfo,
    WithJsonSchema,
)
from pydantic_core import core_schema

from ..errors import InputError, brief

PER_METRE = {"m": 1.0, "mm": 1000.0}
LONGEST, SHORTEST = 1e5, 1e-9  # metres; the shortest of those that must be positive
LARGEST, SMALLEST = 1e6, 1e-18  # of all else, in SI; the smallest of what is not zero
SLOWEST = 1e-9  # rad/s or m/s, of a speed below which friction fades
LARGEST_LIMIT = 1e12  # N m, N, rad/s or m/s: for "no limit", as some files have it
NAME_CHARACTERS, NAME_BYTES = 80, 160  # with an ending it names a file and a column


def per_metre(info: ValidationInfo) -> float:
    """How many of the file's lengths are in a metre."""
    return (info.context or {}).get("per_metre", 1.0)


def _within(value: float, least: float, most: float, unit: str) -> None:
    if abs(value) > most:
        raise ValueError(f"expected at most {most:g}{unit}, got {value:g}")
    if 0 < abs(value) < least:
        raise ValueError(f"expected at least {least:g}{unit}, got {value:g}")


@dataclass(frozen=True)
class Unit:
    """What a number of a file is: `Annotated[float, Unit("kg", gt=0)]`. All bounds are SI.

    unit, sliding: SI; the second where a joint slides, if that is another.
    gt, ge, lt, le: bounds;  least, most: x is 0 or least <= |x| <= most.
    metres: power of the file's length_unit in it.
    direction: an entry of a vector that is not zero.
    """

    unit: str = ""
    sliding: str = ""
    gt: float | None = None
    ge: float | None = None
    lt: float | None = None
    le: float | None = None
    least: float = 0.0
    most: float = LARGEST
    metres: int = 0
    direction: bool = False

    def __str__(self) -> str:
        return f"{self.unit or 1} or {self.sliding}" if self.sliding else self.unit

    def at(self, joint_unit: str) -> Unit:
        """The same at a joint that turns (rad) or slides (m)."""
        unit = self.sliding if self.sliding and joint_unit == "m" else self.unit
        return replace(self, unit=unit, sliding="")

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> core_schema.CoreSchema:
        if source is not float:
            return handler(source)  # it has checks of its own
        bounds = {name: getattr(self, name) for name in ("gt", "ge", "lt", "le")}
        number = core_schema.float_schema(strict=True, allow_inf_nan=False, **bounds)
        return core_schema.with_info_after_validator_function(self._read, number)

    def _read(self, value: float, info: ValidationInfo) -> float:
        """A number of the file in SI."""
        scale = per_metre(info) if self.metres else 1.0
        text = str(self) if scale == 1.0 else self.unit.replace("m", "mm")
        factor = scale**self.metres
        _within(value, self.least * factor, self.most * factor, f" {text}".rstrip())
        # Division rounds once: 13.215 mm becomes the double nearest to 0.013215.
        return value / scale if self.metres > 0 else value * scale


@dataclass(frozen=True)
class NumberField:
    """A number or vector of a table: its unit and range, entries (0: tables differ) and meaning."""

    unit: Unit
    size: int
    meaning: str = ""

    def __str__(self) -> str:
        return ", ".join(filter(None, (str(self.unit), self.meaning)))


@cache
def number_fields(table: type[BaseModel]) -> dict[str, NumberField]:
    """Numbers of a table and of those within it, `crank.inertia`, in the order of the file."""
    fields: dict[str, NumberField] = {}
    for name, field in table.model_fields.items():
        kind = field.annotation
        if isinstance(kind, type) and issubclass(kind, BaseModel):
            fields |= {f"{name}.{path}": own for path, own in number_fields(kind).items()}
        elif own := _unit_and_size(Annotated[kind, None, *field.metadata]):
            fields[name] = NumberField(*own, field.description or "")
    return fields


def _unit_and_size(kind: Any) -> tuple[Unit, int] | None:
    """Unit and size of the entries of a type, if they are numbers of a file."""
    for item in getattr(kind, "__metadata__", ()):
        if isinstance(item, Unit):
            return item, 1
    parts = get_args(kind)
    if not parts or (own := _unit_and_size(parts[0])) is None:
        return None
    rows = len(parts) if get_origin(kind) is tuple else 1
    return own[0], 0 if Ellipsis in parts else rows * own[1]


def with_units(schema: dict[str, Any], table: type[BaseModel]) -> None:
    """Add the unit to each description of a JSON schema; `length_unit` says that of lengths."""
    for name, own in number_fields(table).items():
        if own.unit.unit and not own.unit.metres and "." not in name:
            schema["properties"][table.model_fields[name].alias or name]["description"] = str(own)


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


def _load_point(value: str) -> str:
    for part in value.split(";"):
        if "," not in part:
            _name(part.strip())
    return value


def _interval(value: tuple[float, float], info: ValidationInfo) -> tuple[float, float]:
    if not value[0] < value[1]:
        scale = per_metre(info)
        low, high = (f"{v * scale:.9g}" for v in value)
        unit = "m" if scale == 1.0 else "mm"
        raise ValueError(f"expected [lower, upper] with lower < upper, got [{low}, {high}] {unit}")
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
        raise InputError(f"expected plain numbers, in SI units; got {brief(value)}, with a unit")
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


LIMIT = Unit(gt=0, least=SMALLEST, most=LARGEST_LIMIT)
Number = Annotated[float, Unit()]
Angle = Annotated[float, Unit("rad")]
Acceleration = Annotated[float, Unit("m/s^2")]
Fraction = Annotated[float, Unit(ge=0, le=1)]
Pennation = Annotated[float, Unit("rad", ge=0, lt=math.pi / 2)]
Strain = Annotated[float, Unit(ge=0, least=1e-3)]
Mass = Annotated[float, Unit("kg", gt=0, least=SMALLEST)]
MassOrNone = Annotated[float, Unit("kg", ge=0, least=SMALLEST)]
Moment = Annotated[float, Unit("kg m^2", gt=0, least=SMALLEST)]
MomentOrNone = Annotated[float, Unit("kg m^2", ge=0, least=SMALLEST)]
Product = Annotated[float, Unit("kg m^2")]
Limit = Annotated[float, LIMIT]
SpeedLimit = Annotated[float, replace(LIMIT, unit="rad/s", sliding="m/s")]
Force = Annotated[float, replace(LIMIT, unit="N")]
Stiffness = Annotated[float, replace(LIMIT, unit="N/m")]
JointStiffness = Annotated[float, replace(LIMIT, unit="N m/rad", sliding="N/m")]
Duration = Annotated[float, replace(LIMIT, unit="s")]
Modulus = Annotated[float, replace(LIMIT, unit="Pa")]
PoissonRatio = Annotated[float, Unit(ge=0, le=0.5)]
ContactDamping = Annotated[float, Unit("s/m", ge=0, least=SMALLEST)]
_End = Annotated[float, Field(strict=True), AfterValidator(_end)]
_SIZE: TypeAdapter[Any] = TypeAdapter(Limit)
_RANGE: TypeAdapter[Any] = TypeAdapter(Annotated[tuple[_End, _End], AfterValidator(_rising)])
_EITHER = WithJsonSchema({"anyOf": [_SIZE.json_schema(), _RANGE.json_schema()]})
Length = Annotated[float, Unit("m", most=LONGEST, metres=1)]
PositiveLength = Annotated[float, Unit("m", gt=0, least=SHORTEST, most=LONGEST, metres=1)]
NonNegativeLength = Annotated[float, Unit("m", ge=0, most=LONGEST, metres=1)]
Curvature = Annotated[float, Unit("1/m", metres=-1)]
Gear = Annotated[float, Unit("", "rad/m", gt=0, least=SMALLEST)]
Damping = Annotated[float, Unit("N s/m", ge=0, least=SMALLEST)]
JointDamping = Annotated[float, Unit("N m s/rad", "N s/m", ge=0, least=SMALLEST)]
JointFriction = Annotated[float, Unit("N m", "N", ge=0, least=SMALLEST)]
JointSpeed = Annotated[float, Unit("rad/s", "m/s", gt=0, least=SLOWEST)]
SlidingSpeed = Annotated[float, Unit("m/s", gt=0, least=SLOWEST)]
Coefficient = Annotated[float, Unit(ge=0, least=SMALLEST)]
Restitution = Annotated[float, Unit(ge=0, le=1)]
EffortLimit = Annotated[float | tuple[float, float], PlainValidator(_effort_limit), _EITHER]
PullLimit = Annotated[EffortLimit, AfterValidator(_pull_only)]
Vector = tuple[Number, Number, Number]
Gravity = tuple[Acceleration, Acceleration, Acceleration]
Point = tuple[Length, Length, Length]
_Entry = Annotated[float, Unit(direction=True)]
Direction = Annotated[tuple[_Entry, _Entry, _Entry], AfterValidator(_nonzero)]
Interval = Annotated[tuple[Length, Length], AfterValidator(_interval)]
Name = Annotated[str, Field(min_length=1), AfterValidator(_name)]
LoadPoint = Annotated[str, Field(min_length=1, max_length=1000), AfterValidator(_load_point)]
