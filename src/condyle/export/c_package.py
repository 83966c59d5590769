"""Target `c`: a folder with source, header, an example, recorded test vectors and a Makefile.

And a page of measured facts: by compiling the folder, where there is a compiler.
"""

from __future__ import annotations

import os
import platform
import re
import shutil
import subprocess
import tempfile
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from ..backends.compiler import CompilerError, find_compiler
from ..dynamics import FormulationName, Route
from ..errors import texts_of
from ..files.atomic import make_folder, write_text
from ..mechanism import Mechanism, as_mechanism
from ..model.model import Model
from ..progress import step
from .c_samples import Vectors, vectors
from .c_source import export
from .catalogue import in_order, usual
from .exported import Exported, Function, Precision
from .syntax import c_format, filled, literal, packaged
from .written import Written, write_texts

# By precision: what results may differ from the library's by, over the largest entry of each.
TOLERANCE = {"double": 1e-12, "float": 1e-4}
DUAL = 1e3  # of that, for efforts within limits, which squares decide on
ITERATED = 10  # of that, for what Newton's method ends at
FLAGS = ("-std=c99", "-O2", "-ffp-contract=fast", "-fno-math-errno")
SECONDS = 300
NOTHING: dict[str, Any] = {"code": None, "stack": None, "error": None, "wrong": None}
_TOLD = re.compile(r"^(\w+): (\d+) samples, worst error (\S+), (\d+) wrong", re.MULTILINE)


def export_c(
    model: Model | Mechanism | str | os.PathLike[str],
    path: str | os.PathLike[str],
    *,
    question: str | Sequence[str] | None = None,
    coordinates: str | Sequence[str] = (),
    landmark: str | None = None,
    outputs: str | Sequence[str] = (),
    inputs: str | Sequence[str] = (),
    precision: Precision = "double",
    constants: str = "inside",
    prefix: str | None = None,
    lanes: int = 8,
    size: str = "fast",
    formulation: FormulationName | None = None,
    route: Route | None = None,
) -> Written:
    """Write a mechanism as C99 for a controller: source, header, example, tests and facts.

        condyle.export_c("masticatory", "jaw", question=["inverse", "pose"])

    Args:   model: a model, a mechanism, its file, or the name of a bundled one.
            path: a folder.
            question: names from `condyle.export.CATALOGUE`, and controllers. Default: those that
                      need nothing else, and `closure` with `coordinates` or `landmark`.
            coordinates, landmark: the coordinates that `closure` starts from, or the platform point
                      whose path it starts from.
            outputs: bound, for dynamics to return the bound of their relative error too.
            inputs: gravity and base, for dynamics to take gravity in {S}, and the base's
                    acceleration, angular velocity and angular acceleration, at every call.
            precision: double or float.
            constants: inside, or struct: in a structure that a program fills at run time.
            prefix: of all names in C; default: the mechanism's name.
            lanes: width of GCC's vector types: 2, 4 or 8 doubles; 0: none.
            size: fast, or small: with loops, for processors with little memory.
            formulation, route: of the equations; default: those of the model.
    Returns: the files. Its `notes` name functions that differ from the recorded samples; its `data`
             has the functions, the names changed for C, and the measured facts.
    Raises: InputError, UnsupportedError: for what cannot be exported, or a folder that cannot be
            written.
    """
    own = model if isinstance(model, Model) else as_mechanism(model)
    mechanism = as_mechanism(own)
    names = in_order(texts_of("coordinates", coordinates))
    asked = usual(mechanism) + ("closure",) * bool(names or landmark is not None)
    exported = export(
        own,
        asked if question is None else texts_of("question", question),
        formulation=formulation,
        route=route,
        precision=precision,
        prefix=prefix,
        constants=constants,
        lanes=lanes,
        size=size,
        coordinates=names,
        landmark=landmark,
        outputs=texts_of("outputs", outputs),
        inputs=texts_of("inputs", inputs),
    )
    folder = make_folder(path)
    files = write_package(exported, folder)
    with step("compiling, to measure"):
        facts, warnings = write_facts(exported, folder)
    data = {
        "mechanism": mechanism.name,
        "prefix": exported.prefix,
        "functions": [f.name for f in exported.functions],
        "names": {name: ours for name, ours in exported.names.items() if name != ours},
        "symbols": list(exported.symbols),
        "facts": facts,
    }
    return Written([*files, folder / "FACTS.md"], warnings, data)


def write_package(exported: Exported, folder: Path) -> list[Path]:
    """Write everything but the facts."""
    p, made = exported.prefix, vectors(exported)
    return write_texts(
        folder,
        {
            f"{p}.h": exported.header,
            f"{p}.c": exported.source,
            "main.c": example(exported),
            f"{p}_vectors.h": recorded(exported, made),
            "check.c": check(exported, made),
            "Makefile": makefile(exported),
        },
    )


def tolerance(e: Exported, f: Function) -> float:
    """What results may differ by, over the largest entry of each."""
    wider = DUAL if f.question == "bounded" else ITERATED if f.iterations else 1
    return TOLERANCE[e.precision] * wider


def makefile(e: Exported) -> str:
    """Targets all, check and clean."""
    vector = f"-D{e.prefix.upper()}_VECTOR -march=native" if e.lanes else ""
    return filled(packaged("c_package.mk"), {"prefix": e.prefix, "vector": vector})


def example(e: Exported) -> str:
    """A program that calls the first function at home, at rest."""
    f, p = e.functions[0], e.prefix.upper()
    constants, prepared = _constants(e)
    known = [f"    static const {e.precision} {a.name}[{a.size}] = {{0}};" for a in f.inputs]
    known += [f"    {e.precision} {a.name}[{a.size}];" for a in f.outputs]
    printing = [
        f'    printf("{a.name} {c_format(label)}: %.9g {unit}\\n", (double){a.name}[{i}]);'
        for a in f.outputs
        for i, (label, unit) in enumerate(zip(a.labels, a.units, strict=True))
    ]
    lines = [
        f"/* {f.name} at home: every argument is 0 except those set below. */",
        f'#include <stdio.h>\n#include "{e.prefix}.h"\n\nint main(void)\n{{',
        *(*known, *constants, "    int status;", *prepared),
        f"    status = {_call(e, f, [a.name for a in f.arguments])};",
        f"    if (status != {p}_OK) {{",
        '        printf("status %d\\n", status);\n        return 1;\n    }',
        *(*printing, "    return 0;", "}", ""),
    ]
    return "\n".join(lines)


def _constants(e: Exported) -> tuple[list[str], list[str]]:
    """Statements that declare and fill the constants, where these are a structure."""
    p = e.prefix
    declared = [f"    static const {p}_numbers numbers = {p.upper()}_NUMBERS;"]
    declared += [f"    {p}_constants constants;"]
    return declared * e.struct, [f"    {p}_prepare(&numbers, &constants);"] * e.struct


def _call(e: Exported, f: Function, words: list[str]) -> str:
    return f"{f.name}({', '.join(['&constants'] * e.struct + words)})"


def recorded(e: Exported, made: list[Vectors]) -> str:
    """Arguments and answers as arrays."""
    lines = [f"/* Samples for {e.prefix}.c, and the results of condyle. */", "#include <math.h>"]
    for v in made:
        f, count = v.function, len(v.status)
        lines += ["", f"#define {f.name.upper()}_SAMPLES {count}"]
        for a in f.arguments:
            values = (v.given if a.given else v.right)[a.name]
            kind = e.precision if a.given else "double"
            lines.append(f"static const {kind} {f.name}_{a.name}[{count}][{a.size}] = {{")
            lines += [f"    {{{', '.join(literal(x, kind) for x in row)}}}," for row in values]
            lines.append("};")
        status = ", ".join(str(int(s)) for s in v.status)
        lines.append(f"static const int {f.name}_status[{count}] = {{{status}}};")
    return "\n".join([*lines, ""])


def check(e: Exported, made: list[Vectors]) -> str:
    """A program that compares every function with its recorded samples."""
    lines = [
        f"/* Compares {e.prefix}.c with recorded samples; exit status 0 if all agree. */",
        "#include <stdio.h>",
        f'#include "{e.prefix}.h"',
        f'#include "{e.prefix}_vectors.h"',
        "",
        packaged("c_check.h").replace("real", e.precision),
    ]
    for v in made:
        lines += _checked(e, v.function)
    lines += ["int main(void)", "{", "    int failed = 0;"]
    lines += [f"    failed += check_{f.question}();" for f in e.functions]
    return "\n".join([*lines, "    return failed ? 1 : 0;", "}", ""])


def _checked(e: Exported, f: Function) -> list[str]:
    ok, count = f"{e.prefix.upper()}_OK", f"{f.name.upper()}_SAMPLES"
    constants, prepared = _constants(e)
    words = [f"{f.name}_{a.name}[i]" if a.given else a.name for a in f.arguments]
    compared = [a for a in f.outputs if a.name not in ("residual", "bound")]  # of rounding
    return [
        f"static int check_{f.question}(void)\n{{",
        *(*constants, "    double worst = 0.0;\n    int wrong = 0;", *prepared),
        f"    for (int i = 0; i < {count}; i++) {{",
        *(f"        {e.precision} {a.name}[{a.size}] = {{0}};" for a in f.outputs),
        f"        const int status = {_call(e, f, words)};",
        f"        wrong += status != {f.name}_status[i];",
        f"        if (status != {ok} || {f.name}_status[i] != {ok}) continue;",
        *(
            f"        worst = larger(worst, error({a.name}, &{f.name}_{a.name}[0][0], i, {a.size}, "
            f"{count}));"
            for a in compared
        ),
        f'    }}\n    return report("{f.name}", {count}, wrong, worst, {tolerance(e, f)!r});\n}}\n',
    ]


def write_facts(exported: Exported, folder: Path) -> tuple[dict[str, Any], list[str]]:
    """Measure and write FACTS.md.

    Returns: the same as data, function -> name -> number, None if not measured; and which functions
             do not answer as recorded where they were compiled.
    """
    rows = {
        f.name: {"operations": f.operations, "iterations": f.iterations, **NOTHING}
        for f in exported.functions
    }
    how = ""
    with (
        tempfile.TemporaryDirectory(prefix="condyle-facts-") as place,
        suppress(CompilerError, OSError, subprocess.SubprocessError),
    ):
        command = list(find_compiler().command)
        sizes = _sizes(exported, command, folder.resolve(), Path(place))
        errors = _errors(exported, command, folder.resolve(), Path(place))
        version = _run([*command, "--version"], folder).splitlines()[0]
        how = f"{version}, {' '.join(FLAGS)}, {platform.machine()}"
        for name, row in rows.items():
            row |= sizes.get(name, {}) | errors.get(name, {})
    write_text(folder / "FACTS.md", _page(exported, rows, how))
    warnings = [
        f"{f.name} differs from its recorded samples: worst error {row['error']:.1e}, "
        f"{row['wrong']} wrong statuses; run make check"
        for f, row in zip(exported.functions, rows.values(), strict=True)
        if row["wrong"] or (row["error"] or 0.0) > tolerance(exported, f)
    ]
    return {"functions": rows, "measured_by": how}, warnings


def _sizes(
    e: Exported, command: list[str], folder: Path, place: Path
) -> dict[str, dict[str, int | None]]:
    """Bytes of machine code and of stack of each function, with those that it alone calls."""
    call = [*command, *FLAGS, "-c", str(folder / f"{e.prefix}.c"), "-o", str(place / "code.o")]
    try:
        _run([*call, "-fstack-usage"], place)
    except subprocess.SubprocessError:
        _run(call, place)
    sizes, stacks = Counter[str](), dict[str, int]()
    if shutil.which("nm"):
        for line in _run(["nm", "-S", "-t", "d", str(place / "code.o")], place).splitlines():
            parts = line.split()
            if len(parts) == 4 and parts[2] in "tT":
                sizes[parts[3].partition(".")[0]] += int(parts[1])  # GCC names parts after it
    for usage in place.glob("*.su"):
        for line in usage.read_text(encoding="utf-8").splitlines():
            where, size, *_ = line.split("\t")
            stacks[where.rpartition(":")[2].partition(".")[0]] = int(size)
    calls = _calls(e.source, {*sizes, *stacks})

    def reached(name: str) -> set[str]:
        return {name}.union(*map(reached, calls.get(name, ())))

    def deepest(name: str) -> int:
        return stacks.get(name, 0) + max(map(deepest, calls.get(name, ())), default=0)

    return {
        f.name: {
            "code": sum(sizes[n] for n in reached(f.name)) if sizes else None,
            "stack": deepest(f.name) if stacks else None,
        }
        for f in e.functions
    }


def _calls(source: str, names: set[str]) -> dict[str, set[str]]:
    """Which functions call which, of those that the compiler kept."""
    calls: dict[str, set[str]] = {}
    here = ""
    for line in source.splitlines():
        if line[:1].isalpha() and line.endswith(")"):
            here = line.partition("(")[0].rpartition(" ")[2].lstrip("*")
        elif here and line.startswith(" "):
            words = set(re.findall(r"(\w+)\(", line))
            calls.setdefault(here, set()).update(words & names - {here})
    return calls


def _errors(
    e: Exported, command: list[str], folder: Path, place: Path
) -> dict[str, dict[str, float]]:
    """The worst error over the recorded samples."""
    program = place / "checker"
    sources = [str(folder / "check.c"), str(folder / f"{e.prefix}.c")]
    _run([*command, *FLAGS, *sources, "-o", str(program), "-lm"], place)
    told = subprocess.run([str(program)], capture_output=True, text=True, timeout=SECONDS).stdout
    return {
        name: {"error": float(error), "wrong": int(wrong)}
        for name, _, error, wrong in _TOLD.findall(told)
    }


def _run(call: list[str], place: Path) -> str:
    done = subprocess.run(call, capture_output=True, timeout=SECONDS, cwd=place, check=True)
    return done.stdout.decode(errors="replace")


def _page(e: Exported, rows: dict[str, dict[str, Any]], how: str) -> str:
    lines = [
        f"# {e.prefix}: measured facts",
        "",
        f"Measured with {how}. Portable code, {e.precision}; another target differs."
        if how
        else "Not measured: no C compiler was found. Export again where there is one.",
        "",
        "| function | operations | maximum steps | code [bytes] | stack [bytes] | worst error |",
        "|---|---|---|---|---|---|",
    ]
    for name, row in rows.items():
        steps = str(row["iterations"] or "no iteration")
        error = "" if row["error"] is None else f"{row['error']:.1e}"
        cells = [name, row["operations"], steps, row["code"], row["stack"], error]
        lines.append(f"| {' | '.join('' if cell is None else str(cell) for cell in cells)} |")
    lines += [
        "",
        "- Operations: additions, products, roots and quotients of one call, a fused multiply-add, "
        "or a sine with its cosine, counted as one.",
        "- Code and stack: of a function and all functions that it calls, without the C library.",
        "- Worst error: over the recorded samples, of the largest entry of each result.",
        f"- Functions of the C library that it may call: {', '.join(e.symbols) or 'nothing'}.",
    ]
    return "\n".join([*lines, ""])
