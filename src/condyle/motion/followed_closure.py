"""Path following from home to poses on the contacts with given coordinates, or landmark.

The kernel of the question `closure` closes most samples; these are for those it cannot vouch for.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..backends.kernel import Arrays, KernelValues
from ..backends.numpy_kernel import NumpyKernel
from ..graph.program import Numbers
from ..kinematics.constraints import closed_form_available
from ..kinematics.pose_finder import BOLD, Conditions, NewtonSteps, find, least_squares
from ..mechanism.mechanism import COORDINATES
from ..questions import Question
from ..questions.numbers import characteristic
from ..questions.structure import Structure
from ..status import Status

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
        """The motion in a kernel's answer; NaN where the conditions are not met."""
        reached = answer.status == Status.ok
        arrays = [answer.values[name].T for name in MOTION]
        if not reached.all():
            for a in arrays:
                a[~reached] = np.nan
        return PlatformMotion(arrays[0], arrays[1], arrays[2], reached)

    def answer(self) -> tuple[Arrays, Array]:
        """The same as a kernel's answer: arrays by name, samples last, and statuses."""
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
        self.conditions, self._two_branches = conditions, two_branches
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
        """The closure of a mechanism, by numpy, from the question `conditions`."""
        kernel = NumpyKernel(Question.about(structure, "conditions", names).variants(), numbers)

        def conditions(pose: Array, rate: Array) -> tuple[Array, Array, Array]:
            found = kernel.run({"pose": pose, "pose_rate": rate}).values
            K = np.ascontiguousarray(np.moveaxis(found["K"], -1, 0))
            return np.ascontiguousarray(found["values"].T), K, found["bias"].T

        turns = [name in COORDINATES[3:] for name in names]
        angles = np.array(turns or [False] * structure.m)  # a landmark's path: lengths
        dependent = [name for name in COORDINATES if name not in names]
        closed = closed_form_available([form for form, _ in structure.contacts], dependent)
        length = characteristic(structure, numbers).item()
        return FollowedClosure(conditions, angles, length, bool(names) and closed)

    def solve(self, s: Array, s1: Array, s2: Array) -> PlatformMotion:
        """Poses and rates where g = s, g' = s1, g'' = s2, (N, 6 - k) each."""
        home = np.zeros((len(s), 6))
        pose, reached = find(self._steps, home, self._padded(s))
        if self._two_branches:
            # The straight way may leave the surfaces where another would not: one bold leap, to
            # be judged by its branch.
            left = np.flatnonzero(~reached & np.isfinite(s).all(axis=1))
            pose[left], reached[left] = find(self._steps, home[left], self._padded(s[left]), BOLD)
            reached[left] &= self._side(pose[left]) == self._branch
        # Contacts that hold badly magnify rounding in the steps: one more, down to the residual's.
        pose[reached] += self._steps.step(pose[reached], self._padded(s[reached])).move
        pose[~reached] = np.nan
        _, K, _ = self.conditions(pose, home)
        rate = least_squares(K, self._padded(s1)[..., None])[..., 0]
        bias = self.conditions(pose, rate)[2]
        acceleration = least_squares(K, (self._padded(s2) - bias)[..., None])[..., 0]
        return PlatformMotion(pose, rate, acceleration, reached)

    def _side(self, pose: Array) -> Array:
        """The sign of det K: branches meet where it changes."""
        with np.errstate(invalid="ignore"):
            return np.linalg.slogdet(self.conditions(pose, np.zeros_like(pose))[1]).sign

    def _padded(self, s: Array) -> Array:
        return np.hstack([np.zeros((len(s), self._k)), s])
