"""States of the platform in its independent coordinates, from what a motion gives."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..backends.choose import Backend
from ..backends.kernel import VARIANT, Arrays, Kernel, KernelValues
from ..backends.numpy_kernel import NumpyKernel
from ..errors import InputError, did_you_mean
from ..graph.program import Numbers
from ..kinematics.constraints import closed_form_available
from ..kinematics.continuation import Conditions, NewtonSteps, follow, least_squares, nearest
from ..mechanism.home import (
    MAX_CONDITION,
    condition_of,
    constraint_jacobian,
    usable_sets,
)
from ..mechanism.mechanism import COORDINATES, Mechanism
from ..questions import Question
from ..questions.file_numbers import numbers_of
from ..questions.numbers import characteristic, specialised
from ..questions.structure import Structure, structure_of
from ..status import Status
from .variant_rows import solved_by_variant

Array = np.ndarray
MOTION = ("pose", "pose_rate", "pose_acceleration")


@dataclass(frozen=True)
class PlatformMotion:
    """X_EE and its rates, (N, 6) each; `reached` tells where the conditions were met, (N,)."""

    pose: Array
    rate: Array
    acceleration: Array
    reached: Array

    @staticmethod
    def of(answer: KernelValues) -> PlatformMotion:
        """From what a question answers; NaN where the conditions are not met."""
        reached = answer.status == Status.ok
        found = [answer.values[name].T for name in MOTION]
        if not reached.all():
            for a in found:
                a[~reached] = np.nan
        return PlatformMotion(found[0], found[1], found[2], reached)

    def answer(self) -> tuple[Arrays, Array]:
        """As questions answer: arrays by name, samples last, and statuses."""
        found = dict(zip(MOTION, (self.pose.T, self.rate.T, self.acceleration.T), strict=True))
        return found, np.where(self.reached, Status.ok, Status.unreachable)


class FollowedClosure:
    """Poses followed from home to where six conditions hold: k contacts, phi = 0, and g = s.

    Each sample alone; rates come by the chain rule (see `questions.closure`).
    """

    def __init__(
        self,
        conditions: Callable[[Array, Array], tuple[Array, Array, Array]],
        angles: Array,
        length: float,
        two_branches: bool,
    ) -> None:
        """Args: conditions: of poses and rates, (N, 6) each: (phi, g), K (N, 6, 6) and K' X'.
        angles: which of g are angles, (6 - k,).   length: the characteristic one [m].
        two_branches: whether there are no more than two poses: home's can be told by det K.
        """
        self._conditions, self._two_branches = conditions, two_branches
        self._k = 6 - len(angles)

        def at(pose: Array) -> Conditions:
            value, K, _ = conditions(pose, np.zeros_like(pose))
            none, N = np.zeros_like(pose), len(pose)
            whole = np.broadcast_to(np.eye(6), (N, 6, 6))
            return Conditions(value, np.ascontiguousarray(K), whole, none, none, none[:, :0])

        rows = np.concatenate([np.zeros(self._k, dtype=bool), angles])
        self._steps = NewtonSteps(at, length, rows, np.arange(6))
        self._branch = self._side(np.zeros((1, 6)))[0]

    @staticmethod
    def of(structure: Structure, numbers: Numbers, names: tuple[str, ...]) -> FollowedClosure:
        """By numpy, from the question `conditions`."""
        kernel = NumpyKernel(Question.about(structure, "conditions", names).variants(), numbers)

        def conditions(pose: Array, rate: Array) -> tuple[Array, Array, Array]:
            found = kernel.run({"pose": pose, "pose_rate": rate}).values
            return found["values"].T, np.moveaxis(found["K"], -1, 0), found["bias"].T

        turns = [name in COORDINATES[3:] for name in names]
        angles = np.array(turns or [False] * structure.m)  # a landmark's path: lengths
        dependent = [name for name in COORDINATES if name not in names]
        closed = closed_form_available([form for form, _ in structure.contacts], dependent)
        length = characteristic(structure, numbers).item()
        return FollowedClosure(conditions, angles, length, bool(names) and closed)

    def solve(self, s: Array, s1: Array, s2: Array) -> PlatformMotion:
        """Poses and rates where g = s, g' = s1, g'' = s2, (N, 6 - k) each."""
        home = np.zeros((len(s), 6))
        pose, reached = follow(self._steps, home, self._padded(s))
        if self._two_branches:
            # The straight way may leave the surfaces where another would not: one bold leap, to
            # be judged by its branch.
            left = np.flatnonzero(~reached & np.isfinite(s).all(axis=1))
            pose[left], reached[left] = nearest(
                self._steps, home[left], self._padded(s[left]), bold=True
            )
            reached[left] &= self._side(pose[left]) == self._branch
        # Contacts that hold badly magnify rounding in the steps: one more, down to the residual's.
        pose[reached] += self._steps.step(pose[reached], self._padded(s[reached])).move
        pose[~reached] = np.nan
        _, K, _ = self._conditions(pose, home)
        rate = least_squares(K, self._padded(s1)[..., None])[..., 0]
        bias = self._conditions(pose, rate)[2]
        acceleration = least_squares(K, (self._padded(s2) - bias)[..., None])[..., 0]
        return PlatformMotion(pose, rate, acceleration, reached)

    def _side(self, pose: Array) -> Array:
        """The sign of det K: branches meet where it changes."""
        with np.errstate(invalid="ignore"):
            return np.linalg.slogdet(self._conditions(pose, np.zeros_like(pose))[1]).sign

    def _padded(self, s: Array) -> Array:
        return np.hstack([np.zeros((len(s), self._k)), s])


@dataclass(eq=False)
class Closure:
    """Closes the contacts of V mechanisms for 6 - k coordinates by name, or for a landmark's path.

    kernel: of the question `closure`, on the numbers of all mechanisms.
    """

    names: tuple[str, ...]
    landmark: str | None
    structure: Structure
    numbers: Numbers
    kernel: Kernel

    @staticmethod
    def of(
        mechanism: Mechanism,
        names: Sequence[str] = (),
        landmark: str | None = None,
        backend: Backend | None = None,
        general: bool = False,
    ) -> Closure:
        """Of one mechanism.

        Args:   general: whether its kernel serves every mechanism of the structure.
        Raises: InputError: if these do not determine a pose.
        """
        require_determined(mechanism, names, landmark)
        ordered = () if landmark is not None else tuple(sorted(names, key=COORDINATES.index))
        structure = structure_of(mechanism)
        numbers = numbers_of(structure, mechanism, landmark)
        if not general:
            structure = specialised(structure, numbers)
        question = Question.about(structure, "closure", ordered)
        kernel = (backend or Backend()).kernel(question.key, question.variants, numbers)
        return Closure(ordered, landmark, structure, numbers, kernel)

    def numbers_for(self, mechanism: Mechanism) -> Numbers:
        """The numbers of another mechanism of its structure, for its kernel.

        Raises: InputError: as of `of`.
        """
        require_determined(mechanism, self.names, self.landmark)
        return numbers_of(self.structure, mechanism, self.landmark)

    @cached_property
    def _followed(self) -> FollowedClosure:
        return FollowedClosure.of(self.structure, self.numbers, self.names)

    def solve(
        self, s: np.ndarray, s1: np.ndarray, s2: np.ndarray, threads: int | None = None
    ) -> PlatformMotion:
        """X_EE and its rates where g = s, g' = s1, g'' = s2, (N, 6 - k) each: (V N, 6), mechanism
        by mechanism."""
        inputs, V = {"s": s, "s1": s1, "s2": s2}, len(self.numbers)
        if V > 1:
            inputs = {name: np.tile(a, (V, 1)) for name, a in inputs.items()}
            inputs[VARIANT] = np.repeat(np.arange(V), len(s))
        answer = self.kernel.run(inputs, threads)
        answer.mend(inputs, self._follow)
        return PlatformMotion.of(answer)

    def _follow(self, rows: Arrays) -> tuple[Arrays, Array]:
        """Samples that the kernel cannot vouch for."""
        if len(self.numbers) == 1:
            return self._followed.solve(rows["s"], rows["s1"], rows["s2"]).answer()
        found: tuple[Arrays, Array] = solved_by_variant(rows, self._follow_single)
        return found

    def _follow_single(self, i: int, rows: Arrays) -> tuple[Arrays, Array]:
        return replace(self, numbers=self.numbers.single(i))._follow(rows)


def require_determined(mechanism: Mechanism, names: Sequence[str], landmark: str | None) -> None:
    """Raises InputError if coordinates, or a landmark's path, do not determine a pose."""
    if landmark is None:
        require_independent(mechanism, names)
    else:
        require_landmark(mechanism, landmark)


def require_independent(mechanism: Mechanism, names: Sequence[str]) -> None:
    """Raises InputError if the contacts do not determine the other coordinates at home."""
    dependent = tuple(name for name in COORDINATES if name not in names)
    k = len(mechanism.contacts)
    usable = [tuple(n for n in COORDINATES if n not in d) for d in usable_sets(mechanism)]
    if len(names) != 6 - k:
        raise InputError(
            f"got the {len(names)} coordinates {', '.join(names)}; the mechanism has {6 - k} "
            f"degrees of freedom. Independent coordinates would be: {_sets(usable)}"
        )
    condition = condition_of(constraint_jacobian(mechanism), dependent) if k else 1.0
    if condition >= MAX_CONDITION:
        raise InputError(
            f"the coordinates {', '.join(names)} are not independent: the contacts do not "
            f"determine {', '.join(dependent)} from them. Available: {_sets(usable)}"
        )


def require_landmark(mechanism: Mechanism, landmark: str) -> None:
    """Raises InputError if the landmark's path does not determine a pose."""
    points = mechanism.platform.points
    if landmark not in points:
        raise InputError(
            f'the mechanism has no landmark "{landmark}".{did_you_mean(landmark, points)}'
        )
    if len(mechanism.contacts) != 2:
        raise InputError(
            f"a landmark's path determines a pose only with two contacts; this mechanism has "
            f"{len(mechanism.contacts)}. Give {6 - len(mechanism.contacts)} pose coordinates "
            "instead"
        )


def _sets(usable: list[tuple[str, ...]]) -> str:
    shown = "; ".join(",".join(names) for names in usable[:4])
    return shown + ("; ..." if len(usable) > 4 else "")
