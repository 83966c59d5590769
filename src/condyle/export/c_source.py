"""`export`: a mechanism and some questions as C source and header."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Any

from ..backends.c.emit import text
from ..errors import InputError, as_name, brief
from ..mechanism.coordinates import COORDINATES
from ..mechanism.files import as_mechanism
from ..mechanism.home import dependent_coordinates, independent_coordinates
from ..mechanism.mechanism import Mechanism
from ..model.closing import require_independent, require_landmark
from ..model.model import FORMULATION, ROUTE, Model
from ..progress import stepping
from ..questions.file_numbers import numbers_of
from ..questions.numbers import specialised
from ..questions.structure import GIVEN, structure_of
from ..version import __version__
from . import c_struct
from .c_context import CODES, WHY, Context, FunctionBody, require_precision
from .c_function import function
from .c_names import default_prefix, picked, require_prefix, scalar_functions, used
from .catalogue import CATALOGUE, CEntry, Wish, in_order, least_norm, require_question, usual
from .exported import Exported, Function, FunctionArguments
from .syntax import c_comment, identifiers, literal, packaged

# Functions of the C library that a source may call, in `double`.
LIBRARY = """sqrt fabs floor ceil atan2 pow fmod remainder hypot exp expm1 log log1p tan asin acos
atan sinh cosh tanh asinh acosh atanh erf copysign sin cos"""
WIDTH = 100
# By compilers that say what they were told: GCC, Clang and MSVC.
EXACT = """\
#if defined(__FAST_MATH__) || defined(__ASSOCIATIVE_MATH__) || defined(_M_FP_FAST) \\
    || (defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__)
#error "this code needs NaN and the order of operations as written: compile without -ffast-math"
#endif
"""

SIZES = ("fast", "small")


def export(
    model: Model | Mechanism,
    questions: Sequence[str] | None = None,
    *,
    formulation: str | None = None,
    route: str | None = None,
    precision: str = "double",
    prefix: str | None = None,
    constants: str = "inside",
    lanes: int = 8,
    size: str = "fast",
    coordinates: Sequence[str] = (),
    landmark: str | None = None,
    outputs: Sequence[str] = (),
    inputs: Sequence[str] = (),
    entries: Mapping[str, CEntry] = MappingProxyType({}),
) -> Exported:
    """A mechanism in C: source, header and interface.

    Args:   questions: of `CATALOGUE`; default: those that need no options.
            formulation, route: of the equations; default: those of the model, if it is one.
            precision: double or float.
            prefix:    what every name begins with; default: the mechanism's name.
            constants: inside, or struct: in a structure that can be filled at run time.
            lanes:     width of the vector types (2, 4 or 8 doubles); 0: none. In float, or with
                       constants in a structure, there are none.
            size:      fast, or small: loops over chains and over steps that repeat, in a fifth to a
                       third of the bytes; without vector types.
            coordinates, landmark: what `closure` starts from.
            outputs:   results besides the usual ones: bound, of the relative error.
            inputs:    arguments of dynamics besides the usual ones: gravity, in place of the
                       mechanism's, and base, the motion of the base.
            entries:   questions besides, that `CATALOGUE` has not, by name.
    Raises: InputError, UnsupportedError: for options or mechanisms that C export has not.
            MechanismError: if the contacts do not hold the platform at home.
    """
    options = {
        "precision": precision,
        "constants": constants,
        "prefix": prefix,
        "landmark": landmark,
        "size": size,
    }
    for argument, given in options.items():
        if given is not None:
            as_name(given, argument)
    if not isinstance(lanes, int) or lanes not in (0, 2, 4, 8):
        raise InputError(f"lanes: expected 0, 2, 4 or 8, got {brief(lanes)}")
    if constants not in ("inside", "struct"):
        raise InputError(f'constants: expected inside or struct, got "{constants}"')
    if size not in SIZES:
        raise InputError(f'size: expected fast or small, got "{size}"')
    mechanism, struct = as_mechanism(model), constants == "struct"
    own = (model.formulation, model.route) if isinstance(model, Model) else (FORMULATION, ROUTE)
    how: dict[str, Any] = {
        "formulation": own[0] if formulation is None else formulation,
        "route": own[1] if route is None else route,
    }
    # What a model checks of a mechanism is checked here as well.
    checked = Model(mechanism, **how, backend="numpy", distribution=least_norm(mechanism))
    names = usual(mechanism) if questions is None else questions
    bound = bool(_listed("outputs", outputs, ("bound",)))
    wish = Wish(in_order(coordinates), landmark, bound, _listed("inputs", inputs, GIVEN))
    alone = bool(entries) and not names
    every = ({} if alone else _entries(mechanism, names, wish)) | dict(entries)
    structure = structure_of(mechanism, checked.formulation, checked.route)
    # Two planes need not stay parallel where numbers change.
    structure = replace(structure, given=wish.given, parallel=structure.parallel and not struct)
    numbers = numbers_of(structure, mechanism, landmark)
    structure = structure if struct else specialised(structure, numbers)
    real = require_precision(precision)
    plain = struct or real != "double" or size == "small"
    name = require_prefix(default_prefix(mechanism.name) if prefix is None else prefix)
    arguments = FunctionArguments(mechanism, wish.coordinates, landmark)
    c = Context(
        mechanism,
        structure,
        numbers,
        name,
        real,
        0 if plain else lanes,
        arguments,
        struct,
        size == "small",
        landmark,
    )
    asking = stepping("writing functions", [*every.items()])
    bodies = [function(c, question, entry, wish) for question, entry in asking]
    portable = _portable(c, bodies)
    source = _source(c, bodies, portable)
    code = re.sub(r"/\*.*?\*/", "", portable, flags=re.DOTALL)
    exported = Exported(
        mechanism=mechanism,
        wish=wish,
        prefix=name,
        source=source,
        header="",
        functions=tuple(body.function for body in bodies),
        precision=real,
        names=identifiers((*mechanism.chain_names, *mechanism.contact_names)),
        struct=struct,
        lanes=c.lanes if any(body.wide for body in bodies) else 0,
        symbols=tuple(f"{word}{'f' * (real == 'float')}" for word in used(code, LIBRARY)),
        recipe={"formulation": checked.formulation, "route": checked.route},
    )
    extra = c_struct.declared(c) if struct else ""
    return replace(exported, header=header_text(exported, extra))


def _entries(mechanism: Mechanism, questions: Sequence[str], wish: Wish) -> dict[str, CEntry]:
    """The questions, each once."""
    chosen = {name: require_question(name).asking(name, wish) for name in questions}
    if not chosen:
        raise InputError("no question to export")
    if wish.landmark is not None:
        require_landmark(mechanism, wish.landmark)
    elif "closure" in chosen:
        require_independent(mechanism, wish.coordinates)
    if wish.bound and all(entry.bounding is None for entry in chosen.values()):
        able = ", ".join(name for name, entry in CATALOGUE.items() if entry.bounding is not None)
        raise InputError(
            f"outputs: none of {', '.join(chosen)} has a bound of its error; add one of {able}, or "
            "leave bound out"
        )
    if wish.given and not any(entry.dynamic(name) for name, entry in chosen.items()):
        raise InputError(
            f"inputs: none of {', '.join(chosen)} has gravity or inertia in it; leave "
            f"{' and '.join(wish.given)} out"
        )
    return chosen


def _listed(argument: str, names: Sequence[str], known: Collection[str]) -> tuple[str, ...]:
    """The known names that are given, in order.

    Raises: InputError: for any other name.
    """
    for name in names:
        if name not in known:
            raise InputError(f"{argument}: expected {' or '.join(known)}, got {brief(name)}")
    return tuple(name for name in known if name in names)


def _portable(c: Context, bodies: Sequence[FunctionBody]) -> str:
    """Scalar code, with what it uses."""
    code = "\n".join(body.code for body in bodies)
    if c.struct:
        constants = c_struct.prepared(c)
    else:
        constants = "\n".join(_table(c, name) for name in c.tables if not name.endswith("_quick"))
    helpers = picked(packaged(f"c_{c.precision}.h") + scalar_functions(), constants + code)
    return "\n".join([helpers, constants, code])


def _source(c: Context, bodies: Sequence[FunctionBody], portable: str) -> str:
    parts = [
        f'/* {c.prefix}.c - mechanism "{c_comment(c.mechanism.name)}", written by condyle '
        f"{__version__}. */",
        f'#include "{c.prefix}.h"',
        "#include <math.h>\n",
        EXACT,
        portable,
    ]
    if wide := "\n".join(body.wide for body in bodies if body.wide):
        own = "\n".join(_table(c, name) for name in c.tables if name.endswith("_quick"))
        parts += [_vector(c.prefix.upper(), c.lanes, f"{own}\n{wide}")]
    parts += [body.dispatch for body in bodies if body.dispatch]
    return "\n".join(part.rstrip("\n") + "\n" for part in parts if part)


def _vector(p: str, lanes: int, code: str) -> str:
    """What vector types need, with names that differ from those of scalar code."""
    helpers = picked(text("vector.h"), code)
    both = re.sub(r"(\b[a-z]\w*|##)_s\b", r"\1_w", f"{helpers}\n{code}")
    # Vectors stay within this file: how they are passed between others does not matter.
    quiet = '#pragma GCC diagnostic ignored "-Wpsabi"'
    head = f"#if defined({p}_VECTOR)\n{quiet}\n#define W {lanes}"
    return f"{head}\n{both}\n#endif /* {p}_VECTOR */\n"


def _table(c: Context, name: str) -> str:
    values = c.tables[name]
    if not values.size:
        return ""
    rows = [literal(x, c.precision) for x in values]
    lines = [", ".join(rows[i : i + 4]) for i in range(0, len(rows), 4)]
    body = ",\n    ".join(lines)
    return f"static const {c.precision} {c.prefix}_{name}_table[{len(rows)}] = {{\n    {body}}};\n"


def header_text(exported: Exported, extra: str) -> str:
    """The file `prefix`.h. Args: extra: what constants in a structure need."""
    p = exported.prefix.upper()
    guard = f"{p}_H"
    parts = [
        _about(exported),
        f"#ifndef {guard}\n#define {guard}\n",
        '#ifdef __cplusplus\nextern "C" {\n#endif\n',
        _statuses(p),
        _sizes(p, exported),
        extra,
        *(_declared(exported, f) for f in exported.functions),
        "#ifdef __cplusplus\n}\n#endif\n",
        f"#endif /* {guard} */\n",
    ]
    return "\n".join(part for part in parts if part)


def _about(e: Exported) -> str:
    mechanism = e.mechanism
    lines = [
        f'{e.prefix}.h - mechanism "{mechanism.name}" in C, written by condyle {__version__}',
        "",
        f"Independent coordinates: {', '.join(independent_coordinates(mechanism))}; the contacts "
        f"determine {', '.join(dependent_coordinates(mechanism)) or 'nothing'}.",
        "Units: m, rad, s, kg, N. Frames: {S} of the base, {M} of the platform; they agree at "
        "home. Angles are Bryant angles alpha, beta, gamma.",
        "",
        "Functions return a status and write their results only where it is "
        f"{e.prefix.upper()}_OK. They have no state: no heap, no globals, no input or "
        "output, no recursion; any thread or interrupt may call them. Arrays that go in and out "
        "must not overlap.",
    ]
    if mapped := {theirs: ours for theirs, ours in e.names.items() if theirs != ours}:
        lines += ["", "Names changed for C:"]
        lines += [f"  {theirs} is {ours}" for theirs, ours in mapped.items()]
    return _comment(lines)


def _statuses(p: str) -> str:
    rows = [f"    {p}_{name} = {int(code)}, /* {WHY[name]} */" for name, code in CODES.items()]
    rows[-1] = rows[-1].replace(",", "", 1)
    return "\n".join(["/* Statuses. */", "enum {", *rows, "};", ""])


def _sizes(p: str, exported: Exported) -> str:
    m = exported.mechanism
    named = {"CHAIN": m.chain_names, "CONTACT": m.contact_names}
    sizes = {f"{kind}S": len(names) for kind, names in named.items()}
    lines = ["/* Sizes, and indices into arrays. */"]
    sizes["FREEDOMS"] = m.degrees_of_freedom
    lines += [*(f"#define {p}_{name} {size}" for name, size in sizes.items()), "", "enum {"]
    rows = [
        f"    {p}_{kind}_{exported.names[name]} = {i},"
        for kind, names in named.items()
        for i, name in enumerate(names)
    ]
    rows += [f"    {p}_{name} = {i}," for i, name in enumerate(COORDINATES)]
    rows[-1] = f"{rows[-1].rstrip(',')} /* in X_EE */"
    return "\n".join([*lines, *rows, "};", ""])


def _declared(exported: Exported, f: Function) -> str:
    lines = [f.text, ""]
    for a in f.arguments:
        lines.append(f"  {a.name}[{a.size}]  {'in' if a.given else 'out'}: {a.text} [{a.unit}]")
        lines.append(f"      order: {', '.join(a.labels)}")
    if f.iterations:
        lines += ["", f"Maximum number of steps: {f.iterations}."]
    words = [f"{name.lower()} ({why})" for name, why in f.statuses.items()]
    lines += ["", f"Returns ok, or {', '.join(words)}."]
    declared = textwrap.wrap(
        f"{exported.prototype(f)};", WIDTH, subsequent_indent="    ", break_long_words=False
    )
    return _comment(lines) + "\n".join(declared) + "\n"


def _comment(lines: Sequence[str]) -> str:
    out = []
    for line in lines:
        indent = len(line) - len(line.lstrip())
        wrapped = textwrap.wrap(
            line, WIDTH - 3, subsequent_indent=" " * (indent + 2 if indent else 0)
        )
        out += wrapped or [""]
    text = "\n".join(f" * {c_comment(line)}".rstrip() for line in out)
    return f"/*\n{text}\n */\n"
