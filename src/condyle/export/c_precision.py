"""What changes with the precision: thresholds that rounding decides, and sizes."""

from __future__ import annotations

from ..errors import InputError, did_you_mean
from ..graph.graph import Graph, Value
from ..graph.program import Program
from ..kinematics.iteration import CLOSED, TINY
from ..kinematics.one_angle import CLOSED as ANGLE_CLOSED
from ..questions.inverse import DOUBTFUL, WEAK
from ..questions.pose import CLOSED as POSE_CLOSED
from ..questions.pose import CONDITIONED
from ..questions.pose import TINY as POSE_TINY
from .exported import Precision

# Numbers above which a sample is out of bounds: squares of them, and their sums, are numbers still.
LARGEST = {"double": 1e50, "float": 1e9}
ANGLES = {"double": 2.0**20, "float": 4096.0}  # beyond which sine and cosine lose digits
PRECISIONS: tuple[Precision, ...] = ("double", "float")
# In `float`: a discriminant, squared ratios and last steps that rounding alone does not make.
_FLOAT = {DOUBTFUL: 1e-6, WEAK: 1e-8, CLOSED**2: 4e-12, TINY**2: 1e-10, ANGLE_CLOSED: 4e-6}
_ENCODERS = {POSE_CLOSED**2: 4e-10, POSE_TINY**2: 1e-10, CONDITIONED: 1e-6}
_FLOAT_OF = {"pose": _ENCODERS, "observer": _ENCODERS}


def require_precision(name: str) -> Precision:
    """Raises InputError for what is no precision."""
    for precision in PRECISIONS:
        if precision == name:
            return precision
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
