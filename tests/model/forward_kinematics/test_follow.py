"""Poses are followed: along paths, up to singularities, and never past one without a word."""

from __future__ import annotations

import tomllib
from functools import cache

import numpy as np
import pytest
from oracles.closure import complete_state, independent_coordinates
from oracles.description import Description, joint, read
from oracles.random_mechanism import random_mechanism, random_state
from oracles.rotations import platform_motion
from support.machines import model as shared
from support.speeds import first

import condyle
from condyle.kinematics.pose_finder import CONTINUATION, Acceptance, NewtonSteps, find
from condyle.mechanism import bundled_text
from condyle.mechanism.files import from_data
from condyle.model.forward_kinematics import ForwardKinematics
from condyle.model.forward_kinematics.joint_steps import joint_steps
from condyle.model.forward_kinematics.pose_status import PoseStatus
from condyle.status import Status

Reached = tuple[np.ndarray, np.ndarray]
OK, UNREACHABLE, LOST, INCONSISTENT = PoseStatus


def encoders(d: Description, poses: np.ndarray) -> np.ndarray:
    """Exact joint coordinates of poses, (N, n), by the oracle."""
    motions = map(platform_motion, poses)
    return np.array([[joint(c, m.point(c.M)[0])[0] for c in d.chains] for m in motions])


@cache
def stewart() -> tuple[ForwardKinematics, Description]:
    raw = tomllib.loads(bundled_text("gough-stewart"))
    return ForwardKinematics(condyle.load_mechanism("gough-stewart")), read(raw)


def line(end: tuple[float, ...], rows: int) -> np.ndarray:
    return np.linspace(0, 1, rows)[:, None] * np.array(end)


def test_a_path_that_used_to_jump() -> None:
    """From home, each row alone, Newton takes whole steps and leaps in the last sixteen rows."""
    forward, d = stewart()
    poses = line((-0.1374, 0.2007, -0.0314, 0.6675, -0.5572, -0.6443), 401)
    for time in (np.arange(401.0), None):
        found = forward.solve(encoders(d, poses), time)
        assert (found.status == 0).all()
        np.testing.assert_allclose(found.pose, poses, rtol=0, atol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("families", "contacts"), first([(("PSS", "SPS"), 1), (("RSS",), 2), (("RSS", "SPS"), 3)])
)
def test_round_trips_of_random_mechanisms(families: tuple[str, ...], contacts: int) -> None:
    """Paths through two random states, dense, and with few rows far apart."""
    rng = np.random.default_rng(6 + 10 * contacts)
    raw = random_mechanism(rng, families, 6, contacts, surface="mixed")
    d, forward = read(raw), ForwardKinematics(from_data(raw))
    names = independent_coordinates(d)
    a, b = random_state(rng, raw, 2, scale=1.5)["q"]
    zero, dense = np.zeros(len(names)), np.linspace(0, 1, 61)[:, None]
    q = dense * a + np.sin(np.pi * dense) ** 2 * (b - a)
    path = np.array([complete_state(d, names, row, zero, zero)[0] for row in q])
    for poses in (path, path[::5]):
        given = encoders(d, poses)
        time = np.linspace(0, 1, len(poses)) + np.sort(rng.uniform(0, 1, len(poses)))
        for found in (forward.solve(given, time), forward.solve(given)):
            assert (found.status == 0).all()
            np.testing.assert_allclose(found.pose, poses, rtol=0, atol=1e-10)


@pytest.mark.slow
def test_far_from_home_rows_follow_the_row_before() -> None:
    """Alone, such rows end in minima whose joints differ; in time they are reached exactly."""
    model = shared("masticatory")
    forward = ForwardKinematics(model.mechanism)
    unit = [model.characteristic_length] * 2 + [1.0] * 2
    ends = np.random.default_rng(5).uniform(-0.5, 0.5, (200, 4))[120:] * unit
    minima = 0
    for end in ends:
        result = model.inverse_kinematics(line(tuple(end), 61))
        if (result.status == Status.unreachable).any():
            continue
        poses, joints = result.pose, result.joint
        alone, timed = forward.solve(joints[-1:]), forward.solve(joints, np.arange(61.0))
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
    for _ in range(8):
        poses = line(tuple(rng.uniform(-1, 1, 6)), 81)
        poses += rng.uniform(-0.5, 0.5, 6) * np.sin(np.linspace(0, np.pi, 81))[:, None] ** 2
        given = encoders(d, poses)
        found = forward.solve(given, np.arange(81.0))
        sign = np.linalg.slogdet(steps.step(poses, given).A).sign
        behind = int(np.argmax(sign != sign[0])) if (sign != sign[0]).any() else 81
        ok = found.status == 0
        np.testing.assert_allclose(found.pose[ok], poses[ok], rtol=0, atol=1e-7)
        assert not ok[behind:].any() and ok[: behind - 4].all()
        passed += behind < 81
    assert passed > 2


def test_swinging_about_home_is_no_reason_to_be_lost() -> None:
    """Rests, sharp turns, gaps and rows whose encoders are noisy; one wrong row is alone."""
    forward, d = stewart()
    for home in (forward.solve(np.zeros((1, 6)), time) for time in (None, np.zeros(1))):
        assert (home.status == 0).all() and not home.pose.any()
    u = np.concatenate([np.linspace(0, 1, 40), np.ones(9), np.linspace(1, -1, 90)])
    poses = u[:, None] * np.array([0.2, -0.1, 0.15, 0.4, -0.3, 0.5])
    given, time = encoders(d, poses), np.arange(float(len(u)))
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
    model = shared("masticatory")
    joints = model.inverse_kinematics(line((0.004, 0.002, 0.1, 0.05), 30)).joint
    joints[11, 2] += 0.01
    found = ForwardKinematics(model.mechanism).solve(joints, np.arange(30.0))
    np.testing.assert_array_equal(np.flatnonzero(found.status), [11])
    assert found.status[11] == INCONSISTENT and 1e-4 < np.abs(found.residual[11]).max() < 0.01


def test_candidates_of_another_mode_are_followed_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    """Rows 20 and on begin as the mirror image below the base (Z = -2 m), with the same legs.

    Angles are principal values, whatever turns a search has made.
    """
    forward, d = stewart()
    poses = line((-0.1, 0.2, 0.1, 0.3, -0.2, 0.4), 60)
    calls: list[int] = []

    def leaping(
        steps: NewtonSteps, start: np.ndarray, joints: np.ndarray, by: Acceptance = CONTINUATION
    ) -> Reached:
        if by is CONTINUATION:
            calls.append(len(start))
        found, reached = find(steps, start, joints, by)
        if len(calls) == 1 and by is CONTINUATION:
            found[20:, 2] = -4.0 - found[20:, 2]
            found[20:, 3:5] *= -1
        return found, reached

    def turning(steps: NewtonSteps, start: np.ndarray, joints: np.ndarray) -> Reached:
        found, reached = find(steps, start, joints)
        return found + 2 * np.pi * np.array([0, 0, 0, 1, 0, -2]), reached

    monkeypatch.setattr("condyle.model.forward_kinematics.track.find", leaping)
    found = forward.solve(encoders(d, poses), np.arange(60.0))
    assert (found.status == 0).all() and len(calls) > 2
    np.testing.assert_allclose(found.pose, poses, rtol=0, atol=1e-12)
    monkeypatch.setattr("condyle.model.forward_kinematics.solver.find", turning)
    found = forward.solve(encoders(d, poses[::20]))
    np.testing.assert_allclose(found.pose, poses[::20], rtol=0, atol=1e-12)
