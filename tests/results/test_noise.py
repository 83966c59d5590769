"""Standard deviations of efforts from those of states, against differences of inverse dynamics."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support import machines

import condyle
from condyle.errors import InputError

pytestmark = pytest.mark.slow  # differences of many models


def solved(model: Any, rows: np.ndarray, noise: Any, folder: Path, **how: Any) -> np.ndarray:
    """Columns sd_tau_<chain>, (N, n)."""
    names = [prefix + name for prefix in ("", "d", "dd") for name in model.independent]
    states, out = folder / "states.csv", folder / "out.csv"
    np.savetxt(states, rows, "%.17g", ",", header=",".join(names), comments="")
    condyle.solve_states(model, states, out, noise=noise, **how)
    head = out.read_text().splitlines()[0].split(",")
    chosen = [head.index(f"sd_tau_{c}") for c in model.mechanism.chain_names]
    return np.genfromtxt(out, delimiter=",", skip_header=1, usecols=chosen)


@pytest.mark.parametrize("name", ["masticatory", "gough-stewart"])
def test_against_differences(name: str, tmp_path: Path) -> None:
    model = machines.model(name)
    m = len(model.independent)
    rng = np.random.default_rng(3)
    rows = rng.normal(size=(3, 3 * m)) * np.repeat([1e-3, 0.1, 1.0], m)
    names = [prefix + one for prefix in ("", "d", "dd") for one in model.independent]
    deviations = rng.uniform(1e-6, 1e-4, 3 * m)
    square = 0.0
    for i, (s, step) in enumerate(zip(deviations, np.repeat([1e-6, 1e-3, 1e-2], m), strict=True)):
        e = np.eye(3 * m)[i] * step
        ends = [model.inverse_dynamics(*np.split(r, 3, 1)).effort for r in (rows + e, rows - e)]
        square = square + ((ends[0] - ends[1]) / (2 * step) * s) ** 2
    found = solved(model, rows, dict(zip(names, deviations, strict=True)), tmp_path)
    np.testing.assert_allclose(found, np.sqrt(square), rtol=1e-6)


WRONG = [
    ("Q=1 mm", 'noise: there is no "Q"'),
    ("X=1 deg", "is not a unit of length"),
    ("X=-1 mm", "noise: X: expected a positive number, got -0.001"),
    ("", "noise: expected at least one of X, Y"),
]


def test_units_a_flagged_row_and_limits_that_do_not_bind(tmp_path: Path) -> None:
    model = machines.model("masticatory")
    rows = np.zeros((2, 12))
    rows[1, 0] = 10.0
    found = solved(model, rows, "X=0.01 mm,ddalpha=2 deg/s^2", tmp_path, flag=True)
    same = solved(model, rows[:1], {"X": 1e-5, "ddalpha": np.radians(2)}, tmp_path)
    np.testing.assert_allclose(found[0], same, rtol=1e-12)
    assert (found[0] > 0).all() and np.isnan(found[1]).all()
    limited = model.with_distribution("bounded")
    found = [solved(m, np.full((1, 12), 1e-3), "X=1 mm", tmp_path) for m in (model, limited)]
    np.testing.assert_allclose(found[1], found[0], rtol=1e-9)
    for noise, message in WRONG:
        with pytest.raises(InputError, match=message):
            solved(model, rows[:1], noise, tmp_path)


def test_numbers_of_the_file_count_too(tmp_path: Path) -> None:
    """Each entry by itself, with states: squares add."""
    model = machines.model("masticatory")
    rows, by = np.full((1, 12), 1e-3), {"platform.mass": 0.01, "chain.masseter_left.base": 1e-4}
    both = solved(
        model, rows, "X=1 mm,platform.mass=0.01,chain.masseter_left.base=0.0001", tmp_path
    )
    square = solved(model, rows, {"X": 1e-3}, tmp_path) ** 2
    for path, deviation in by.items():
        value = np.atleast_1d(np.array(model.mechanism.get(path), dtype=float))
        for step in np.eye(len(value)) * deviation * 1e-2:
            ends = []
            for moved in (value + step, value - step):
                new = moved.tolist() if len(value) > 1 else float(moved[0])
                other = condyle.derive(model.mechanism.set({path: new}), backend="numpy")
                ends.append(other.inverse_dynamics(*np.split(rows, 3, 1)).effort[0])
            square = square + ((ends[0] - ends[1]) / 2e-2) ** 2
    np.testing.assert_allclose(both, np.sqrt(square), rtol=1e-6)
