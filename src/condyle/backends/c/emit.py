"""A program as C: one evaluation with lanes in the registers, and a batch with samples in them.

    prepare(numbers, table)          what does not change from sample to sample, once
    one(table, in, out)              least latency: shared values scalar, lane values vectors
    batch(table, in, strides, ...)   most throughput: all values vectors over W samples

Both are printed from the same graph, one evaluation by `straight`, a batch by `loops`. They are
texts of their own, since compilers do best by each with other flags.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib.resources import files

from ...graph.fuse import fuse
from ...graph.program import Interface, Program, Programs
from ..kernel import AGAIN
from .loops import Loops
from .prepare import prepare
from .straight_line import Straight

CHAIN = 5  # terms above which a sum becomes two that run side by side


@dataclass(frozen=True)
class Source:
    """Generated C and what a caller must know of it.

    single:     text of one evaluation, for the batch to be linked with; None where there is none.
    batch:      text of the batch.
    table_size: numbers that `prepare` computes.
    checks:     numbers that `one` writes after the results.
    operations: vector operations of one batch step; a fused multiply-add counts one.
    """

    single: str | None
    batch: str
    interface: Interface
    table_size: int
    checks: int
    operations: int


def emit(variants: Programs, width: int) -> Source:
    """The kernel's C for `width` lanes."""
    main = fused(variants.main)
    step = Loops(main, width)
    apart: dict[str, Straight] = {}
    if variants.single:
        one = main if variants.latency is None else fused(variants.latency)
        apart["quick"] = Straight(one, width)
    if variants.robust is not None:
        apart["robust"] = Straight(fused(variants.robust), width)
    face, checks = main.interface, main.checks
    macros = {
        "W": width,
        "INPUTS": face.columns,
        "OUTPUTS": sum(face.width(r) for r in face.results),
        "CHECKS": len(checks),
        "AGAIN": AGAIN,
        "ROBUST": int("robust" in apart),
        "SINGLE": int(variants.single),
    }
    size = 0
    for name, printer in {"step": step, **apart}.items():
        macros[f"{name.upper()}_TABLE"] = size
        size += -(-printer.table_size // width) * width
    tolerances = ", ".join(repr(c.tolerance) for c in checks)
    below = ", ".join(str(AGAIN if c.below is None else int(c.below)) for c in checks)
    head = [
        *(f"#define {name} {value}" for name, value in macros.items()),
        text("vector.h"),
        f"static const double tolerance[CHECKS + 1] = {{{tolerances}}};",
        f"static const int below[CHECKS + 1] = {{{below}}};",
        text("judge.h"),
    ]
    code = [prepare(step, "prepare_step"), step.function("step")]
    batch = "\n".join([*head, *code, text("batch.h")])
    single = None
    if apart:
        code = [
            part
            for name, printer in apart.items()
            for part in (prepare(printer, f"prepare_{name}"), printer.function(name))
        ]
        single = "\n".join([*head, *code, text("single.h")])
    return Source(single, batch, face, size, len(checks), step.operations())


def text(name: str) -> str:
    """A file of C of this folder."""
    return (files(__package__) / name).read_text(encoding="utf-8")


def fused(program: Program) -> Program:
    """The program with its sums as fused multiply-adds."""
    graph, moved = fuse(program.graph, program.roots, CHAIN)
    return program.moved(graph, {old: new for old, new in zip(program.roots, moved, strict=True)})
