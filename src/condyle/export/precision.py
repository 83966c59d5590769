"""What changes with the precision: thresholds that rounding decides, and sizes."""

from __future__ import annotations

from ..errors import InputError, did_you_mean
from ..kinematics.iteration import CLOSED, TINY
from ..kinematics.one_angle import CLOSED as ANGLE_CLOSED
from ..questions.inverse import DOUBTFUL, WEAK
from .exported import Precision

# Numbers above which a sample is out of bounds: squares of them, and their sums, are numbers still.
LARGEST = {"double": 1e50, "float": 1e9}
ANGLES = {"double": 2.0**20, "float": 4096.0}  # beyond which sine and cosine lose digits
PRECISIONS: tuple[Precision, ...] = ("double", "float")
# In `float`: a discriminant, squared ratios and last steps that rounding alone does not make.
_FLOAT = {DOUBTFUL: 1e-6, WEAK: 1e-8, CLOSED**2: 4e-12, TINY**2: 1e-10, ANGLE_CLOSED: 4e-6}


def require_precision(name: str) -> Precision:
    """Raises InputError for what is no precision."""
    for precision in PRECISIONS:
        if precision == name:
            return precision
    raise InputError(f'no precision "{name}".{did_you_mean(name, PRECISIONS)}')


def threshold(value: float, precision: Precision) -> float:
    """A number of a program as this precision has it."""
    return value if precision == "double" else _FLOAT.get(value, value)
