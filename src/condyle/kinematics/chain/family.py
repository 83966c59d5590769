"""The interface of a chain family: the one place where a new family plugs in.

A chain meets the platform at one point M. A family maps that point's position, velocity and
acceleration to the joint coordinate, its rates, and the forces of its bodies on the platform, in
two ways:

- joint space (Section 3.2): joint coordinates q_r = (joint, beta, gamma) in closed form, the
  loop's tip as an expression in q_r, the moving links and the joints between them. The textbook
  formulations and the reactions derive the rest.
- virtual power: the same forces written out by hand with the fewest operations.

Numbers of a chain enter as named constants, so that one expression serves every chain.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from operator import attrgetter
from types import SimpleNamespace
from typing import Any, ClassVar

import casadi as ca
import numpy as np

from ...errors import UnsupportedError
from ...mechanism.chain import CHAINS
from ...mechanism.coordinates import rotations
from ...mechanism.quantities import number_fields
from ...mechanism.surface.base import named
from ..moving_base import MovingBase
from ..rotation import rotation_y, rotation_z
from .chain_drawing import ChainDrawing, DrawnRod

Cut = Callable[[ca.SX], ca.SX]

LEFT_OUT = -1e-300  # in the place of an optional number that a file leaves out
OTHER_TABLES = ("actuator.", "muscle.")  # tables that loops and bodies do not know
NEAR_X = np.cos(np.radians(5.0))  # a rod this near X_S takes Y_S for its frame


Constants = SimpleNamespace  # of a chain by name: scalars, 3-vectors and 3 x 3 matrices


@dataclass(frozen=True)
class Link:
    """A moving body of a chain, by expressions in q_r.

    centre: mass centre in {S}, (3,).   spin: W, (3, 3), with omega = W q_r'.
    inertia: about the mass centre, in {S}, (3, 3).   mass: [kg].
    """

    name: str
    mass: ca.SX
    centre: ca.SX
    spin: ca.SX
    inertia: ca.SX


@dataclass(frozen=True)
class Joint:
    """Where a link meets the link before it, and the first link the base; expressions in q_r.

    name, place: of the joint and its point, in reports.
    point:  in {S}, (3,).
    turns:  axes of rotation, (3, a).
    slides: directions of translation, (3, b).
    driven: whether the actuator drives its one freedom.
    guide:  axis of an additional moment of the base on the link, (3,), or None.
    """

    name: str
    place: str
    point: ca.SX
    turns: ca.SX
    slides: ca.SX
    driven: bool = False
    guide: ca.SX | None = None

    @staticmethod
    def ball(name: str, place: str, point: ca.SX, guide: ca.SX | None = None) -> Joint:
        return Joint(name, place, point, ca.SX.eye(3), ca.SX(3, 0), guide=guide)

    @staticmethod
    def shaft(name: str, place: str, point: ca.SX, axis: ca.SX) -> Joint:
        """Rotated by the actuator."""
        return Joint(name, place, point, axis, ca.SX(3, 0), driven=True)

    @staticmethod
    def slide(name: str, place: str, point: ca.SX, direction: ca.SX) -> Joint:
        """Pushed by the actuator."""
        return Joint(name, place, point, ca.SX(3, 0), direction, driven=True)


@dataclass(frozen=True)
class ChainLoop:
    """The closed loop at a position of M ([Cheng2023] eqs 12-14, 25-26).

    q_r:      joint coordinates, (3,): (joint, beta, gamma).
    discriminant:    dimensionless; the chain reaches M where it is not negative.
    J:        row of the actuator Jacobian on M: joint' = J . M', (3,).
    rod:      the vector e that closes the loop, (3,) [m].
    J_A:      d L / d joint, and its scale: J_A / scale is the sine of the transmission angle.
    cos_gamma: cosine of gamma_i; at 0 the two rod angles lose their meaning.
    """

    q_r: ca.SX
    discriminant: ca.SX
    J: ca.SX
    rod: ca.SX
    rod_length: ca.SX
    J_A: ca.SX
    J_A_scale: ca.SX
    cos_gamma: ca.SX

    @staticmethod
    def of(N: ca.SX, joint: ca.SX, rod: ca.SX, length: ca.SX, **rest: ca.SX) -> ChainLoop:
        """The loop from the rod vector, whose angles in N_i0 are the other joint coordinates."""
        beta, gamma, cos_gamma = rod_angles(N, rod, length)
        q_r = ca.vertcat(joint, beta, gamma)
        return ChainLoop(q_r=q_r, rod=rod, rod_length=length, cos_gamma=cos_gamma, **rest)

    @property
    def transmission(self) -> ca.SX:
        """Sine of the transmission angle."""
        return self.J_A / self.J_A_scale

    @property
    def upright(self) -> ca.SX:
        """cos(gamma_i)^2."""
        return self.cos_gamma * self.cos_gamma


@dataclass(frozen=True)
class ChainDynamics:
    """Forces of a chain's bodies on M, (3,) each, and the joint's motion.

    forces:     body name -> force dual to M' (inertia less gravity).
    efforts:    body name -> effort at the joint, J effort on M, not included in `forces`.
    inertias:   body name -> constant inertia at the joint; its effort, inertia times
                `acceleration`, is not included in `efforts`.
    end_masses: body name -> constant mass at M; its force, end_mass (M'' - g), is not included in
                `forces`: it can be added to the platform's inertia once for all samples.
    upright:    cos(gamma_i)^2 of the body that turns about its own axis; 1 if none does.
    """

    forces: dict[str, ca.SX]
    J: ca.SX
    discriminant: ca.SX
    rate: ca.SX
    acceleration: ca.SX
    efforts: dict[str, ca.SX] = field(default_factory=dict)
    inertias: dict[str, ca.SX] = field(default_factory=dict)
    end_masses: dict[str, ca.SX] = field(default_factory=dict)
    upright: ca.SX = field(default_factory=lambda: ca.SX(1))

    @property
    def effort(self) -> ca.SX:
        """All efforts at the joint."""
        inertia = sum(self.inertias.values(), ca.SX(0))
        return inertia * self.acceleration + sum(self.efforts.values(), ca.SX(0))

    def complete(self, A: ca.SX, g: ca.SX) -> ChainDynamics:
        """The same dynamics with everything among the forces."""
        forces = {name: ca.SX.zeros(3) for name in (*self.efforts, *self.inertias)}
        forces |= self.forces
        for name, effort in self.efforts.items():
            forces[name] += self.J * effort
        for name, inertia in self.inertias.items():
            forces[name] += self.J * (inertia * self.acceleration)
        for name, mass in self.end_masses.items():
            forces[name] += mass * (A - g)
        return replace(self, forces=forces, efforts={}, inertias={}, end_masses={})


@dataclass(frozen=True)
class GivingChain:
    """A chain whose joint and platform joint M move apart from each other.

    stretch: of its rod or leg [m]; the loop closes where it is 0.
    kinetic: energy [J].   height: sum of masses times places of mass centres, (3,) [kg m].
    """

    stretch: ca.SX
    kinetic: ca.SX
    height: ca.SX


class Family(ABC):
    """One chain family. Instances hold no data; constants come in as arguments."""

    kind: ClassVar[str]
    # Moving links, base to platform, in the plural of reports; a line has none.
    bodies: ClassVar[tuple[str, ...]]
    joint_unit: ClassVar[str]
    effort_unit: ClassVar[str]
    shapes: ClassVar[dict[str, int]]  # constant -> number of entries (1, 2, 3 or 9)
    # Numbers of the bodies in which forces are linear, with units: see `of_standard`.
    standard: ClassVar[dict[str, str]] = {}
    # Constants that make J and forces of `dynamics` vanish at 0, for lanes without a chain. A
    # family without any is masked by a few multiplications.
    padding: ClassVar[tuple[str, ...]] = ()

    # Path in the chain's table of the stiffness of its rod or leg along itself, if it may have one.
    axial: ClassVar[str] = ""
    pulls: ClassVar[bool] = False  # whether it can only pull

    # What a file for MuJoCo leaves out of such chains, as a note.
    idealised: ClassVar[str] = ""

    # Name -> path in the chain's table of numbers that a simulator may change, and what they are.
    tuned: ClassVar[dict[str, tuple[str, str]]] = {}

    @cached_property
    def numbers(self) -> dict[str, int]:
        """Path in the chain's table -> number of entries: of points and bodies."""
        every = number_fields(CHAINS[self.kind]).items()
        own = {p: own.size for p, own in every if own.size and not p.startswith(OTHER_TABLES)}
        own.pop(self.axial, None)
        return own

    @abstractmethod
    def derived(self, f: Constants) -> dict[str, ca.SX]:
        """Constants by the names of `shapes`, from the file's numbers.

        Args: f: by the paths of `numbers`, with `_` for a dot.
        """

    def margins(self, f: Constants) -> tuple[ca.SX, ca.SX]:
        """Positive where the axis is near enough the perpendicular, and where home has a branch.

        Args: f: as of `derived`.
        """
        return ca.SX(1), ca.SX(1)

    def of_standard(self, c: Constants, p: Constants) -> dict[str, Any]:
        """Constants of the bodies from their standard numbers, by the names of `shapes`.

        Args: p: by the names of `standard`, with `_` for a dot; masses are not 0.
        """
        return {}

    def to_standard(self, f: Constants) -> dict[str, Any]:
        """The numbers of `standard` from the file's. Args: f: as of `derived`."""
        return {}

    def constants(self, chain: Any) -> dict[str, np.ndarray]:
        """Constants of one chain, by the names of `shapes`."""
        found = np.asarray(_derivation(self)(self.file_numbers(chain))).ravel()
        return vars(self.named(found))

    def file_numbers(self, chain: Any, paths: Iterable[str] | None = None) -> np.ndarray:
        """The file's numbers of a chain at some paths of its table; default: `numbers`.

        Optional ones that are left out are `LEFT_OUT`.
        """
        parts = [attrgetter(path)(chain) for path in paths or self.numbers]
        flat = [x for part in parts for x in np.ravel(part)]
        return np.array([LEFT_OUT if x is None else x for x in flat], dtype=float)

    @abstractmethod
    def end_point(self, c: Constants, q_r: ca.SX) -> ca.SX:
        """M by way of the chain: the left side of [Cheng2023] eq. (15), (3,)."""

    @abstractmethod
    def links(self, c: Constants, q_r: ca.SX) -> list[Link]:
        """The moving bodies, in the order of `bodies`."""

    @abstractmethod
    def joints(self, c: Constants, q_r: ca.SX) -> list[Joint]:
        """One joint per link, in the order of `bodies`, without the platform joint M."""

    @abstractmethod
    def loop(self, c: Constants, M: ca.SX) -> ChainLoop:
        """Inverse kinematics in closed form, on the branch of home."""

    def giving(self, c: Constants, M: ca.SX, joint: ca.SX, V: ca.SX, rate: ca.SX) -> GivingChain:
        """The chain where its joint does not follow M, since rod or leg give.

        Args:   M, joint: symbols;  V, rate: their rates.
        Raises: UnsupportedError: where a family does not say.
        """
        raise UnsupportedError(
            f"chains of kind {self.kind} have no `giving`, so stiffness is not known: see Family"
        )

    def end_masses(self, c: Constants) -> dict[str, ca.SX]:
        """`ChainDynamics.end_masses`, from constants alone."""
        return {}

    @abstractmethod
    def dynamics(
        self, c: Constants, M: ca.SX, V: ca.SX, A: ca.SX, g: ca.SX, cut: Cut = ca.SX
    ) -> ChainDynamics:
        """Virtual power: forces on M from its motion.

        Args: cut: passes the joint's acceleration on, or puts a symbol in its place.
        """

    @abstractmethod
    def carried(self, c: Constants, M: ca.SX, V: ca.SX, base: MovingBase) -> ca.SX:
        """Virtual power: what a moving base adds to the forces on M, (3,)."""

    @abstractmethod
    def explain(self, chain: Any, pose: np.ndarray) -> str:
        """Why the chain cannot reach its platform joint at a pose, with distances."""

    def drawing(self, chain: Any, joint: np.ndarray, M: np.ndarray) -> ChainDrawing:
        """What to draw of a chain: a straight line, if the family does not say.

        Args: joint: its coordinates, (N,);  M: its platform joint in {S}, (N, 3) [m].
        """
        points = {"B": np.asarray(chain.fixed_points[0], dtype=float), "M": M}
        return ChainDrawing(points, (DrawnRod("chain", "B", "M"),), ("M",))

    def span(self, chain: Any, pose: np.ndarray) -> tuple[float, float] | None:
        """The distance that the rod would have to span at an unreachable pose, and its length [m].

        None for families whose reach has no such bound.
        """
        return None

    @classmethod
    def size(cls) -> int:
        return sum(cls.shapes.values())

    @classmethod
    def vector(cls, values: dict[str, Any]) -> np.ndarray:
        """Constants in the order of `shapes`, (size,)."""
        return np.concatenate([np.ravel(values[name]) for name in cls.shapes])

    @classmethod
    def named(cls, vector: Any) -> Constants:
        """Constants by name from a symbolic or numeric vector, (size,)."""
        return named(vector, cls.shapes)

    def derived_vector(self, numbers: Any) -> ca.SX:
        """Constants in the order of `shapes` from the file's numbers in theirs."""
        paths = {path.replace(".", "_"): count for path, count in self.numbers.items()}
        found = self.derived(named(numbers, paths))
        return ca.densify(ca.vertcat(*(ca.vec(ca.SX(found[name]).T) for name in self.shapes)))


@cache
def _derivation(family: Family) -> ca.Function:
    """A family's constants as a function of the file's numbers."""
    numbers = ca.SX.sym("numbers", sum(family.numbers.values()))
    return ca.Function("constants", [numbers], [family.derived_vector(numbers)])


def sine(a: ca.SX, b: ca.SX) -> ca.SX:
    """The sine of the angle by which two vectors are off the perpendicular, without sign."""
    return ca.fabs(ca.dot(a, b)) / (ca.norm_2(a) * ca.norm_2(b))


def joint_position(chain: Any, pose: np.ndarray) -> np.ndarray:
    """M in {S}, (3,), at a pose X_EE, (6,)."""
    return pose[:3] + rotations(np.asarray(pose[3:])) @ np.asarray(chain.platform)


def rod_frame(direction: ca.SX) -> ca.SX:
    """N_i0, (3, 3): X along the rod at home, Y = X x X_S (X x Y_S for a rod near X_S)."""
    x = unit(direction)
    near = ca.fabs(x[0]) > NEAR_X
    y = unit(ca.cross(x, ca.vertcat(ca.logic_not(near), near, 0)))
    return ca.horzcat(x, y, ca.cross(x, y))


def unit(vector: ca.SX) -> ca.SX:
    """The unit vector along another, (3,)."""
    return vector / ca.norm_2(vector)


def rod_angles(N: ca.SX, rod: ca.SX, length: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
    """beta_i, gamma_i and cos(gamma_i) of a rod vector ([Cheng2023] eq. 14)."""
    n = N.T @ rod / length
    cos_gamma = ca.sqrt(n[0] ** 2 + n[2] ** 2)
    return ca.atan2(-n[2], n[0]), ca.atan2(n[1], cos_gamma), cos_gamma


def rod_direction(N: ca.SX, q_r: ca.SX) -> ca.SX:
    """Unit vector along the rod, X of N_i0 Ry(beta_i) Rz(gamma_i) ([Cheng2023] eq. 12)."""
    beta, gamma = q_r[1], q_r[2]
    turn = rotation_y(ca.cos(beta), ca.sin(beta)) @ rotation_z(ca.cos(gamma), ca.sin(gamma))
    return (N @ turn)[:, 0]


def rod_spin(N: ca.SX, q_r: ca.SX) -> ca.SX:
    """W of a rod, (3, 3): omega = W q_r' ([Cheng2023] eq. 19)."""
    beta = q_r[1]
    in_N = ca.vertcat(
        ca.horzcat(0, 0, ca.sin(beta)), ca.horzcat(0, 1, 0), ca.horzcat(0, 0, ca.cos(beta))
    )
    return N @ in_N


def rod_guide(N: ca.SX, q_r: ca.SX) -> ca.SX:
    """Axis of the moment that keeps a rod turning with N_i0 Ry(beta_i) Rz(gamma_i), (3,).

    Two ball joints leave a rod free to spin about itself. Not to spin is a constraint, and its
    moment does no work on beta_i' and gamma_i': it acts along X of N_i0 Ry(beta_i), normal to
    both of their axes. The angles are relative to the base, so the base must provide it.
    """
    beta = q_r[1]
    return N @ ca.vertcat(ca.cos(beta), 0, -ca.sin(beta))


def rod_inertia(n: ca.SX, transverse: ca.SX, axial: ca.SX) -> ca.SX:
    """Inertia of a rod along the unit vector n, in {S}, (3, 3)."""
    return transverse * ca.SX.eye(3) + (axial - transverse) * (n @ n.T)


def carried_moment(
    e: ca.SX,
    e_rate: ca.SX,
    Y: ca.SX,
    transverse: ca.SX,
    axial: ca.SX,
    base: MovingBase,
    inverse: ca.SX,
) -> ca.SX:
    """Force dual to e' of what a moving base adds to the moment of a body along e, (3,) [N].

    The body turns with N_i0 Ry(beta) Rz(gamma): omega = n x e' / |e| + beta' s n, as in
    `axial_force`. Apart, since without axial inertia nothing depends on beta.

    Args: inverse: 1 / |e|.
    """
    n = e * inverse
    across = ca.skew(n) * inverse
    s, turn = ca.dot(Y, n), ca.cross(Y, n) * inverse
    spin = across + n @ (turn * (s / (1 - s * s))).T
    outer = n @ n.T
    swung = base.moment(transverse * (ca.SX.eye(3) - outer), across @ e_rate)
    return across.T @ swung + spin.T @ base.moment(axial * outer, spin @ e_rate)


def rod_masses(
    mass: ca.SX, com: ca.SX, transverse: ca.SX, length: ca.SX
) -> tuple[ca.SX, ca.SX, ca.SX]:
    """A rod from S to M as three constants on its ends, m_MM, m_SM and m_SS.

    Its kinetic energy is (m_MM M'^2 + 2 m_SM S'.M' + m_SS S'^2) / 2 plus the axial part.
    """
    bend = transverse / length**2
    return mass * com**2 + bend, mass * com * (1 - com) - bend, mass * (1 - com) ** 2 + bend


def spin_energy(e: ca.SX, e_rate: ca.SX, Y: ca.SX, axial: ca.SX) -> ca.SX:
    """Energy of the axial inertia of a body along e [J], turning as in `axial_force`."""
    along = ca.dot(Y, e)
    square = ca.dot(e, e)
    beta_rate = ca.dot(ca.cross(Y, e), e_rate) / (square - along * along)
    return axial * (along * beta_rate) ** 2 / square / 2


def axial_force(
    e: ca.SX, e_rate: ca.SX, e_acceleration: ca.SX, Y: ca.SX, length: ca.SX, axial: ca.SX
) -> ca.SX:
    """Force dual to e' that the axial inertia of a rod of constant length needs, (3,) [N].

    The rod turns with N_i0 Ry(beta) Rz(gamma), so its axial rate is beta' s with s = sin(gamma).
    With s = Y.e / L and u = Y x e / L^2:

        beta'  = u.e' / (1 - s^2),    beta'' = (u.e'' + 2 s s' beta') / (1 - s^2),
        force  = axial [(beta'' - u.e'') / (1 - s^2) u - s beta'^2 Y / L],

    up to a multiple of e, which does no work.
    """
    direction, across = Y / length, Y / length**2
    s, u = ca.dot(direction, e), ca.cross(across, e)
    inverse = 1 / (1 - s * s)
    beta_rate = ca.dot(u, e_rate) * inverse
    bending = ca.dot(u, e_acceleration)
    twice_s_rate = ca.dot(2 * direction, e_rate)
    beta_acceleration = (bending + s * twice_s_rate * beta_rate) * inverse
    along_u = axial * inverse * (beta_acceleration - bending)
    return along_u * u - (axial * s * beta_rate * beta_rate) * direction
