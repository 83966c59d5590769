"""The pose on the contacts that is nearest to where points of the platform were measured.

    min over q of  sum_i w_i |x_i(q) - measured_i|^2,    x_i = R s_i + O_M,

all frames at once in arrays, by Gauss-Newton in the independent coordinates:

    A dq ~ measured - x,    A = (dx / dX_EE) M_J,    X_EE' = M_J q',

with M_J from the contacts' exact derivatives (the question `conditions`), and the dependent
coordinates brought back onto the surfaces in the same steps. A frame starts at the pose that fits
its points without contacts, which the contacts are not far from. Where the ends of the way do not
tell that no singularity, where branches meet, is between them, it is followed in pieces
(`kinematics.pose_finder`); a frame that does not get to its end so, or ends on another branch than
home's, starts at the frame before it, or after it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Unpack

import numpy as np

from ..backends.numpy_kernel import NumpyKernel
from ..errors import InputError
from ..kinematics.constraints import indices
from ..kinematics.pose_finder import (
    ALIKE,
    SHRINKING,
    Conditions,
    NewtonSteps,
    find,
    least_squares,
    unlikeness,
)
from ..mechanism.coordinates import rotations
from ..mechanism.home import characteristic_length, independent_coordinates
from ..mechanism.mechanism import Mechanism
from ..questions import Question
from ..questions.file_numbers import numbers_of
from ..questions.structure import structure_of
from .column_units import POSE
from .followed_closure import FollowedClosure, PlatformMotion
from .path import Motion, Options

_SAME = 1e-6  # m and rad
_FLATTEST = 0.03  # breadth over length of points that still tell a turn about their length


@dataclass(frozen=True, eq=False)
class NearestPoses:
    """Poses on the contacts nearest to F frames of n measured points.

    Attributes: names: of the points, (n,).
                pose: X_EE, (F, 6) [m, rad]; NaN where there is none.
                before, after: distance of each point from where it was measured, with the pose that
                    fits without contacts, and with the one on them, (F, n) [m].
                moved: distance between the two places, (F, n) [m].
    """

    names: tuple[str, ...]
    pose: np.ndarray
    before: np.ndarray
    after: np.ndarray
    moved: np.ndarray

    @classmethod
    def unmoved(cls, names: tuple[str, ...], pose: np.ndarray) -> NearestPoses:
        """Poses that contacts have no say in, (F, 6)."""
        return cls(names, pose, *(np.full((len(pose), len(names)), np.nan) for _ in range(3)))

    @property
    def determined(self) -> np.ndarray:
        """Frames that have a pose, (F,)."""
        return np.isfinite(self.pose[:, 0])

    def moved_by(self, frames: np.ndarray | slice = slice(None)) -> dict[str, list[float]]:
        """How far each point was moved, and "all": root mean square and largest [m]."""
        found = self.summary(frames)
        return {n: [d["moved_rms"], d["moved_largest"]] for n, d in found.items() if d}

    def summary(self, frames: np.ndarray | slice = slice(None)) -> dict[str, dict[str, float]]:
        """Distances of each point, and of all together ("all"), root mean square and most [m]."""
        table: dict[str, dict[str, float]] = {}
        columns = {name: [i] for i, name in enumerate(self.names)}
        for name, i in (columns | {"all": list(range(len(self.names)))}).items():
            table[name] = {}
            for what in ("before", "after", "moved"):
                values = getattr(self, what)[frames][:, i]
                values = values[np.isfinite(values)]
                if values.size:
                    table[name][f"{what}_rms"] = float(np.sqrt(np.mean(values**2)))
                    table[name][f"{what}_largest"] = float(values.max())
        return table


def nearest_poses(
    mechanism: Mechanism,
    points: dict[str, np.ndarray],
    measured: np.ndarray,
    start: np.ndarray,
    weights: np.ndarray | None = None,
) -> NearestPoses:
    """Poses on the contacts for measured points.

    Args:   points: name -> place in {M}, (3,) [m], of n points.
            measured: in {S}, (F, n, 3) [m]; NaN where not seen.
            start: poses that fit without contacts, (F, 6); NaN where there is none.
            weights: of the points, (n,); default: 1.
    Returns: NaN where there is no start, or no way from it or a neighbour without a singularity, on
        the branch of home: the independent coordinates give every pose again.
    """
    shape = np.array(list(points.values()), dtype=float).reshape(-1, 3)
    root = np.sqrt(np.ones(len(shape)) if weights is None else np.asarray(weights, dtype=float))
    pose = np.full(start.shape, np.nan)
    seen = np.isfinite(measured).all(axis=-1)
    usable = np.isfinite(start).all(axis=1) & (seen.sum(axis=1) >= 2)
    patterns, which = np.unique(seen, axis=0, return_inverse=True)
    which = which.ravel()
    contacts = _contacts(mechanism)
    fits = [_steps(contacts, shape[p], root[p]) for p in patterns]
    aims = [(measured[:, p] * root[p, None]).reshape(len(pose), 3 * p.sum()) for p in patterns]
    for i, steps in enumerate(fits):
        here = np.flatnonzero(usable & (which == i))
        if not len(here):
            continue
        goal = aims[i][here]
        there, reached = find(steps, start[here], goal, SHRINKING)
        reached[reached] = _alike(steps, start[here][reached], there[reached])
        far = ~reached
        there[far], reached[far] = find(steps, start[here[far]], goal[far])
        reached &= contacts.again(there)
        pose[here[reached]] = there[reached]

    left = np.flatnonzero(usable & np.isnan(pose[:, 0]))
    for forwards in (True, False):
        for f in left if forwards else left[::-1]:
            neighbour = f - 1 if forwards else f + 1
            if not 0 <= neighbour < len(pose) or not np.isnan(pose[f, 0]):
                continue
            steps, goal = fits[which[f]], aims[which[f]][f : f + 1]
            there, reached = find(steps, pose[neighbour : neighbour + 1], goal)
            if reached[0] and contacts.again(there)[0]:
                pose[f] = there[0]

    free, on = (points_at(shape, p) for p in (start, pose))
    before, after, moved = (
        np.linalg.norm(a - b, axis=-1) for a, b in ((free, measured), (on, measured), (on, free))
    )
    moved[~seen] = np.nan
    return NearestPoses(tuple(points), pose, before, after, moved)


def points_at(shape: np.ndarray, pose: np.ndarray) -> np.ndarray:
    """Points of the platform, (n, 3) in {M}, at poses (F, 6): (F, n, 3) in {S}."""
    return shape @ rotations(pose[:, 3:]).transpose(0, 2, 1) + pose[:, None, :3]


def nearest_to(
    mechanism: Mechanism, start: np.ndarray, wanted: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Poses on the contacts, (N, 6), nearest to `wanted`, X_EE (N, 6), and whether found, (N,).

    By steps from `start`, (N, 6), as long as they shrink. Angles are multiplied by the
    characteristic length.
    """
    contacts = _contacts(mechanism)

    def at(pose: np.ndarray) -> Conditions:
        phi, M_J, back = contacts.at(pose)
        return Conditions(pose, M_J, M_J, back, back, phi)

    angles = np.repeat([False, True], 3)
    steps = NewtonSteps(at, contacts.length, angles, np.array(contacts.free))
    return find(steps, start, wanted, SHRINKING)


def fit_motion(mechanism: Mechanism, motion: Motion, **options: Unpack[Options]) -> Motion:
    """A motion of whole poses, moved onto the contacts sample by sample.

    Nearest at the points of the platform: contact points and landmarks, all of one weight; where
    these are on a line, the chains' joints on the platform too.

    Args:   options: as of `Motion.from_arrays`, for the motion on the contacts.
    Raises: InputError: for another motion, or a sample that has no pose on the contacts near it.
    """
    if motion.kind != "pose":
        raise InputError(
            f"{motion.source}: --fit (fit=True) is for whole poses ({', '.join(POSE)}), got "
            f"{', '.join(motion.names)}: those are on the contacts already. Leave it out"
        )
    points = {c.name: np.array(c.point) for c in mechanism.contacts}
    points |= {name: np.array(p) for name, p in mechanism.platform.points.items()}
    if _on_a_line(points):
        points |= {chain.name: np.array(chain.platform) for chain in mechanism.chains}
    there = points_at(np.array(list(points.values())), motion.value)
    nearest = nearest_poses(mechanism, points, there, motion.value)
    if not nearest.determined.all():
        i = int(np.argmin(nearest.determined))
        raise InputError(
            f"{motion.source}: no pose on the contacts is near that of t = {motion.t[i]:.6g} s "
            f"(sample {i}): {', '.join(f'{v:.4g}' for v in motion.value[i])}. The motion is of "
            "another mechanism, in other units, or in another frame"
        )
    columns = motion.columns | dict(zip(POSE, nearest.pose.T, strict=True))
    del columns["t"]
    fitted = Motion.from_arrays(motion.t, columns, source=motion.source, **options)
    warnings = (*dict.fromkeys((*motion.warnings, *fitted.warnings)),)
    return replace(fitted, sha256=motion.sha256, warnings=warnings, contact_fit=nearest.moved_by())


def _on_a_line(points: dict[str, np.ndarray]) -> bool:
    shape = np.array(list(points.values())).reshape(-1, 3)
    if len(shape) < 3:
        return True
    sigma = np.linalg.svd(shape - shape.mean(axis=0), compute_uv=False)
    return bool(sigma[1] <= _FLATTEST * sigma[0])


@dataclass(frozen=True)
class _Contacts:
    """phi and C = d phi / dX_EE at poses, by numpy, and which coordinates depend."""

    closure: NumpyKernel | None
    followed: FollowedClosure
    dependent: list[int]
    free: list[int]
    length: float

    def again(self, pose: np.ndarray) -> np.ndarray:
        """Whether poses are those that their independent coordinates give, closed from home, (N,).

        Others are on another branch.
        """
        if self.closure is None:  # without contacts
            return np.ones(len(pose), dtype=bool)
        s = pose[:, self.free]
        still = np.zeros_like(s)
        inputs = {"s": s, "s1": still, "s2": still}
        answer = self.closure.run(inputs)
        answer.mend(inputs, lambda rows: self.followed.solve(*rows.values()).answer())
        with np.errstate(invalid="ignore"):
            return np.abs(PlatformMotion.of(answer).pose - pose).max(axis=1) <= _SAME

    def at(self, pose: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Distances (N, k), M_J (N, 6, 6 - k), and the way back onto the surfaces, (N, 6)."""
        k, dep, free = len(self.dependent), self.dependent, self.free
        value, K, _ = self.followed.conditions(pose, np.zeros_like(pose))
        phi, C = value[:, :k], K[:, :k]
        M_J = np.zeros((len(pose), 6, 6 - k))
        M_J[:, free, range(6 - k)] = 1.0
        back = np.zeros_like(pose)
        if k:
            solved = -least_squares(C[:, :, dep], np.dstack([C[:, :, free], phi]))
            M_J[:, dep], back[:, dep] = solved[..., :-1], solved[..., -1]
        return phi, M_J, back


@lru_cache(8)  # recordings of a session are of a few mechanisms, and deriving takes longer
def _contacts(mechanism: Mechanism) -> _Contacts:
    names = tuple(independent_coordinates(mechanism))
    structure = structure_of(mechanism)
    numbers = numbers_of(structure, mechanism)
    question = Question.about(structure, "closure", names)
    closure = NumpyKernel(question.variants(), numbers) if mechanism.contacts else None
    free = indices(names)
    dependent = [i for i in range(6) if i not in free]
    length = characteristic_length(mechanism)
    followed = FollowedClosure.of(structure, numbers, names)
    return _Contacts(closure, followed, dependent, free, length)


def _steps(contacts: _Contacts, shape: np.ndarray, root: np.ndarray) -> NewtonSteps:
    """Steps towards measured points (n, 3) times the roots of their weights, (n,)."""

    def at(pose: np.ndarray) -> Conditions:
        phi, M_J, back = contacts.at(pose)
        R = rotations(pose[:, 3:])
        lever = shape @ R.transpose(0, 2, 1)
        # Axes about which alpha, beta and gamma turn.
        first = np.broadcast_to([1.0, 0.0, 0.0], (len(pose), 3))
        cos, sin = np.cos(pose[:, 3]), np.sin(pose[:, 3])
        axes = (first, np.column_stack([np.zeros(len(pose)), cos, sin]), R[:, :, 2])
        slope = np.zeros((len(pose), len(shape), 3, 6))
        slope[..., range(3), range(3)] = 1.0
        for i, axis in enumerate(axes):
            slope[..., 3 + i] = np.cross(axis[:, None], lever)
        rows = len(pose), 3 * len(shape)
        slope = (slope * root[:, None, None]).reshape(*rows, 6)
        value = ((lever + pose[:, None, :3]) * root[:, None]).reshape(rows)
        carried = (slope @ back[..., None])[..., 0]
        return Conditions(value, slope @ M_J, M_J, back, carried, phi)

    none = np.zeros(3 * len(shape), dtype=bool)
    return NewtonSteps(at, contacts.length, none, np.array(contacts.free))


def _alike(steps: NewtonSteps, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Whether no singularity is between the ends of ways, as far as these tell, (N,)."""
    A, B = (steps.conditions(pose).slope * steps.free_unit for pose in (start, end))
    return unlikeness(A, B) <= ALIKE
