"""Units of the files that people bring: `--units mm,deg`. Inside, all is SI."""

from __future__ import annotations

import math
from dataclasses import dataclass

from condyle.errors import InputError, did_you_mean

POSE = ("X", "Y", "Z", "alpha", "beta", "gamma")
LANDMARK = ("x", "y", "z")

LENGTH_UNITS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6}
ANGLE_UNITS = {"rad": 1.0, "deg": math.pi / 180}

_LENGTHS = frozenset("XYZxyz")
_ANGLES = frozenset(POSE[3:])


@dataclass(frozen=True)
class Units:
    """What one unit of length and of angle is, in metres and radians."""

    length: float = 1.0
    angle: float = 1.0

    def scale(self, column: str) -> float:
        """Factor to SI of a column: of X, x, alpha and so on, their rates dX and accelerations ddX.

        1 for all else: time, force and moment are SI in every file.
        """
        name = column if column in _ANGLES else column.lstrip("d")
        return self.length if name in _LENGTHS else self.angle if name in _ANGLES else 1.0


def parse_units(text: str | Units) -> Units:
    """Units from 'mm,deg': a length, an angle or both, in either order; SI for what is not given.

    Raises: InputError: for an unknown unit, or two of a kind.
    """
    if isinstance(text, Units):
        return text
    found: dict[str, float] = {}
    for word in (part.strip() for part in text.split(",")):
        kind, table = ("angle", ANGLE_UNITS) if word in ANGLE_UNITS else ("length", LENGTH_UNITS)
        if word not in table:
            hint = did_you_mean(word, [*LENGTH_UNITS, *ANGLE_UNITS])
            raise InputError(f'units "{text}": "{word}" is not a unit.{hint}')
        if kind in found:
            raise InputError(f'units "{text}": two units of {kind}; expected one, as in "mm,deg"')
        found[kind] = table[word]
    return Units(**found)
