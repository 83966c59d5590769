"""Forward kinematics inverts inverse kinematics, and says how well it fits."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from oracles.random_mechanism import random_mechanism
from oracles.rotations import bryant
from scipy.spatial.transform import Rotation

import condyle
from condyle.errors import InconsistentError, InputError, UnreachableError
from condyle.mechanism import bundled_mechanisms
from condyle.mechanism.coordinates import bryant_angles, rotations
from condyle.mechanism.files import from_data
from condyle.model.forward_kinematics import ForwardKinematics
from condyle.model.forward_kinematics.orientation import principal
from condyle.model.forward_kinematics.pose_status import PoseStatus
from condyle.motion import read_table, write_table
from condyle.results.pose_rows import pose_states
from condyle.status import Status


def poses_and_joints(name: str, count: int, size: float) -> tuple[np.ndarray, np.ndarray]:
    model = condyle.derive(condyle.load_mechanism(name), backend="numpy")
    m = model.mechanism.degrees_of_freedom
    unit = [model.characteristic_length if c in "XYZ" else 1.0 for c in model.independent]
    q = np.random.default_rng(7).uniform(-size, size, (count, m)) * unit
    result = model.inverse_dynamics(q, 0 * q, 0 * q, outputs="all")
    pose = result.pose[(result.status != Status.unreachable)]
    return pose, model.poses.configuration(pose).joint


@pytest.mark.parametrize("name", bundled_mechanisms())
def test_inverts_inverse_kinematics(name: str) -> None:
    pose, joints = poses_and_joints(name, 200, 0.1)
    found = ForwardKinematics(condyle.load_mechanism(name)).solve(joints)
    assert (found.status == 0).all()
    np.testing.assert_allclose(found.pose, pose, rtol=0, atol=1e-12)
    assert np.abs(found.residual).max() < 1e-11
    assert (found.condition >= 1).all()


def test_condition_is_of_twists_not_of_angles() -> None:
    """By central differences along turns about fixed axes; near a gimbal lock nothing happens."""
    model = condyle.derive("gough-stewart", backend="numpy")
    L, h = model.characteristic_length, 1e-6
    for beta in (0.3, np.pi / 2 - 1e-3):
        pose = np.array([0.005, 0.003, -0.004, 0.2, beta, -0.1])
        joint = model.poses.configuration(pose[None]).joint[0]
        found = model.forward_kinematics(joint, start=pose)
        columns = []
        for i in range(6):
            ends = []
            for step in (h, -h):
                moved = pose.copy()
                if i < 3:
                    moved[i] += step * L
                else:
                    turn = Rotation.from_rotvec(step * np.eye(3)[i - 3]).as_matrix()
                    moved[3:] = bryant_angles(turn @ rotations(pose[None, 3:])[0])
                ends.append(model.poses.configuration(moved[None]).joint[0])
            columns.append((ends[0] - ends[1]) / (2 * h))
        right = np.linalg.cond(np.array(columns).T)
        assert found.condition == pytest.approx(right, rel=1e-4)


def test_turns_of_a_joint_do_not_matter() -> None:
    pose, joints = poses_and_joints("masticatory", 20, 0.05)
    joints[:, 2] += 2 * np.pi
    found = ForwardKinematics(condyle.load_mechanism("masticatory")).solve(joints)
    np.testing.assert_allclose(found.pose, pose, rtol=0, atol=1e-12)


def test_noise_is_spread_in_the_least_squares_sense() -> None:
    """At the solution the residual is orthogonal to every motion that the contacts allow."""
    mechanism = condyle.load_mechanism("masticatory")
    _pose, joints = poses_and_joints("masticatory", 30, 0.05)
    noise = 1e-4 * np.random.default_rng(1).normal(size=joints.shape)
    forward = ForwardKinematics(mechanism)
    refused = forward.solve(joints + noise)
    assert (refused.status == PoseStatus.INCONSISTENT).all()
    assert np.isnan(refused.pose).all() and np.abs(refused.residual).max() > 1e-6
    found = forward.solve(joints + noise, tolerance=1e-3)
    assert (found.status == 0).all()
    left = np.linalg.norm(found.residual, axis=1)
    assert (left > 0).all() and (left <= np.linalg.norm(noise, axis=1) + 1e-15).all()
    step = 1e-6
    model = condyle.derive(mechanism, backend="numpy")
    columns = [0, 1, 3, 4]
    for k in range(4):
        moved = []
        for sign in (1, -1):
            q = found.pose[:, columns].copy()
            q[:, k] += sign * step
            zero = np.zeros_like(q)
            result = model.inverse_dynamics(q, zero, zero, outputs="all")
            moved.append(model.poses.configuration(result.pose).joint)
        slope = (moved[0] - moved[1]) / (2 * step)
        cosine = (slope * found.residual).sum(axis=1) / np.linalg.norm(slope, axis=1) / left
        assert np.abs(cosine).max() < 1e-5


def test_a_sample_without_a_pose_is_missing_alone() -> None:
    _pose, joints = poses_and_joints("gough-stewart", 5, 0.05)
    joints[2] = np.nan
    found = ForwardKinematics(condyle.load_mechanism("gough-stewart")).solve(joints)
    np.testing.assert_array_equal((found.status == 0), [True, True, False, True, True])
    assert np.isnan(found.pose[2]).all() and not np.isnan(found.pose[[0, 1, 3, 4]]).any()


def test_file_in_file_out(tmp_path: Path) -> None:
    mechanism = condyle.load_mechanism("masticatory")
    pose, joints = poses_and_joints("masticatory", 20, 0.05)
    columns = {f"joint_{name}": joints[:, i] for i, name in enumerate(mechanism.chain_names)}
    write_table(tmp_path / "joints.csv", {"t": np.arange(20.0), **columns})
    report = pose_states(mechanism, tmp_path / "joints.csv", tmp_path / "poses.csv")
    assert (report.data["rows"], report.data["missing"]) == (20, 0)
    table = read_table(tmp_path / "poses.csv")
    names = list(table.columns)
    assert names == ["t", "X", "Y", "Z", "alpha", "beta", "gamma", "residual", "condition"]
    np.testing.assert_allclose(table.require(names[1:7]), pose, rtol=0, atol=1e-12)


def test_residuals_of_chains_that_turn_and_slide(tmp_path: Path) -> None:
    """Redundant encoders, one of them wrong: radians and metres never share a column."""
    raw = random_mechanism(np.random.default_rng(3), families=("RSS", "PSS"), chains=6)
    mechanism = from_data(raw)
    names = [f"joint_{name}" for name in mechanism.chain_names]
    write_table(tmp_path / "joints.csv", dict.fromkeys(names, np.zeros(2)) | {names[0]: [0, 1e-4]})
    files = tmp_path / "joints.csv", tmp_path / "poses.csv"
    with pytest.raises(InconsistentError, match=r"row 2.*raise --tolerance") as error:
        pose_states(mechanism, *files)
    assert error.value.samples == [1] and not files[1].exists()
    report = pose_states(mechanism, *files, tolerance=1e-3)
    table = read_table(files[1])
    assert list(table.columns)[6:] == ["residual_m", "residual_rad", "condition"]
    joints = np.array([[0.0] * 6, [1e-4] + [0.0] * 5])
    found = ForwardKinematics(mechanism).solve(joints, tolerance=1e-3)
    for unit, kind in (("rad", "RSS"), ("m", "PSS")):
        mine = [chain.kind == kind for chain in mechanism.chains]
        worst = np.abs(found.residual[:, mine]).max(axis=1)
        np.testing.assert_allclose(table.columns[f"residual_{unit}"], worst, rtol=1e-12, atol=1e-15)
        assert f"{report.data['residual'][unit]:.3g} {unit}" in str(report)
        assert worst[0] < 1e-15 < 1e-7 < worst[1]


def test_joints_that_no_pose_has(tmp_path: Path) -> None:
    mechanism = condyle.load_mechanism("gough-stewart")
    columns = {f"joint_{name}": np.array([0.0, -50.0]) for name in mechanism.chain_names}
    write_table(tmp_path / "joints.csv", columns)
    with pytest.raises(UnreachableError, match="row 2"):
        pose_states(mechanism, tmp_path / "joints.csv", tmp_path / "poses.csv")
    assert not (tmp_path / "poses.csv").exists()
    report = pose_states(mechanism, tmp_path / "joints.csv", tmp_path / "poses.csv", flag=True)
    assert (report.data["missing"], report.data["failed"]) == (1, {"unreachable": 1})
    assert "1 of 2 poses found (1 unreachable)" in str(report)
    assert (tmp_path / "poses.csv").read_text().splitlines()[2] == "," * 8 + "unreachable"


def test_rows_without_times_never_influence_each_other() -> None:
    _pose, joints = poses_and_joints("masticatory", 60, 0.3)
    joints = np.vstack([joints, joints[:5] + 0.5, np.full((1, 6), np.nan)])
    order = np.random.default_rng(2).permutation(len(joints))
    forward = ForwardKinematics(condyle.load_mechanism("masticatory"))
    together, mixed = forward.solve(joints), forward.solve(joints[order])
    alone = [forward.solve(row[None]) for row in joints]
    for name in ("pose", "status", "residual"):
        expected = getattr(together, name)
        np.testing.assert_array_equal(getattr(mixed, name), expected[order])
        np.testing.assert_array_equal(
            np.vstack([getattr(a, name) for a in alone]).squeeze(), expected
        )


def test_times_must_rise() -> None:
    forward = ForwardKinematics(condyle.load_mechanism("gough-stewart"))
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
@pytest.mark.parametrize("name", ["masticatory", "gough-stewart"])
@pytest.mark.parametrize("joint", [1e308, -1e200, 1e154, 1e10])
def test_hostile_joints(name: str, joint: float) -> None:
    """Nothing is printed, and nothing called a pose."""
    model = condyle.derive(name, backend="numpy")
    for time in (None, [0.0, 1.0]):
        found = model.forward_kinematics(np.full((2, 6), joint), time=time)
        assert (found.status != 0).all() and np.isnan(found.pose).all()
