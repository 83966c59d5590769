"""A program as C: one evaluation with lanes in the registers, and a batch with samples in them.

    prepare(numbers, table)          what does not change from sample to sample, once
    one(table, in, out)              least latency: shared values scalar, lane values vectors
    batch(table, in, strides, ...)   most throughput: all values vectors over W samples

All shapes are printed from the same graph: `straight` for one evaluation, `loops` for a batch.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib.resources import files

from ...graph.fuse import fuse
from ...graph.program import Interface, Program, Variants
from ..kernel import AGAIN
from .loops import Loops
from .prepare import prepare
from .straight import Straight

CHAIN = 5  # terms above which a sum becomes two that run side by side


@dataclass(frozen=True)
class Source:
    """Generated C and what a caller must know of it.

    table_size: numbers that `prepare` computes.
    checks:     numbers that `one` writes after the results.
    operations: vector operations of one batch step; a fused multiply-add counts one.
    """

    text: str
    interface: Interface
    table_size: int
    checks: int
    operations: int


def emit(variants: Variants, width: int) -> Source:
    """The kernel's C for `width` lanes."""
    main = fused(variants.main)
    batch = Loops(main, width)
    functions: dict[str, Straight | Loops] = {"step": batch}
    if variants.single:
        one = main if variants.latency is None else fused(variants.latency)
        functions["quick"] = Straight(one, width)
    if variants.robust is not None:
        functions["robust"] = Straight(fused(variants.robust), width)
    face, checks = main.interface, main.checks
    macros = {
        "W": width,
        "INPUTS": face.columns,
        "OUTPUTS": sum(face.width(r) for r in face.results),
        "CHECKS": len(checks),
        "AGAIN": AGAIN,
        "ROBUST": int("robust" in functions),
        "SINGLE": int(variants.single),
    }
    size, code = 0, []
    for name, printer in functions.items():
        macros[f"{name.upper()}_TABLE"] = size
        size += -(-printer.table_size // width) * width
        code += [prepare(printer, f"prepare_{name}"), printer.function(name)]
    below = ", ".join(str(AGAIN if c.below is None else int(c.below)) for c in checks)
    tolerances = ", ".join(repr(c.tolerance) for c in checks)
    judged = [
        f"static const double tolerance[CHECKS + 1] = {{{tolerances}}};",
        f"static const int below[CHECKS + 1] = {{{below}}};",
    ]
    defines = [f"#define {name} {value}" for name, value in macros.items()]
    text = "\n".join([*defines, _text("vector.h"), *judged, *code, _text("driver.h")])
    return Source(text, face, size, len(checks), batch.operations())


def _text(name: str) -> str:
    return (files(__package__) / name).read_text(encoding="utf-8")


def fused(program: Program) -> Program:
    """The program with its sums as fused multiply-adds."""
    graph, moved = fuse(program.graph, program.roots, CHAIN)
    return program.moved(graph, {old: new for old, new in zip(program.roots, moved, strict=True)})
