"""Effort distribution: how actuation redundancy is resolved, and the contact forces that follow.

Arrays in, arrays out, many samples at once: see `distribute`. A `Problem` is the force balance
with its bounds; mechanisms are not known here.
"""

from .distribute import distribute, within
from .objectives import EMG, OBJECTIVES, Objective, ObjectiveName, register
from .problem import Problem
from .result import CERTIFIED, Outcome, Result

__all__ = [
    "CERTIFIED",
    "EMG",
    "OBJECTIVES",
    "Objective",
    "ObjectiveName",
    "Outcome",
    "Problem",
    "Result",
    "distribute",
    "register",
    "within",
]
