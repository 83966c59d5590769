"""Distribution: which of all efforts that balance a machine it is given, and its contacts' load.

Numbers in, numbers out, many samples at once: see `distribute`. What mechanisms, actuators and
friction are is not known here; `Problem` says what of them counts.
"""

from .distribute import distribute, within
from .objectives import OBJECTIVES, Objective, register
from .problem import Problem
from .result import CERTIFIED, Result, Status

__all__ = [
    "CERTIFIED",
    "OBJECTIVES",
    "Objective",
    "Problem",
    "Result",
    "Status",
    "distribute",
    "register",
    "within",
]
