"""The free bodies of a mechanism, with their motion from positions alone: those of `digits`, named.

For each body mass, mass centre and axes as jets, central inertia in its own axes. What a body
needs is m (a - g) and the rate of its angular momentum.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from .description import COORDINATES
from .jets import Array, Jet, jet, spin
from .long_digits import Jet as Number
from .long_digits import Machine

NAMES = {
    "RSS": ("crank", "coupler"), "PSS": ("slider", "rod"), "SPS": ("cylinder", "piston"),
}  # fmt: skip


@dataclass(frozen=True)
class Body:
    """name: "<chain>.<body>" or "platform". inertia: central, in the axes R, (3, 3)."""

    name: str
    mass: float
    centre: Jet
    R: Jet
    inertia: Array

    def needs(self, gravity: Array) -> tuple[Array, Array]:
        """Force, and moment about the mass centre, that the other bodies must provide."""
        omega, omega_rate = spin(self.R)
        I = self.R.x @ self.inertia @ self.R.x.T
        moment = I @ omega_rate + np.cross(omega, I @ omega)
        return self.mass * (self.centre.a - gravity), moment


def cross_matrix(v: Array) -> Array:
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


def array_of(numbers: Sequence[Any]) -> Jet:
    """A jet of an array, from a list of jets or a list of such lists."""
    if isinstance(numbers[0], Sequence):
        return Jet(*(np.array([getattr(array_of(row), k) for row in numbers]) for k in "xva"))
    return Jet(*(np.array([float(getattr(one, k)) for one in numbers]) for k in "xva"))


def about(axis: Array, angle: Any) -> Jet:
    """The rotation about an axis, by Rodrigues."""
    K, x = cross_matrix(axis), jet(0.0) + Jet(*(float(getattr(angle, k)) for k in "xva"))
    sine, cosine = np.sin(x.x), np.cos(x.x)
    return x.map(sine, cosine, -sine) * K + x.map(1 - cosine, sine, cosine) * (K @ K) + np.eye(3)


def bodies(raw: dict[str, Any], pose: Jet) -> dict[str, Body]:
    """Every body of a mechanism at a moving pose."""
    machine = Machine(raw, COORDINATES)
    _, moving = machine._kinetics([Number(*p) for p in zip(pose.x, pose.v, pose.a, strict=True)])
    rows, found = iter(moving), dict[str, Body]()

    def add(name: str, row: tuple[Any, ...], R: Jet | None = None, inertia: Any = None) -> None:
        mass, centre, own, moments = row
        if inertia is None:  # along x and across; nothing of a slider; the platform's whole
            inertia = np.zeros((3, 3)) if moments is None else moments
            if isinstance(moments, tuple):
                inertia = np.diag([moments[0], moments[1], moments[1]])
        R = R or (jet(np.eye(3)) if own is None else array_of(own))
        inertia = np.array(inertia, float)
        found[name] = Body(name, float(mass), array_of(centre), R, inertia)

    add("platform", next(rows))
    for chain in machine.chains:
        for name in NAMES.get(chain["kind"], ()):
            row, own = next(rows), f"{chain['raw']['name']}.{name}"
            if name == "crank":
                _, moment, angle, _ = row
                axis = np.array(chain["axis"], float)
                inertia = float(moment) * np.outer(axis, axis)
                add(own, next(rows), about(axis, angle), inertia)
            else:
                add(own, row)
    return found
