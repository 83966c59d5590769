"""Exported C takes the same number of instructions for every sample, however adverse."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from support.tools import need, run

import condyle
from condyle.export import Exported, Function, export
from condyle.export.controller import controller_source

STATES = 2_000
SPREAD = 1.10
CHOOSING = 1.20  # of an active set, some of whose choices GCC makes branches: 1.15 was seen
QUESTIONS = ("inverse", "forward", "motion", "closure", "pose", "bite_force")
ODD = (0.0, -0.0, 5e-324, -1e-310, 1e-200, 1e49, 1e300, np.inf, -np.inf, np.nan)


def adverse(f: Function, rng: np.random.Generator, count: int = STATES) -> dict[str, np.ndarray]:
    """States at bounds, near and at singular poses, out of reach, no numbers, denormal, huge."""
    kind = np.arange(count) % 6
    found = {}
    for a in f.inputs:
        x = 0.05 * rng.normal(size=(count, a.size))
        x[kind == 1] *= 100  # out of reach, or nearly
        x[kind == 2] *= 10.0 ** rng.uniform(-12, 12, (np.sum(kind == 2), 1))
        x[kind == 3] = rng.choice(ODD, (np.sum(kind == 3), a.size))
        x[kind == 4] *= 1e-307
        if a.name == "q":  # a whole turn in 16 steps: singular poses are among them
            x[kind == 5] = np.pi / 8 * rng.integers(-8, 9, (np.sum(kind == 5), a.size))
        found[a.name] = x
    return found


@pytest.mark.ci
def test_instructions_do_not_depend_on_the_state(tmp_path: Path) -> None:
    need("valgrind", "gcc")
    exported = export(condyle.load_mechanism("masticatory"), QUESTIONS, lanes=0, landmark="incisor")
    rng = np.random.default_rng(0)
    found = counts(exported, {f.question: adverse(f, rng) for f in exported.functions}, tmp_path)
    for question, instructions in found.items():
        assert instructions.min() > 0
        assert instructions.max() < SPREAD * instructions.min(), question


@pytest.mark.ci
def test_nor_do_those_of_a_tick_with_observer_law_and_limits(tmp_path: Path) -> None:
    need("valgrind", "gcc")
    robot = condyle.load_mechanism("masticatory")
    weak = {f"chain.{name}.actuator.torque_limit": 0.3 for name in robot.chain_names}
    bite = {"kind": "bite_force", "stiffness": 900.0, "force": 50.0, "distribution": "bounded"}
    scenario = {
        "controller": bite | {"effort_rate": 50.0},
        "sensors": {"encoder_noise": 1e-4},
        "observer": {"kind": "kalman"},
    }
    exported = controller_source(robot.set(weak), scenario, None).exported
    states = {"tick": adverse(exported["tick"], np.random.default_rng(0), 300)}
    instructions = counts(exported, states, tmp_path)["tick"]
    assert 0 < instructions.max() < CHOOSING * instructions.min()


def counts(
    exported: Exported, states: Mapping[str, Mapping[str, np.ndarray]], folder: Path
) -> dict[str, np.ndarray]:
    """Instructions of each state, (N,), by question.

    Every state has a function of its own, from which callgrind sees what the calls cost.

    Args: states: question -> argument -> (N, size).
    """
    asked = [exported[question] for question in states]
    count = len(next(iter(next(iter(states.values())).values())))
    (folder / f"{exported.prefix}.c").write_text(exported.source)
    (folder / f"{exported.prefix}.h").write_text(exported.header)
    (folder / "states.c").write_text(_program(exported, asked, count))
    rows = [np.hstack([states[f.question][a.name] for a in f.inputs]) for f in asked]
    np.hstack(rows).astype(float).tofile(folder / "states.bin")
    build = ["gcc", "-std=c99", "-ffp-contract=fast", "-fno-math-errno"]
    run(*build, "-O2", "-c", f"{exported.prefix}.c", folder=folder)
    run(*build, "-O0", "states.c", f"{exported.prefix}.o", "-o", "states", "-lm", folder=folder)
    count_them = ["valgrind", "--tool=callgrind", "--callgrind-out-file=costs", "./states"]
    subprocess.run(count_them, cwd=folder, capture_output=True, check=True)  # takes minutes
    return _costs((folder / "costs").read_text(), asked, count)


def _program(e: Exported, asked: list[Function], count: int) -> str:
    width = sum(a.size for f in asked for a in f.inputs)
    lines = ["#include <stdio.h>", f'#include "{e.prefix}.h"']
    lines += [f"static double in[{count}][{width}], out[200];", "static int status;"]
    calls, at = [], 0
    for f in asked:
        words, to = [], 0
        for a in f.arguments:
            words.append(f"in[i] + {at}" if a.given else f"out + {to}")
            at, to = (at + a.size, to) if a.given else (at, to + a.size)
        calls.append(f"status += {f.name}({', '.join(words)});")
    lines.append(f"#define CALLS(i) {' '.join(calls)}")
    lines += [
        f"static void state_{i}(void) {{ CALLS({i}) }}".replace("[i]", f"[{i}]")
        for i in range(count)
    ]
    lines += ["int main(void) {", '    FILE *f = fopen("states.bin", "rb");']
    lines += ["    if (fread(in, sizeof in, 1, f) != 1) return 1;"]
    lines += [f"    state_{i}();" for i in range(count)]
    return "\n".join([*lines, "    return 0;", "}", ""]).replace("CALLS(i) ", "CALLS(i) ", 1)


def _costs(text: str, asked: list[Function], count: int) -> dict[str, np.ndarray]:
    found = {f.question: np.zeros(count, dtype=int) for f in asked}
    names: dict[str, str] = {}
    questions = {f.name: f.question for f in asked}
    here, called = -1, ""
    lines = iter(text.splitlines())
    for line in lines:
        if match := re.match(r"(c?)fn=\((\d+)\)(?: (\S+))?", line):
            name = names.setdefault(match[2], match[3] or "")
            if match[1]:
                called = name
            else:
                here = int(name[6:]) if re.fullmatch(r"state_\d+", name) else -1
        elif line.startswith("calls=") and here >= 0 and called in questions:
            found[questions[called]][here] = int(next(lines).split()[-1])
    return found
