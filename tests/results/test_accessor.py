"""`dataset.condyle`: of solutions, maps and sweeps; what a notebook shows of them."""

from __future__ import annotations

import csv
import json
import weakref
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from support.machines import model

import condyle
from condyle.motion import Motion

pytestmark = pytest.mark.slow  # pictures

PNG = b"\x89PNG"


@pytest.fixture(scope="module")
def datasets() -> dict[str, xr.Dataset]:
    t = np.linspace(0, 1, 11)
    motion = Motion.from_arrays(t, {n: 1e-3 * t for n in ("X", "Y", "alpha", "beta")})
    study = {
        "motion": {"file": "reference", "rate": 5.0},
        "vary": [{"what": "platform.mass", "values": [0.2, 0.3]}],
        "measure": {"peak": {"of": "effort", "take": "max_abs"}},
    }
    return {
        "solution": model("masticatory").solve(motion),
        "map": condyle.workspace_map(
            model("masticatory"), ["X=-5:5:5 mm", "beta=-5:20:4 deg"], "ratio"
        ),
        "sweep": condyle.sweep(study, workers=1),
    }


@pytest.mark.parametrize(
    ("kind", "figure", "said"),
    [
        ("solution", "effort", "peak effort"),
        ("map", "ratio", "reachable: "),
        ("sweep", "scatter", "platform.mass"),
    ],
)
def test_a_cell_shows_picture_and_table(
    datasets: dict[str, xr.Dataset], kind: str, figure: str, said: str
) -> None:
    found = datasets[kind].condyle
    assert found.kind == kind and said in repr(found)
    assert found._repr_html_().startswith('<img src="data:image/png;base64,')
    assert "<pre>" in found._repr_html_() and figure in dir(found.plot)
    drawn = getattr(found.plot, figure)()
    assert drawn._repr_png_().startswith(PNG) and found.plot._repr_png_().startswith(PNG)
    with pytest.raises(AttributeError, match=f'a {kind} has no figure "nothing"'):
        found.plot.nothing  # noqa: B018


@pytest.mark.parametrize("kind", ["map", "sweep"])
def test_maps_and_sweeps_are_saved(
    datasets: dict[str, xr.Dataset], kind: str, tmp_path: Path
) -> None:
    dataset = datasets[kind]
    dataset.condyle.save(tmp_path / "a.nc", tmp_path / "a.csv", tmp_path / "a.mat")
    again = xr.load_dataset(tmp_path / "a.nc", engine="h5netcdf")
    assert again.condyle.kind == kind and again.sizes == dataset.sizes
    with (tmp_path / "a.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == dataset["status"].size
    name = "ratio" if kind == "map" else "peak"
    flat = [float(row[name] or "nan") for row in rows]
    np.testing.assert_array_equal(flat, dataset[name].values.ravel())
    if kind == "map":
        assert [float(row["beta"]) for row in rows[:4]] == dataset["beta"].values.tolist()


def test_a_dataset_of_something_else_says_so(datasets: dict[str, xr.Dataset]) -> None:
    with pytest.raises(condyle.InputError, match='this dataset has no "mechanism"'):
        xr.Dataset().condyle.mechanism  # noqa: B018
    # A dataset that kept its accessor would hold its own arrays until garbage is collected.
    seen = weakref.ref(datasets["solution"].condyle)
    assert seen() is None


def test_older_files_open_with_the_names_of_today(
    datasets: dict[str, xr.Dataset], tmp_path: Path
) -> None:
    old = datasets["solution"].rename(effort="torque", contact_loss="lift_off")
    old.attrs["events"] = json.dumps([{"kind": "lift_off"}])
    old.condyle.save(tmp_path / "old.nc")
    found = condyle.open_solution(tmp_path / "old.nc")
    assert "torque" not in found and found.condyle.events == [{"kind": "contact_loss"}]
    for name in ("effort", "contact_loss"):
        np.testing.assert_array_equal(found[name], datasets["solution"][name])


def test_a_run_is_drawn_on_a_map(datasets: dict[str, xr.Dataset]) -> None:
    [axes, *_] = datasets["map"].condyle.plot.ratio(datasets["solution"]).axes
    pose = datasets["solution"]["pose"].sel(coordinate=["X", "beta"]).values
    drawn = [line.get_xydata() for line in axes.get_lines()]
    assert any(len(one) == 11 and np.allclose(one[:, 0], 1e3 * pose[:, 0]) for one in drawn)
