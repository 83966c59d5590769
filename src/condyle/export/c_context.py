"""What every exported question is written with: one mechanism, one prefix, one precision."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..backends.c.emit import fused
from ..backends.c.printer import Printer
from ..errors import InputError, did_you_mean
from ..graph.graph import Graph, Value
from ..graph.operations import OPERATIONS, REDUCTIONS
from ..graph.program import Numbers, Program
from ..kinematics.iteration import CLOSED, TINY
from ..kinematics.one_angle import CLOSED as ANGLE_CLOSED
from ..mechanism.mechanism import Mechanism
from ..questions.inverse import DOUBTFUL, WEAK
from ..questions.pose import CLOSED as POSE_CLOSED
from ..questions.pose import CONDITIONED
from ..questions.pose import TINY as POSE_TINY
from ..questions.structure import Structure
from ..status import Status
from .exported import Arguments, Function, Precision

# Numbers above which a sample is out of bounds: squares of them, and their sums, are numbers still.
LARGEST = {"double": 1e50, "float": 1e9}
ANGLES = {"double": 2.0**20, "float": 4096.0}  # beyond which sine and cosine lose digits
PRECISIONS: tuple[Precision, ...] = ("double", "float")
# In `float`: a discriminant, squared ratios and last steps that rounding alone does not make.
_FLOAT = {DOUBTFUL: 1e-6, WEAK: 1e-8, CLOSED**2: 4e-12, TINY**2: 1e-10, ANGLE_CLOSED: 4e-6}
_ENCODERS = {POSE_CLOSED**2: 4e-10, POSE_TINY**2: 1e-10, CONDITIONED: 1e-6}
_FLOAT_OF = {"pose": _ENCODERS, "observer": _ENCODERS}
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
    "GIMBAL_LOCK": "beta is +-90 degrees: accelerations of the angles are not determined",
    "AMBIGUOUS": "Coulomb friction has several solutions",
}


def require_precision(name: str) -> Precision:
    """Raises InputError for an unknown precision."""
    if found := [one for one in PRECISIONS if one == name]:
        return found[0]
    raise InputError(f'no precision "{name}".{did_you_mean(name, PRECISIONS)}')


def threshold(value: float, precision: Precision, question: str = "") -> float:
    """A number of a question as this precision has it."""
    table = {} if precision == "double" else _FLOAT | _FLOAT_OF.get(question, {})
    return table.get(value, value)


def rescaled(program: Program, question: str, precision: Precision) -> Program:
    """The program, where constants that rounding decides are those of `precision`."""
    if precision == "double":
        return program
    graph = Graph()
    moved: dict[Value | None, Value] = {}
    for v in program.order:
        node = program.graph.nodes[v]
        if node.op == "const":
            value = float(node.data[0])  # type: ignore[arg-type]
            moved[v] = graph.const(threshold(value, precision, question))
        else:
            moved[v] = graph.copy(node, tuple(moved[a] for a in node.args))
    return program.moved(graph, moved)


def constants_table(printer: Printer, numbers: Numbers) -> np.ndarray:
    """The numbers that a body reads as `table`, (size,)."""
    g, padded = printer.g, printer.padded
    lanes = [
        np.hstack([own, np.repeat(pad[:, None], width - own.shape[1], axis=1)])
        for own, pad, width in zip(numbers.lanes, numbers.padding, padded, strict=True)
    ]
    values: dict[int, Any] = {}
    with np.errstate(all="ignore"):
        for v in printer.fixed:
            op, args, data = g.nodes[v].op, g.nodes[v].args, g.nodes[v].data
            if op == "const":
                values[v] = np.float64(data[0])  # type: ignore[arg-type]
            elif op == "parameter":
                values[v] = numbers.parameters[int(data[0])]  # type: ignore[call-overload]
            elif op == "lane":
                values[v] = lanes[int(data[0])][int(data[1])]  # type: ignore[call-overload]
            elif op in REDUCTIONS:
                values[v] = _reduced(printer, v, values)
            else:
                values[v] = OPERATIONS[op].numpy(*(values[a] for a in args))
    found = np.zeros(printer.table_size)
    for v, slot in printer.table.shared.items():
        found[slot] = values[v]
    for group, slots in enumerate(printer.table.lanes):
        for v, slot in slots.items():
            start = printer.starts[group] + slot * padded[group]
            found[start : start + padded[group]] = values[v]
    return found


def _reduced(printer: Printer, v: int, values: dict[int, Any]) -> float:
    own = [values[t][: printer.counts[g]] for g, t in printer.lane_terms(v)]
    shared = [(count, values[t]) for count, t in printer.shared_terms(v)]
    if printer.g.nodes[v].op == "sum":
        return sum(a.sum() for a in own) + sum(count * a for count, a in shared)
    return min([a.min() for a in own] + [a for _, a in shared])


@dataclass(frozen=True)
class Body:
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
    """

    mechanism: Mechanism
    structure: Structure
    numbers: Numbers
    prefix: str
    precision: Precision
    lanes: int
    arguments: Arguments
    struct: bool = False
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
