"""A static trial: home and the points are its own, both bodies carry them into other trials."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w
from scipy.spatial.transform import Rotation
from support.recorded_jaw import Jaw, record

from condyle.errors import InputError
from condyle.markers import MarkerMotion, between_trials, motion_from_c3d
from condyle.markers.rigid import common_shape, fit
from condyle.motion import write_table

STATIC: dict[str, Any] = {"file": "static.c3d", "home": [0.0, 0.5]}
ROUNDING = np.array([1e-6] * 3 + [2e-5] * 3)  # single precision, over the least breadth


def trial(folder: Path) -> Jaw:
    """A static trial, written, and a jaw that opens with the head 45 mm away and turned."""
    record(seconds=0.8).write(folder / "static.c3d")
    jaw = record(seconds=1.2)
    jaw.points[:] = jaw.points @ TURN.T + 0.03 * AWAY
    return jaw


TURN = Rotation.from_rotvec([0.3, -0.2, 0.1]).as_matrix()
AWAY = np.array([1.0, -1.0, 0.5])


def carried(jaw: Jaw) -> dict[str, Any]:
    """The points where the head of the trial has them [mm]."""
    return {n: (TURN @ p + 30 * AWAY).tolist() for n, p in jaw.register.items()}


def measured(jaw: Jaw, folder: Path, **changes: Any) -> MarkerMotion:
    tables = jaw.tables(**changes)
    if "static" in changes and "home" not in changes:
        del tables["home"]
    path = folder / "m.toml"
    path.write_text(tomli_w.dumps(tables))
    return motion_from_c3d(jaw.write(folder / "a.c3d"), path, "masticatory")


def error(got: MarkerMotion, jaw: Jaw) -> np.ndarray:
    return np.abs(got.motion.value - jaw.pose).max(axis=0)


def test_both_bodies_carry_the_static_trial(tmp_path: Path) -> None:
    """The head stands elsewhere and turned; the teeth need not be closed in the trial."""
    jaw = trial(tmp_path)
    got = measured(jaw, tmp_path, static=STATIC)
    assert (error(got, jaw) < ROUNDING).all() and got.warnings == ()
    assert got.static is not None and got.static["source"] == "static.c3d"
    assert 0.03 < got.static["head_moved"] < 1.0 and "platform_moved" not in got.static
    assert "From the static trial static.c3d the head is at most" in str(got)
    # The numbers of another trial, taken as if the head had stayed.
    wrong = measured(jaw, tmp_path)
    assert error(wrong, jaw)[:3].max() > 1e-3
    assert "given as numbers: they hold where the head is" in str(wrong)
    assert "given as numbers" not in str(got)
    still = motion_from_c3d(tmp_path / "static.c3d", jaw.tables(), "masticatory")
    assert between_trials([still, got]) == (
        {"a.c3d": pytest.approx({"fixed": 0, "platform": 0}, abs=2e-6)},
        (),
    )
    apart, (said,) = between_trials([still, wrong])
    assert apart["a.c3d"]["fixed"] > 0.02 and "points and markers disagree with static.c3d" in said
    # The trial's own home is held against the static's.
    both = measured(jaw, tmp_path, static=STATIC, home=[0.0, 0.5])
    assert (error(both, jaw) < ROUNDING).all() and both.warnings == ()
    assert both.static is not None and both.static["platform_moved"] < 2e-6


def test_markers_that_moved_on_their_body_are_said(tmp_path: Path) -> None:
    """A brace that slipped by 3 mm between the trials."""
    jaw = trial(tmp_path)
    for name in ("Lower_FL", "Lower_BL", "Lower_FR", "Lower_BR"):
        jaw.at(name)[:] += [0.003, 0.0, 0.0]
    got = measured(jaw, tmp_path, static=STATIC, home=[0.0, 0.5])
    said = "at its home the platform is 3 mm from where it is in the static trial"
    assert said in str(got.warnings)
    still = motion_from_c3d(tmp_path / "static.c3d", jaw.tables(), "masticatory")
    slipped = motion_from_c3d(tmp_path / "a.c3d", jaw.tables(register=carried(jaw)), "masticatory")
    assert "at home the platform is 3 mm" in str(between_trials([still, slipped])[1])


def test_points_of_the_static_trial_itself(tmp_path: Path) -> None:
    """In a table points are in its own unit; a pointed marker may be gone in the trial."""
    jaw, still = trial(tmp_path), record(seconds=0.8)
    columns = {f"{n}_{x}": still.at(n)[:, i] for n in jaw.labels for i, x in enumerate("xyz")}
    write_table(tmp_path / "static.csv", {"t": still.t} | columns)
    register = {name: (np.array(p) / 1e3).tolist() for name, p in jaw.register.items()}
    got = measured(jaw, tmp_path, static=STATIC | {"file": "static.csv"}, register=register)
    assert (error(got, jaw) < ROUNDING).all()
    upper = still.points[:, :4]  # the marker goes with the head
    head = fit(common_shape(upper[:51]), upper)
    still.at("TMJ_L")[:] = head.rotation @ np.array(register["left_condyle"]) + head.position
    still.write(tmp_path / "static.c3d")
    jaw.at("TMJ_L")[:] = np.nan
    pointed = jaw.register | {"left_condyle": "TMJ_L"}
    got = measured(jaw, tmp_path, static=STATIC, register=pointed)
    assert (error(got, jaw) < 2 * ROUNDING).all()


def test_a_static_trial_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        measured(record(seconds=0.8), tmp_path, static={"file": "none.c3d", "home": 0.2})
