"""condyle derivatives and map: files, pictures, numbers."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from support.machines import model

import condyle
from condyle.errors import InputError, SampleError

from .conftest import read_csv, write_csv


def test_columns_of_derivatives(run: Any) -> None:
    """The table has what the model has."""
    rows = np.random.default_rng(0).normal(0, 1, (2, 12)) * np.repeat([1e-3, 0.1, 1.0], 4)
    names = [p + n for p in ("", "d", "dd") for n in ("X", "Y", "alpha", "beta")]
    write_csv("states.csv", names, rows)
    viscous = "chain.*.actuator.viscous"
    wrt = ("q", "a", "platform.mass", viscous, "gravity")
    asked = [word for by in wrt for word in ("--wrt", by)]
    call = ("derivatives", "masticatory", "--states", "states.csv", "--of", "effort")
    assert run(*call, *asked, "--out", "out.csv").status == 0
    head, cells = read_csv("out.csv")
    table = np.array(cells, dtype=float)
    q, v, a = np.split(rows, 3, axis=1)
    d = model("masticatory").derivatives("effort", wrt, q=q, v=v, a=a)
    for name, i, by, at in (
        ("masseter_left / d beta", 2, "q", 3),
        ("pterygoid_right / d ddX", 5, "a", 0),
        ("temporalis_left / d platform.mass", 0, "platform.mass", ...),
        ("masseter_right / d chain.masseter_left.actuator.viscous", 3, viscous, 2),
        ("masseter_right / d gravity[2]", 3, "gravity", 2),
    ):
        wanted = d["effort", by][:, i]
        wanted = wanted if at is ... else wanted[..., at]
        np.testing.assert_allclose(table[:, head.index(f"d tau_{name}")], wanted, rtol=1e-12)

    given: dict[str, Any] = dict(model=model("masticatory"), states="states.csv", out="out.csv")
    with pytest.raises(InputError, match="there is no 'torque' of states"):
        condyle.derivative_states(**given, of="torque")
    with pytest.raises(InputError, match="effort cannot depend on joint"):
        condyle.derivative_states(**given, wrt="joint")
    write_csv("states.csv", names, [[10, *[0] * 11]])
    with pytest.raises(SampleError, match="row 1 has no derivatives"):
        condyle.derivative_states(**given)
    condyle.derivative_states(**given, flag=True)
    assert Path("out.csv").read_text().splitlines()[1].endswith("unreachable")


@pytest.mark.ci
def test_a_map_with_its_pictures(run: Any) -> None:
    done = run(
        *("map", "masticatory", "--over", "X=-3:9:7 mm", "--over", "beta=-8:14:6 deg"),
        *("--quantity", "reachable,effort", "--load", "Fz=-9 N", "--hold", "Y=1 mm"),
        *("--out", "maps"),
    )
    assert (done.status, done.err) == (0, "")
    data = done.data
    assert data["axes"]["X"] == pytest.approx({"low": -3e-3, "high": 9e-3, "count": 7})
    assert 0 < data["volume"]["share"] < 1 and data["volume"]["unit"] == "m rad"
    assert 0 < data["ball"]["radius"] < 3e-3 and data["ball"]["points"] >= 1000
    names = {Path(name).name for name in data["files"]}
    pictures = {f"masticatory-map-{v}.{k}" for v in ("reach", "effort") for k in ("png", "svg")}
    assert names == pictures | {"masticatory-map.nc"} == {p.name for p in Path("maps").iterdir()}
    found = xr.open_dataset("maps/masticatory-map.nc", engine="h5netcdf")
    assert found.cause.dims == ("X", "beta") and found.effort.dims == ("X", "beta", "chain")
    assert found.attrs["load"][2] == -9 and np.isfinite(found.effort).any()


@pytest.mark.ci
def test_three_coordinates(run: Any) -> None:
    done = run(
        *("map", "gough-stewart", "--over", "X=-2:2:5 m", "--over", "Y=-2:2:4 m", "--over"),
        *("Z=-1:1:3 m", "--stroke", "*=-900:900 mm", "--quantity", "condition", "--no-figures"),
    )
    assert done.status == 0, done.err
    assert "ends at the reach of chain leg_" in done.out and "certified at" in done.out
    found = condyle.open_map("maps/gough-stewart-map.nc")
    assert found.condition.shape == (5, 4, 3) and set(np.unique(found.status)) == {0, 1}
