"""Least norm: sum effort_i^2 under the equations, and friction's signs, alone."""

from .objective import register
from .quadratic import Quadratic


class MinimumNorm(Quadratic):
    name = "minimum_norm"
    summary = "least sum of squares of efforts; limits are not looked at"
    limits = False


register(MinimumNorm())
