"""Indentation, area and pressure of contacts in solutions, files, figures, bands and summaries."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import condyle
from condyle.analysis.sweep import Study, with_bands
from condyle.report.figures import PLOTS
from condyle.results.inverse_rows import solve_states
from condyle.results.summary import summarize

R, H, E = 8e-3, 2e-3, 2e6
LAYER = {"kind": "foundation", "modulus": E, "poisson": 0.0, "thickness": H, "radius": R}


@pytest.fixture(scope="module")
def model() -> condyle.Model:
    """Left, unilateral, on a layer; right rigid."""
    left = {"side": "below", "one_sided": True, "compliance": LAYER}
    machine = condyle.load_mechanism("masticatory")
    changes = {f"contact.left_condyle.{key}": value for key, value in left.items()}
    return condyle.derive(machine.set(changes), backend="numpy")


@pytest.fixture(scope="module")
def solution(model: condyle.Model) -> xr.Dataset:
    return model.solve(condyle.reference_motion(), condyle.reference_load())


def test_values_are_the_laws_and_the_rigid_contact_has_none(solution: xr.Dataset) -> None:
    force = solution["contact_force"].values[:, 0]
    pressing = np.fmax(-force, 0)  # from above
    assert 0 < (pressing == 0).sum() < len(force) and solution["contact_loss"][:, 0].any()
    d = np.sqrt(pressing * H / (np.pi * E * R))
    wanted = {"indentation": d, "contact_area": 2 * np.pi * R * d, "peak_pressure": E * d / H}
    wanted |= {"mean_pressure": E * d / H / 2, "energy_density": E * (d / H) ** 2 / 2}
    columns = solution.condyle.columns()
    for name, values in wanted.items():
        np.testing.assert_allclose(solution[name].values[:, 0], values, rtol=1e-10)
        assert np.isnan(solution[name].values[:, 1]).all()
        column = f"{name.removeprefix('contact_')}_left_condyle"
        np.testing.assert_array_equal(columns[column], solution[name].values[:, 0])


def test_they_are_in_every_text(solution: xr.Dataset, tmp_path: Path) -> None:
    most = summarize(solution).data["peak_pressure"]
    k = int(solution["peak_pressure"].values[:, 0].argmax())
    assert [*most] == ["left_condyle"] and most["left_condyle"]["time"] == solution["time"][k]
    assert most["left_condyle"]["area"] == solution["contact_area"].values[k, 0]
    assert "peak pressure: left_condyle" in str(solution.condyle)
    figure = PLOTS["pressure"](solution)
    labels = [axes.get_ylabel() for axes in figure.axes]
    units = {"indentation": "mm", "area": "mm²", "mean pressure": "MPa", "peak pressure": "MPa"}
    units["energy density"] = "kJ/m³"
    assert labels == [f"{axis} [{unit}]" for axis, unit in units.items()]
    drawn = figure.axes[3].get_lines()[0].get_ydata()
    np.testing.assert_allclose(drawn, solution["peak_pressure"].values[:, 0] * 1e-6)
    condyle.write_report(solution, tmp_path / "page.html")
    page = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert "Largest pressure" in page and "Peak pressure" in page


def test_files_of_states_have_them(model: condyle.Model, tmp_path: Path) -> None:
    (tmp_path / "states.csv").write_text("X,Y,alpha,beta,Fz\n0,0,0,0,20\n0.001,0,0,0.01,-20\n")
    solve_states(model, tmp_path / "states.csv", tmp_path / "out.csv", "incisor")
    rows = np.genfromtxt(tmp_path / "out.csv", delimiter=",", names=True)
    force = np.fmax(-rows["contact_left_condyle"], 0)
    d = np.sqrt(force * H / (np.pi * E * R))
    assert (force > 0).any()
    np.testing.assert_allclose(rows["indentation_left_condyle"], d, rtol=1e-10)
    assert np.isnan(rows["area_right_condyle"]).all()


def test_bands_and_variants_have_them(model: condyle.Model) -> None:
    """Peak pressure goes by the root of the modulus: its quantiles are those of the moduli."""
    motion = condyle.trial_motion(model.mechanism, rate=2.0)
    load = condyle.Load.constant((0, 0, -20), point="incisor")
    solution = model.solve(motion, load)
    what = "contact.left_condyle.compliance.modulus"
    study = Study.read({"vary": [{"what": what, "values": [E, 4 * E, 9 * E]}], "backend": "numpy"})
    found = with_bands(solution, study, motion, load, mechanism=model.mechanism, workers=1)
    for name, power in (("peak_pressure", 0.5), ("indentation", -0.5), ("contact_force", 0.0)):
        middle = found[f"{name}_quantile"].sel(quantile=0.5).values[:, 0]
        wanted = solution[name].values[:, 0] * 4**power
        assert (wanted != 0).any()
        np.testing.assert_allclose(middle, wanted, rtol=1e-9)
    batch = model.variants({what: np.array([E, 4 * E]), "platform.mass": np.array([0.2, 0.4])})
    both = batch.solve(motion, load, keep=["indentation"])["indentation"].values
    for i, mass in enumerate((0.2, 0.4)):
        alone = model.mechanism.set({what: E * (1, 4)[i], "platform.mass": mass})
        own = condyle.derive(alone, backend="numpy").solve(motion, load)
        np.testing.assert_allclose(both[i], own["indentation"].values, rtol=1e-9)
