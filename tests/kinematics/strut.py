"""A chain family of one's own: its table, its equations, and the line that registers both."""

from __future__ import annotations

from typing import Any, ClassVar, Literal

import casadi as ca
from pydantic import Field

from condyle.kinematics.chain import Constants, register
from condyle.kinematics.chain.sps import BODIES, SPSFamily
from condyle.mechanism.actuator import LinearActuator
from condyle.mechanism.chain import ChainTable
from condyle.mechanism.quantities import Mass, Point


class Strut(ChainTable):
    """A telescopic leg whose mass is at the platform's joint."""

    kind: Literal["strut"]
    base: Point = Field(description="base joint B, in {S}")
    platform: Point = Field(description="platform joint M, in {M}")
    mass: Mass = Field(description="at the platform's joint")
    actuator: LinearActuator = LinearActuator()

    links: ClassVar[dict[str, tuple[str, str]]] = {"leg": ("base", "platform")}
    rod_name = "strut"


class StrutFamily(SPSFamily):
    """The telescopic leg, of fewer numbers."""

    kind = "strut"
    standard: ClassVar[dict[str, str]] = {}
    tuned: ClassVar[dict[str, tuple[str, str]]] = {"strut_mass": ("mass", "of the strut")}

    def derived(self, f: Any) -> dict[str, ca.SX]:
        bodies = {f"{body}_{name}": ca.SX(0) for body, name in BODIES} | {"piston_mass": f.mass}
        return super().derived(Constants(**vars(f), **bodies))


def add() -> None:
    register(StrutFamily(), Strut)
