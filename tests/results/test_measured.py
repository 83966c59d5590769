"""What was measured beside a motion: through files, onto a solution, and what is refused."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from scipy.spatial.transform import Rotation
from support.machines import model
from support.recorded_jaw import FIXED, LOWER, PLATFORM, record

from condyle.errors import InputError
from condyle.markers import MeasuredChannels, motion_from_c3d, read_channels
from condyle.motion import Motion, write_table
from condyle.results.solution import open_solution


@pytest.fixture(scope="module")
def channels(tmp_path_factory: pytest.TempPathFactory) -> MeasuredChannels:
    """Eight markers, one of them not seen for a while, and EMG of a crank."""
    jaw = record(seconds=2.0)
    jaw.at("Lower_FL")[150:155] = np.nan
    path = tmp_path_factory.mktemp("channels") / "a.c3d"
    jaw.write(path, channels=[("E", "V")], analog=np.abs(np.sin(jaw.t))[:, None, None])
    name = model("masticatory").mechanism.chain_names[2]
    tables = jaw.tables(emg={"channels": {name: "E"}, "high_pass": 0.0})
    return motion_from_c3d(path, tables, "masticatory").channels


@pytest.fixture(scope="module")
def solution() -> xr.Dataset:
    """A pose of which all is known, at every third sample."""
    jaw = record(seconds=2.0)
    motion = Motion.from_arrays(jaw.t, jaw.pose, ("X", "Y", "Z", "alpha", "beta", "gamma"))
    return model("masticatory").solve(motion).isel(time=slice(20, None, 3))


def test_a_table_comes_back(channels: MeasuredChannels, tmp_path: Path) -> None:
    for name in ("p.csv", "p.parquet"):
        write_table(tmp_path / name, channels.columns())
        got = read_channels(tmp_path / name)
        assert (got.names, got.bodies) == (channels.names, channels.bodies)
        for part in ("t", "points", "residual"):
            np.testing.assert_array_equal(getattr(got, part), getattr(channels, part))
        for chain, values in channels.emg.items():
            np.testing.assert_array_equal(got.emg[chain], values)
        assert np.isnan(got.points[150, 4]).all()


def test_markers_ride_on_the_solution(
    solution: xr.Dataset, channels: MeasuredChannels, tmp_path: Path
) -> None:
    got = solution.condyle.with_measured(channels)
    assert "marker_place" not in solution and isinstance(got, xr.Dataset)
    assert got["marker"].values.tolist() == [*FIXED, *PLATFORM]
    assert got["marker_body"].values.tolist() == ["fixed"] * 4 + ["platform"] * 4
    t = solution["time"].values
    pick = np.searchsorted(channels.t, t - 1e-9)
    np.testing.assert_allclose(got["marker_place"].values, channels.points[pick], atol=1e-12)
    np.testing.assert_allclose(got["marker_residual"].values, channels.residual[pick], atol=1e-12)
    # The solution's platform is where the markers are: they were on its contacts.
    offset = got["marker_offset"].values
    seen = np.isfinite(offset)
    assert 0 < np.nanmax(offset[:, 4:]) < 2e-6 and np.nanmax(offset[:, :4]) < 2e-6
    assert not seen[:, 4].all() and seen[:, [0, 5]].all()
    short = channels.at(channels.t[channels.t < 1.0])
    place = solution.condyle.with_measured(short)["marker_place"].values
    assert np.isnan(place[t >= 1.0]).all() and np.isfinite(place[t < 0.98]).all()
    emg = got["emg"].values
    assert np.isfinite(emg).all(axis=0).tolist() == [c == 2 for c in range(6)]
    got.condyle.save(tmp_path / "s.nc")
    back = open_solution(tmp_path / "s.nc")
    np.testing.assert_array_equal(back["marker_place"].values, got["marker_place"].values)
    assert back["marker_place"].attrs["units"] == "m"
    again = back.condyle.with_measured(MeasuredChannels(channels.t, emg=channels.emg))
    assert "marker_place" not in again and "marker" not in again.dims and "emg" in again


def test_offsets_are_distances_from_the_computed_motion(solution: xr.Dataset) -> None:
    """A marker that swings by 4 mm about its place on the platform; of no body there is none."""
    t, pose = solution["time"].values, solution["pose"].values
    swing = 4e-3 * np.sign(np.sin(40 * t))
    own = np.array(LOWER["Lower_BR"]) + swing[:, None] * [0, 0, 1]
    place = Rotation.from_euler("XYZ", pose[:, 3:]).apply(own) + pose[:, :3]
    for body, wanted in (("platform", np.abs(swing - swing.mean())), ("", np.full(len(t), np.nan))):
        only = MeasuredChannels(t, ("M",), (body,), place[:, None], np.zeros((len(t), 1)))
        got = solution.condyle.with_measured(only)["marker_offset"].values[:, 0]
        np.testing.assert_allclose(got, wanted, atol=1e-9)


Spoil = Callable[[dict[str, np.ndarray]], dict[str, np.ndarray]]
WRONG: list[tuple[Spoil, str]] = [
    (lambda c: {k: v for k, v in c.items() if k != "t"}, 'column "t" is missing'),
    (lambda c: {"t": c["t"]}, "no markers .* and no EMG"),
    (lambda c: {**c, "force": c["t"]}, 'column "force" is neither of a marker'),
    (lambda c: {k: v for k, v in c.items() if k != "Upper_FL_y"}, '"Upper_FL_x", "Upper_FL_z"'),
    (lambda c: {**c, "A_residual_fixed": c["t"]}, '"A_residual_fixed" is neither'),
    (lambda c: {**c, "t": c["t"][::-1].copy()}, "times must be strictly increasing"),
    (
        lambda c: {**c, "t": np.where(c["t"] == 1, np.nan, c["t"])},
        'column "t": got nan, expected a fin',
    ),
    (lambda c: {**c, "Upper_FL_x": np.full(len(c["t"]), np.inf)}, "expected a finite number"),
    (lambda c: {**c, "t": c["t"] + 100}, "no time in common"),
    (lambda c: {**c, "emg_masseter": c["t"]}, 'has no chain "masseter"'),
]


def test_tables_that_cannot_be_used(
    solution: xr.Dataset, channels: MeasuredChannels, tmp_path: Path
) -> None:
    path = tmp_path / "p.csv"
    with pytest.raises(InputError, match="no such file"):
        solution.condyle.with_measured(path)
    for spoil, said in WRONG:
        write_table(path, spoil(channels.columns()))
        with pytest.raises(InputError, match=said) as caught:
            solution.condyle.with_measured(path)
        assert "\n" not in str(caught.value)
    path.write_text("t,A_x,A_y,A_z\n0,1,2,x\n")
    with pytest.raises(InputError, match='got "x", expected a number'):
        solution.condyle.with_measured(path)
    path.write_text("t;A_x;A_y;A_z\n0,5;;2;3\n1;1;;\n")
    np.testing.assert_array_equal(read_channels(path).points[0, 0], [np.nan, 2, 3])
