"""Poses followed from home by Newton's method, where a kernel's fixed number of steps is in doubt.

Each sample is solved from home, alone; rates come by the chain rule (see `questions.closure`).
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from ..backends.numpy_kernel import NumpyKernel
from ..graph.program import Numbers
from ..kinematics.constraints import closed_form_available
from ..mechanism.mechanism import COORDINATES
from ..questions import Prescribed, Question
from ..questions.numbers import characteristic
from ..questions.structure import Structure

SMALLEST_PIECE = 2.0**-10  # of the way from home
ITERATIONS = 30
ROUNDING = 1e-15


@dataclass(frozen=True)
class PlatformMotion:
    """X_EE and its rates, (N, 6) each; `reached` tells where the conditions were met, (N,)."""

    pose: np.ndarray
    rate: np.ndarray
    acceleration: np.ndarray
    reached: np.ndarray

    def named(self) -> dict[str, np.ndarray]:
        """The arrays, by the names that questions have for them."""
        return {
            "pose": self.pose,
            "pose_rate": self.rate,
            "pose_acceleration": self.acceleration,
        }


class Follow:
    """Solves poses for one choice of prescribed functions."""

    def __init__(self, structure: Structure, numbers: Numbers, prescribed: Prescribed) -> None:
        question = Question.about(structure, "conditions", prescribed)
        self._kernel = NumpyKernel(question.variants(), numbers)
        self._k = len(structure.contacts)
        dependent = [name for name in COORDINATES if name not in prescribed.names]
        forms = [form for form, _ in structure.contacts]
        # Whether there are no more than two poses: then the other can be told from home's.
        self._two_branches = bool(prescribed.names) and closed_form_available(forms, dependent)
        home, K_home = self._conditions(np.zeros((1, 6)))
        self._home = home[0, self._k :]
        self._branch = np.linalg.slogdet(K_home).sign[0]
        length = characteristic(structure, numbers)
        self._unit = np.repeat([length, 1.0], 3)
        self._scale = 1.0 + length  # lengths, and angles of scale 1

    def solve(self, s: np.ndarray, s1: np.ndarray, s2: np.ndarray) -> PlatformMotion:
        """Poses and rates where g = s, g' = s1, g'' = s2, (N, 6 - k) each."""
        pose, reached = self._poses(s)
        _, K = self._conditions(pose)
        rate = solve_samples(K, self._padded(s1))
        bias = self._kernel.run({"pose": pose, "pose_rate": rate}).values["bias"].T
        acceleration = solve_samples(K, self._padded(s2) - bias)
        return PlatformMotion(pose, rate, acceleration, reached)

    def _conditions(self, pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(phi, g), (N, 6), and K, (N, 6, 6)."""
        found = self._kernel.run({"pose": pose, "pose_rate": np.zeros_like(pose)}).values
        return found["values"].T, np.moveaxis(found["K"], -1, 0)

    def _poses(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Follow each sample from home, at once where Newton can, in pieces where it needs them."""
        pose, done, piece = np.zeros((len(s), 6)), np.zeros(len(s)), np.ones(len(s))
        active = np.flatnonzero(np.isfinite(s).all(axis=1))
        while active.size:
            goal = np.minimum(done[active] + piece[active], 1.0)
            target = self._home + (s[active] - self._home) * goal[:, None]
            x, ok = self._newton(pose[active], target)
            # Branches meet where K is singular, and the sign of its determinant changes: a leap
            # from one to the other was too long.
            ok &= self._on_branch(x)
            pose[active[ok]], done[active[ok]] = x[ok], goal[ok]
            piece[active] *= np.where(ok, 2.0, 0.5)
            active = active[(done[active] < 1) & (piece[active] >= SMALLEST_PIECE)]
        reached = done == 1
        if self._two_branches:
            # The straight way may leave the surfaces where another would not: one bold leap, to
            # be judged by its branch.
            missed = np.flatnonzero(~reached & np.isfinite(s).all(axis=1))
            pose[missed], reached[missed] = self._newton(pose[missed] * 0, s[missed], bold=True)
        reached &= self._on_branch(pose)
        pose[~reached] = np.nan
        return pose, reached

    def _newton(
        self, x: np.ndarray, target: np.ndarray, bold: bool = False
    ) -> tuple[np.ndarray, np.ndarray]:
        """Newton from x, down to rounding.

        Steps that shrink to a quarter each time lead to the solution nearest to x, so that no
        sample leaves the branch of home; unless `bold`, a sample with other steps fails.
        """
        longest, shrink = (10.0, np.inf) if bold else (1.0, 0.25)
        x = x.copy()
        last = np.full(len(x), np.inf)
        active = np.arange(len(x))
        converged = np.zeros(len(x), dtype=bool)
        for _ in range(ITERATIONS):
            if not active.size:
                break
            value, K = self._conditions(x[active])
            value[:, self._k :] -= target[active]
            step = solve_samples(K, value)
            size = np.abs(step / self._unit).max(axis=1)
            finite = np.isfinite(size)
            x[active[finite]] -= step[finite]
            small = size <= ROUNDING * self._scale
            # A stall near rounding is convergence. Contacts that hold badly magnify rounding in
            # the steps, never in the residual.
            stalled = size > shrink * last[active]
            rounding = ROUNDING * (self._scale + np.abs(x[active]).max(axis=1))
            near = (size < 1e-13) | (np.abs(value).max(axis=1) <= rounding)
            converged[active] = small | (near & (stalled | bold))
            failed = ~finite | (stalled & ~near) | (size > longest)
            last[active] = size
            active = active[~(converged[active] | failed)]
        return x, converged

    def _on_branch(self, pose: np.ndarray) -> np.ndarray:
        with np.errstate(invalid="ignore"):  # of poses that have no conditions
            return np.linalg.slogdet(self._conditions(pose)[1]).sign == self._branch

    def _padded(self, s: np.ndarray) -> np.ndarray:
        return np.hstack([np.zeros((len(s), self._k)), s])


def solve_samples(K: np.ndarray, b: np.ndarray) -> np.ndarray:
    """K^-1 b for each sample; NaN where K is singular or not finite."""
    good = np.isfinite(K).all(axis=(1, 2)) & np.isfinite(b).all(axis=1)
    x = np.full_like(b, np.nan)
    try:
        x[good] = np.linalg.solve(K[good], b[good][..., None])[..., 0]
    except np.linalg.LinAlgError:
        for i in np.flatnonzero(good):  # as above, so that no sample depends on its company
            with suppress(np.linalg.LinAlgError):
                x[i] = np.linalg.solve(K[i], b[i])
    return x
