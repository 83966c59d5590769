"""What a controller is: a table of the scenario file, and equations on the Builder.

    efforts, memory = equations(measured, reference, memory, gains)

Everything that differs from mechanism to mechanism or from file to file is a port; what lasts from
one period to the next is memory. So the same few lines run by numpy, as compiled code, as a batch
of runs in lockstep and in exported files, and have exact derivatives.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any, ClassVar

import casadi as ca
import numpy as np
from pydantic import Field

from ...mechanism.quantities import Name
from ...mechanism.table import Table
from ..builder import Builder, Lanes
from ..entries import Count, File, Frequency, Gain, Gains, Machine, Positive, Signed, each, unit
from ..equations import Wrench
from ..instant import inertia_matrix
from ..observer import Measured
from ..platform import PlatformState, platform_at

EACH_COORDINATE, EACH_CHAIN = "coordinate", "chain"  # sizes of ports


@dataclass(frozen=True)
class Reference:
    """What the controller is to follow: q, q1, q2 (m,), joint, joint_rate, a chain's, force [N]."""

    q: Any
    q1: Any
    q2: Any
    joint: Any
    joint_rate: Any
    force: Any


@dataclass(frozen=True)
class ControlledPoint:
    """A point of the platform: where it is, (3,) [m] in {S}, and its Jacobian, v = J q', (3, m)."""

    position: ca.SX
    J: ca.SX


@dataclass(frozen=True)
class Control:
    """What a law's equations are written with.

    gains:   its ports by name, such as `c.gains.stiffness`.
    choices: entries of its table that decide which equations they are, by name.
    memory:  what it returned at the last tick, (size,);  period: since then [s].
    cut:     of efforts: 1 where limits cut any of them, so that integrals do not wind up.
    """

    b: Builder
    measured: Measured
    reference: Reference
    gains: Any
    choices: Mapping[str, Any]
    memory: ca.SX
    period: ca.SX
    solve: Callable[[ca.SX, ca.SX, ca.SX, Wrench], Lanes]
    cut: Callable[[Lanes], ca.SX]

    def inverse(
        self,
        q: ca.SX,
        q1: ca.SX,
        q2: ca.SX,
        force: ca.SX | None = None,
        point: ca.SX | None = None,
    ) -> Lanes:
        """Inverse dynamics, lanes [N m or N]: once in a law.

        Args: force: that the efforts bear besides, (3,) [N] in {S}, at a point (3,) [m] of {M}.
        """
        zero = ca.SX.zeros(3)
        load = Wrench(zero if force is None else force, zero, zero if point is None else point)
        return self.solve(q, q1, q2, load)

    def point(self, q: ca.SX, point: ca.SX) -> ControlledPoint:
        """The controlled point of (3,) [m] in {M}."""
        platform = self._at(q)
        T, r = platform.motion.E @ platform.motion.M_J, platform.R @ point
        return ControlledPoint(platform.placement.position + r, T[:3, :] - ca.skew(r) @ T[3:, :])

    def inertia(self, q: ca.SX) -> ca.SX:
        """Inertia matrix M_r of the independent coordinates, (m, m)."""
        return inertia_matrix(self.b, self._at(q))

    def _at(self, q: ca.SX) -> PlatformState:
        zero = ca.SX.zeros(self.b.structure.m)
        return platform_at(self.b, q, zero, zero)


class ControllerTable(Table):
    """The `[controller]`; its `kind` says which.

    Of a kind of its own: `ports` and their sizes, what `numbers` gives for them where it is more
    than entries of their names, and `equations`.
    """

    ports: ClassVar[Mapping[str, str | int]] = {}
    # Memory to begin with; laws without any can do without periods.
    memory: ClassVar[tuple[float, ...]] = ()
    # Memory while it holds the forces of `held_forces` on a load; None where it never does.
    holding: ClassVar[tuple[float, ...] | None] = None
    # Memory that every tick of an exported controller begins with outside RUN; None: its own.
    resting: ClassVar[tuple[float, ...] | None] = None
    # Whether it holds them all the time, so that it has no rest where nothing is touched.
    always_holds: ClassVar[bool] = False
    # Numbers that may change while it runs, with their units; `force` is that of the path.
    parameters: ClassVar[Mapping[str, str]] = {}
    # Whether it adds to the efforts of inverse dynamics.
    adds: ClassVar[bool] = False
    # Entries that decide which equations they are.
    chooses: ClassVar[tuple[str, ...]] = ()

    kind: Any
    motion: File | None = Field(
        default=None, description="CSV to follow; default: the bundled or a trial motion"
    )
    units: str | None = Field(default=None, description='of the motion, such as "mm,deg"')
    landmark: Name | None = Field(default=None, description="whose path the motion gives")
    rate: Frequency | None = Field(
        default=1000.0, description="Hz; efforts are held between samples"
    )
    ideal: bool = Field(
        default=False, description="at all times: no rate, no delay, and the state itself"
    )
    delay: Count = Field(default=0, description="whole periods between a sample and its efforts")
    model: File | None = Field(
        default=None, description="mechanism file it computes with, if it is not the plant"
    )
    distribution: str | None = Field(default=None, description="how it chooses efforts")
    preload: float = Field(default=0.0, ge=0, allow_inf_nan=False, description="N")
    contact_weight: Gain = Field(
        default=0.0, description='of contact forces, with distribution = "weighted"; 1'
    )
    contact_force: Signed | None = Field(
        default=None,
        description="that contact_weight draws to, N along the normals; one, or one a contact",
    )
    effort_rate: Gains | None = Field(
        default=None, description="largest change of efforts, N m/s or N/s; one, or one a chain"
    )
    keep_bounds: bool = Field(
        default=False, description="slow down before joints are too fast and sockets end"
    )
    bound_rate: Positive = Field(
        default=50.0, description="how fast bounds are approached at most, 1/s"
    )

    def numbers(self, machine: Machine) -> Mapping[str, Any]:
        """What its ports are given, by name: its own entries, one for all or one each.

        Raises: InputError: where it does not fit the mechanism.
        """
        owners = {EACH_COORDINATE: machine.independent, EACH_CHAIN: machine.chains, 3: "xyz"}
        values = {name: getattr(self, name) for name in self.ports}
        for name, size in self.ports.items():
            if name == "point":
                values[name] = machine.point(values[name])[1]
            elif name == "direction":
                values[name] = unit(values[name])
            elif size in owners and values[name] is not None:
                values[name] = each(values[name], owners[size], f"controller.{name}")
        return values

    def place(self, machine: Machine) -> str | None:
        """Name of the point where it measures force, or None."""
        return None

    @staticmethod
    def held_forces(
        numbers: Mapping[str, np.ndarray], force: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Directions (r, 3) in {S} along which it holds forces, and these, (r,) [N], on what is
        touched.

        Args: numbers: of its ports;  force: of the path [N].
        """
        return np.zeros((0, 3)), np.zeros(0)

    @staticmethod
    @abstractmethod
    def equations(c: Control) -> tuple[Lanes, ca.SX]:
        """Efforts, lanes [N m or N] before any limit, and the memory of the next period."""

    def bind(self, machine: Machine) -> Law:
        """The law with its numbers."""
        numbers = {name: np.array(v, dtype=float) for name, v in self.numbers(machine).items()}
        choices = tuple((name, getattr(self, name)) for name in self.chooses)
        memory = np.array(self.memory)
        return Law(type(self), choices, numbers, memory, self.place(machine))


@dataclass(frozen=True)
class Law:
    """A controller on one mechanism.

    table:   whose equations they are; None where efforts are given.
    numbers: of its ports, one each for coordinates, or for chains in the mechanism's order.
    memory:  to begin with.   place: name of the point where it measures force, or None.
    """

    table: type[ControllerTable] | None
    choices: tuple[tuple[str, Any], ...] = ()
    numbers: dict[str, np.ndarray] = field(default_factory=dict)
    memory: np.ndarray = field(default_factory=lambda: np.zeros(0))
    place: str | None = None

    @property
    def parameters(self) -> Mapping[str, str]:
        """Numbers that may change while it runs, with their units."""
        return {} if self.table is None else self.table.parameters


def gains_of(b: Builder, ports: Mapping[str, str | int]) -> SimpleNamespace:
    """Ports of a law, by name."""
    return SimpleNamespace(
        **{
            name: b.lane_sample(name)
            if size == EACH_CHAIN
            else b.sample(name, b.structure.m if size == EACH_COORDINATE else int(size))
            for name, size in ports.items()
        }
    )
