"""Target `c`: a folder with source, header, an example, recorded test vectors and a Makefile."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from ..atomic import write_text
from ..mechanism.mechanism import Mechanism
from .c_names import in_format, literal, packaged
from .c_samples import Vectors, vectors
from .catalogue import Wish
from .exported import Exported, Function

# By precision: what results may differ from the library's by, over the largest entry of each.
TOLERANCE = {"double": 1e-12, "float": 1e-4}
DUAL = 1e3  # of that, for efforts within limits, which squares decide on


def write_package(
    exported: Exported, mechanism: Mechanism, wish: Wish, folder: Path
) -> dict[str, Path]:
    """Write everything but the facts; returns the files by what they are."""
    made = vectors(exported, mechanism, wish)
    p = exported.prefix
    texts = {
        "header": (f"{p}.h", exported.header),
        "source": (f"{p}.c", exported.source),
        "example": ("main.c", example(exported)),
        "vectors": (f"{p}_vectors.h", recorded(exported, made)),
        "check": ("check.c", check(exported, made)),
        "makefile": ("Makefile", makefile(exported)),
    }
    written = {}
    for kind, (name, text) in texts.items():
        written[kind] = folder / name
        write_text(written[kind], text)
    return written


def tolerance(e: Exported, f: Function) -> float:
    """What results may differ by, over the largest entry of each."""
    return TOLERANCE[e.precision] * (DUAL if f.question == "bounded" else 1.0)


def makefile(e: Exported) -> str:
    """Targets all, check and clean."""
    text = packaged("c_package.mk")
    vector = f"-D{e.prefix.upper()}_VECTOR -march=native" if e.lanes else ""
    return text.replace("@prefix@", e.prefix).replace("@vector@", vector)


def example(e: Exported) -> str:
    """A program that asks the first question at home, at rest."""
    f = e.functions[0]
    p = e.prefix.upper()
    lines = [
        f"/* What {f.name} answers at home: every argument is 0 but those set below. */",
        "#include <stdio.h>",
        f'#include "{e.prefix}.h"',
        "",
        "int main(void)",
        "{",
    ]
    lines += [f"    static const {e.precision} {a.name}[{a.size}] = {{0}};" for a in f.inputs]
    lines += [f"    {e.precision} {a.name}[{a.size}];" for a in f.outputs]
    words = ["&constants"] * e.struct + [a.name for a in f.arguments]
    if e.struct:
        lines += [
            f"    static const {e.prefix}_numbers numbers = {p}_NUMBERS;",
            f"    {e.prefix}_constants constants;",
        ]
    call = f"{f.name}({', '.join(words)})"
    lines += ["    int status;"]
    lines += [f"    {e.prefix}_prepare(&numbers, &constants);"] * e.struct
    lines += [
        f"    status = {call};",
        f"    if (status != {p}_OK) {{",
        '        printf("status %d\\n", status);',
        "        return 1;",
        "    }",
    ]
    for a in f.outputs:
        for i, (label, unit) in enumerate(zip(a.labels, a.units, strict=True)):
            text = f"{a.name} {in_format(label)}: %.9g {unit}"
            lines.append(f'    printf("{text}\\n", (double){a.name}[{i}]);')
    return "\n".join([*lines, "    return 0;", "}", ""])


def recorded(e: Exported, made: list[Vectors]) -> str:
    """Arguments and answers as arrays."""
    lines = [
        f"/* Samples for {e.prefix}.c, and what condyle answers to them. */",
        "#include <math.h>",
    ]
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
        f"/* Compares {e.prefix}.c with recorded samples; exit status 0 where all agree. */",
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


def _checked(e: Exported, f: Function) -> Iterator[str]:
    p = e.prefix.upper()
    yield f"static int check_{f.question}(void)"
    yield "{"
    if e.struct:
        yield f"    static const {e.prefix}_numbers numbers = {p}_NUMBERS;"
        yield f"    {e.prefix}_constants constants;"
    yield "    double worst = 0.0;"
    yield "    int wrong = 0;"
    if e.struct:
        yield f"    {e.prefix}_prepare(&numbers, &constants);"
    yield f"    for (int i = 0; i < {f.name.upper()}_SAMPLES; i++) {{"
    for a in f.outputs:
        yield f"        {e.precision} {a.name}[{a.size}] = {{0}};"
    words = [f"{f.name}_{a.name}[i]" if a.given else a.name for a in f.arguments]
    call = f"{f.name}({', '.join(['&constants'] * e.struct + words)})"
    yield f"        const int status = {call};"
    yield f"        wrong += status != {f.name}_status[i];"
    yield f"        if (status != {p}_OK || {f.name}_status[i] != {p}_OK) continue;"
    for a in f.outputs:
        if a.name != "residual":  # which is rounding
            right = f"&{f.name}_{a.name}[0][0]"
            yield (
                f"        worst = larger(worst, error({a.name}, {right}, i, {a.size}, "
                f"{f.name.upper()}_SAMPLES));"
            )
    yield "    }"
    count, most = f"{f.name.upper()}_SAMPLES", tolerance(e, f)
    yield f'    return told("{f.name}", {count}, wrong, worst, {most!r});'
    yield "}"
    yield ""
