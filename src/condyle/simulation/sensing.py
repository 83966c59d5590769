"""From encoders to the state: counts, forward kinematics from the last pose on, rates.

    count = resolution round(theta / resolution)
    q:   A dq ~ count - theta(q),   A = d theta / dq,   from the last q on, carried on by q'
    q':  A q' ~ theta',   theta' = smoothing theta'_before + (1 - smoothing) (count - before) / T

n joints over-determine m coordinates: ~ is least squares, with turning joints multiplied by the
characteristic length. Poses follow one another within a period, so that the assembly mode is that
of the last one (`condyle.model.forward_kinematics` looks for it from afar).
"""

from __future__ import annotations

import numpy as np

from ..kinematics.chain import FAMILIES
from ..mechanism.home import characteristic_length
from ..model.evaluator import Evaluator
from .plan import Sensing
from .point import Instant

ITERATIONS = 8
CONVERGED = 1e-13  # step of q, in the mechanism's size and radians
ROUGH = 1e-6  # the same, after the last iteration


class Lost(Exception):
    """The counts give no pose near the last one."""


class Observer:
    """What a controller's machine knows of its state."""

    def __init__(self, model: Evaluator, sensing: Sensing, period: float) -> None:
        self.sensing, self.period = sensing, period
        self._at = Instant(model)
        families = [FAMILIES[chain.kind] for chain in model.mechanism.chains]
        length = characteristic_length(model.mechanism)
        self.turning = np.array([f.joint_unit == "rad" for f in families])
        self.weight = np.where(self.turning, length, 1.0)
        self.scale = np.where([n in "XYZ" for n in model.independent], length, 1.0)

    def begin(self, q: np.ndarray, q1: np.ndarray, joint: np.ndarray) -> None:
        """A machine knows where it starts."""
        self.q, self.q1, self.before = q.copy(), q1.copy(), self.counts(joint)
        self._at(q, q1)
        self.rate = self._at["joint_rate"].copy()
        self.first = np.ones(1, dtype=np.uint8)

    def counts(self, joint: np.ndarray) -> np.ndarray:
        """What encoders read of joints (n,)."""
        step = self.sensing.resolution
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(step > 0, step * np.round(joint / step), joint)

    def see(
        self, joint: np.ndarray, joint_rate: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Counts and rates (n,), and the state q, q' (m,) that they give, one period on.

        Args:   joint, joint_rate: as they are.
        Raises: Lost: where they give none.
        """
        sensing, count = self.sensing, self.counts(joint)
        rate = self.rate
        if not sensing.difference:
            rate = joint_rate
        elif not self.first[0]:
            part = sensing.smoothing
            rate = part * rate + (1 - part) * (count - self.before) / self.period
        q = self.q if self.first[0] else self.q + self.period * self.q1
        for _ in range(ITERATIONS):
            if self._at(q, self.q1):
                raise Lost
            off = count - self._at["joint"]
            off = np.where(self.turning, off - 2 * np.pi * np.round(off / (2 * np.pi)), off)
            dq = self._solve(off)
            q = q + dq
            if np.abs(dq / self.scale).max() < CONVERGED:
                break
        else:
            if not np.abs(dq / self.scale).max() < ROUGH:
                raise Lost
        # In place: compiled code goes on from here, too.
        self.q[:], self.q1[:], self.before[:], self.rate[:] = q, self._solve(rate), count, rate
        self.first[0] = 0
        return count, self.rate.copy(), q, self.q1.copy()

    def _solve(self, right: np.ndarray) -> np.ndarray:
        """x with A x ~ right, at the last look."""
        A = self._at["A"] * self.weight[:, None]
        try:
            return np.linalg.solve(A.T @ A, A.T @ (self.weight * right))
        except np.linalg.LinAlgError:
            raise Lost from None
