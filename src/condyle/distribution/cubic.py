"""Muscle recruitment: sum (effort_i / max_i)^3 over efforts that only pull."""

from __future__ import annotations

import numpy as np

from ..errors import InputError
from .certificate import settle
from .law import Cube
from .newton import Answer, greatest, maximise
from .objective import Objective, register
from .problem import Problem
from .quadratic import least_squares
from .reduced import Reduced
from .small import total

# f = x^3 / 3 has no curvature at 0, where the answer to a price is steepest; a very small
# square added to it keeps Newton's steps finite and changes less than the certificate shows.
SOFT = 1e-12
SOFTER = (1.0, 1e-1, 1e-2, 1e-3, 1e-4, 1e-6, 1e-8, SOFT)  # where that is too sudden


class Cubic(Objective):
    name = "cubic"
    summary = "sum of cubes of efforts over their limits, efforts >= 0: muscle recruitment"
    mixes_units = True

    def check(self, problem: Problem) -> None:
        super().check(problem)
        if (problem.limits[0] < 0).any():
            negative = np.flatnonzero(problem.limits[0] < 0).tolist()
            raise InputError(
                f"cubic is for efforts that only pull; efforts {negative} may be negative. Set "
                "their lower limit to 0, or use weighted"
            )

    def solve(self, r: Reduced, start: np.ndarray, cutoff: np.ndarray) -> Answer:
        rows = total(np.abs(r.G[: r.m]), 1)
        typical = (np.abs(r.right[: r.m]) / np.where(rows > 0, rows, np.inf)).max(axis=0, initial=0)
        typical = np.where(typical > 0, typical, 1.0)
        law = Cube(SOFT * typical)
        cutoff = np.minimum(cutoff, greatest(r, law))
        answer = settle(r, Cube(), maximise(r, law, start * typical, cutoff))
        left = np.flatnonzero(~answer.found & ~answer.beaten)
        if len(left):
            part = r.take(left)
            # Where there is a solution at all, the sum of squares has one, and is a start.
            never = np.full(len(left), np.inf)
            square = least_squares(part, start[:, left], never)
            left, part, never = left[square.found], part.take(square.found), never[square.found]
            u = square.u[:, square.found] * typical[left]
            for soft in SOFTER:
                found = maximise(part, Cube(soft * typical[left]), u, never, steps=60)
                u = found.u
            answer.put(left, settle(part, Cube(), found))
        return answer

    def values(self, r: Reduced, answer: Answer) -> np.ndarray:
        return total(answer.x**3, 0)[None] / 3.0


register(Cubic())
