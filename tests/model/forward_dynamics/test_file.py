"""condyle forward: its columns, its digits, its errors."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.loads import load_point_of, parts, with_point

import condyle
from condyle.mechanism import COORDINATES
from condyle.model.model import Model

NAMES = ("X", "Y", "alpha", "beta")
LOAD = ("Fx", "Fy", "Fz")
COUNT = 5

Run = Callable[..., Any]


@pytest.fixture(autouse=True)
def by_numpy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CONDYLE_BACKEND", "numpy")


@pytest.fixture(scope="module")
def model() -> Model:
    return Model(condyle.load_mechanism("masticatory"), backend="numpy")


def drawn(model: Model) -> tuple[np.ndarray, ...]:
    rng = np.random.default_rng(0)
    q = rng.uniform(-1, 1, (COUNT, 4)) * [0.002, 0.002, 0.05, 0.08]
    return q, rng.normal(0, 0.5, (COUNT, 4)), rng.normal(0, 0.1, (COUNT, 6))


def columns_of(model: Model) -> list[str]:
    return [*NAMES, *(f"d{n}" for n in NAMES), *(f"tau_{n}" for n in model.mechanism.chain_names)]


def write(path: Path, names: list[str], rows: np.ndarray) -> Path:
    lines = [",".join(names), *(",".join(repr(float(x)) for x in row) for row in rows)]
    path.write_text("\n".join(lines), encoding="utf-8")
    return path


def read(path: str) -> tuple[list[str], list[list[str]]]:
    head, *rows = Path(path).read_text(encoding="utf-8").splitlines()
    return head.split(","), [row.split(",") for row in rows]


WORDS = ("forward", "masticatory", "--states", "in.csv", "--out", "out.csv")


def test_columns_and_digits(condyle_command: Run, model: Model) -> None:
    """Columns in the contract's order; every cell is the double that Python gets."""
    q, q1, effort = drawn(model)
    force = np.random.default_rng(1).normal(0, 5, (COUNT, 3))
    write(Path("in.csv"), [*columns_of(model), *LOAD], np.hstack([q, q1, effort, force]))
    outcome = condyle_command(*WORDS, "--load-point", "incisor", "--json")
    assert outcome.status == 0
    assert json.loads(outcome.out)["rows"] == COUNT
    names, rows = read("out.csv")
    chains, contacts = model.mechanism.chain_names, model.mechanism.contact_names
    assert names == [
        *(f"dd{name}" for name in NAMES),
        *(f"contact_{name}" for name in contacts),
        *COORDINATES,
        *(f"joint_{name}" for name in chains),
    ]
    load = with_point(np.hstack([force, 0 * force]), load_point_of(model, "incisor"))
    found = model.forward_dynamics(
        q,
        q1,
        effort,
        *parts(load),
        outputs="all",
    )
    wanted = [found.acceleration, found.contact_force, found.pose, found.joint]
    np.testing.assert_array_equal(np.array(rows, dtype=float), np.hstack(wanted))


def test_other_coordinates(condyle_command: Run, model: Model) -> None:
    """A state in Z and gamma gets its accelerations in these."""
    q, q1, effort = drawn(model)
    found = model.forward_dynamics(q, q1, effort, outputs="all")
    names = ("Y", "Z", "beta", "gamma")
    at = [COORDINATES.index(name) for name in names]
    head = [*names, *(f"d{n}" for n in names)]
    head += [f"tau_{n} [N mm]" for n in model.mechanism.chain_names]
    rows = np.hstack([found.pose[:, at], found.pose_rate[:, at], 1e3 * effort])
    write(Path("in.csv"), head, rows)
    assert condyle_command(*WORDS).status == 0
    columns, cells = read("out.csv")
    assert columns[:4] == [f"dd{name}" for name in names]
    second = found.pose_acceleration
    size = np.abs(second).max()
    np.testing.assert_allclose(
        np.array(cells, dtype=float)[:, :4], second[:, at], rtol=0, atol=1e-8 * size
    )


def test_rows_that_fail(condyle_command: Run, model: Model) -> None:
    q, q1, effort = drawn(model)
    q[3, 0] = 0.3
    q1[4, 2] = 1e200
    write(Path("in.csv"), columns_of(model), np.hstack([q, q1, effort]))
    outcome = condyle_command(*WORDS)
    assert outcome.status == 2
    assert "cannot reach" in outcome.err and "row 4" in outcome.err
    assert "1 more samples fail" in outcome.err
    assert not Path("out.csv").exists()
    assert condyle_command(*WORDS, "--flag").status == 0
    names, rows = read("out.csv")
    assert names[-2:] == ["status", "cause"]
    assert [row[-2] for row in rows] == ["ok", "ok", "ok", "unreachable", "overflow"]
    assert rows[3][0] == rows[3][6] == rows[4][0] == ""
    write(Path("in.csv"), columns_of(model), np.hstack([q, q1, effort])[4:])
    outcome = condyle_command(*WORDS)
    assert outcome.status == 2
    assert "accelerations at row 1 are not finite" in outcome.err


def test_without_rates_it_is_at_rest(condyle_command: Run, model: Model) -> None:
    q, _, effort = drawn(model)
    names = columns_of(model)
    write(Path("in.csv"), [*names[:4], *names[8:]], np.hstack([q, effort]))
    outcome = condyle_command(*WORDS)
    assert outcome.status == 0
    assert "the states are at rest" in outcome.err
    found = model.forward_dynamics(q, 0 * q, effort)
    rows = np.array(read("out.csv")[1], dtype=float)
    np.testing.assert_array_equal(rows[:, :4], found.acceleration)


def test_columns_that_are_missing(condyle_command: Run, model: Model) -> None:
    q, q1, effort = drawn(model)
    rows = np.hstack([q, q1, effort])
    write(Path("in.csv"), columns_of(model)[:-1], rows[:, :-1])
    outcome = condyle_command(*WORDS)
    assert outcome.status == 2
    assert f'column "tau_{model.mechanism.chain_names[-1]}" is missing' in outcome.err
    write(Path("in.csv"), columns_of(model)[1:], rows[:, 1:])
    outcome = condyle_command(*WORDS)
    assert outcome.status == 2
    assert "got the pose coordinates Y, alpha, beta; a state of this mechanism has 4" in outcome.err
