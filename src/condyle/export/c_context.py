"""What every exported question is written with: one mechanism, one prefix, one precision."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..backends.c.constants_table import constants_table
from ..backends.c.emit import fused
from ..backends.c.printer import Printer
from ..errors import InputError, did_you_mean
from ..graph.program import Numbers, Program
from ..mechanism.mechanism import Mechanism
from ..questions.precision import rescaled
from ..questions.structure import Structure
from ..status import Status
from .exported import Function, FunctionArguments, Precision

# Numbers above which a sample is out of bounds: squares of them, and their sums, are numbers still.
LARGEST = {"double": 1e50, "float": 1e9}
ANGLES = {"double": 2.0**20, "float": 4096.0}  # beyond which sine and cosine lose digits
PRECISIONS: tuple[Precision, ...] = ("double", "float")
# Statuses in C, and where they come from.
CODES = {
    "OK": Status.ok,
    "UNREACHABLE": Status.unreachable,
    "SINGULAR": Status.singular,
    "OUT_OF_BOUNDS": Status.overflow,
    "INFEASIBLE": Status.infeasible,
    "JAMMED": Status.jammed,
    "UNCERTIFIED": Status.uncertified,
    "GIMBAL_LOCK": Status.gimbal_lock,
    "AMBIGUOUS": Status.ambiguous,
}
WHY = {
    "OK": "results are written",
    "UNREACHABLE": "a chain or contact cannot reach this pose, or this could not be certified",
    "SINGULAR": "the pose is singular to this precision",
    "OUT_OF_BOUNDS": "an argument is not a number, or too large",
    "INFEASIBLE": "no efforts within the limits, or no pose, fit the arguments",
    "JAMMED": "Coulomb friction has no solution",
    "UNCERTIFIED": "the result could not be certified",
    "GIMBAL_LOCK": "beta is too near +-90 degrees for rates of the angles",
    "AMBIGUOUS": "Coulomb friction has several solutions",
}


def require_precision(name: str) -> Precision:
    """Raises InputError for an unknown precision."""
    if found := [one for one in PRECISIONS if one == name]:
        return found[0]
    raise InputError(f'no precision "{name}".{did_you_mean(name, PRECISIONS)}')


@dataclass(frozen=True)
class FunctionBody:
    """A program as a C function.

    code:     its definition in portable C.
    wide:     the quick variant with vector types, and
    dispatch: what chooses between both; nothing where there is one alone.
    """

    function: Function
    code: str
    wide: str = ""
    dispatch: str = ""


@dataclass
class Context:
    """One mechanism on its way into C.

    tables: constants that bodies read: name -> numbers.
    lanes:  width of the vector types, or 0.
    small:  whether code has loops over chains and repeated steps.
    """

    mechanism: Mechanism
    structure: Structure
    numbers: Numbers
    prefix: str
    precision: Precision
    lanes: int
    arguments: FunctionArguments
    struct: bool = False
    small: bool = False
    landmark: str | None = None
    tables: dict[str, np.ndarray] = field(default_factory=dict)
    printers: dict[str, Printer] = field(default_factory=dict)

    def table(self, name: str, printer: Printer) -> str:
        """The statement by which a body finds its constants."""
        self.tables[name] = constants_table(printer, self.numbers)
        self.printers[name] = printer
        if not printer.table_size:
            return "    (void)constants;" if self.struct else ""
        real = self.precision
        where = f"constants->{name}" if self.struct else f"{self.prefix}_{name}_table"
        return f"    const {real} *const table = {where};"

    def floats(self, program: Program, question: str) -> Program:
        """A program with its sums fused, and the thresholds of this precision."""
        return fused(rescaled(program, question, self.precision))
