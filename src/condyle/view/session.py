"""The live view without its page: a pose and a load in, a snapshot out. It never raises for a pose.

The platform stands still, so efforts are those that hold it against gravity and the load.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import InputError, did_you_mean
from ..kinematics.causes import unreachable_cause
from ..kinematics.constraints import indices
from ..kinematics.singularities import KINDS, NEAR_SINGULAR
from ..mechanism import COORDINATES, Mechanism
from ..mechanism.chain import limits
from ..mechanism.vocabulary import words_of
from ..model.inverse_dynamics import SOLVED
from ..model.model import Model
from ..model.model_result import ModelResult
from ..motion.nearest_pose import nearest_to
from ..motion.points import DEFAULT_LOAD_POINT
from ..results.contacts import bound_margins
from ..status import Status
from .snapshot import Level, Snapshot, bound_messages, measured, state_messages

CENTRE = "mass centre"  # where the load acts besides the platform's points
SPAN_ANGLE = np.radians(60)  # how far from home the reach is looked for
SCAN = 121
BEYOND = 1.25  # sliders go this much further than the reach, to show where it ends
MOST_INTERNAL = 6  # directions of internal efforts that have a slider
WIDE = 25  # range of sliders of actuators without limits, over the largest effort at home

NO_EFFORTS: dict[int, str] = {
    Status.singular: "Singular: the efforts are not determined here",
    Status.overflow: "The load is too large for numbers",
    Status.infeasible: "Infeasible: no efforts within the limits balance the load",
    Status.jammed: "Jammed: Coulomb friction has no solution here",
    Status.uncertified: "The efforts found here failed the accuracy check",
    Status.overlap: "The ball of a contact overlaps its surface",
    Status.indeterminate: "Active contacts depend on each other: their forces are not determined",
    Status.gimbal_lock: "Gimbal lock: beta is +-90 degrees",
}


@dataclass(frozen=True)
class Coordinate:
    """An independent coordinate that a slider moves: its range in SI, and how it is shown."""

    name: str
    low: float
    high: float
    unit: str
    scale: float


class Session:
    """A mechanism at one pose under one load, both free to change.

    Attributes: q: independent coordinates, (m,) [m, rad];  load: force in {S}, (3,) [N];
                load_point: of `load_points`;  internal: efforts that balance each
                other, (r,) [N m or N], r = n - m, added to those that hold the platform.
    """

    load_points: tuple[str, ...]
    load_point: str

    def __init__(self, mechanism: Mechanism) -> None:
        """Raises: MechanismError: if the contacts do not hold the platform at home."""
        self.mechanism = mechanism
        # One pose at a time: a compiled kernel would take longer to build than it saves.
        self.model: Model = Model(mechanism, backend="numpy")
        self.q: np.ndarray = np.zeros(len(self.model.independent))
        self.load: np.ndarray = np.zeros(3)
        self.load_points, self.load_point = load_points(mechanism)
        self._internal = Internal(self.model)
        self.internal: np.ndarray = np.zeros(self._internal.at(np.zeros(6)).count)
        self._pose = np.zeros(6)
        self._joint = np.zeros(len(mechanism.chains))

    def coordinates(self) -> list[Coordinate]:
        """The independent coordinates, with ranges a little wider than their reach from home."""
        coordinates = []
        for i, name in enumerate(self.model.independent):
            angle = name not in COORDINATES[:3]
            span = SPAN_ANGLE if angle else self.model.characteristic_length
            value = np.linspace(-span, span, SCAN)
            q = np.zeros((SCAN, len(self.q)))
            q[:, i] = value
            reached = self._evaluate(q).status == Status.ok
            low, high = _around_home(value, reached)
            unit, scale = ("°", 180 / np.pi) if angle else ("mm", 1e3)
            coordinates.append(Coordinate(name, BEYOND * low, BEYOND * high, unit, scale))
        return coordinates

    def set_coordinate(self, name: str, value: float) -> None:
        """Move one independent coordinate [m or rad]."""
        if name not in self.model.independent:
            known = did_you_mean(name, self.model.independent)
            raise InputError(f'"{name}" is not an independent coordinate.{known}')
        self.q[self.model.independent.index(name)] = value

    def set_load(self, force: np.ndarray, point: str | None = None) -> None:
        """Put a force (3,) [N] on the platform, at a point of it."""
        self.load = np.asarray(force, dtype=float)
        if point is not None and point not in self.load_points:
            raise InputError(f'no load point "{point}".{did_you_mean(point, self.load_points)}')
        self.load_point = point or self.load_point

    def set_internal(self, number: int, value: float) -> None:
        """Set the amplitude of a direction of internal efforts: its largest effort [N m or N]."""
        if not 0 <= number < len(self.internal):
            raise InputError(
                f"there is no direction {number} of internal efforts: this mechanism has "
                f"{len(self.internal)}, counted from 0"
            )
        self.internal[number] = value

    def directions(self) -> Directions:
        """Directions of internal efforts at the last good pose."""
        return self._internal.at(self._pose)

    def internal_reach(self) -> float:
        """Range of a slider of internal efforts, either way [N m or N]."""
        greatest = [limits(chain).greatest for chain in self.mechanism.chains]
        finite = [value for value in greatest if np.isfinite(value) and value > 0]
        if finite:
            return max(finite)
        found = self._evaluate(np.zeros((1, len(self.q)))).effort
        return WIDE * float(np.nanmax(np.abs(found), initial=0.0)) or 1.0

    def take_pose(self, pose: np.ndarray) -> None:
        """Go on from X_EE, (6,) [m, rad], which the contacts meet."""
        self.q = np.array(pose)[indices(self.model.independent)]

    def go_home(self) -> None:
        self.q = np.zeros(len(self.q))

    def drag_to(self, wanted: np.ndarray) -> None:
        """Go to the pose on the contacts that is nearest to `wanted`, X_EE (6,) [m, rad].

        Where the search cannot start, the independent coordinates of `wanted` are taken as they
        are, so that the page can say what is wrong with them.
        """
        wanted = np.asarray(wanted, dtype=float)
        pose, reached = nearest_to(self.mechanism, self._pose[None], wanted[None])
        # Steps that do not converge still come near.
        stuck = not reached[0] and bool((pose[0] == self._pose).all())
        self.take_pose(wanted if stuck else pose[0])

    def snapshot(self) -> Snapshot:
        """The mechanism at `q` under `load`."""
        solution = self._evaluate(self.q[None])
        status = int(solution.status[0])
        pose = solution.pose[0]
        met = bool(np.isfinite(pose).all())
        # What was asked for, completed by the dependent coordinates of the last good pose.
        wanted = None if met else self._pose.copy()
        if wanted is not None:
            wanted[indices(self.model.independent)] = self.q
        if met:
            self._pose = pose
        joint, reach = solution.configuration.joint[0], solution.configuration.discriminant[0]
        in_reach = reach >= 0
        out_of_reach = [
            n for n, fine in zip(self.mechanism.chain_names, in_reach, strict=True) if not fine
        ]
        if met:
            self._joint = np.where(in_reach, joint, self._joint)
        force, effort = (
            np.where(status == Status.ok, values[0], np.nan)
            for values in (solution.contact_force, solution.effort)
        )
        if met and self.internal.any():
            directions = self.directions()
            effort = effort + directions.effort @ self.internal
            force = force + directions.contact @ self.internal
        measures = measured(solution.configuration.singularity)
        margin = bound_margins(self.mechanism, solution.configuration.contact_point)[0]
        level: Level
        if status == Status.unreachable:
            level, cause = "unreachable", unreachable_cause(self.mechanism, solution, 0)
            messages = [f"Out of reach: {cause}"]
            others = [name for name in out_of_reach if f'"{name}"' not in cause]
            if met and others:
                messages.append(f"Also out of reach: {', '.join(others)}")
            messages += bound_messages(self.mechanism, margin)
        else:
            messages = [] if status == Status.ok else [words_of(self.mechanism)(NO_EFFORTS[status])]
            messages += state_messages(self.mechanism, margin, force, effort, None)
            if (near := measures["near"]) != KINDS[0] and status == Status.ok:
                text = f"Near a singularity of the kind {near} (ratio below {NEAR_SINGULAR:g})"
                messages.append(words_of(self.mechanism)(text))
            level = "warning" if messages else "ok"
        return Snapshot.at(
            self.mechanism,
            self._pose,
            self._joint,
            wanted=wanted,
            out_of_reach=tuple(out_of_reach) if met else (),
            joint=np.where(in_reach, joint, np.nan),
            effort=effort,
            reach=reach,
            contact_force=force,
            margin=margin,
            load=self.load,
            load_at=self._load_at(),
            level=level,
            messages=tuple(messages),
            **measures,
        )

    def _evaluate(self, q: np.ndarray) -> ModelResult:
        rest, wrench = np.zeros_like(q), np.concatenate([self.load, np.zeros(3)])
        return self.model.inverse_dynamics(q, rest, rest, wrench, self._load_at(), outputs=SOLVED)

    def _load_at(self) -> np.ndarray:
        return place_of(self.mechanism, self.load_point)


def load_points(mechanism: Mechanism) -> tuple[tuple[str, ...], str]:
    """Names of the points at which a force can act, and the one that is meant first."""
    names = (CENTRE, *mechanism.platform.points)
    return names, DEFAULT_LOAD_POINT if DEFAULT_LOAD_POINT in names else CENTRE


def place_of(mechanism: Mechanism, name: str) -> np.ndarray:
    """Where one of `load_points` is, (3,) [m] in {M}."""
    return np.array(mechanism.platform.points.get(name, (0.0, 0.0, 0.0)))


def _around_home(value: np.ndarray, reached: np.ndarray) -> tuple[float, float]:
    """Ends of the unbroken run of reached values round the middle one."""
    middle = len(value) // 2
    low = high = middle
    while low > 0 and reached[low - 1]:
        low -= 1
    while high < len(value) - 1 and reached[high + 1]:
        high += 1
    step = value[1] - value[0]
    return min(value[low], -step), max(value[high], step)


RANK = 1e-10  # of the largest singular value
SAME = 1e-9  # contact forces below this part of a unit effort are none


@dataclass(frozen=True)
class Directions:
    """Internal efforts at one pose.

    effort: (n, r) [N m or N], the largest entry of each direction 1.
    contact: (k, r) [N], what they add to the contact forces.
    """

    effort: np.ndarray
    contact: np.ndarray

    @property
    def count(self) -> int:
        return self.effort.shape[1]


def null_space(J: np.ndarray, normal: np.ndarray) -> Directions:
    """An orthonormal basis of what J^T tau + sum lambda_k N_k = 0 leaves to the efforts.

    Args: J: (n, 6), actuator Jacobian;  normal: (k, 6), wrenches of unit contact forces.
    """
    balance = np.vstack([J, normal]).T
    # Rows are scaled, since moments and forces have units of their own.
    size = np.linalg.norm(balance, axis=1, keepdims=True)
    _, sigma, V = np.linalg.svd(balance / np.where(size > 0, size, 1.0))
    rank = int((sigma > RANK * sigma[0]).sum())
    free = V[rank:].T
    n = len(J)
    basis, R = np.linalg.qr(free[:n])
    return Directions(basis, free[n:] @ np.linalg.inv(R))


def ordered(directions: Directions) -> Directions:
    """The same space, those directions first that change the contact forces the most."""
    if not directions.contact.size:
        return directions
    _, _, V = np.linalg.svd(directions.contact)
    return Directions(directions.effort @ V.T, directions.contact @ V.T)


def aligned(directions: Directions, home: Directions) -> Directions:
    """The same space, each direction as near as can be to that of `home`."""
    if directions.count != home.count:
        return directions
    U, _, V = np.linalg.svd(directions.effort.T @ home.effort)
    return Directions(directions.effort @ (U @ V), directions.contact @ (U @ V))


def scaled(directions: Directions) -> Directions:
    """The largest effort of each direction has size 1, so that sliders are in units of efforts."""
    by = np.abs(directions.effort).max(axis=0)
    contact = np.where(np.abs(directions.contact) < SAME, 0.0, directions.contact)
    return Directions(directions.effort / by, contact / by)


class Internal:
    """Directions of internal efforts: those that balance each other, but load the contacts.

    With n efforts and m freedoms there are n - m. At home those come first that change the contact
    forces the most for their size; elsewhere a direction is the nearest one to its own at home, so
    that a slider means the same wherever the platform is.
    """

    def __init__(self, model: Model) -> None:
        self._model = model
        self._home: Directions | None = None
        self._last = Directions(np.empty((0, 0)), np.empty((0, 0)))

    def at(self, pose: np.ndarray) -> Directions:
        """Directions at X_EE, (6,) [m, rad], at rest; those before where chains cannot reach it."""
        if self._home is None:
            J, normal = self._balance(np.zeros(6))
            self._home = ordered(null_space(J, normal))
            self._last = scaled(self._home)
        J, normal = self._balance(pose)
        if np.isfinite(J).all() and np.isfinite(normal).all():
            self._last = scaled(aligned(null_space(J, normal), self._home))
        return self._last

    def _balance(self, pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Actuator Jacobian (n, 6) and wrenches of unit contact forces (k, 6)."""
        still, none = np.zeros((1, 6)), np.zeros((1, 3))
        ports = {"pose": pose[None], "pose_rate": still, "pose_acceleration": still}
        ports |= {"force": none, "moment": none, "point": none}
        s = self._model.kernel("system").run(ports).values
        return s["J"][..., 0].T, s["normal"][..., 0]
