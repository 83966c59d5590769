"""Least norm within limits: sum effort_i^2, and one-sided contacts push."""

from .objective import register
from .quadratic import Quadratic


class Bounded(Quadratic):
    name = "bounded"
    summary = "least sum of squares of efforts within limits; one-sided contacts push"


register(Bounded())
