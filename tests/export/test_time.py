"""Exported C takes the same number of instructions for every sample, however adverse."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from export.instructions import counts
from support.tools import need

import condyle
from condyle.export import Function, export

STATES = 10_000
SPREAD = 1.10
QUESTIONS = ("inverse", "forward", "motion", "closure", "pose", "bite_force")
ODD = (0.0, -0.0, 5e-324, -1e-310, 1e-200, 1e49, 1e300, np.inf, -np.inf, np.nan)


def adverse(f: Function, rng: np.random.Generator) -> dict[str, np.ndarray]:
    """States at bounds, near and at singular poses, out of reach, no numbers, denormal, huge."""
    kind = np.arange(STATES) % 6
    found = {}
    for a in f.inputs:
        x = 0.05 * rng.normal(size=(STATES, a.size))
        x[kind == 1] *= 100  # out of reach, or nearly
        x[kind == 2] *= 10.0 ** rng.uniform(-12, 12, (np.sum(kind == 2), 1))
        x[kind == 3] = rng.choice(ODD, (np.sum(kind == 3), a.size))
        x[kind == 4] *= 1e-307
        if a.name == "q":  # a whole turn in 16 steps: singular poses are among them
            x[kind == 5] = np.pi / 8 * rng.integers(-8, 9, (np.sum(kind == 5), a.size))
        found[a.name] = x
    return found


def test_instructions_do_not_depend_on_the_state(tmp_path: Path) -> None:
    need("valgrind", "gcc")
    exported = export(condyle.load("masticatory"), QUESTIONS, lanes=0, landmark="incisor")
    rng = np.random.default_rng(0)
    found = counts(exported, {f.question: adverse(f, rng) for f in exported.functions}, tmp_path)
    for question, instructions in found.items():
        assert instructions.min() > 0
        assert instructions.max() < SPREAD * instructions.min(), question
