"""The header: names, statuses and declarations, every argument with its order and unit."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence

from ..mechanism.coordinates import COORDINATES
from ..mechanism.home import dependent_coordinates, independent_coordinates
from ..mechanism.mechanism import Mechanism
from ..version import __version__
from .c_context import CODES
from .c_names import in_comment
from .exported import Argument, Exported, Function

WHY = {
    "OK": "results are written",
    "UNREACHABLE": "no chain or contact reaches this pose, or none that could be vouched for",
    "SINGULAR": "the pose is singular to this precision",
    "OUT_OF_BOUNDS": "an argument is no number, or too large for the arithmetic",
    "INFEASIBLE": "nothing within the limits, or no pose, fits what is given",
    "JAMMED": "no pattern of friction is consistent",
    "UNCERTIFIED": "a result was found that could not be certified",
}
WIDTH = 100


def header_text(exported: Exported, mechanism: Mechanism, extra: str) -> str:
    """The file `prefix`.h. Args: extra: what constants in a structure need."""
    p = exported.prefix.upper()
    guard = f"{p}_H"
    parts = [
        _about(exported, mechanism),
        f"#ifndef {guard}\n#define {guard}\n",
        '#ifdef __cplusplus\nextern "C" {\n#endif\n',
        _statuses(p),
        _sizes(p, exported, mechanism),
        extra,
        *(_declared(exported, f) for f in exported.functions),
        "#ifdef __cplusplus\n}\n#endif\n",
        f"#endif /* {guard} */\n",
    ]
    return "\n".join(part for part in parts if part)


def _about(exported: Exported, mechanism: Mechanism) -> str:
    name = mechanism.name
    lines = [
        f'{exported.prefix}.h - mechanism "{name}" in C, written by condyle {__version__}',
        "",
        f"Independent coordinates: {', '.join(independent_coordinates(mechanism))}; the contacts "
        f"determine {', '.join(dependent_coordinates(mechanism)) or 'nothing'}.",
        "Units: m, rad, s, kg, N. Frames: {S} of the base, {M} of the platform; they agree at "
        "home. Angles are Bryant angles alpha, beta, gamma.",
        "",
        "Functions return a status and write their results only where it is "
        f"{exported.prefix.upper()}_OK. They keep nothing: no heap, no globals, no input or "
        "output, no recursion; any thread or interrupt may call them. Arrays that go in and out "
        "must not overlap.",
    ]
    if exported.names and (mapped := {k: v for k, v in exported.names.items() if k != v}):
        lines += ["", "Names that C does not take:"]
        lines += [f"  {theirs} is {ours}" for theirs, ours in mapped.items()]
    return _comment(lines)


def _statuses(p: str) -> str:
    rows = [f"    {p}_{name} = {int(code)}, /* {WHY[name]} */" for name, code in CODES.items()]
    rows[-1] = rows[-1].replace(",", "", 1)
    return "\n".join(["/* Statuses. */", "enum {", *rows, "};", ""])


def _sizes(p: str, exported: Exported, m: Mechanism) -> str:
    lines = ["/* Sizes, and where things stand in arrays. */"]
    for name, size in (
        ("CHAINS", len(m.chains)),
        ("CONTACTS", len(m.contacts)),
        ("FREEDOMS", m.degrees_of_freedom),
    ):
        lines.append(f"#define {p}_{name} {size}")
    lines += ["", "enum {"]
    groups: Sequence[tuple[str, Sequence[str]]] = (
        ("CHAIN", [c.name for c in m.chains]),
        ("CONTACT", m.contact_names),
    )
    rows = [
        f"    {p}_{kind}_{exported.names[name]} = {i},"
        for kind, names in groups
        for i, name in enumerate(names)
    ]
    rows += [f"    {p}_{name} = {i}," for i, name in enumerate(COORDINATES)]
    rows[-1] = f"{rows[-1].rstrip(',')} /* in X_EE */"
    return "\n".join([*lines, *rows, "};", ""])


def _declared(exported: Exported, f: Function) -> str:
    lines = [f.text, ""]
    lines += [line for a in f.arguments for line in _argument(a)]
    if f.iterations:
        lines += ["", f"At most {f.iterations} steps."]
    words = [f"{name.lower()} ({why})" for name, why in f.statuses.items()]
    lines += ["", f"Returns ok, or {', '.join(words)}."]
    declared = textwrap.wrap(
        f"{exported.prototype(f)};", WIDTH, subsequent_indent="    ", break_long_words=False
    )
    return _comment(lines) + "\n".join(declared) + "\n"


def _argument(a: Argument) -> Iterator[str]:
    way = "in" if a.given else "out"
    yield f"  {a.name}[{a.size}]  {way}: {a.text} [{a.unit}]"
    yield f"      order: {', '.join(a.labels)}"


def _comment(lines: Sequence[str]) -> str:
    out = []
    for line in lines:
        indent = len(line) - len(line.lstrip())
        wrapped = textwrap.wrap(
            line, WIDTH - 3, subsequent_indent=" " * (indent + 2 if indent else 0)
        )
        out += wrapped or [""]
    text = "\n".join(f" * {in_comment(line)}".rstrip() for line in out)
    return f"/*\n{text}\n */\n"
