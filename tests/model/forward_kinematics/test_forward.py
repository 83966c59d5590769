"""Forward kinematics inverts inverse kinematics, says how well it fits, and finds other modes."""

from __future__ import annotations

from itertools import product
from pathlib import Path

import numpy as np
import pytest
from oracles.random_mechanism import random_mechanism
from oracles.rotations import bryant
from scipy.spatial.transform import Rotation
from support.machines import model as shared
from support.speeds import first

import condyle
from condyle.errors import InconsistentError, InputError, LostError, UnreachableError
from condyle.mechanism import COORDINATES, Mechanism
from condyle.mechanism.coordinates import bryant_angles, rotations
from condyle.mechanism.files import from_data
from condyle.model.forward_kinematics import ForwardKinematics
from condyle.model.forward_kinematics.orientation import principal
from condyle.model.forward_kinematics.pose_status import PoseStatus
from condyle.motion import read_table, write_table
from condyle.results.pose_rows import pose_states
from condyle.status import Status


def poses_and_joints(name: str, count: int, size: float) -> tuple[np.ndarray, np.ndarray]:
    model = shared(name)
    unit = [model.characteristic_length if c in "XYZ" else 1.0 for c in model.independent]
    q = np.random.default_rng(7).uniform(-size, size, (count, len(unit))) * unit
    found = model.inverse_kinematics(q)
    good = found.status != Status.unreachable
    return found.pose[good], found.joint[good]


@pytest.mark.parametrize("name", first(["masticatory-curved", "hexaglide", "human-jaw-curved"], 2))
def test_inverts_inverse_kinematics(name: str) -> None:
    pose, joints = poses_and_joints(name, 60, 0.1)
    found = ForwardKinematics(condyle.load_mechanism(name)).solve(joints)
    assert (found.status == 0).all()
    np.testing.assert_allclose(found.pose, pose, rtol=0, atol=1e-12)
    assert np.abs(found.residual).max() < 1e-11 and (found.condition >= 1).all()


def test_condition_is_of_twists_not_of_angles() -> None:
    """By central differences along turns about fixed axes; near a gimbal lock nothing happens."""
    model = shared("gough-stewart")
    step = 1e-6
    for beta in (0.3, np.pi / 2 - 1e-3):
        pose = np.array([0.005, 0.003, -0.004, 0.2, beta, -0.1])
        joint = model.poses.configuration(pose[None]).joint[0]
        found = model.forward_kinematics(joint, start=pose)
        moved = np.tile(pose, (2, 6, 1))
        for s, rows in zip((step, -step), moved, strict=True):
            rows[:3, :3] += s * model.characteristic_length * np.eye(3)
            turns = Rotation.from_rotvec(s * np.eye(3)).as_matrix()
            rows[3:, 3:] = bryant_angles(turns @ rotations(pose[None, 3:])[0])
        ends = (model.poses.configuration(rows).joint for rows in moved)
        slopes = np.subtract(*ends) / (2 * step)
        assert found.condition == pytest.approx(np.linalg.cond(slopes), rel=1e-4)


def test_noise_is_spread_in_the_least_squares_sense() -> None:
    """At the solution the residual is orthogonal to every motion that the contacts allow.

    Turns of a joint do not matter; a sample without a pose is missing alone.
    """
    pose, joints = poses_and_joints("masticatory", 30, 0.05)
    model, forward = shared("masticatory"), ForwardKinematics(condyle.load_mechanism("masticatory"))
    turned = joints.copy()
    turned[:, 2] += 2 * np.pi
    turned[2] = np.nan
    found = forward.solve(turned)
    good = np.arange(30) != 2
    np.testing.assert_array_equal(found.status == 0, good)
    assert np.isnan(found.pose[2]).all()
    np.testing.assert_allclose(found.pose[good], pose[good], rtol=0, atol=1e-12)
    noise = 1e-4 * np.random.default_rng(1).normal(size=joints.shape)
    refused = forward.solve(joints + noise)
    assert (refused.status == PoseStatus.INCONSISTENT).all()
    assert np.isnan(refused.pose).all() and np.abs(refused.residual).max() > 1e-6
    found = forward.solve(joints + noise, tolerance=1e-3)
    assert (found.status == 0).all()
    left = np.linalg.norm(found.residual, axis=1)
    assert (left > 0).all() and (left <= np.linalg.norm(noise, axis=1) + 1e-15).all()
    for step in 1e-6 * np.eye(4):
        q = found.pose[:, [0, 1, 3, 4]]
        slope = model.inverse_kinematics(q + step).joint - model.inverse_kinematics(q - step).joint
        cosine = (slope * found.residual).sum(axis=1) / np.linalg.norm(slope, axis=1) / left
        assert np.abs(cosine).max() < 1e-5


def test_rows_without_times_never_influence_each_other() -> None:
    _, joints = poses_and_joints("masticatory", 24, 0.3)
    joints = np.vstack([joints, joints[:5] + 0.5, np.full((1, 6), np.nan)])
    order = np.random.default_rng(2).permutation(len(joints))
    forward = ForwardKinematics(condyle.load_mechanism("masticatory"))
    together, mixed = forward.solve(joints), forward.solve(joints[order])
    alone = [forward.solve(row[None]) for row in joints]
    for name in ("pose", "status", "residual"):
        expected = getattr(together, name)
        np.testing.assert_array_equal(getattr(mixed, name), expected[order])
        np.testing.assert_array_equal(np.concatenate([getattr(a, name) for a in alone]), expected)
    with pytest.raises(InputError, match=r"strictly increasing: 1 s follows 1 s \(row 3\)"):
        forward.solve(np.zeros((3, 6)), np.array([0.0, 1.0, 1.0]))


def test_angles_are_principal_values() -> None:
    """The same orientations, with alpha and gamma in (-pi, pi] and beta within a right angle."""
    rng = np.random.default_rng(4)
    pose = np.hstack([rng.normal(size=(300, 3)), rng.uniform(-20, 20, (300, 3))])
    pose[0, 3:], pose[1, 3:] = (np.pi, 0, -np.pi), (-np.pi, 0.5, np.pi)
    told = principal(pose)
    np.testing.assert_allclose(rotations(told[:, 3:]), rotations(pose[:, 3:]), atol=1e-14)
    np.testing.assert_array_equal(told[:, :3], pose[:, :3])
    assert (np.abs(told[:, 4]) <= np.pi / 2).all()
    assert (told[:, [3, 5]] > -np.pi).all() and (told[:, [3, 5]] <= np.pi).all()
    assert told[0, 5] == told[1, 3] == np.pi
    np.testing.assert_array_equal(principal(told), told)
    np.testing.assert_allclose(bryant_angles(rotations(told[:, 3:])), told[:, 3:], atol=1e-7)
    R = np.array([bryant(angles) for angles in pose[:, 3:]])
    np.testing.assert_allclose(rotations(pose[:, 3:]), R, atol=1e-14)


@pytest.mark.filterwarnings("error")
def test_hostile_joints() -> None:
    """Nothing is printed, and nothing called a pose."""
    for name, time in product(("masticatory", "gough-stewart"), (None, [0.0, 1.0])):
        for joint in (1e308, -1e200, 1e154, 1e10):
            found = shared(name).forward_kinematics(np.full((2, 6), joint), time=time)
            assert (found.status != 0).all() and np.isnan(found.pose).all()


# -- files ---------------------------------------------------------------------------------


def write_joints(m: Mechanism, joints: np.ndarray, **more: np.ndarray) -> None:
    names = [f"joint_{name}" for name in m.chain_names]
    write_table(Path("in.csv"), more | dict(zip(names, joints.T, strict=True)))


def test_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Poses of all rows; joints that no pose has, and a track that is lost at a singularity."""
    monkeypatch.chdir(tmp_path)
    files, out = (Path("in.csv"), Path("out.csv")), Path("out.csv")
    mechanism = condyle.load_mechanism("masticatory")
    pose, joints = poses_and_joints("masticatory", 20, 0.05)
    write_joints(mechanism, joints, t=np.arange(20.0))
    report = pose_states(mechanism, *files)
    assert (report.data["rows"], report.data["missing"]) == (20, 0)
    table = read_table(out)
    assert list(table.columns) == ["t", *COORDINATES, "residual", "condition"]
    np.testing.assert_allclose(table.require(COORDINATES), pose, rtol=0, atol=1e-12)
    out.unlink()
    mechanism = condyle.load_mechanism("gough-stewart")
    write_joints(mechanism, np.repeat([[0.0], [-50.0]], 6, axis=1))
    with pytest.raises(UnreachableError, match="row 2"):
        pose_states(mechanism, *files)
    assert not out.exists()
    report = pose_states(mechanism, *files, flag=True)
    assert (report.data["missing"], report.data["failed"]) == (1, {"unreachable": 1})
    assert "1 of 2 poses found (1 unreachable)" in str(report)
    assert out.read_text().splitlines()[2] == "," * 8 + "unreachable"
    out.unlink()
    # Turning about the vertical by a quarter, this machine is at a singularity.
    turned = np.outer(np.linspace(0, 1, 101), [0, 0, 0, 0, 0, 2.0])
    joints = shared("gough-stewart").inverse_kinematics(turned).joint
    write_joints(mechanism, joints, t=np.arange(101.0))
    with pytest.raises(LostError, match=r"from row 7[89] on it is not certain") as error:
        pose_states(mechanism, *files)
    assert error.value.samples[-1] == 100 and not out.exists()
    report = pose_states(mechanism, *files, flag=True)
    missing = report.data["missing"]
    assert report.data["failed"] == {"lost": missing} and missing >= 22


def test_residuals_of_chains_that_turn_and_slide(tmp_path: Path, monkeypatch) -> None:
    """Redundant encoders, one of them wrong: radians and metres never share a column."""
    monkeypatch.chdir(tmp_path)
    files = Path("in.csv"), Path("out.csv")
    raw = random_mechanism(np.random.default_rng(3), families=("RSS", "PSS"), chains=6)
    mechanism, joints = from_data(raw), 1e-4 * np.eye(6)[[1, 0]] * [1, 0, 0, 0, 0, 0]
    write_joints(mechanism, joints)
    with pytest.raises(InconsistentError, match=r"row 2.*raise --tolerance") as error:
        pose_states(mechanism, *files)
    assert error.value.samples == [1] and not files[1].exists()
    report = pose_states(mechanism, *files, tolerance=1e-3)
    table = read_table(files[1])
    assert list(table.columns)[6:] == ["residual_m", "residual_rad", "condition"]
    found = ForwardKinematics(mechanism).solve(joints, tolerance=1e-3)
    for unit, kind in (("rad", "RSS"), ("m", "PSS")):
        mine = [chain.kind == kind for chain in mechanism.chains]
        worst = np.abs(found.residual[:, mine]).max(axis=1)
        np.testing.assert_allclose(table.columns[f"residual_{unit}"], worst, rtol=1e-12, atol=1e-15)
        assert f"{report.data['residual'][unit]:.3g} {unit}" in str(report)
        assert worst[0] < 1e-15 < 1e-7 < worst[1]


# -- assembly modes: several poses of the same joints --------------------------------------


def test_modes_of_a_stewart_platform(tmp_path: Path, monkeypatch) -> None:
    """At home: home, its mirror image below the base, and pairs; each has the joints of home.

    In a file, one mode a row; the pose that `pose_states` finds is one of them.
    """
    mechanism = condyle.load_mechanism("gough-stewart")
    forward = ForwardKinematics(mechanism)
    modes = forward.modes(np.zeros(6))
    assert len(modes.pose) >= 8 and (np.diff(modes.distance) >= 0).all()
    # Legs that leave a flat base for a flat platform do not tell above from below.
    base, platform = (
        np.array([getattr(c, x) for c in mechanism.chains]) for x in ("base", "platform")
    )
    assert np.ptp(base[:, 2]) == np.ptp(platform[:, 2] - base[:, 2]) == 0
    np.testing.assert_array_equal(modes.pose[0], 0)
    np.testing.assert_allclose(modes.pose[-1], [0, 0, 2 * base[0, 2], 0, 0, 0], atol=1e-12)
    length = np.linalg.norm(platform - base, axis=1)
    for pose in modes.pose:
        legs = pose[:3] + platform @ bryant(pose[3:]).T - base
        np.testing.assert_allclose(np.linalg.norm(legs, axis=1), length, atol=1e-12)
    apart = np.abs(modes.pose[:, None] - modes.pose[None]).max(axis=2)
    assert apart[~np.eye(len(apart), dtype=bool)].min() > 0.1
    # The search repeats, and has a seed.
    joints = np.array([[0.0] * 6, [0.1, -0.05, 0.02, 0.03, -0.1, 0.07], [-50.0] * 6])
    first, again, other = (forward.modes(joints[1], seed) for seed in (0, 0, 1))
    np.testing.assert_array_equal(first.pose, again.pose)
    np.testing.assert_allclose(first.pose, other.pose, atol=1e-9)
    assert not np.array_equal(first.pose, other.pose)
    none = forward.modes(joints[2])  # joints that no pose has
    assert none.pose.shape == (0, 6) and none.residual.shape == (0, 6)
    monkeypatch.chdir(tmp_path)
    write_joints(mechanism, joints)
    report = pose_states(mechanism, Path("in.csv"), Path("modes.csv"), every=True)
    table = read_table(Path("modes.csv"))
    assert list(table.columns) == ["row", "mode", *COORDINATES, "distance", "residual", "condition"]
    counts = [int((table.columns["row"] == row).sum()) for row in (1, 2, 3)]
    assert report.data["modes"] == counts == [len(modes.pose), len(first.pose), 0]
    assert str(report).startswith(f"0 to {max(counts)} assembly modes found for 3 rows")
    followed, poses = forward.solve(joints[:2]).pose, table.require(COORDINATES)
    for row in (1, 2):
        own = table.columns["row"] == row
        assert np.abs(poses[own] - followed[row - 1]).max(axis=1).min() < 1e-9
        np.testing.assert_array_equal(table.columns["mode"][own], np.arange(own.sum()) + 1)


def test_the_pose_that_is_followed_is_among_the_modes() -> None:
    forward = ForwardKinematics(condyle.load_mechanism("masticatory-curved"))
    modes = forward.modes(np.zeros(6))
    for pose in (np.zeros(6), forward.solve(np.zeros((1, 6))).pose[0]):
        assert np.abs(modes.pose - pose).max(axis=1).min() < 1e-9
    assert np.abs(modes.residual).max() < 1e-12
