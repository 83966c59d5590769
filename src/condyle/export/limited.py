"""`bounded`: efforts of least norm within limits, where at most two of them are free.

The least norm is tried first; where it breaks a limit, the kernels' own routine,
`backends/c/limits.c`, finds the nearest efforts that break none.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from importlib.resources import files

import numpy as np

from ..backends.c.limits import WithinLimits
from ..errors import UnsupportedError
from ..mechanism.chain import limits
from .c_body import Places, Scalar
from .c_context import Body, Context
from .c_pick import picked
from .exported import Argument

ROUNDS = 64  # of the routine: sides of its polygon are taken and left so often at the most
RESULTS = ("Q", "J", "normal", "friction")
PORTS = ("pose", "pose_rate", "pose_acceleration", "force", "moment", "point")


def body(c: Context, own: Sequence[Argument]) -> Body:
    """The function; it calls `contact` and `motion`.

    Args:   own: its arguments.
    Raises: UnsupportedError: where more than two efforts are free, or in float.
    """
    n, k = len(c.mechanism.chains), len(c.mechanism.contacts)
    if not WithinLimits.fits(n, k):
        raise UnsupportedError(
            f"efforts within limits are exported where at most two of them are free; this "
            f"mechanism has {n} chains for {6 - k} degrees of freedom"
        )
    if c.precision != "double":
        raise UnsupportedError("efforts within limits are exported in double alone")
    program = c.variants("balance").main
    results = {name: name for name in RESULTS}
    order = c.numbers.order
    places = Places.of(program.interface, order, lambda port, i: f"{port}[{i}]", results)
    scalar = Scalar(c.floats(program, "bounded"), places, c.precision)
    code = _routine(c).replace("@public", _public(c, own))
    weak = ("UNCERTIFIED",) if c.structure.friction else ("SINGULAR", "UNCERTIFIED")
    statuses = ("UNREACHABLE", *weak, "INFEASIBLE", "OUT_OF_BOUNDS")
    return Body(_balance(c, scalar) + code, scalar.operations, statuses)


def _balance(c: Context, body: Scalar) -> str:
    constants = [f"const {c.prefix}_constants *constants"] * c.struct
    given, found = (f"const double *{p}" for p in PORTS), (f"double *{name}" for name in RESULTS)
    lines = [f"static void balance({', '.join([*constants, *given, *found])})", "{"]
    lines += [c.table("balance", body)]
    lines += [f"    {line}" for line in (*body.lines(), *body.stores())]
    lines += [] if c.mechanism.contacts else ["    (void)normal, (void)friction;"]
    return "\n".join([*(line for line in lines if line), "}", "", ""])


def _routine(c: Context) -> str:
    """What finds efforts within limits of one sample; its macros are gone after it."""
    text = (files("condyle.backends.c") / "limits.c").read_text(encoding="utf-8")
    text = re.sub(r"^(int|void) (\w+)\(", r"static \1 \2(", text, flags=re.MULTILINE)
    text = re.sub(r"^#include.*\n", "", text, flags=re.MULTILINE)
    text = text.replace("INFINITY", "HUGE_VAL")  # which is a double
    text = picked(text, "least_pattern" if c.structure.friction else "within_limits")
    names = re.findall(r"^#define (\w+)", text, flags=re.MULTILINE)
    n, k = len(c.mechanism.chains), len(c.mechanism.contacts)
    head = f"#include <float.h>\n#define EFFORTS {n}\n#define CONTACTS {k}\n"
    undefined = "\n".join(f"#undef {name}" for name in ("EFFORTS", "CONTACTS", *names))
    return f"{head}{text}\n@public\n{undefined}\n\n"


def _public(c: Context, own: Sequence[Argument]) -> str:
    n, k, p = len(c.mechanism.chains), len(c.mechanism.contacts), c.prefix.upper()
    both = [limits(chain) for chain in c.mechanism.chains]
    push = [contact.push if contact.one_sided else 0 for contact in c.mechanism.contacts]
    low = [0.0 if s > 0 else -np.inf for s in push] + [0.0]
    high = [0.0 if s < 0 else np.inf for s in push] + [0.0]
    limit = ", ".join(
        _list(row) for row in ([b.low for b in both], [b.high for b in both], [1.0] * n, low, high)
    )
    rubs = [int(i in c.structure.friction) for i in range(k)] + [0]
    count = max(1, k)
    call, ports = ["force", "moment", "point"], ["q", "q1", "q2"]
    words = [*ports, *call, "least", *(["pushed"] * (k > 0))]
    pose = ["pose", "rate", "acceleration"]
    balance = [*pose, *call, "Q", "flat", "(double *)normal", "(double *)friction"]
    solve = "within_limits(Q, (const double(*)[6])J, (const double(*)[6])normal, &bounds, &found)"
    if c.structure.friction:
        solve = (
            "least_pattern(Q, (const double(*)[6])J, (const double(*)[6])normal,\n"
            "        (const double(*)[6])friction, rubs, &bounds, &found)"
        )
    lines = [
        f"int {c.prefix}_bounded({c.parameters(own)})",
        "{",
        f"    static const bounds_t bounds = {{{limit}, 0.0}};",
        *([f"    static const int rubs[{k + 1}] = {{{', '.join(map(str, rubs))}}};"]
          * bool(c.structure.friction)),
        f"    double least[{n}], pushed[{count}], pose[6], rate[6], acceleration[6];",
        f"    double Q[6], flat[6 * {n}], J[{n}][6], normal[{count}][6], friction[{count}][6];",
        "    answer_t found;",
        "    int fits = 1, answer;",
        f"    int status = {c.call(f'{c.prefix}_contact', words)};",
        f"    if (status != {p}_OK) return status;",
        f"    for (int i = 0; i < {n}; i++)",
        "        fits = fits && least[i] >= bounds.low[i] && least[i] <= bounds.high[i];",
        f"    for (int i = 0; i < {k}; i++)",
        "        fits = fits && pushed[i] >= bounds.contact_low[i] &&",
        "               pushed[i] <= bounds.contact_high[i];" if k else "",
        "    if (!fits) {",
        f"        status = {c.call(f'{c.prefix}_motion', [*ports, *pose])};",
        f"        if (status != {p}_OK) return status;",
        f"        {c.call('balance', balance)};",
        f"        for (int i = 0; i < 6 * {n}; i++) J[i % {n}][i / {n}] = flat[i];",
        f"        answer = {solve};",
        f"        if (answer == INFEASIBLE) return {p}_INFEASIBLE;",
        f"        if (answer != FOUND) return {p}_UNCERTIFIED;",
        f"        for (int i = 0; i < {n}; i++) least[i] = found.effort[i];",
        f"        for (int i = 0; i < {k}; i++) pushed[i] = found.force[i];",
        "    }",
        f"    for (int i = 0; i < {n}; i++) effort[i] = least[i];",
        f"    for (int i = 0; i < {k}; i++) contact_force[i] = pushed[i];" if k else "",
        f"    return {p}_OK;",
        "}",
        "",
    ]  # fmt: skip
    if not k:
        lines = [line for line in lines if "pushed[i]" not in line and "i < 0;" not in line]
        lines = [line.replace("pushed[1], ", "") for line in lines]
    return "\n".join(line for line in lines if line) + "\n"


def _list(numbers: Sequence[float]) -> str:
    texts = (repr(float(x)) if np.isfinite(x) else f"{'-' * (x < 0)}HUGE_VAL" for x in numbers)
    return "{" + ", ".join(texts) + "}"
