"""Questions without a robust path, and in `float`: what rounding decides otherwise there."""

from __future__ import annotations

from dataclasses import replace

from ..graph.graph import Graph, Value
from ..graph.program import Program
from ..kinematics.iteration import CLOSED, TINY
from ..kinematics.one_angle import CLOSED as ANGLE_CLOSED
from ..kinematics.rotation import GIMBAL_LOCK, NEAR_LOCK
from .bound import ROUNDING
from .bound import TINY as LEAST_FORCE
from .inverse import DOUBTFUL, WEAK
from .pose import CLOSED as POSE_CLOSED
from .pose import CONDITIONED
from .pose import TINY as POSE_TINY

# In `float`: a discriminant, squared ratios and last steps that rounding alone does not make.
_FLOAT = {DOUBTFUL: 1e-6, WEAK: 1e-8, CLOSED**2: 4e-12, TINY**2: 1e-10, ANGLE_CLOSED: 4e-6}
_ENCODERS = {POSE_CLOSED**2: 4e-10, POSE_TINY**2: 1e-10, CONDITIONED: 1e-6}
_FLOAT_OF = {"pose": _ENCODERS, "observer": _ENCODERS}
# Of bounds: rounding, and what avoids 0 / 0.
_FLOAT |= {ROUNDING: 2.0**-24, LEAST_FORCE: 1e-30}
# |cos beta| at which accelerations of angles are off by 1e-4; without twists, at which pivots, of
# its square, are in doubt.
_FLOAT |= {GIMBAL_LOCK: 1e-3, NEAR_LOCK: 3e-2}
_DOUBLE = {NEAR_LOCK: 1e-2}


def threshold(value: float, precision: str, question: str = "") -> float:
    """A number of a question as this precision has it."""
    table = _DOUBLE if precision == "double" else _FLOAT | _FLOAT_OF.get(question, {})
    return table.get(value, value)


def rescaled(program: Program, question: str, precision: str) -> Program:
    """The program, where constants that rounding decides are those of `precision`."""
    graph = Graph()
    moved: dict[Value | None, Value] = {}
    for v in program.order:
        node = program.graph.nodes[v]
        if node.op == "const":
            value = float(node.data[0])  # type: ignore[arg-type]
            moved[v] = graph.const(threshold(value, precision, question))
        else:
            moved[v] = graph.copy(node, tuple(moved[a] for a in node.args))
    program = program.moved(graph, moved)
    checks = (replace(c, tolerance=threshold(c.tolerance, precision)) for c in program.checks)
    return replace(program, checks=tuple(checks))
