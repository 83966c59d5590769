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
from condyle.results.solving import given_along
from condyle.results.summary import summarize

T = np.linspace(0, 1, 41)
HEXAGLIDE = ("X", "Y", "alpha", "beta", "gamma")


def columns(tilt: float = 0.4) -> dict[str, np.ndarray]:
    """A platform that sways on a base that swings and is tilted."""
    found = {"t": T, **{n: 0.01 * np.sin(3 * T + i) for i, n in enumerate(HEXAGLIDE)}}
    found |= {"gx": 9.81 * np.sin(tilt * T), "gy": 0 * T, "gz": -9.81 * np.cos(tilt * T)}
    found |= {"base_az": np.cos(4 * T), "base_wy": np.sin(2 * T), "base_dwy": 2 * np.cos(2 * T)}
    return found


def moved() -> Motion:
    return Motion.from_arrays(T, {n: a for n, a in columns().items() if n != "t"})


@pytest.fixture(scope="module")
def model() -> condyle.Model:
    return machines.model("hexaglide")


def test_a_motion_file(tmp_path: Path, model: condyle.Model) -> None:
    write_table(tmp_path / "a.csv", columns())
    motion = Motion.from_csv(tmp_path / "a.csv")
    assert motion.warnings == () and motion.gravity is not None and motion.base is not None
    np.testing.assert_array_equal(motion.gravity[:, 0], columns()["gx"])
    np.testing.assert_array_equal(motion.base[:, BASE.index("base_dwy")], columns()["base_dwy"])
    assert not motion.base[:, BASE.index("base_wx")].any()
    solution = model.solve(motion)
    wanted = model.inverse_dynamics(
        motion.value, motion.rate, motion.acceleration, **motion.given, outputs="share"
    )
    np.testing.assert_allclose(solution["effort"], wanted.effort, rtol=1e-14)
    np.testing.assert_allclose(solution["share"].sel(part="base"), wanted.share[:, -2], atol=1e-14)
    still = model.inverse_dynamics(motion.value, motion.rate, motion.acceleration)
    assert np.abs(wanted.effort - still.effort).max() > 0.1 * np.abs(still.effort).max()
    summary = summarize(solution)
    assert summary.data["gravity"]["tilt"] == pytest.approx(np.degrees(0.4))
    largest = np.abs(solution["share"].sel(part="base")).max()
    assert summary.data["moving_base"]["value"] == pytest.approx(float(largest))
    assert "at most 22.9 degrees from" in str(summary)
    assert "effort for the base's motion: at most" in str(summary)
    for name, a in motion.given.items():
        np.testing.assert_array_equal(given_along(solution)[name], a)
    again = model.solve(motion, reactions=True)
    np.testing.assert_array_equal(again["effort"], solution["effort"])
    solution.condyle.save(tmp_path / "a.nc")
    xr.testing.assert_identical(solution, condyle.open_solution(tmp_path / "a.nc"))
    for name in ("b.csv", "b.parquet"):
        solution.condyle.save(tmp_path / name)
        table = read_table(tmp_path / name).columns
        for column in ("gx", "gz", "base_az", "base_wy", "base_dwy"):
            np.testing.assert_allclose(table[column], columns()[column], atol=1e-15)
    assert list(motion.columns) == ["t", *HEXAGLIDE, *GRAVITY, *BASE]


def test_columns_between_the_samples_and_units() -> None:
    c = columns()
    given = {n: a for n, a in c.items() if n not in ("t", "base_dwy")}
    fine = Motion.from_arrays(T, given, rate=333)
    assert fine.gravity is not None and fine.base is not None
    np.testing.assert_allclose(np.linalg.norm(fine.gravity, axis=1), 9.81, rtol=1e-6)
    # Without a column of it, the angular acceleration is the rate of the angular velocity.
    np.testing.assert_allclose(fine.base[:, 7], 2 * np.cos(2 * fine.t), atol=1e-4)
    turns = {*HEXAGLIDE[2:], "base_wy"}
    other = {n: np.degrees(a) if n in turns else 1e3 * a for n, a in given.items()}
    other = Motion.from_arrays(T, other, units="mm,deg", rate=333)
    np.testing.assert_allclose(other.base, fine.base, atol=1e-12)
    np.testing.assert_allclose(other.gravity, fine.gravity, atol=1e-12)


def test_what_is_wrong_with_columns(model: condyle.Model) -> None:
    c = columns()
    del c["gy"]
    with pytest.raises(InputError, match="gravity also needs gy"):
        Motion.from_arrays(c.pop("t"), c)
    c = columns() | {"gz": 0.1 * columns()["gz"]}
    (said,) = Motion.from_arrays(c.pop("t"), c).warnings
    assert "neither the Earth's 9.81 nor none" in said
    motion = moved()
    with pytest.raises(UnsupportedError, match="columns of gravity and base in open"):
        condyle.simulate(model, {"duration": 0.1}, motion=motion)


def test_variants_and_sweeps(model: condyle.Model) -> None:
    motion = moved()
    mass = model.mechanism.platform.mass
    whole = np.zeros((len(T), 6))
    whole[:, [0, 1, 3, 4, 5]] = motion.value
    projected = Motion.from_arrays(T, whole, ("X", "Y", "Z", "alpha", "beta", "gamma"))
    found = model.variants({"platform.mass": [mass]}).solve(projected)
    np.testing.assert_allclose(found["effort"][0], model.solve(projected)["effort"], rtol=1e-11)
    found = model.variants({"platform.mass": [mass, 2 * mass]}).solve(
        motion, keep=["effort", "share"]
    )
    alone = model.solve(motion)
    np.testing.assert_allclose(found["effort"][0], alone["effort"], rtol=1e-11, atol=1e-12)
    np.testing.assert_allclose(
        found["share"][0].sel(part="base"), alone["share"].sel(part="base"), atol=1e-12
    )


def test_states(tmp_path: Path, model: condyle.Model) -> None:
    name = "a.parquet"
    motion = moved()
    states = {n: a for n, a in motion.columns.items() if n != "t"}
    for prefix, rates in (("d", motion.rate), ("dd", motion.acceleration)):
        states |= {prefix + n: rates[:, i] for i, n in enumerate(motion.names)}
    write_table(tmp_path / name, states)
    wanted = model.inverse_dynamics(motion.value, motion.rate, motion.acceleration, **motion.given)
    condyle.solve_states(model, tmp_path / name, tmp_path / "out.csv", noise="gravity=0.1")
    out = read_table(tmp_path / "out.csv").columns
    chains = model.mechanism.chain_names
    efforts = np.column_stack([out[f"tau_{c}"] for c in chains])
    np.testing.assert_allclose(efforts, wanted.effort, rtol=1e-12, atol=1e-14)
    assert all((out[f"sd_tau_{c}"] > 0).all() for c in chains)
    forward = {n: a for n, a in states.items() if not n.startswith("dd")}
    forward |= {f"tau_{c}": a for c, a in zip(chains, wanted.effort.T, strict=True)}
    write_table(tmp_path / name, forward)
    condyle.forward_states(model, tmp_path / name, tmp_path / "out.csv")
    out = read_table(tmp_path / "out.csv").columns
    np.testing.assert_allclose(out["ddX"], motion.acceleration[:, 0], atol=1e-9)


def test_a_sweep_over_motions_with_and_without(tmp_path: Path, model: condyle.Model) -> None:
    write_table(tmp_path / "moving.csv", columns())
    write_table(tmp_path / "still.csv", {n: columns()[n] for n in ("t", *HEXAGLIDE)})
    mass = model.mechanism.platform.mass
    study = {
        "motion": [{"file": str(tmp_path / f"{name}.csv")} for name in ("moving", "still")],
        "vary": [{"what": "platform.mass", "values": [mass, 2 * mass]}],
        "measure": {"need": {"of": "share", "take": "max_abs", "over": ["time", "chain"]}},
        "backend": "numpy",
    }
    table = condyle.sweep(study, mechanism=model.mechanism, load=condyle.Load.zero(), workers=1)
    wanted = np.abs(model.solve(moved())["share"]).max(("time", "chain"))
    for part in ("platform", "base"):
        np.testing.assert_allclose(table[f"need.{part}"][0], wanted.sel(part=part), rtol=1e-12)
    assert float(table["need.base"][1]) == 0
