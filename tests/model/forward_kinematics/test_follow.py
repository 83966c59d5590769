"""Poses are followed: along paths, up to singularities, and never past one without a word."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest
from oracles.closure import complete_state, independent_coordinates
from oracles.description import Description, joint, read
from oracles.random_mechanism import random_mechanism, random_state
from oracles.rotations import platform_motion

import condyle
from condyle.errors import LostError
from condyle.kinematics.continuation import Steps, follow
from condyle.mechanism import bundled_text
from condyle.mechanism.files import from_data
from condyle.model.forward_kinematics import ForwardKinematics
from condyle.model.forward_kinematics.joint_steps import joint_steps
from condyle.model.forward_kinematics.pose_status import PoseStatus
from condyle.motion import write_table
from condyle.results.pose_rows import pose_states
from condyle.status import Status

Reached = tuple[np.ndarray, np.ndarray]
OK, UNREACHABLE, LOST, INCONSISTENT = PoseStatus


def encoders(d: Description, poses: np.ndarray) -> np.ndarray:
    """Exact joint coordinates of poses, (N, n), by the oracle."""
    rows = []
    for pose in poses:
        motion = platform_motion(pose)
        rows.append([joint(chain, motion.point(chain.M)[0])[0] for chain in d.chains])
    return np.array(rows)


def stewart() -> tuple[ForwardKinematics, Description]:
    raw = tomllib.loads(bundled_text("gough-stewart"))
    return ForwardKinematics(condyle.load_mechanism("gough-stewart")), read(raw)


def line(end: tuple[float, ...], rows: int) -> np.ndarray:
    return np.linspace(0, 1, rows)[:, None] * np.array(end)


@pytest.mark.parametrize("timed", [True, False])
def test_a_path_that_used_to_jump(timed: bool) -> None:
    """From home, each row alone, Newton takes whole steps and leaps in the last sixteen rows."""
    forward, d = stewart()
    poses = line((-0.1374, 0.2007, -0.0314, 0.6675, -0.5572, -0.6443), 401)
    found = forward.solve(encoders(d, poses), np.arange(401.0) if timed else None)
    assert (found.status == 0).all()
    np.testing.assert_allclose(found.pose, poses, rtol=0, atol=1e-12)


FAMILIES = [(("RSS",), 6, 2), (("PSS", "SPS"), 6, 1), (("SPS",), 6, 0), (("RSS", "SPS"), 6, 3)]


@pytest.mark.slow
@pytest.mark.parametrize(("families", "chains", "contacts"), FAMILIES)
def test_round_trips_of_random_mechanisms(
    families: tuple[str, ...], chains: int, contacts: int
) -> None:
    """Paths through two random states, dense, and with few rows far apart."""
    rng = np.random.default_rng(chains + 10 * contacts)
    raw = random_mechanism(rng, families, chains, contacts, surface="mixed")
    d, forward = read(raw), ForwardKinematics(from_data(raw))
    names = independent_coordinates(d)
    a, b = random_state(rng, raw, 2, scale=1.5)["q"]
    for rows in (200, 12):
        u = np.linspace(0, 1, rows)[:, None]
        q = u * a + np.sin(np.pi * u) ** 2 * (b - a)
        zero = np.zeros(len(names))
        try:
            poses = np.array([complete_state(d, names, row, zero, zero)[0] for row in q])
        except ValueError:
            pytest.fail("the path is not reachable; choose another seed")
        given = encoders(d, poses)
        time = np.sort(rng.uniform(0, 1, rows)) + u[:, 0]
        for found in (forward.solve(given, time), forward.solve(given)):
            assert (found.status == 0).all()
            np.testing.assert_allclose(found.pose, poses, rtol=0, atol=1e-10)


@pytest.mark.slow
def test_far_from_home_rows_follow_the_row_before() -> None:
    """Alone, such rows end in minima whose joints differ; in time they are reached exactly."""
    mechanism = condyle.load_mechanism("masticatory")
    model, forward = condyle.derive(mechanism, backend="numpy"), ForwardKinematics(mechanism)
    unit = [model.characteristic_length] * 2 + [1.0] * 2
    ends = np.random.default_rng(5).uniform(-0.5, 0.5, (200, 4)) * unit
    minima = 0
    for end in ends:
        q = line(tuple(end), 101)
        result = model.inverse_dynamics(q, 0 * q, 0 * q, outputs="all")
        if not (result.status != Status.unreachable).all():
            continue
        poses = result.pose
        joints = model.poses.configuration(poses).joint
        alone, timed = forward.solve(joints[-1:]), forward.solve(joints, np.arange(101.0))
        assert (timed.status == 0).all()
        np.testing.assert_allclose(timed.pose, poses, rtol=0, atol=1e-9)
        if alone.status == INCONSISTENT:
            minima += 1
            assert np.abs(alone.residual).max() > 1e-6 and np.isnan(alone.pose).all()
        elif alone.status == 0:
            np.testing.assert_allclose(alone.pose, poses[-1:], rtol=0, atol=1e-9)
    assert minima


@pytest.mark.slow
def test_paths_through_singularities_are_lost_there() -> None:
    """Encoders cannot tell passing a singularity from turning back: no row behind it has a pose."""
    forward, d = stewart()
    steps = joint_steps(condyle.load_mechanism("gough-stewart"))
    rng, passed = np.random.default_rng(1), 0
    for rows in (81, 301):
        for _ in range(25):
            poses = line(tuple(rng.uniform(-1, 1, 6)), rows)
            bow = rng.uniform(-0.5, 0.5, 6) * np.sin(np.linspace(0, np.pi, rows))[:, None] ** 2
            given = encoders(d, poses + bow)
            found = forward.solve(given, np.arange(float(rows)))
            sign = np.linalg.slogdet(steps.step(poses + bow, given).A).sign
            behind = int(np.argmax(sign != sign[0])) if (sign != sign[0]).any() else rows
            np.testing.assert_allclose(
                found.pose[(found.status == 0)],
                (poses + bow)[(found.status == 0)],
                rtol=0,
                atol=1e-7,
            )
            assert not (found.status == 0)[behind:].any()
            assert (found.status == 0)[: behind - max(2, rows // 20)].all()
            passed += behind < rows
    assert passed > 10


def test_swinging_about_home_is_no_reason_to_be_lost() -> None:
    """Rests, sharp turns, gaps and rows whose encoders are noisy."""
    forward, d = stewart()
    u = np.concatenate([np.linspace(0, 1, 40), np.ones(9), np.linspace(1, -1, 90)])
    poses = u[:, None] * np.array([0.2, -0.1, 0.15, 0.4, -0.3, 0.5])
    given = encoders(d, poses)
    time = np.arange(float(len(u)))
    noisy = given + 1e-4 * np.random.default_rng(0).normal(size=given.shape)
    for joints, atol in ((given, 1e-12), (noisy, 1e-3)):
        found = forward.solve(joints, time)
        assert (found.status == 0).all()
        np.testing.assert_allclose(found.pose, poses, rtol=0, atol=atol)
    holes = [0, 7, 8, 60]
    given[holes[:3]], given[60] = np.nan, -50.0
    found = forward.solve(given, time)
    np.testing.assert_array_equal(np.flatnonzero(found.status == UNREACHABLE), holes)
    kept = np.delete(np.arange(len(u)), holes)
    np.testing.assert_allclose(found.pose[kept], poses[kept], rtol=0, atol=1e-12)


def test_one_wrong_encoder_row_is_inconsistent_alone() -> None:
    model = condyle.derive(condyle.load_mechanism("masticatory"), backend="numpy")
    q = line((0.004, 0.002, 0.1, 0.05), 30)
    result = model.inverse_dynamics(q, 0 * q, 0 * q, outputs="all")
    joints = model.poses.configuration(result.pose).joint
    joints[11, 2] += 0.01
    found = ForwardKinematics(condyle.load_mechanism("masticatory")).solve(joints, np.arange(30.0))
    np.testing.assert_array_equal(np.flatnonzero(found.status), [11])
    assert found.status[11] == INCONSISTENT and 1e-4 < np.abs(found.residual[11]).max() < 0.01


def test_the_mechanism_may_stand_at_home_as_a_row_of_its_own() -> None:
    forward, _ = stewart()
    for time in (None, np.zeros(1)):
        found = forward.solve(np.zeros((1, 6)), time)
        assert (found.status == 0).all() and not found.pose.any()


def test_a_lost_track_in_a_file(tmp_path: Path) -> None:
    _, d = stewart()
    # Turning about the vertical by a quarter, this machine is at a singularity.
    poses = line((0, 0, 0, 0, 0, 2.0), 101)
    mechanism = condyle.load_mechanism("gough-stewart")
    joints = encoders(d, poses)
    names = [f"joint_{name}" for name in mechanism.chain_names]
    columns = {"t": np.arange(101.0)} | dict(zip(names, joints.T, strict=True))
    write_table(tmp_path / "in.csv", columns)
    with pytest.raises(LostError, match=r"from row 7[89] on it is not certain") as error:
        pose_states(mechanism, tmp_path / "in.csv", tmp_path / "out.csv")
    assert error.value.samples[-1] == 100 and not (tmp_path / "out.csv").exists()
    report = pose_states(mechanism, tmp_path / "in.csv", tmp_path / "out.csv", flag=True)
    assert (
        report.data["failed"] == {"lost": report.data["missing"]} and report.data["missing"] >= 22
    )


def test_candidates_of_another_mode_are_followed_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    """Rows 20 and on begin as the mirror image below the base (Z = -2 m), with the same legs."""
    forward, d = stewart()
    poses = line((-0.1, 0.2, 0.1, 0.3, -0.2, 0.4), 60)
    calls: list[int] = []

    def leaping(steps: Steps, start: np.ndarray, joints: np.ndarray) -> Reached:
        calls.append(len(start))
        found, reached = follow(steps, start, joints)
        if len(calls) == 1:
            found[20:, 2] = -4.0 - found[20:, 2]
            found[20:, 3:5] *= -1
        return found, reached

    monkeypatch.setattr("condyle.model.forward_kinematics.track.follow", leaping)
    found = forward.solve(encoders(d, poses), np.arange(60.0))
    assert (found.status == 0).all() and len(calls) > 2
    np.testing.assert_allclose(found.pose, poses, rtol=0, atol=1e-12)


def test_solutions_have_principal_angles(monkeypatch: pytest.MonkeyPatch) -> None:
    forward, d = stewart()
    poses = line((-0.1, 0.2, 0.1, 0.3, -0.2, 0.4), 3)

    def turning(steps: Steps, start: np.ndarray, joints: np.ndarray) -> Reached:
        found, reached = follow(steps, start, joints)
        return found + 2 * np.pi * np.array([0, 0, 0, 1, 0, -2]), reached

    monkeypatch.setattr("condyle.model.forward_kinematics.solver.follow", turning)
    found = forward.solve(encoders(d, poses))
    np.testing.assert_allclose(found.pose, poses, rtol=0, atol=1e-12)
