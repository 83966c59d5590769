"""How true efforts are: required accuracy, proven digits, and deviations by noise."""

from __future__ import annotations

import json
import tomllib
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from oracles.digits import Machine
from support import machines

import condyle
from condyle.errors import AccuracyError, InputError, UnsupportedError
from condyle.mechanism.library import bundled_text


@pytest.fixture(scope="module")
def model() -> condyle.Model:
    return machines.model("masticatory")


def columns(path: Path) -> dict[str, np.ndarray]:
    names = path.read_text().splitlines()[0].split(",")
    return dict(zip(names, np.genfromtxt(path, delimiter=",", skip_header=1).T, strict=True))


# -- bounds ---------------------------------------------------------------------------------------


def test_too_few_digits_of_states_are_an_error(model: condyle.Model, tmp_path: Path) -> None:
    """And bounds are written on request, by every question on files."""
    states, out = tmp_path / "states.csv", tmp_path / "out.csv"
    head, chains = ["X", "Y", "alpha", "beta"], model.mechanism.chain_names
    for question, names in (
        ("solve", head),
        ("forward", [*head, *(f"tau_{c}" for c in chains)]),
        ("pose", [f"joint_{c}" for c in chains]),
    ):
        row = ",".join("0" for _ in names)
        states.write_text("\n".join([",".join(names), row, row]))
        run = partial(getattr(condyle, f"{question}_states"), model, states, out)
        run()
        assert "bound" not in out.read_text()
        run(max_error=1e-8)
        bound = columns(out)["bound"]
        assert (bound > 0).all() and (bound < 1e-8).all()
        with pytest.raises(AccuracyError, match="the relative error at row 1 may be") as caught:
            run(max_error=1e-15)
        assert caught.value.row == 1 and caught.value.samples == [0, 1]
        assert caught.value.bound == 1e-15 < caught.value.value


def test_too_few_digits_of_a_motion_are_an_error(tmp_path: Path) -> None:
    solution = condyle.run(backend="numpy", max_error=1e-8)
    solution.condyle.save(tmp_path / "run.csv")
    np.testing.assert_array_equal(columns(tmp_path / "run.csv")["bound"], solution["bound"])
    with pytest.raises(AccuracyError, match="at t = 0 s"):
        condyle.run(backend="numpy", max_error=1e-15)
    for given in (0, -1e-8, "small", True, float("nan")):
        with pytest.raises(InputError, match="max_error: expected a positive number such as 1e-8"):
            condyle.run(backend="numpy", max_error=given)


def test_few_digits_are_a_warning(model: condyle.Model, tmp_path: Path) -> None:
    """Next to the end of a chain's reach."""
    ray = np.array([1.0, 0, 0, 0])
    near, far = 0.0, 1.0
    for _ in range(60):
        middle = (near + far) / 2
        ok = model.inverse_dynamics(middle * ray, 0 * ray, 0 * ray).status == 0
        near, far = (middle, far) if ok else (near, middle)
    states = tmp_path / "states.csv"
    states.write_text(f"X,Y,alpha,beta\n{near * (1 - 1e-9)!r},0,0,0\n0,0,0,0\n")
    report = condyle.solve_states(model, states, tmp_path / "out.csv")
    (text,) = [t for t in report.data["warnings"] if "few digits" in t]
    assert text.startswith("1 row with few digits: the relative error may be")


# -- proofs ---------------------------------------------------------------------------------------


@pytest.mark.slow
def test_what_is_proven_is_true() -> None:
    """At least as many digits agree with an oracle of 60, from the other text of the machine, whose
    constants are no doubles.
    """
    solution = condyle.run("masticatory-curved", backend="numpy", prove=2)
    proofs, options = json.loads(solution.attrs["proof"]), solution.condyle.options
    names = list(options["independent"])
    machine = Machine(tomllib.loads(bundled_text("masticatory-curved")), names)
    point = solution.condyle.mechanism.platform.points[options["load_point"] or "right_molar"]
    assert len(proofs) == 2
    for proof in proofs:
        here = solution.sel(time=proof["time"])
        parts = ("pose", "pose_rate", "pose_acceleration")
        rows = [here[n].sel(coordinate=names).values for n in parts]
        tau, _ = machine.inverse(here["pose"].values, *rows, here["load"].values, point)
        exact = np.array([float(x) for x in tau])
        off = np.abs(exact - here["effort"].values).max() / np.abs(exact).max()
        assert proof["digits"] > 13 and off < 50 * 10 ** -proof["digits"]
        assert 10 ** -proof["digits"] < proof["bound"]


def test_what_cannot_be_proven() -> None:
    """A number of samples that is none; efforts within limits."""
    for given in (0, -1, 1.5, "all", True):
        with pytest.raises(InputError, match="prove: expected a number of samples, at least 1"):
            condyle.run(backend="numpy", prove=given)
    with pytest.raises(UnsupportedError, match="--distribution minimum_norm"):
        condyle.run("human-jaw", backend="numpy", prove=1)


# -- noise ----------------------------------------------------------------------------------------


def solved(model: Any, rows: np.ndarray, noise: Any, folder: Path, **how: Any) -> np.ndarray:
    """Columns sd_tau_<chain>, (N, n)."""
    names = [prefix + name for prefix in ("", "d", "dd") for name in model.independent]
    states, out = folder / "states.csv", folder / "out.csv"
    np.savetxt(states, rows, "%.17g", ",", header=",".join(names), comments="")
    condyle.solve_states(model, states, out, noise=noise, **how)
    found = columns(out)
    return np.column_stack([found[f"sd_tau_{c}"] for c in model.mechanism.chain_names])


@pytest.mark.slow
def test_deviations_by_states_against_differences(tmp_path: Path) -> None:
    for name in ("masticatory", "gough-stewart"):
        model, rng = machines.model(name), np.random.default_rng(3)
        m = len(model.independent)
        rows = rng.normal(size=(3, 3 * m)) * np.repeat([1e-3, 0.1, 1.0], m)
        names = [prefix + one for prefix in ("", "d", "dd") for one in model.independent]
        deviations, steps = rng.uniform(1e-6, 1e-4, 3 * m), np.repeat([1e-6, 1e-3, 1e-2], m)
        square = 0.0
        for e, s, step in zip(np.diag(steps), deviations, steps, strict=True):
            ends = [model.inverse_dynamics(*np.split(r, 3, 1)).effort for r in (rows + e, rows - e)]
            square = square + ((ends[0] - ends[1]) / (2 * step) * s) ** 2
        found = solved(model, rows, dict(zip(names, deviations, strict=True)), tmp_path)
        np.testing.assert_allclose(found, np.sqrt(square), rtol=1e-6)


@pytest.mark.slow
def test_deviations_by_numbers_of_the_file(model: condyle.Model, tmp_path: Path) -> None:
    """Each entry by itself, with states: squares add."""
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


@pytest.mark.slow
def test_units_of_noise_a_flagged_row_and_limits_that_do_not_bind(
    model: condyle.Model, tmp_path: Path
) -> None:
    rows = np.zeros((2, 12))
    rows[1, 0] = 10.0
    found = solved(model, rows, "X=0.01 mm,ddalpha=2 deg/s^2", tmp_path, flag=True)
    same = solved(model, rows[:1], {"X": 1e-5, "ddalpha": np.radians(2)}, tmp_path)
    np.testing.assert_allclose(found[:1], same, rtol=1e-12)
    assert (found[0] > 0).all() and np.isnan(found[1]).all()
    limited = model.with_distribution("bounded")
    found, same = (solved(m, np.full((1, 12), 1e-3), "X=1 mm", tmp_path) for m in (model, limited))
    np.testing.assert_allclose(found, same, rtol=1e-9)
    for noise, message in (
        ("Q=1 mm", 'noise: unknown name "Q"'),
        ("X=1 deg", "is not a unit of length"),
        ("X=-1 mm", "noise: X: expected a positive number, got -0.001"),
        ("", "noise: expected at least one of X, Y"),
    ):
        with pytest.raises(InputError, match=message):
            solved(model, rows[:1], noise, tmp_path)
