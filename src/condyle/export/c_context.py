"""What every exported question is written with: one mechanism, one formulation, one prefix."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..backends.c.emit import fused
from ..backends.c.printer import Printer
from ..graph.program import Numbers, Program, Variants
from ..mechanism.mechanism import Mechanism
from ..questions import Question
from ..questions.structure import Structure
from ..status import Status
from .arguments import Arguments
from .c_constants import table as constants_table
from .c_precision import rescaled
from .exported import Argument, Precision

# Statuses in C, and where they come from.
CODES = {
    "OK": Status.ok,
    "UNREACHABLE": Status.unreachable,
    "SINGULAR": Status.singular,
    "OUT_OF_BOUNDS": Status.overflow,
    "INFEASIBLE": Status.infeasible,
    "JAMMED": Status.jammed,
    "UNCERTIFIED": Status.uncertified,
}


@dataclass(frozen=True)
class Body:
    """A program as a C function.

    code:       its definition in portable C.
    operations: floating-point operations of that.
    statuses:   what it may return besides ok.
    wide:       the quick variant with vector types, and
    dispatch:   what chooses between both; nothing where there is one alone.
    """

    code: str
    operations: int
    statuses: tuple[str, ...]
    wide: str = ""
    dispatch: str = ""


@dataclass
class Context:
    """One mechanism on its way into C.

    tables: constants that bodies read: name -> numbers.
    lanes:  width of the vector types, or 0.
    """

    mechanism: Mechanism
    structure: Structure
    numbers: Numbers
    prefix: str
    precision: Precision
    lanes: int
    arguments: Arguments
    struct: bool = False
    tables: dict[str, np.ndarray] = field(default_factory=dict)
    printers: dict[str, Printer] = field(default_factory=dict)

    @property
    def pulls(self) -> bool:
        """Whether some chains can only pull."""
        return any(chain.kind == "cable" for chain in self.mechanism.chains)

    def variants(self, question: str, *details: Any) -> Variants:
        """The graph of a question about this mechanism."""
        return Question.about(self.structure, question, *details).variants()

    def parameters(self, arguments: Sequence[Argument]) -> str:
        """The parameter list of a C function."""
        own = [f"const {self.prefix}_constants *constants"] * self.struct
        return ", ".join(own + [a.declared(self.precision) for a in arguments])

    def call(self, name: str, arguments: Sequence[str]) -> str:
        """A call of a function with that list."""
        return f"{name}({', '.join(['constants'] * self.struct + list(arguments))})"

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
