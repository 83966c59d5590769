"""Units of the files that people bring: `--units ms,mm,deg` or a header `x [mm]`. Inside is SI."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field

from ..errors import InputError, brief, did_you_mean, short

POSE = ("X", "Y", "Z", "alpha", "beta", "gamma")
LANDMARK = ("x", "y", "z")
GRAVITY = ("gx", "gy", "gz")
# Acceleration, angular velocity and angular acceleration of the base.
BASE = tuple(f"base_{kind}{axis}" for kind in ("a", "w", "dw") for axis in "xyz")
FORCE = ("Fx", "Fy", "Fz")
MOMENT = ("Mx", "My", "Mz")

TIME_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "min": 60.0}
LENGTH_UNITS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6}
ANGLE_UNITS = {"rad": 1.0, "deg": math.pi / 180, "mrad": 1e-3}
_FORCE_UNITS = {"N": 1.0, "kN": 1e3, "mN": 1e-3}
_MOMENT_UNITS = {
    f"{force}{length}": a * b
    for force, a in _FORCE_UNITS.items()
    for length, b in LENGTH_UNITS.items()
}
_UNITS = {
    "time": TIME_UNITS,
    "length": LENGTH_UNITS,
    "angle": ANGLE_UNITS,
    "force": _FORCE_UNITS,
    "moment": _MOMENT_UNITS,
    "ratio": {"1": 1.0, "%": 0.01},
}
_SYNONYMS = {"sec": "s", "seconds": "s", "degrees": "deg", "radians": "rad", "\u00b0": "deg"}

Dimension = tuple[str, int]
"""A kind of quantity, and how often it is divided by time: ("length", 2) is an acceleration."""


@dataclass(frozen=True)
class Units:
    """What one unit of length, of angle and of time is, in metres, radians and seconds.

    Attributes: given: which of the three were given.
    """

    length: float = 1.0
    angle: float = 1.0
    time: float = 1.0
    given: frozenset[str] = field(default=frozenset(), compare=False)

    def scale(self, column: str) -> float:
        """Factor to SI of a column: of t, of X, x, alpha and so on, their rates dX, ddX.

        1 for all else: forces and moments are SI unless the header says so.
        """
        kind, per_time = dimension(column) or ("", 0)
        scales = {"length": self.length, "angle": self.angle, "time": self.time}
        return scales.get(kind, 1.0) / self.time**per_time


def dimension(column: str) -> Dimension | None:
    """What the column of a motion, a load or a state is; None for other columns."""
    if column == "t":
        return "time", 0
    if column in FORCE:
        return "force", 0
    if column in MOMENT:
        return "moment", 0
    if column in (*GRAVITY, *BASE[:3]):
        return "length", 2
    if column in BASE:
        return "angle", 1 if column in BASE[3:6] else 2
    for rates in range(3):
        name = column[rates:]
        if column.startswith("d" * rates) and name in (*POSE, *LANDMARK):
            return "angle" if name in POSE[3:] else "length", rates
    return None


def unit_factor(text: str, of: Dimension, where: str = "") -> float:
    """Factor to SI of a unit such as "mm", "N mm" or "deg/s^2"; `where` begins messages.

    Raises: InputError: for an unknown unit, or one of something else than `of`.
    """
    parsed = _parse(text)
    kind, per_time = of
    if parsed is None or parsed[:2] != of:
        suffix = ("", "/s", "/s^2")[per_time]
        what = f"a unit of {kind}{suffix and f' {suffix}'}"
        expected = ", ".join(unit + suffix for unit in _UNITS[kind])
        raise InputError(f'{where}"{short(text)}" is not {what}; expected {expected}')
    return parsed[2]


def name_and_unit(text: str) -> tuple[str, str]:
    """Name and unit of `x [mm]`, `x(mm)`, `x_[mm]`, `x / mm`, `x, mm`, `x in mm` or `x_mm`; "" for
    none. Linear in the length of the text, whoever wrote it."""
    at = max(text.rfind("["), text.rfind("("))
    if at >= 0 and text[-1] in "])" and not {"]", ")"} & {*text[at + 1 : -1]}:
        return text[:at].removesuffix("_").rstrip(), text[at + 1 : -1].strip()
    for name, found, unit in (*map(text.partition, ("/", ",", " in ")), text.rpartition("_")):
        if found and name and is_unit(unit):
            return name.rstrip(), unit
    return text, ""


def ratio(given: str, wanted: str) -> float | None:
    """What a unit is in another one; None where it is one of something else."""
    one, other = _parse(given), _parse(wanted)
    return one[2] / other[2] if one and other and one[:2] == other[:2] else None


def si_unit(column: str) -> str:
    """The unit of a column of a motion or a load inside: "rad/s" of dalpha."""
    kind, per_time = dimension(column) or ("ratio", 0)
    unit = "N m" if kind == "moment" else next(iter(_UNITS[kind]))
    return unit + ("", "/s", "/s^2")[per_time]


def is_unit(text: str) -> bool:
    """Whether `text` is a unit of anything that stands in a table."""
    return _parse(text) is not None


def _parse(text: str) -> tuple[str, int, float] | None:
    """Kind, powers of time below the line, factor to SI."""
    plain = text.strip().replace("\u00b2", "^2").replace("\u00b5", "u").replace("\u03bc", "u")
    above, _, below = plain.partition("/")
    above = re.sub(r"[\s.*\u00b7\u22c5_-]", "", above)
    above = "N" + above[2:] if above[:2].casefold() == "nt" else _SYNONYMS.get(above, above)
    parts = re.fullmatch(r"([a-z]+)\^?([12]?)", "".join(below.split())) if below else None
    if below and (parts is None or parts[1] not in TIME_UNITS):
        return None
    per_time = int(parts[2] or 1) if parts else 0
    for kind, table in _UNITS.items():
        if above in table:
            return kind, per_time, table[above] / (TIME_UNITS[parts[1]] if parts else 1) ** per_time
    return None


def parse_units(text: str | Units | None) -> Units:
    """Units from 'ms,mm,deg': a time, a length, an angle, in any order; default: SI.

    Raises: InputError: for an unknown unit, or two of a kind.
    """
    if text is None or isinstance(text, Units):
        return text or Units()
    if not isinstance(text, str):
        raise InputError(f'units: got {brief(text)}, expected text such as "mm,deg"')
    tables = {"time": TIME_UNITS, "length": LENGTH_UNITS, "angle": ANGLE_UNITS}
    units: dict[str, float] = {}
    for word in (part.strip() for part in text.split(",")):
        kind = next((kind for kind, table in tables.items() if word in table), None)
        if kind is None:
            hint = did_you_mean(word, [unit for table in tables.values() for unit in table])
            raise InputError(f'units "{short(text)}": "{short(word)}" is not a unit.{hint}')
        if kind in units:
            raise InputError(
                f'units "{short(text)}": two units of {kind}; expected one, as in "ms,mm,deg"'
            )
        units[kind] = tables[kind][word]
    return Units(**units, given=frozenset(units))
