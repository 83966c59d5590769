"""The least greatest effort over its limit, and of those the least sum of squares."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .certificate import accept, ratio
from .newton import Answer
from .objective import Objective, register
from .program import Sample
from .quadratic import least_squares
from .reduced import Reduced
from .small import pick, total
from .stretch import least_stretch

ROOM = 1e-10  # above t, within which other efforts may be


class Minimax(Objective):
    name = "minimax"
    summary = "least of the greatest effort over its limit; of those, as weighted"
    mixes_units = True

    def solve(self, r: Reduced, start: np.ndarray, cutoff: np.ndarray) -> Answer:
        answer, t = Answer.empty(r.n, r.k, r.count), np.empty(r.count)
        ones = np.ones(r.n)
        for i in range(r.count):
            s = least_stretch(Sample.of(r, i), -ones, ones)
            answer.x[:, i], answer.u[:, i], answer.error[i], t[i] = s.x, s.u, s.error, s.t
        answer.x = np.minimum(np.maximum(answer.x, r.low), r.high)
        answer.force = r.forces(answer.x)
        answer.beaten = np.isinf(t)
        answer.found = ~answer.beaten
        answer = accept(r, answer)
        left = np.flatnonzero(~answer.found & ~answer.beaten)
        if len(left):
            answer.put(left, _within(r.take(left), t[left], pick(start, left)))
        return answer

    def values(self, r: Reduced, answer: Answer) -> np.ndarray:
        return np.array([np.abs(answer.x).max(axis=0), total(answer.x**2, 0)])


def _within(r: Reduced, t: np.ndarray, start: np.ndarray) -> Answer:
    """Least squares with |x| <= t: for a t that is known better than its x."""
    most = t * (1 + ROOM)
    narrow = replace(r, low=np.maximum(r.low, -most), high=np.minimum(r.high, most))
    answer = least_squares(narrow, start, np.full(r.count, np.inf))
    above = np.abs(np.abs(answer.x).max(axis=0) - t)
    answer.error = np.fmax(answer.error, ratio(above, t))
    return accept(r, answer)


register(Minimax())
