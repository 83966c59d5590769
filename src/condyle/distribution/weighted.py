"""Efforts weighed by their limits: sum (effort_i / max_i)^2 + W sum (lambda_k / N_ref)^2."""

from .objective import register
from .problem import Problem
from .quadratic import Quadratic


class Weighted(Quadratic):
    name = "weighted"
    summary = "as bounded, each effort divided by its limit; contact forces may weigh as well"
    mixes_units = True

    def weight(self, problem: Problem) -> float:
        return problem.contact_weight


register(Weighted())
