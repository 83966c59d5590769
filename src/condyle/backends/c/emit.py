"""A program as C: one evaluation with chains in the lanes, and a batch with samples in them.

    prepare(numbers, table)          what does not change from sample to sample, once
    one(table, in, out)              least latency: shared values scalar, lane values vectors
    batch(table, in, stride, ...)    most throughput: all values vectors over W samples

Both shapes are printed from the same graph: `straight` for one evaluation, `loops` for a batch.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib.resources import files

from ...graph.fuse import fuse
from ...questions.program import Output, Program, build, folds
from ...questions.spec import KernelSpec
from .loops import Loops
from .prepare import prepare
from .straight import Straight

CHAIN = 5
NEAR = 1e-14  # margin or quality below which a sample is looked at again by the interpreter


@dataclass(frozen=True)
class Source:
    """Generated C and what a caller must know of it.

    outputs:    names and sizes, in the order in which `one` and `batch` write them.
    table_size: numbers that `prepare` computes.
    operations: vector operations of one batch step; a fused multiply-add counts one.
    """

    text: str
    outputs: list[tuple[str, int]]
    table_size: int
    operations: int


def emit(spec: KernelSpec, width: int) -> Source:
    """The kernel's C for `width` lanes."""
    program = fused(build(spec))
    one = fused(build(spec, early=True)) if folds(spec) else program
    quick, batch = Straight(one, width), Loops(program, width)
    functions: dict[str, Straight | Loops] = {"quick": quick, "step": batch}
    if spec.n > spec.m:
        functions["careful"] = Straight(fused(build(spec, careful=True)), width)
    outputs: dict[str, int] = {}
    for o in program.outputs:
        outputs[o.name] = outputs.get(o.name, 0) + (spec.n if o.lane else 1)
    names = [name for name, count in outputs.items() for _ in range(count)]
    macros = {
        "W": width,
        "INPUTS": len(program.layout.inputs),
        "OUTPUTS": len(names),
        "MARGIN": names.index("margin"),
        "QUALITY": names.index("quality"),
        "NEAR": NEAR,
        "CAREFUL": int("careful" in functions),
    }
    size, code = 0, []
    for name, printer in functions.items():
        macros[f"{name.upper()}_TABLE"] = size
        size += -(-printer.table_size // width) * width
        code += [prepare(printer, f"prepare_{name}"), printer.function(name)]
    defines = [f"#define {name} {value}" for name, value in macros.items()]
    text = "\n".join([*defines, _text("vector.h"), *code, _text("driver.h")])
    return Source(text, list(outputs.items()), size, batch.operations())


def _text(name: str) -> str:
    return (files(__package__) / name).read_text(encoding="utf-8")


def fused(program: Program) -> Program:
    """The program with its sums as fused multiply-adds."""
    roots = [v for output in program.outputs for v in output.nodes]
    graph, moved = fuse(program.graph, roots, CHAIN)
    renamed = dict(zip(roots, moved, strict=True))
    outputs = [Output(o.name, o.lane, tuple(renamed[v] for v in o.nodes)) for o in program.outputs]
    return Program(program.spec, program.layout, graph, outputs)
