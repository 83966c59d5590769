"""The page of measured facts of an exported folder: by compiling it, where there is a compiler."""

from __future__ import annotations

import platform
import re
import shutil
import subprocess
import tempfile
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..atomic import write_text
from ..backends.compiler import CompilerError, find_compiler
from .c_package import tolerance
from .exported import Exported

FLAGS = ("-std=c99", "-O2", "-ffp-contract=fast", "-fno-math-errno")
SECONDS = 300
NOTHING: dict[str, Any] = {"code": None, "stack": None, "error": None, "wrong": None}
_TOLD = re.compile(r"^(\w+): (\d+) samples, worst error (\S+), (\d+) wrong", re.MULTILINE)


@dataclass(frozen=True)
class Facts:
    """Where they stand, and the same as data: function -> name -> number, None if not measured.

    warnings: functions that do not answer as recorded where they were compiled.
    """

    path: Path
    data: dict[str, Any]
    warnings: list[str]


def write_facts(exported: Exported, folder: Path) -> Facts:
    """Measure and write FACTS.md."""
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
        found = _sizes(exported, command, folder.resolve(), Path(place))
        errors = _errors(exported, command, folder.resolve(), Path(place))
        version = _run([*command, "--version"], folder).splitlines()[0]
        how = f"{version}, {' '.join(FLAGS)}, {platform.machine()}"
        for name, row in rows.items():
            row |= found.get(name, {}) | errors.get(name, {})
    path = folder / "FACTS.md"
    write_text(path, _page(exported, rows, how))
    warnings = [
        f"{f.name} does not answer as recorded: worst error {row['error']:.1e}, {row['wrong']} "
        "wrong statuses; look at it with make check"
        for f, row in zip(exported.functions, rows.values(), strict=True)
        if row["wrong"] or (row["error"] or 0.0) > tolerance(exported, f)
    ]
    return Facts(path, {"functions": rows, "measured_by": how}, warnings)


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
    found: dict[str, set[str]] = {}
    here = ""
    for line in source.splitlines():
        if line[:1].isalpha() and line.endswith(")"):
            here = line.partition("(")[0].rpartition(" ")[2].lstrip("*")
        elif here and line.startswith(" "):
            words = set(re.findall(r"(\w+)\(", line))
            found.setdefault(here, set()).update(words & names - {here})
    return found


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
        f"Measured with {how}. Portable code, {e.precision}; yours will differ."
        if how
        else "Not measured: no C compiler was at hand. `condyle export` again where there is one.",
        "",
        "| function | operations | steps at most | code [bytes] | stack [bytes] | worst error |",
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
        "or a sine with its cosine, as one.",
        "- Code and stack: of a function with all that it calls, but the C library.",
        "- Worst error: over the recorded samples, of the largest entry of each result.",
        f"- Of the C library it may call {', '.join(e.symbols) or 'nothing'}.",
    ]
    return "\n".join([*lines, ""])
