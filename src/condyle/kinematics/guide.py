"""A landmark's path as contacts: three moving planes normal to the axes of {S}."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import casadi as ca

from .constraints import ContactSymbols


@dataclass(frozen=True)
class AcrossAxis:
    """Points whose coordinate along an axis of {S} is a number: phi = p_axis - number."""

    axis: int

    def phi(self, point: ca.SX, constants: ca.SX) -> ca.SX:
        return point[self.axis] - constants[0]

    def gradient(self, point: ca.SX, constants: ca.SX) -> ca.SX:
        unit = ca.SX.zeros(3)
        unit[self.axis] = 1
        return unit

    def bending(self, point: ca.SX, velocity: ca.SX, constants: ca.SX) -> ca.SX:
        return ca.SX(0)

    def started_at(self, point: ca.SX, constants: ca.SX) -> AcrossAxis:
        return self


@dataclass(frozen=True)
class Guide(ContactSymbols):
    """A platform point with a given displacement from home along one axis.

    displacement: at the end of the path from home [m].
    """

    displacement: Any = 0.0

    @staticmethod
    def on_axis(axis: int, point: ca.SX, displacement: ca.SX) -> Guide:
        """Args: point: (3,) in {M}; displacement: from home, in {S}."""
        return Guide(AcrossAxis(axis), point, point[axis], displacement=displacement)

    def along_path(self, part: float) -> Guide:
        return replace(self, constants=self.point[self.surface.axis] + part * self.displacement)
