"""Distribution: which of all efforts that balance a machine it is given, and its contacts' load.

Numbers in, numbers out, many samples at once: see `distribute`. What mechanisms, actuators and
friction are is not known here; `Problem` says what of them counts.
"""

from . import bounded, cubic, minimax, minimum_norm, weighted  # each registers its objective
from .limits import within
from .objective import OBJECTIVES, Objective, register
from .problem import Problem
from .quadratic import Quadratic
from .result import CERTIFIED, Result, Status
from .solve import distribute

__all__ = [
    "CERTIFIED",
    "OBJECTIVES",
    "Objective",
    "Problem",
    "Quadratic",
    "Result",
    "Status",
    "bounded",
    "cubic",
    "distribute",
    "minimax",
    "minimum_norm",
    "register",
    "weighted",
    "within",
]
