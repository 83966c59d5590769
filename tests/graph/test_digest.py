"""The digest of a program: equal for equal questions, another for any change, in any process."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from support.cases import case

import condyle
from condyle.graph.graph import Graph
from condyle.graph.program import Check, Interface, Output, Port, Program, Variants
from condyle.questions import QUESTIONS, Question
from condyle.questions.structure import structure_of
from condyle.status import Status


def made(
    op: str = "add",
    swapped: bool = False,
    constant: float = 2.0,
    leaf: int = 1,
    useless: bool = False,
    **changed: Any,
) -> Program:
    """sum_i (x0 - x1) y_i, with a check; each option changes one thing."""
    graph = Graph()
    if useless:  # which only shifts the numbers of nodes
        graph.apply("sin", graph.leaf("input", 7))
    a, b = graph.leaf("input", 0), graph.leaf("input", leaf)
    first = graph.apply("sub", *((b, a) if swapped else (a, b)))
    y = graph.leaf("lane_input", 0, 2, group=0)
    total = graph.reduce("sum", [graph.apply("mul", first, y)])
    root = graph.apply(op, total, graph.const(constant))
    outputs = (
        Output("f", (), "N", False, ((root,),)),
        Output("g", (), "N", False, ((total,),)),
    )
    whole = Program(
        graph,
        counts=(3,),
        columns=5,
        ports=(Port("x", 2, "", False, 0), Port("y", 1, "", True, 2)),
        outputs=outputs,
        checks=(Check(first, 1e-14, None),),
    )
    return replace(whole, **changed)


def renamed(p: Program) -> Program:
    return replace(p, outputs=(replace(p.outputs[0], name="h"), p.outputs[1]))


CHANGES: dict[str, Callable[[], Program]] = {
    "operation": lambda: made("sub"),
    "order of arguments": lambda: made(swapped=True),
    "constant": lambda: made(constant=2.5),
    "leaf": lambda: made(leaf=3),
    "lanes": lambda: made(counts=(4,)),
    "columns": lambda: made(columns=6),
    "order of outputs": lambda: replace(made(), outputs=made().outputs[::-1]),
    "fewer outputs": lambda: replace(made(), outputs=made().outputs[:1]),
    "name of an output": lambda: renamed(made()),
    "no check": lambda: made(checks=()),
    "tolerance": lambda: replace(made(), checks=(replace(made().checks[0], tolerance=1e-13),)),
    "status": lambda: replace(
        made(), checks=(replace(made().checks[0], below=Status.unreachable),)
    ),
    "what is checked": lambda: replace(
        made(), checks=(replace(made().checks[0], value=made().outputs[1].entries[0][0]),)
    ),
}


@pytest.mark.parametrize("change", CHANGES)
def test_any_change_is_seen(change: str) -> None:
    assert CHANGES[change]().digest != made().digest


def test_equal_programs_have_equal_digests() -> None:
    assert made().digest == made().digest
    assert made(useless=True).digest == made().digest


def test_variants_are_told_apart() -> None:
    main, other = made(), made("sub")
    found = [
        Variants(main),
        Variants(main, write_robust=lambda: other),
        Variants(main, write_latency=lambda: other),
        Variants(main, write_robust=lambda: other, write_latency=lambda: other),
        Variants(other),
    ]
    assert len({v.digest for v in found}) == len(found)


def test_variants_have_one_interface() -> None:
    variants = Variants(made(), write_robust=lambda: renamed(made()))
    with pytest.raises(AssertionError):
        _ = variants.robust


def test_an_interface_survives_json() -> None:
    face = Question.about(structure_of(case("mixed_k2_n8").mechanism), "reactions")
    interface = face.variants().main.interface
    assert Interface.of(interface.data()) == interface
    assert any(r.lanes and len(r.groups) < len(interface.counts) for r in interface.results)


DIGESTS = """
from support.cases import case
from condyle.questions import QUESTIONS, Question
from condyle.questions.law import CONTROLLERS
from condyle.questions.structure import structure_of, walls_of
line = {"name": "l", "base": [0.0, 0.0, 0.2], "platform": [0, 0, 0], "slack_length": 0.1}
machine = case("mixed_k2_n8").mechanism.replace(ligaments=({**line, "stiffness": 100.0},))
structure = structure_of(machine)
given = {"tick": (CONTROLLERS["impedance"],)}
given["derivative"] = ("slopes", "linear", (), ("q",), ("residual",))
given["file_numbers"] = (walls_of(machine, structure), True)
for name in QUESTIONS:
    question = Question.about(structure, name, *given.get(name, ()))
    print(name, question.variants().digest, question.key)
"""


def test_other_processes_find_the_same() -> None:
    """Sets and texts are hashed anew in every process."""
    paths = [str(Path(condyle.__file__).parents[1]), str(Path(__file__).parents[1])]
    said = set()
    for seed in ("1", "2"):
        env = {**os.environ, "PYTHONPATH": os.pathsep.join(paths), "PYTHONHASHSEED": seed}
        done = subprocess.run(
            [sys.executable, "-c", DIGESTS], env=env, capture_output=True, text=True, check=True
        )
        said.add(done.stdout)
    assert len(said) == 1
    assert len(said.pop().splitlines()) == len(QUESTIONS)


def test_keys_do_not_depend_on_the_order_of_a_set() -> None:
    structure = structure_of(case("mixed_k2_n8").mechanism)
    zeros = [(-1, i) for i in range(40)] + [(0, i) for i in range(40)]
    keys = {
        Question.about(replace(structure, zeros=frozenset(z)), "closure").key
        for z in (zeros, zeros[::-1], zeros[7:] + zeros[:7])
    }
    assert len(keys) == 1
