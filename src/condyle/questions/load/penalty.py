"""A wall of the mechanism as a load: a spring and damper that only pushes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Literal

import casadi as ca
import numpy as np

from ...mechanism.fossa_wall import FossaWall
from .acting import ActingLoad, LoadPlace, LoadTable


class Penalty(LoadTable):
    """force = (elastic - damping gap') n, elastic = max(0, -stiffness gap), n the unit normal.

    The damper's part is between -elastic and elastic, so that the force begins at 0. No kind of a
    scenario: the mechanism's walls are such loads.
    """

    ports: ClassVar[Mapping[str, int]] = {"normal": 3, "home": 1, "stiffness": 1, "damping": 1}

    kind: Literal["wall"]

    @staticmethod
    def wrench(at: LoadPlace) -> ca.SX:
        n, normal = at.numbers, at.numbers.normal
        gap = n.home + ca.dot(normal, at.s)
        elastic = ca.fmax(-n.stiffness * gap, 0)
        damped = ca.fmin(ca.fmax(-n.damping * ca.dot(normal, at.v), -elastic), elastic)
        return (elastic + damped) * normal

    @staticmethod
    def of(wall: FossaWall) -> ActingLoad:
        """A wall's load."""
        numbers: dict[str, Any] = {
            "normal": wall.normal,
            "home": wall.gap,
            "stiffness": wall.stiffness,
            "damping": wall.damping,
        }
        made = {name: np.array(value, dtype=float) for name, value in numbers.items()}
        return ActingLoad(Penalty, f"wall {wall.name}", np.array(wall.point), None, made)
