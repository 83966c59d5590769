"""The interface of a formulation: the platform's generalized force, and the dynamics of a chain.

A formulation sees the platform through a `State` and each chain through the motion of its joint M
alone, so that one text serves every route, every family and any number of contacts:

    sum of forces, dual to c' = J_theta^T tau + bite        [Cheng2023] eqs (43), (46), (57), (63)
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from ..kinematics.chain import ChainDynamics, Constants, Family
from ..kinematics.state import PointMotion, State


@dataclass(frozen=True)
class Body:
    """The platform: mass [kg], first moment about O_M (3,) [kg m] and inertia (3, 3) in {M}.

    The paper's platform has its mass centre at O_M, so its first moment vanishes.
    """

    mass: ca.SX
    first_moment: ca.SX
    inertia: ca.SX


class Formulation(ABC):
    """One way to write the equations of motion."""

    name: ClassVar[str]
    uses_twist: ClassVar[bool] = False  # whether route `core` works in twist coordinates
    # Whether a chain's bodies can act as one, with end masses that are part of the platform, and
    # whether padding constants (`Family.padding`) alone make a lane vanish.
    lumps: ClassVar[bool] = False
    pads: ClassVar[bool] = False

    @abstractmethod
    def platform(self, state: State, body: Body, g: ca.SX) -> ca.SX:
        """Inertia less gravity of the platform, dual to the state's c', (m,)."""

    @abstractmethod
    def chain(self, family: Family, c: Constants, M: PointMotion, g: ca.SX) -> ChainDynamics:
        """Forces of a chain's bodies on its platform joint, and the joint's motion."""
