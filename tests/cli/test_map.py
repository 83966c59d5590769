"""condyle map: files, pictures, numbers; what is wrong leaves no file."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import condyle
from condyle.analysis.map.map_quantities import QUANTITIES
from condyle.cli import completion

SMALL = ("--over", "X=-3:9:9 mm", "--over", "beta=-8:14:8 deg", "--backend", "numpy")


def test_names_are_those_of_the_library() -> None:
    assert tuple(QUANTITIES) == completion.QUANTITIES


@pytest.mark.slow
def test_a_map_with_its_pictures(condyle_command: Callable[..., Any], tmp_path: Path) -> None:
    done = condyle_command(
        "map", "masticatory", *SMALL, "--quantity", "reachable,effort", "--load", "Fz=-9 N",
        "--hold", "Y=1 mm", "--out", "maps", "--json",
    )  # fmt: skip
    assert (done.status, done.err) == (0, "")
    data = json.loads(done.out)
    assert data["axes"]["X"] == pytest.approx({"low": -3e-3, "high": 9e-3, "count": 9})
    assert 0 < data["volume"]["share"] < 1 and data["volume"]["unit"] == "m rad"
    assert 0 < data["ball"]["radius"] < 3e-3 and data["ball"]["points"] >= 1000
    names = {Path(name).name for name in data["files"]}
    pictures = {f"masticatory-map-{v}.{k}" for v in ("reach", "effort") for k in ("png", "svg")}
    assert names == pictures | {"masticatory-map.nc"} == {p.name for p in Path("maps").iterdir()}
    found = xr.open_dataset("maps/masticatory-map.nc", engine="h5netcdf")
    assert found.cause.dims == ("X", "beta") and found.effort.dims == ("X", "beta", "chain")
    assert found.attrs["load"][2] == -9 and np.isfinite(found.effort).any()


def test_three_coordinates(condyle_command: Callable[..., Any], tmp_path: Path) -> None:
    done = condyle_command(
        "map", "gough-stewart", "--over", "X=-2:2:5 m", "--over", "Y=-2:2:4 m", "--over",
        "Z=-1:1:3 m", "--stroke", "*=-900:900 mm", "--backend", "numpy",
        "--quantity", "condition", "--no-figures",
    )  # fmt: skip
    assert done.status == 0, done.err
    assert "ends at the reach of chain leg_" in done.out and "certified at" in done.out
    found = condyle.open_map("maps/gough-stewart-map.nc")
    assert found.condition.shape == (5, 4, 3) and set(np.unique(found.status)) == {0, 1}


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--over", "X=5:-5:9 mm"), "must be increasing"),
        (("--quantity", "ratoi"), "ratoi"),
        (("--run", "missing.nc"), "missing.nc"),
        (("--margin", "2"), "margin"),
        (("--scheduler", "nobody"), "expected processes, threads, or"),
        (("--distribution", "bouned"), "bounded"),
    ],
)
def test_wrong_input(
    condyle_command: Callable[..., Any], tmp_path: Path, arguments: tuple[str, ...], words: str
) -> None:
    done = condyle_command("map", "masticatory", *arguments)
    assert done.status == 2 and words in done.err + done.out and not list(tmp_path.iterdir())
    assert "Traceback" not in done.err
