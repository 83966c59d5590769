"""The digest of a program: equal for equal questions, another for any change, in any process."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from support.cases import case

import condyle
from condyle.graph.graph import Graph
from condyle.graph.program import Check, Interface, Output, Port, Program, Programs
from condyle.questions import QUESTIONS, Question
from condyle.questions.law import CONTROLLERS
from condyle.questions.structure import structure_of, walls_of
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
    outputs = Output("f", (), "N", False, ((root,),)), Output("g", (), "N", False, ((total,),))
    ports = Port("x", 2, "", False, 0), Port("y", 1, "", True, 2)
    checks = (Check(first, 1e-14, None),)
    return replace(Program(graph, (3,), 5, ports, outputs, checks), **changed)


def test_any_change_is_seen() -> None:
    program = made()
    (f, g), (check,) = program.outputs, program.checks
    changes: dict[str, dict[str, Any]] = {
        "operation": {"op": "sub"},
        "order of arguments": {"swapped": True},
        "constant": {"constant": 2.5},
        "leaf": {"leaf": 3},
        "lanes": {"counts": (4,)},
        "columns": {"columns": 6},
        "order of outputs": {"outputs": (g, f)},
        "fewer outputs": {"outputs": (f,)},
        "name of an output": {"outputs": (replace(f, name="h"), g)},
        "no check": {"checks": ()},
        "tolerance": {"checks": (replace(check, tolerance=1e-13),)},
        "status": {"checks": (replace(check, below=Status.unreachable),)},
        "what is checked": {"checks": (replace(check, value=g.entries[0][0]),)},
    }
    digests = {name: made(**change).digest for name, change in changes.items()}
    assert len({program.digest, *digests.values()}) == 1 + len(changes), digests
    assert made().digest == program.digest == made(useless=True).digest


def test_variants_are_told_apart_and_have_one_interface() -> None:
    main, other = made(), made("sub")
    robust, latency = {"write_robust": lambda: other}, {"write_latency": lambda: other}
    found = [Programs(main, **more) for more in ({}, robust, latency, robust | latency)]
    assert len({v.digest for v in (*found, Programs(other))}) == 5
    renamed = replace(main, outputs=(replace(main.outputs[0], name="h"), main.outputs[1]))
    with pytest.raises(AssertionError):
        _ = Programs(main, write_robust=lambda: renamed).robust


def test_an_interface_survives_json() -> None:
    face = Question.about(structure_of(case("mixed_k2_n8").mechanism), "reactions")
    interface = face.variants().main.interface
    assert Interface.of(interface.data()) == interface
    assert any(r.lanes and len(r.groups) < len(interface.counts) for r in interface.results)


# Half of the seconds of all questions; the machinery that writes them out is that of the others.
DEAR = {"allocation", "coriolis", "derivative", "kalman", "limited", "observer", "pose"}


def digests(dear: bool) -> str:
    """A line of every question that there is: of `DEAR`, or of the others."""
    line = {"name": "l", "base": [0.0, 0.0, 0.2], "platform": [0, 0, 0], "slack_length": 0.1}
    machine = case("mixed_k2_n8").mechanism.replace(ligaments=({**line, "stiffness": 100.0},))
    structure = structure_of(machine)
    given: dict[str, tuple[Any, ...]] = {
        "tick": (CONTROLLERS["impedance"],),
        "derivative": ("slopes", "linear", (), ("q",), ("residual",)),
        "file_numbers": (walls_of(machine, structure), True),
        "impact": ((("plane", 3, False),),),
        "lifting": ((("plane", 3, False),),),
    }
    names = [name for name in QUESTIONS if (name in DEAR) == dear]
    asked = {name: Question.about(structure, name, *given.get(name, ())) for name in names}
    return "\n".join(f"{name} {q.variants().digest} {q.key}" for name, q in asked.items())


@pytest.mark.slow
@pytest.mark.parametrize("dear", [False, pytest.param(True, marks=pytest.mark.ci)])
def test_another_process_finds_the_same(dear: bool) -> None:
    """Sets and texts are hashed anew in every process."""
    code = f"from graph.test_digest import digests; print(digests({dear}))"
    paths = map(str, (Path(condyle.__file__).parents[1], *Path(__file__).parents[1:3]))
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(paths), "PYTHONHASHSEED": "1"},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.strip() == digests(dear)


def test_keys_do_not_depend_on_the_order_of_a_set() -> None:
    structure = structure_of(case("mixed_k2_n8").mechanism)
    zeros = [(group, i) for group in (-1, 0) for i in range(40)]
    orders = (zeros, zeros[::-1], zeros[7:] + zeros[:7])
    asked = [replace(structure, zeros=frozenset(order)) for order in orders]
    assert len({Question.about(one, "closure").key for one in asked}) == 1
