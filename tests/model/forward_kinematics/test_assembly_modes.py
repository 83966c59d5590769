"""Assembly modes: several poses of the same joints, each of them verified."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from oracles.rotations import bryant

import condyle
from condyle.model.forward_kinematics import ForwardKinematics
from condyle.motion import read_table, write_table
from condyle.results.pose_rows import pose_states


def test_modes_of_a_stewart_platform() -> None:
    """At home: home, its mirror image below the base, and pairs; each has the joints of home."""
    mechanism = condyle.load_mechanism("gough-stewart")
    modes = ForwardKinematics(mechanism).modes(np.zeros(6))
    assert len(modes.pose) >= 8
    # Legs that leave a flat base for a flat platform do not tell above from below.
    leg = np.array([np.subtract(chain.platform, chain.base) for chain in mechanism.chains])
    base = np.array([chain.base for chain in mechanism.chains])
    assert np.ptp(base[:, 2]) == np.ptp(leg[:, 2]) == 0
    np.testing.assert_array_equal(modes.pose[0], 0)
    np.testing.assert_allclose(modes.pose[-1], [0, 0, 2 * base[0, 2], 0, 0, 0], atol=1e-12)
    for pose in modes.pose:
        R = bryant(pose[3:])
        for chain in mechanism.chains:
            now = pose[:3] + R @ chain.platform - chain.base
            home = np.subtract(chain.platform, chain.base)
            assert np.linalg.norm(now) == pytest.approx(np.linalg.norm(home), abs=1e-12)
    assert (np.diff(modes.distance) >= 0).all()
    apart = np.abs(modes.pose[:, None] - modes.pose[None]).max(axis=2)
    assert apart[~np.eye(len(apart), dtype=bool)].min() > 0.1


def test_the_search_repeats_and_has_a_seed() -> None:
    forward = ForwardKinematics(condyle.load_mechanism("gough-stewart"))
    joints = np.array([0.1, -0.05, 0.02, 0.03, -0.1, 0.07])
    first, again, other = (forward.modes(joints, seed) for seed in (0, 0, 1))
    np.testing.assert_array_equal(first.pose, again.pose)
    np.testing.assert_allclose(first.pose, other.pose, atol=1e-9)
    assert not np.array_equal(first.pose, other.pose)


def test_modes_of_joints_that_no_pose_has() -> None:
    modes = ForwardKinematics(condyle.load_mechanism("gough-stewart")).modes(np.full(6, -50.0))
    assert modes.pose.shape == (0, 6) and modes.residual.shape == (0, 6)


@pytest.mark.parametrize("name", ["masticatory", "masticatory-curved", "hexaglide"])
def test_the_pose_that_is_followed_is_among_the_modes(name: str) -> None:
    mechanism = condyle.load_mechanism(name)
    forward = ForwardKinematics(mechanism)
    for pose in (np.zeros(6), forward.solve(np.zeros((1, len(mechanism.chains)))).pose[0]):
        modes = forward.modes(np.zeros(len(mechanism.chains)))
        assert np.abs(modes.pose - pose).max(axis=1).min() < 1e-9
        assert np.abs(modes.residual).max() < 1e-12


def test_modes_of_a_file(tmp_path: Path) -> None:
    """One mode a row; the pose that `pose_states` finds is one of them."""
    mechanism = condyle.load_mechanism("gough-stewart")
    joints = np.array([[0.0] * 6, [0.1, -0.05, 0.02, 0.03, -0.1, 0.07], [-50.0] * 6])
    names = [f"joint_{name}" for name in mechanism.chain_names]
    write_table(tmp_path / "in.csv", dict(zip(names, joints.T, strict=True)))
    report = pose_states(mechanism, tmp_path / "in.csv", tmp_path / "modes.csv", every=True)
    pose_states(mechanism, tmp_path / "in.csv", tmp_path / "poses.csv", flag=True)
    table = read_table(tmp_path / "modes.csv")
    coordinates = ("X", "Y", "Z", "alpha", "beta", "gamma")
    assert tuple(table.columns) == (
        "row",
        "mode",
        *coordinates,
        "distance",
        "residual",
        "condition",
    )
    counts = [int((table.columns["row"] == row).sum()) for row in (1, 2, 3)]
    assert report.data["modes"] == counts and counts[0] >= 8 and counts[1] >= 2 and counts[2] == 0
    assert str(report).startswith(f"0 to {max(counts)} assembly modes found for 3 rows")
    followed = np.genfromtxt(tmp_path / "poses.csv", delimiter=",", skip_header=1, max_rows=2)
    modes = table.require(coordinates)
    for row in (1, 2):
        mine = modes[table.columns["row"] == row]
        assert np.abs(mine - followed[row - 1, :6]).max(axis=1).min() < 1e-9
        np.testing.assert_array_equal(
            table.columns["mode"][table.columns["row"] == row], np.arange(len(mine)) + 1
        )
