"""The least greatest effort over its limit, and of those the least sum of squares."""

from __future__ import annotations

import numpy as np

from .certificate import excess, residual
from .newton import Answer
from .objective import Objective, register
from .reduced import Reduced
from .result import CERTIFIED
from .small import total
from .stretch import Sample, least_stretch


class Minimax(Objective):
    name = "minimax"
    summary = "least of the greatest effort over its limit; of those, as weighted"
    mixes_units = True

    def solve(self, r: Reduced, start: np.ndarray, cutoff: np.ndarray) -> Answer:
        answer = Answer.empty(r)
        ones = np.ones(r.n)
        for i in range(r.count):
            s = least_stretch(Sample.of(r, i), -ones, ones)
            answer.x[:, i], answer.u[:, i] = s.x, s.u
            answer.error[i] = s.error
        answer.x = np.minimum(np.maximum(answer.x, r.low), r.high)
        answer.force = r.forces(answer.x)
        with np.errstate(invalid="ignore"):
            parts = (residual(r, answer), excess(r, answer), answer.error)
            answer.found = np.all([part <= CERTIFIED for part in parts], axis=0)
        return answer

    def values(self, r: Reduced, answer: Answer) -> np.ndarray:
        return np.array([np.abs(answer.x).max(axis=0), total(answer.x**2, 0)])


register(Minimax())
