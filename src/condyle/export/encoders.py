"""`pose`: the pose that joint coordinates belong to, by a bounded number of Gauss-Newton steps.

As `model.continuation` with fewer pieces: a start that is too far off is unreachable, never
another assembly mode without a word.
"""

from __future__ import annotations

from importlib.resources import files

from ..graph.program import Program
from ..kinematics.constraints import indices
from ..mechanism.home import characteristic_length, dependent_coordinates
from ..mechanism.mechanism import COORDINATES
from .body import Scalar
from .context import Body, Context
from .exported import Argument
from .places import Places
from .precision import LARGEST
from .straight import operations

ITERATIONS = 32  # looks at a pose; five do from one sample of a motion to the next
# By precision: a step that is as good as none, rounding, a joint's residual that fits [rad or m],
# and the ratio of pivots below which a pose is singular.
_CONVERGED = {"double": 1e-12, "float": 4e-6}
_ROUNDING = {"double": 4e-15, "float": 1e-6}
TOLERANCE = {"double": 1e-6, "float": 1e-4}
_SINGULAR = {"double": 1e-10, "float": 1e-4}


def arguments(c: Context) -> list[Argument]:
    """Joints and a start; the pose and what is left of the joints."""
    a = c.arguments
    start = a.coordinates(
        "start", "where to start: the last pose; at first home, zeros", COORDINATES
    )
    left = "joint less joint coordinates of the pose"
    residual = Argument("residual", left, a.chains, a.joint_units, False)
    pose = a.coordinates("pose", "the platform's pose X_EE", COORDINATES, given=False)
    return [a.joint(), start, pose, residual]


def body(c: Context) -> Body:
    """The function `pose`, and the static ones that it calls."""
    program = c.variants("encoders").main
    encoders = Scalar(c.floats(program), _places(c, program), c.precision)
    code = _encoders(c, encoders) + _steps(c) + _public(c)
    return Body(code, operations(encoders))


def _places(c: Context, program: Program) -> Places:
    results = {o.name: o.name for o in program.outputs}
    return Places.of(program.interface, c.numbers.order, {"pose": "at"}, results)


def _encoders(c: Context, body: Scalar) -> str:
    real = c.precision
    outputs = ("joint", "J_theta", "M_J", "correction", "phi")
    constants = [f"const {c.prefix}_constants *constants"] * c.struct
    parameters = ", ".join([*constants, f"const {real} *at", *(f"{real} *{o}" for o in outputs)])
    lines = [f"static void encoders({parameters})", "{", c.table("encoders", body)]
    lines += [f"    {line}" for line in (*body.lines(), *body.stores())]
    if not c.mechanism.contacts:
        lines.append("    (void)phi;")
    return "\n".join([*(line for line in lines if line), "}", "", ""])


def _steps(c: Context) -> str:
    m, a = c.mechanism, c.arguments
    length = characteristic_length(m)
    free = [i for i in range(6) if i not in indices(dependent_coordinates(m))]
    turning = [unit == "rad" for unit in a.joint_units]
    weight = [1.0 if turns else 1.0 / length for turns in turning]
    tiny = {
        "CONVERGED": _CONVERGED,
        "ROUNDING": _ROUNDING,
        "REGULAR": _SINGULAR,
    }
    macros: dict[str, str] = {
        "N": str(len(m.chains)),
        "M": str(len(free)),
        "CONTACTS": str(len(m.contacts)),
        "K": str(max(1, len(m.contacts))),
        "ITERATIONS": str(ITERATIONS),
        "WEIGHT": _list([f"R({x!r})" for x in weight]),
        "UNIT": _list([f"R({x!r})" for x in [length] * 3 + [1.0] * 3]),
        "TURNING": _list([f"R({6.283185307179586 * x!r})" for x in turning]),
        "FREE": _list([str(i) for i in free]),
        "TURN": "R(0.15915494309189535)",
        "LENGTH": f"R({length!r})",
        **{name: f"R({of[c.precision]!r})" for name, of in tiny.items()},
    }
    text = (files(__package__) / "newton.h").read_text(encoding="utf-8")
    text = text.replace("P_", f"{c.prefix.upper()}_")
    text = text.replace("CONTEXT ", f"const {c.prefix}_constants *constants, " if c.struct else "")
    text = text.replace("ARGUMENTS ", "constants, " if c.struct else "")
    defines = "\n".join(f"#define {name} {value}" for name, value in macros.items())
    undefines = "\n".join(f"#undef {name}" for name in macros)
    return f"{defines}\n\n{text}\n{undefines}\n\n"


def _public(c: Context) -> str:
    p, n = c.prefix.upper(), len(c.mechanism.chains)
    largest = f"R({LARGEST[c.precision]!r})"
    return f"""int {c.prefix}_pose({c.parameters(arguments(c))})
{{
    real at[6], left[{n}], size = R(0.0), rest = R(0.0);
    int status;
    for (int i = 0; i < {n}; i++) size += F(fabs)(joint[i]);
    for (int i = 0; i < 6; i++) size += F(fabs)(start[i]);
    if (!(size <= {largest})) return {p}_OUT_OF_BOUNDS;
    status = {c.call("followed", ["joint", "start", "at", "left"])};
    for (int i = 0; i < {n}; i++) rest = F(fabs)(left[i]) > rest ? F(fabs)(left[i]) : rest;
    if (status == {p}_OK && !(rest <= R({TOLERANCE[c.precision]!r}))) status = {p}_INFEASIBLE;
    if (status == {p}_OK) {{
        for (int i = 0; i < 6; i++) pose[i] = at[i];
        for (int i = 0; i < {n}; i++) residual[i] = left[i];
    }}
    return status;
}}
"""


def _list(items: list[str]) -> str:
    return "{" + ", ".join(items) + "}"
