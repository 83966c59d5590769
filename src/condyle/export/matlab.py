"""Target `matlab`: MEX functions of the exported C, with help texts, a build script and an example.

In matrices a row is an entry and a column a sample; one column serves all samples. The last output
is the status of every sample. MATLAB and Octave.
"""

from __future__ import annotations

import os
import textwrap
from collections.abc import Iterator, Sequence

from ..errors import texts_of
from ..files.atomic import make_folder
from ..mechanism import Mechanism, as_mechanism
from ..model.model import Model
from .c_names import PREFIX_LENGTH, default_prefix
from .c_source import export
from .exported import CArray, Exported, Function
from .syntax import line_comment, matlab_string, packaged
from .written import Written, write_texts

DEFAULT = ("contact", "inverse", "bounded", "forward", "motion", "pose", "computed_torque")
LONGEST = 63  # letters of a name in MATLAB


def export_matlab(
    model: Model | Mechanism | str | os.PathLike[str],
    path: str | os.PathLike[str],
    *,
    question: str | Sequence[str] = DEFAULT,
) -> Written:
    """Write MEX functions for MATLAB and Octave: C, help texts, `build.m`, `NAME_example.m`.

    Args:   model: a model, a mechanism, its file, or the name of a bundled one.
            path: a folder.
            question: names from `condyle.export.CATALOGUE`, and controllers.
    Raises: InputError, UnsupportedError: for what cannot be exported to C, or a folder that cannot
            be written.
    """
    mechanism = as_mechanism(model)
    asked = texts_of("question", question)
    longest = max(map(len, asked), default=0)
    prefix = default_prefix(mechanism.name, min(LONGEST - 1 - longest, PREFIX_LENGTH))
    e = export(mechanism, asked, lanes=0, prefix=prefix)
    texts = {f"{e.prefix}.c": e.source, f"{e.prefix}.h": e.header}
    for f in e.functions:
        texts[f"{f.name}_mex.c"] = gateway(e, f)
        texts[f"{f.name}.m"] = help_text(e, f)
    texts |= {"build.m": build(e), f"{e.prefix}_example.m": example(e)}
    return Written(write_texts(make_folder(path), texts), (), {"mechanism": mechanism.name})


def gateway(e: Exported, f: Function) -> str:
    """C of one MEX function."""
    rows = [f'    {{{a.size}, "{a.name}"}},' for a in (*f.inputs, *f.outputs)]
    words = ", ".join(
        f"in[{i}]" if a.given else f"out[{i - len(f.inputs)}]" for i, a in _in_order(f)
    )
    parts = [
        f"/* {f.name} for MATLAB and Octave: {f.text} */",
        f'#include "{e.prefix}.h"',
        f"#define INPUTS {len(f.inputs)}",
        f"#define OUTPUTS {len(f.outputs)}",
        f'#define NAME "{f.name}"',
        "static const struct { unsigned size; const char *name; } ARGUMENTS[] = {",
        *rows,
        "};",
        f"#define CALL(in, out) {f.name}({words})",
        "",
    ]
    return "\n".join(parts) + packaged("matlab_mex.c")


def help_text(e: Exported, f: Function) -> str:
    """The .m file that `help` shows, and that says what to do before there is a MEX function."""
    outputs = ", ".join([a.name for a in f.outputs] + ["status"])
    inputs = ", ".join(a.name for a in f.inputs)
    lines = [f"{f.name.upper()}  {f.text}", f"  [{outputs}] = {f.name}({inputs})", ""]
    lines += [
        f'  Mechanism "{e.mechanism.name}", written by condyle. A column is a sample;',
        "  one column serves all samples.",
        "",
    ]
    for a in f.arguments:
        lines += _wrapped(f"{a.name} ({a.size} x N): {a.text} [{a.unit}]: {', '.join(a.labels)}")
    words = "; ".join(f"{name.lower()}: {why}" for name, why in f.statuses.items())
    lines += _wrapped(
        f"status (1 x N): 0 where there is a result, else results are NaN. {words}. Without this "
        "output it is an error."
    )
    head = f"function varargout = {f.name}(varargin)"
    text = [head, *(f"% {line}".rstrip() for line in lines)]
    text = [line_comment(line) for line in text]
    return "\n".join([*text, "error('run build.m first: it compiles this function');", "end", ""])


def build(e: Exported) -> str:
    """build.m."""
    lines = ["% Compiles the functions of this folder: needs a C compiler (mex -setup C)."]
    lines += ["here = fileparts(mfilename('fullpath'));", "before = cd(here);"]
    lines += ["back = onCleanup(@() cd(before));"]
    lines += [f"mex('-c', '{e.prefix}.c');", f"object = dir('{e.prefix}.o*');"]
    for f in e.functions:
        lines.append(f"mex('-output', '{f.name}', '{f.name}_mex.c', object(1).name);")
    return "\n".join([*lines, "rehash", ""])


def example(e: Exported) -> str:
    """NAME_example.m: a sway about home, there and back."""
    f = e.functions[0]
    lines = [
        f'% How to call the functions of "{e.mechanism.name}". Run build.m once before this.',
        "t = linspace(0, 1, 101);",
    ]
    for a in f.inputs:
        lines.append(f"{a.name} = zeros({a.size}, 1);  % {', '.join(a.labels)} [{a.unit}]")
    names = [a.name for a in f.inputs]
    if {"q", "q1", "q2"} <= set(names):
        lines += [
            "% A sway of the first coordinate by 0.1 mm (or 0.1 mrad), once a second.",
            "q = repmat(q, size(t)); q1 = repmat(q1, size(t)); q2 = repmat(q2, size(t));",
            "w = 2 * pi;",
            "q(1, :) = 1e-4 * sin(w * t); q1(1, :) = 1e-4 * w * cos(w * t);",
            "q2(1, :) = -1e-4 * w^2 * sin(w * t);",
        ]
    outputs = ", ".join([a.name for a in f.outputs] + ["status"])
    lines.append(f"[{outputs}] = {f.name}({', '.join(names)});")
    lines.append("assert(all(status == 0))")
    if effort := next((a for a in f.outputs if a.name == "effort"), None):
        legend = ", ".join(f"'{matlab_string(label)}'" for label in effort.labels)
        lines += [f"% plot(t, effort'); legend({legend}); ylabel('effort [{effort.unit}]');"]
        known = {g.question: g for g in e.functions}
        if "forward" in known:
            lines += [
                "% And back: those efforts make those accelerations.",
                f"again = {known['forward'].name}(q, q1, effort, force, moment, point);",
                "assert(max(abs(again(:) - q2(:))) < 1e-6 * max(abs(q2(:))))",
            ]
    return "\n".join([*map(line_comment, lines), ""])


def _wrapped(text: str) -> list[str]:
    return textwrap.wrap(text, 92, initial_indent="  ", subsequent_indent=" " * 6)


def _in_order(f: Function) -> Iterator[tuple[int, CArray]]:
    """Arguments of the C function, counted inputs first."""
    order = {a.name: i for i, a in enumerate((*f.inputs, *f.outputs))}
    return ((order[a.name], a) for a in f.arguments)
