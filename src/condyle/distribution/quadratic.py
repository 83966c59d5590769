"""What the three objectives that are sums of squares have in common."""

from __future__ import annotations

import numpy as np

from .certificate import settle
from .law import Square
from .newton import Answer, greatest, maximise
from .objective import Objective
from .reduced import Reduced
from .robust import active_set
from .small import total

SQUARE = Square()


def least_squares(r: Reduced, start: np.ndarray, cutoff: np.ndarray) -> Answer:
    """Least of |x|^2 / 2 + W |lambda|^2 / 2: Newton on all samples, DAQP where that fails."""
    if r.weight == 0.0:
        cutoff = np.minimum(cutoff, greatest(r, SQUARE))
    answer = settle(r, SQUARE, maximise(r, SQUARE, start, cutoff))
    left = np.flatnonzero(~answer.found & ~answer.beaten)
    if len(left):
        found = active_set(r.take(left))
        left, found = left[found.found], found.take(found.found)
        part = r.take(left)
        # Newton from DAQP's multipliers ends at once, and its answer is exact to rounding.
        exact = settle(part, SQUARE, maximise(part, SQUARE, found.u, np.full(len(left), np.inf)))
        found = settle(part, SQUARE, found)
        found.put(np.flatnonzero(exact.found), exact.take(exact.found))
        answer.put(left, found)
    return answer


class Quadratic(Objective):
    """Sum of squares of efforts over `scale`, plus W times those of contact forces."""

    def lower_bound(self, r: Reduced, u: np.ndarray) -> np.ndarray:
        return 0.5 * total(r.right * u, 0)

    def solve(self, r: Reduced, start: np.ndarray, cutoff: np.ndarray) -> Answer:
        return least_squares(r, start, cutoff)

    def values(self, r: Reduced, answer: Answer) -> np.ndarray:
        return (0.5 * total(answer.x**2, 0) + 0.5 * r.weight * (answer.force**2).sum(axis=0))[None]
