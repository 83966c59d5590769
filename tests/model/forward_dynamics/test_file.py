"""condyle forward: its columns, its digits, its errors."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from support.families import close
from support.loads import load_point_of
from support.machines import model as shared

from condyle.mechanism import COORDINATES

NAMES = ("X", "Y", "alpha", "beta")
RATES = tuple(f"d{name}" for name in NAMES)
WORDS = ("forward", "masticatory", "--states", "in.csv", "--out", "out.csv")


def write(names: list[str], rows: np.ndarray) -> None:
    np.savetxt("in.csv", rows, "%.17g", ",", header=",".join(names), comments="")


def read() -> tuple[list[str], list[list[str]]]:
    head, *rows = Path("out.csv").read_text(encoding="utf-8").splitlines()
    return head.split(","), [row.split(",") for row in rows]


def test_columns_digits_and_rows_that_fail(condyle_command: Callable[..., Any]) -> None:
    """Columns in the contract's order; every cell is the double that Python gets."""
    model, rng = shared("masticatory"), np.random.default_rng(0)
    chains, contacts = model.mechanism.chain_names, model.mechanism.contact_names
    q = rng.uniform(-1, 1, (5, 4)) * [0.002, 0.002, 0.05, 0.08]
    q1, effort = rng.normal(0, 0.5, (5, 4)), rng.normal(0, 0.1, (5, 6))
    force, efforts = rng.normal(0, 5, (5, 3)), [f"tau_{name}" for name in chains]
    write([*NAMES, *RATES, *efforts, "Fx", "Fy", "Fz"], np.hstack([q, q1, effort, force]))
    outcome = condyle_command(*WORDS, "--load-point", "incisor", "--json")
    assert outcome.status == 0 and json.loads(outcome.out)["rows"] == 5
    names, rows = read()
    wanted = [*(f"dd{name}" for name in NAMES), *(f"contact_{name}" for name in contacts)]
    assert names == [*wanted, *COORDINATES, *(f"joint_{name}" for name in chains)]
    load = np.hstack([force, 0 * force]), np.tile(load_point_of(model, "incisor"), (5, 1))
    found = model.forward_dynamics(q, q1, effort, *load, outputs="all")
    wanted = [found.acceleration, found.contact_force, found.pose, found.joint]
    np.testing.assert_array_equal(np.array(rows, dtype=float), np.hstack(wanted))
    # A state in Z and gamma gets its accelerations in these; without rates it is at rest.
    found = model.forward_dynamics(q, q1, effort, outputs="all")
    others = ("Y", "Z", "beta", "gamma")
    at = [COORDINATES.index(name) for name in others]
    head = [*others, *(f"d{n}" for n in others), *(f"tau_{n} [N mm]" for n in chains)]
    write(head, np.hstack([found.pose[:, at], found.pose_rate[:, at], 1e3 * effort]))
    assert condyle_command(*WORDS).status == 0
    columns, cells = read()
    assert columns[:4] == [f"dd{name}" for name in others]
    second = found.pose_acceleration
    close(np.array(cells, dtype=float)[:, :4], second[:, at], 1e-8, np.abs(second).max())
    write([*NAMES, *efforts], np.hstack([q, effort]))
    outcome = condyle_command(*WORDS)
    assert outcome.status == 0 and "the states are at rest" in outcome.err
    rows = np.array(read()[1], dtype=float)[:, :4]
    np.testing.assert_array_equal(rows, model.forward_dynamics(q, 0 * q, effort).acceleration)
    # Rows that fail and columns that are missing.
    q[3, 0], q1[4, 2] = 0.3, 1e200
    names, rows = [*NAMES, *RATES, *efforts], np.hstack([q, q1, effort])
    Path("out.csv").unlink()
    state = "got the pose coordinates Y, alpha, beta; a state of this mechanism has 4"
    for columns, given, said in (
        (names[:-1], rows[:, :-1], [f'column "{names[-1]}" is missing']),
        (names[1:], rows[:, 1:], [state]),
        (names, rows[4:], ["accelerations at row 1 are not finite"]),
        (names, rows, ["cannot reach", "row 4", "1 more samples fail"]),
    ):
        write(columns, given)
        outcome = condyle_command(*WORDS)
        assert outcome.status == 2 and all(text in outcome.err for text in said), outcome.err
        assert not Path("out.csv").exists()
    assert condyle_command(*WORDS, "--flag").status == 0
    columns, cells = read()
    assert columns[-2:] == ["status", "cause"]
    assert [row[-2] for row in cells] == ["ok", "ok", "ok", "unreachable", "overflow"]
    assert cells[3][0] == cells[3][6] == cells[4][0] == ""
