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
SHOWN = {
    "solution": ("effort", "peak effort"),
    "map": ("ratio", "reachable: "),
    "sweep": ("scatter", "platform.mass"),
}


@pytest.fixture(scope="module")
def datasets() -> dict[str, xr.Dataset]:
    t = np.linspace(0, 1, 11)
    motion = Motion.from_arrays(t, {n: 1e-3 * t for n in ("X", "Y", "alpha", "beta")})
    study = {
        "motion": [{"file": "reference", "rate": 5.0}],
        "vary": [{"what": "platform.mass", "values": [0.2, 0.3]}],
        "measure": {"peak": {"of": "effort", "take": "max_abs"}},
    }
    over = ["X=-5:5:5 mm", "beta=-5:20:4 deg"]
    return {
        "solution": model("masticatory").solve(motion),
        "map": condyle.workspace_map(model("masticatory"), over, "ratio"),
        "sweep": condyle.sweep(study, workers=1),
    }


def test_a_cell_shows_picture_and_table(datasets: dict[str, xr.Dataset]) -> None:
    for kind, (figure, said) in SHOWN.items():
        found = datasets[kind].condyle
        assert found.kind == kind and said in repr(found)
        html = found._repr_html_()
        assert html.startswith('<img src="data:image/png;base64,') and "<pre>" in html
        assert figure in dir(found.plot)
        with pytest.raises(AttributeError, match=f'a {kind} has no figure "nothing"'):
            found.plot.nothing  # noqa: B018
    plot = datasets["sweep"].condyle.plot
    for drawn in (plot, plot.scatter()):
        assert drawn._repr_png_().startswith(PNG)
    # A run is drawn on a map.
    [axes, *_] = datasets["map"].condyle.plot.ratio(datasets["solution"]).axes
    pose = datasets["solution"]["pose"].sel(coordinate=["X", "beta"]).values
    drawn = [line.get_xydata() for line in axes.get_lines()]
    assert any(len(one) == 11 and np.allclose(one[:, 0], 1e3 * pose[:, 0]) for one in drawn)


def test_maps_and_sweeps_are_saved(datasets: dict[str, xr.Dataset], tmp_path: Path) -> None:
    for kind, name in (("map", "ratio"), ("sweep", "peak")):
        dataset = datasets[kind]
        dataset.condyle.save(*(tmp_path / f"{kind}.{end}" for end in ("nc", "csv", "mat")))
        again = xr.load_dataset(tmp_path / f"{kind}.nc", engine="h5netcdf")
        assert again.condyle.kind == kind and again.sizes == dataset.sizes
        assert (tmp_path / f"{kind}.mat").stat().st_size
        with (tmp_path / f"{kind}.csv").open() as file:
            rows = list(csv.DictReader(file))
        assert len(rows) == dataset["status"].size
        flat = [float(row[name] or "nan") for row in rows]
        np.testing.assert_array_equal(flat, dataset[name].values.ravel())
        if kind == "map":
            assert [float(row["beta"]) for row in rows[:4]] == dataset["beta"].values.tolist()


def test_other_datasets_and_older_files(datasets: dict[str, xr.Dataset], tmp_path: Path) -> None:
    """What is no dataset of condyle says so; files of before have the names of today."""
    with pytest.raises(condyle.InputError, match='this dataset has no "mechanism"'):
        xr.Dataset().condyle.mechanism  # noqa: B018
    # A dataset that kept its accessor would hold its own arrays until garbage is collected.
    seen = weakref.ref(datasets["solution"].condyle)
    assert seen() is None
    old = datasets["solution"].rename(effort="torque", contact_loss="lift_off")
    old.attrs["events"] = json.dumps([{"kind": "lift_off"}])
    old.condyle.save(tmp_path / "old.nc")
    found = condyle.open_solution(tmp_path / "old.nc")
    assert "torque" not in found and found.condyle.events == [{"kind": "contact_loss"}]
    for name in ("effort", "contact_loss"):
        np.testing.assert_array_equal(found[name], datasets["solution"][name])
