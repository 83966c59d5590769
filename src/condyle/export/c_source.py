"""`export`: a mechanism and some questions as C source and header."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from importlib.resources import files

import numpy as np

from ..dynamics import formulation as formulation_named
from ..errors import InputError
from ..mechanism.mechanism import Mechanism
from ..model.closing import require_independent, require_landmark
from ..model.model import Model
from ..questions.numbers import Layout, specialised
from ..questions.structure import structure_of
from ..version import __version__
from . import c_struct
from .arguments import Arguments
from .c_context import Body, Context
from .c_function import function
from .c_header import WHY, header_text
from .c_names import OTHERS, identifier, identifiers, in_comment, require_prefix
from .c_pick import picked, used
from .c_precision import require_precision
from .catalogue import Entry, Wish, in_order, least_norm, require_question, usual
from .exported import Argument, Exported, Function

# Functions of the C library that a source may call, in `double`.
LIBRARY = """sqrt fabs floor ceil atan2 pow fmod remainder hypot exp expm1 log log1p tan asin acos
atan sinh cosh tanh asinh acosh atanh erf copysign sin cos"""


def export(
    mechanism: Mechanism,
    questions: Sequence[str] | None = None,
    *,
    formulation: str = "virtual_power",
    route: str = "core",
    precision: str = "double",
    prefix: str | None = None,
    constants: str = "inside",
    lanes: int = 8,
    coordinates: Sequence[str] = (),
    landmark: str | None = None,
) -> Exported:
    """A mechanism in C: source, header, and what a caller must know.

    Args:   questions: of `CATALOGUE`; default: all that need nothing more to be said.
            precision: double or float.
            prefix:    what every name begins with; default: the mechanism's name.
            constants: inside, or struct: in a structure that can be filled at run time.
            lanes:     width of the vector types (2, 4 or 8 doubles); 0: none. In float, or with
                       constants in a structure, there are none.
            coordinates, landmark: what `closure` starts from.
    Raises: InputError, UnsupportedError: for what cannot be exported.
            MechanismError: if the contacts do not hold the platform at home.
    """
    # What a model checks of a mechanism is checked here as well.
    model = Model(mechanism, formulation, route, "numpy", least_norm(mechanism))
    asked = usual(mechanism) if questions is None else questions
    entries = _entries(mechanism, asked, coordinates, landmark)
    structure = structure_of(mechanism, formulation_named(formulation).name, route)
    numbers = Layout.of(structure).numbers(mechanism, landmark)
    struct = _is_struct(constants)
    if not struct:
        structure = specialised(structure, numbers)
    real = require_precision(precision)
    if lanes not in (0, 2, 4, 8):
        raise InputError(f"lanes: expected 0, 2, 4 or 8, got {lanes}")
    plain = struct or real != "double"
    own = identifier(mechanism.name).lower()
    name = require_prefix(prefix or (f"{own}_" if own in OTHERS else own))
    wish = Wish(in_order(coordinates), landmark)
    arguments = Arguments(mechanism, wish.coordinates, landmark)
    c = Context(mechanism, structure, numbers, name, real, 0 if plain else lanes, arguments, struct)
    made = {question: function(c, question, entry, wish) for question, entry in entries.items()}
    functions = [_function(c, q, entries[q], *own) for q, own in made.items()]
    bodies = [body for _, body in made.values()]
    named = [*(chain.name for chain in mechanism.chains), *mechanism.contact_names]
    portable = _portable(c, bodies)
    source = _source(c, bodies, portable)
    exported = Exported(
        prefix=name,
        source=source,
        header="",
        functions=tuple(functions),
        precision=real,
        names=identifiers(named),
        struct=struct,
        lanes=c.lanes if any(body.wide for body in bodies) else 0,
        symbols=_symbols(c, portable),
        recipe={"formulation": model.formulation, "route": route},
    )
    extra = c_struct.declared(c) if struct else ""
    return replace(exported, header=header_text(exported, mechanism, extra))


def _entries(
    mechanism: Mechanism, questions: Sequence[str], coordinates: Sequence[str], landmark: str | None
) -> dict[str, Entry]:
    """The questions, each once."""
    found = {question: require_question(question) for question in questions}
    if not found:
        raise InputError("no question to export")
    if "closure" in found:
        if landmark is not None:
            require_landmark(mechanism, landmark)
        else:
            require_independent(mechanism, in_order(coordinates))
    return found


def _is_struct(constants: str) -> bool:
    if constants not in ("inside", "struct"):
        raise InputError(f'constants: expected inside or struct, got "{constants}"')
    return constants == "struct"


def _function(
    c: Context, question: str, entry: Entry, arguments: tuple[Argument, ...], body: Body
) -> Function:
    text = entry.text
    if c.pulls and not entry.limited and any(a.name == "effort" and not a.given for a in arguments):
        text += " Limits are not regarded: a cable's effort may be negative."
    return Function(
        f"{c.prefix}_{question}",
        question,
        text,
        arguments,
        entry.steps,
        body.operations,
        {name: WHY[name] for name in body.statuses},
    )


def _portable(c: Context, bodies: Sequence[Body]) -> str:
    """Scalar code, with what it uses."""
    code = "\n".join(body.code for body in bodies)
    if c.struct:
        constants = c_struct.prepared(c)
    else:
        constants = "\n".join(_table(c, name) for name in c.tables if not _is_quick(name))
    helpers = picked(_text(f"c_{c.precision}.h") + _text("c_scalar.h"), constants + code)
    return "\n".join([helpers, constants, code])


def _source(c: Context, bodies: Sequence[Body], portable: str) -> str:
    parts = [
        f'/* {c.prefix}.c - mechanism "{in_comment(c.mechanism.name)}", written by condyle '
        f"{__version__}. */",
        f'#include "{c.prefix}.h"',
        "#include <math.h>\n",
        portable,
    ]
    if wide := "\n".join(body.wide for body in bodies if body.wide):
        own = "\n".join(_table(c, name) for name in c.tables if _is_quick(name))
        parts += [_vector(c.prefix.upper(), c.lanes, f"{own}\n{wide}")]
    parts += [body.dispatch for body in bodies if body.dispatch]
    return "\n".join(part.rstrip("\n") + "\n" for part in parts if part)


def _is_quick(table: str) -> bool:
    return table.endswith("_quick")


def _vector(p: str, lanes: int, code: str) -> str:
    """What vector types need, with names that differ from those of scalar code."""
    text = (files("condyle.backends.c") / "vector.h").read_text(encoding="utf-8")
    text = picked(text, code)
    both = re.sub(r"(\b[a-z]\w*|##)_s\b", r"\1_w", f"{text}\n{code}")
    # Vectors stay within this file: how they are passed between others does not matter.
    quiet = '#pragma GCC diagnostic ignored "-Wpsabi"'
    head = f"#if defined({p}_VECTOR)\n{quiet}\n#define W {lanes}"
    return f"{head}\n{both}\n#endif /* {p}_VECTOR */\n"


def _table(c: Context, name: str) -> str:
    values = c.tables[name]
    if not values.size:
        return ""
    rows = [_number(x, c.precision) for x in values]
    lines = [", ".join(rows[i : i + 4]) for i in range(0, len(rows), 4)]
    body = ",\n    ".join(lines)
    return f"static const {c.precision} {c.prefix}_{name}_table[{len(rows)}] = {{\n    {body}}};\n"


def _number(x: float, precision: str) -> str:
    if not np.isfinite(x):
        name = "NAN" if np.isnan(x) else "INFINITY" if x > 0 else "-INFINITY"
        return f"({precision}){name}"
    if precision == "double":
        return repr(float(x))
    return f"{float(np.float32(x))!r}f"


def _symbols(c: Context, source: str) -> tuple[str, ...]:
    """Functions of the library that a source calls, with the suffix of its precision."""
    code = re.sub(r"/\*.*?\*/", "", source, flags=re.DOTALL)
    return tuple(f"{word}{'f' * (c.precision == 'float')}" for word in used(code, LIBRARY))


def _text(name: str) -> str:
    return (files(__package__) / name).read_text(encoding="utf-8")
