"""A point of the platform: where it is, how fast, and its Jacobian, from a question's results."""

from __future__ import annotations

import numpy as np

from ..model.evaluator import Evaluator
from .single import Single


class Instant:
    """The question `instant` of one model, state by state; see `condyle.questions.instant`."""

    def __init__(self, model: Evaluator, inertia: bool = False) -> None:
        self.found = Single(model.kernel("instant", *([True] if inertia else [])))

    def __call__(self, q: np.ndarray, q1: np.ndarray) -> int:
        """Look at a state; returns its status. Results by name, valid until the next call."""
        return self.found(q, q1)

    def __getitem__(self, name: str) -> np.ndarray:
        return self.found[name]

    def position(self, point: np.ndarray) -> np.ndarray:
        """Of a point (3,) [m] in {M}: where it is in {S}."""
        return self.found["pose"][:3] + self.found["R"] @ point

    def jacobian(self, point: np.ndarray) -> np.ndarray:
        """Velocity of a point in q', (3, m)."""
        T, r = self.found["T"], self.found["R"] @ point
        return T[:3] - skew(r) @ T[3:]


def skew(r: np.ndarray) -> np.ndarray:
    """[r x], (3, 3)."""
    x, y, z = r.tolist()
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
