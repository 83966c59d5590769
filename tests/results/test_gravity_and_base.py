"""Motions and states with gravity and the base's motion: from files to every result."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from support import machines

import condyle
from condyle import InputError, Motion, UnsupportedError
from condyle.motion import read_table, write_table
from condyle.motion.column_units import BASE, GRAVITY
from condyle.results.solving import inputs_of
from condyle.results.summary import summarize

T = np.linspace(0, 1, 41)
HEXAGLIDE = ("X", "Y", "alpha", "beta", "gamma")
# A platform that sways on a base that swings and is tilted, up to 0.4 rad.
COLUMNS = {n: 0.01 * np.sin(3 * T + i) for i, n in enumerate(HEXAGLIDE)} | {
    "gx": 9.81 * np.sin(0.4 * T),
    "gy": 0 * T,
    "gz": -9.81 * np.cos(0.4 * T),
    "base_az": np.cos(4 * T),
    "base_wy": np.sin(2 * T),
    "base_dwy": 2 * np.cos(2 * T),
}


@pytest.fixture(scope="module")
def motion() -> Motion:
    return Motion.from_arrays(T, COLUMNS)


@pytest.fixture(scope="module")
def model() -> condyle.Model:
    return machines.model("hexaglide")


@pytest.fixture(scope="module")
def solution(model: condyle.Model, motion: Motion) -> xr.Dataset:
    return model.solve(motion)


def test_a_file_of_a_motion(tmp_path: Path) -> None:
    """Its columns are what is solved, said in the summary and saved."""
    write_table(tmp_path / "a.csv", {"t": T} | COLUMNS)
    motion = Motion.from_csv(tmp_path / "a.csv")
    assert motion.warnings == () and motion.gravity is not None and motion.base is not None
    np.testing.assert_array_equal(motion.gravity[:, 0], COLUMNS["gx"])
    np.testing.assert_array_equal(motion.base[:, BASE.index("base_dwy")], COLUMNS["base_dwy"])
    assert not motion.base[:, BASE.index("base_wx")].any()
    assert list(motion.columns) == ["t", *HEXAGLIDE, *GRAVITY, *BASE]


def test_a_solution(
    model: condyle.Model, motion: Motion, solution: xr.Dataset, tmp_path: Path
) -> None:
    states = (motion.value, motion.rate, motion.acceleration)
    wanted = model.inverse_dynamics(*states, **motion.given, outputs="share")
    np.testing.assert_allclose(solution["effort"], wanted.effort, rtol=1e-14)
    np.testing.assert_allclose(solution["share"].sel(part="base"), wanted.share[:, -2], atol=1e-14)
    still = model.inverse_dynamics(*states)
    assert np.abs(wanted.effort - still.effort).max() > 0.1 * np.abs(still.effort).max()
    summary = summarize(solution)
    assert summary.data["gravity"]["tilt"] == pytest.approx(np.degrees(0.4))
    largest = np.abs(solution["share"].sel(part="base")).max()
    assert summary.data["moving_base"]["value"] == pytest.approx(float(largest))
    assert "at most 22.9 degrees from" in str(summary)
    assert "effort for the base's motion: at most" in str(summary)
    for name, a in motion.given.items():
        np.testing.assert_array_equal(inputs_of(solution)[name], a)
    again = model.solve(motion, reactions=True)
    np.testing.assert_array_equal(again["effort"], solution["effort"])
    solution.condyle.save(tmp_path / "a.nc", tmp_path / "b.csv", tmp_path / "b.parquet")
    xr.testing.assert_identical(solution, condyle.open_solution(tmp_path / "a.nc"))
    for name in ("b.csv", "b.parquet"):
        table = read_table(tmp_path / name).columns
        for column in ("gx", "gz", "base_az", "base_wy", "base_dwy"):
            np.testing.assert_allclose(table[column], COLUMNS[column], atol=1e-15)


def test_columns_between_the_samples_and_units() -> None:
    """Without a column of it, the angular acceleration is the rate of the angular velocity."""
    given = {n: a for n, a in COLUMNS.items() if n != "base_dwy"}
    fine = Motion.from_arrays(T, given, rate=333)
    assert fine.gravity is not None and fine.base is not None
    np.testing.assert_allclose(np.linalg.norm(fine.gravity, axis=1), 9.81, rtol=1e-6)
    np.testing.assert_allclose(fine.base[:, 7], 2 * np.cos(2 * fine.t), atol=1e-4)
    turns = {*HEXAGLIDE[2:], "base_wy"}
    other = {n: np.degrees(a) if n in turns else 1e3 * a for n, a in given.items()}
    other = Motion.from_arrays(T, other, units="mm,deg", rate=333)
    np.testing.assert_allclose(other.base, fine.base, atol=1e-12)
    np.testing.assert_allclose(other.gravity, fine.gravity, atol=1e-12)


def test_what_is_wrong_with_columns(model: condyle.Model, motion: Motion) -> None:
    with pytest.raises(InputError, match="gravity also needs gy"):
        Motion.from_arrays(T, {n: a for n, a in COLUMNS.items() if n != "gy"})
    (said,) = Motion.from_arrays(T, COLUMNS | {"gz": 0.1 * COLUMNS["gz"]}).warnings
    assert "neither the Earth's 9.81 nor none" in said
    with pytest.raises(UnsupportedError, match="columns of gravity and base in open"):
        condyle.simulate(model, {"duration": 0.1}, motion=motion)


def test_variants_and_sweeps(
    model: condyle.Model, motion: Motion, solution: xr.Dataset, tmp_path: Path
) -> None:
    """Of a motion with columns, of one that is projected, and of one without in the same sweep."""
    mass = model.mechanism.platform.mass
    projected = np.insert(motion.value, 2, 0, axis=1)
    projected = Motion.from_arrays(T, projected, ("X", "Y", "Z", "alpha", "beta", "gamma"))
    found = model.variants({"platform.mass": [mass]}).solve(projected)
    np.testing.assert_allclose(found["effort"][0], model.solve(projected)["effort"], rtol=1e-11)
    variants = model.variants({"platform.mass": [mass, 2 * mass]})
    found = variants.solve(motion, keep=["effort", "share"])
    np.testing.assert_allclose(found["effort"][0], solution["effort"], rtol=1e-11, atol=1e-12)
    base = found["share"][0].sel(part="base")
    np.testing.assert_allclose(base, solution["share"].sel(part="base"), atol=1e-12)
    write_table(tmp_path / "moving.csv", {"t": T} | COLUMNS)
    write_table(tmp_path / "still.csv", {"t": T} | {n: COLUMNS[n] for n in HEXAGLIDE})
    study = {
        "motion": [{"file": str(tmp_path / f"{name}.csv")} for name in ("moving", "still")],
        "vary": [{"what": "platform.mass", "values": [mass, 2 * mass]}],
        "measure": {"need": {"of": "share", "take": "max_abs", "over": ["time", "chain"]}},
        "backend": "numpy",
    }
    table = condyle.sweep(study, mechanism=model.mechanism, load=condyle.Load.zero(), workers=1)
    wanted = np.abs(solution["share"]).max(("time", "chain"))
    for part in ("platform", "base"):
        np.testing.assert_allclose(table[f"need.{part}"][0], wanted.sel(part=part), rtol=1e-12)
    assert float(table["need.base"][1]) == 0


def test_states(tmp_path: Path, model: condyle.Model, motion: Motion) -> None:
    """There and back, with deviations by the noise of a sensor of gravity."""
    path, out = tmp_path / "a.parquet", tmp_path / "out.csv"
    states = {n: a for n, a in motion.columns.items() if n != "t"}
    for prefix, rates in (("d", motion.rate), ("dd", motion.acceleration)):
        states |= {prefix + n: rates[:, i] for i, n in enumerate(motion.names)}
    write_table(path, states)
    wanted = model.inverse_dynamics(motion.value, motion.rate, motion.acceleration, **motion.given)
    condyle.solve_states(model, path, out, noise="gravity=0.1")
    columns, chains = read_table(out).columns, model.mechanism.chain_names
    efforts = np.column_stack([columns[f"tau_{c}"] for c in chains])
    np.testing.assert_allclose(efforts, wanted.effort, rtol=1e-12, atol=1e-14)
    assert all((columns[f"sd_tau_{c}"] > 0).all() for c in chains)
    forward = {n: a for n, a in states.items() if not n.startswith("dd")}
    forward |= {f"tau_{c}": a for c, a in zip(chains, wanted.effort.T, strict=True)}
    write_table(path, forward)
    condyle.forward_states(model, path, out)
    back = read_table(out).columns["ddX"]
    np.testing.assert_allclose(back, motion.acceleration[:, 0], atol=1e-9)
