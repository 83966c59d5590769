"""The pose on the contacts nearest to measured points: against truth, and what noise permits.

Truth comes from the tests' own closure of the contacts; bounds of Cramer and Rao by differences of
it.
"""

from __future__ import annotations

import numpy as np
import pytest
from oracles.closure import complete_state
from support.families import Case, case
from support.recorded_jaw import on_contacts
from support.speeds import few

import condyle
from condyle.errors import InputError
from condyle.motion import Motion
from condyle.motion.column_units import POSE
from condyle.motion.nearest_pose import NearestPoses, fit_motion, nearest_poses, points_at
from condyle.results.summary import summarize

Array = np.ndarray
MARKERS = {
    "FL": np.array([0.085, 0.025, -0.02]),
    "BL": np.array([0.055, 0.042, -0.03]),
    "FR": np.array([0.083, -0.027, -0.018]),
    "BR": np.array([0.052, -0.043, -0.035]),
}
SHAPE = np.array(list(MARKERS.values()))
# Planes and curved joints, no contact to three.
CASES = few(("k2_n9", "k3_curved", "pss_k1"), "k3_curved")
NOISE = 2e-4  # m


def pose_of(of: Case, q: Array) -> Array:
    still = np.zeros_like(q)
    return np.asarray(complete_state(of.raw, of.states["names"], q, still, still, steps=8)[0])


def nearest(of: Case, measured: Array, start: Array, weights: Array | None = None) -> NearestPoses:
    return nearest_poses(of.mechanism, MARKERS, measured, start, weights)


@pytest.mark.parametrize("name", CASES)
def test_without_noise_the_pose_comes_back_and_with_it_the_nearest(name: str) -> None:
    """From starts 3 mm and 2 degrees away; a marker that is not seen is left out. By 1 mm of
    misfit and weights: neighbours on the contacts are all farther."""
    of, rng = case(name), np.random.default_rng(1)
    true = of.states["pose"]
    measured = points_at(SHAPE, true)
    measured[1, 2] = np.nan
    off = rng.normal(0, 1, true.shape) * np.repeat([0.003, 0.035], 3)
    found = nearest(of, measured, true + off)
    assert found.determined.all()
    np.testing.assert_allclose(found.pose, true, rtol=0, atol=1e-9)
    assert np.isnan(found.after[1, 2]) and np.nanmax(found.after) < 1e-9

    one, weights = true[[3]], np.array([1.0, 4.0, 0.5, 2.0])
    noisy = points_at(SHAPE, one) + rng.normal(0, 0.001, (1, 4, 3))
    pose = nearest(of, noisy, one, weights).pose[0]
    q = pose[[POSE.index(n) for n in of.states["names"]]]

    def misfit(pose: Array) -> float:
        return float((weights[:, None] * (points_at(SHAPE, pose[None]) - noisy)[0] ** 2).sum())

    assert pose == pytest.approx(pose_of(of, q), abs=1e-11)
    for step in np.concatenate([np.eye(len(q)), -np.eye(len(q))]) * 1e-4:
        assert misfit(pose_of(of, q + step)) > misfit(pose)
    assert misfit(nearest(of, noisy, one).pose[0]) > misfit(pose)  # the weights count


@pytest.mark.parametrize("name", CASES)
def test_noise_within_the_bound_of_cramer_and_rao(name: str) -> None:
    of, rng, count, h = case(name), np.random.default_rng(2), 400, 1e-6
    q = of.states["q"][1]
    true = pose_of(of, q)
    steps = h * np.eye(len(q))
    slope = np.array([(pose_of(of, q + d) - pose_of(of, q - d)) / (2 * h) for d in steps]).T
    away = [
        points_at(SHAPE, true + h * c) - points_at(SHAPE, true - h * c) for c in slope.T[:, None]
    ]
    J = np.array(away).reshape(len(q), -1).T / (2 * h)
    bound = np.sqrt(np.diag(slope @ np.linalg.inv(J.T @ J / NOISE**2) @ slope.T))
    many = np.tile(true, (count, 1))
    measured = points_at(SHAPE, many)
    found = nearest(of, measured + rng.normal(0, NOISE, measured.shape), many)
    error = np.sqrt(((found.pose - true) ** 2).mean(axis=0))
    # 400 frames tell a deviation to 3.5 %.
    moves = bound > 1e-12
    assert (error[moves] < 1.15 * bound[moves]).all() and (error[moves] > 0.85 * bound[moves]).all()


def test_a_frame_that_cannot_be_followed_is_left_out() -> None:
    of = case("k3_curved")
    true = np.repeat(of.states["pose"][[1]], 3, axis=0)
    measured, start = points_at(SHAPE, true), true.copy()
    start[1] = np.nan  # no pose without contacts
    measured[2] += 5.0  # nothing of this mechanism gets there
    found = nearest(of, measured, start)
    assert found.determined[0] and not found.determined[1]
    assert set(found.summary()) == {*MARKERS, "all"}
    np.testing.assert_allclose(found.pose[0], true[0], atol=1e-9)
    if found.determined[2]:  # the nearest there is: on the contacts
        q = found.pose[2][[POSE.index(n) for n in of.states["names"]]]
        np.testing.assert_allclose(pose_of(of, q), found.pose[2], atol=1e-8)


def measured_poses() -> tuple[Motion, Array]:
    """A jaw that opens, 2 mm too low and turned to a side; gravity is given with it."""
    t = np.linspace(0.0, 1.0, 51)
    open_, side = (1 - np.cos(2 * np.pi * t)) / 2, np.sin(2 * np.pi * t)
    true = np.column_stack([0.003 * open_, 0.001 * side, 0 * t, 0.01 * side, 0.12 * open_, 0 * t])
    true = on_contacts("masticatory", true)
    given = true + open_[:, None] * [0, 0, -0.002, 0.0, 0.0, 0.02]
    columns = dict(zip(POSE, given.T, strict=True)) | {"gx": 0 * t, "gy": 0 * t, "gz": 0 * t - 9.81}
    return Motion.from_arrays(t, columns), given


def test_a_motion_of_whole_poses_is_moved_onto_the_contacts() -> None:
    motion, given = measured_poses()
    machine = condyle.load_mechanism("masticatory")
    got = fit_motion(machine, motion)
    np.testing.assert_allclose(on_contacts("masticatory", got.value), got.value, atol=1e-12)
    assert got.gravity is not None and got.kind == "pose" and got.contact_fit is not None
    # Less than keeping X, Y, alpha and beta moves the same points.
    points = {c.name: c.point for c in machine.contacts} | dict(machine.platform.points)
    shape = np.array([*points.values()])
    kept = on_contacts("masticatory", given)
    by_kept, by_fit = (
        np.linalg.norm(points_at(shape, p) - points_at(shape, given), axis=-1)
        for p in (kept, got.value)
    )
    assert np.sqrt((by_fit**2).mean()) < 0.6 * np.sqrt((by_kept**2).mean())
    assert set(got.contact_fit) == {*points, "all"}
    rms, most = got.contact_fit["all"]
    assert [rms, most] == pytest.approx([np.sqrt((by_fit**2).mean()), by_fit.max()])
    solution = condyle.run("masticatory", motion, fit=True, backend="numpy")
    np.testing.assert_allclose(solution["pose"].values, got.value, atol=1e-9)
    assert solution.condyle.options["contact_fit"] == got.contact_fit
    assert "moved onto the contacts (RMS, at most)" in str(summarize(solution))
    # What smoothing alone takes off the contacts again is no news.
    smooth = fit_motion(machine, motion, cutoff=8.0)
    assert not condyle.run("masticatory", smooth, backend="numpy").condyle.warnings


def test_motions_that_cannot_be_fitted() -> None:
    motion, _ = measured_poses()
    few_columns = dict(zip(("X", "Y", "alpha", "beta"), motion.value.T[[0, 1, 3, 4]], strict=True))
    with pytest.raises(InputError, match="on the contacts already"):
        condyle.run("masticatory", Motion.from_arrays(motion.t, few_columns), fit=True)
    with pytest.raises(InputError, match="requires --motion"):
        condyle.run("masticatory", fit=True)


def test_no_pose_is_on_another_branch() -> None:
    """A curved jaw wide open and turned far to a side: its coordinates mean the other side."""
    yaw = np.linspace(-0.5, -0.3, 5)
    start = np.column_stack(
        [np.full(5, v) for v in (0.0053, -0.0019, -0.0127, 0.0016, 0.2491)] + [yaw]
    )
    machine = condyle.load_mechanism("human-jaw-curved")
    found = nearest_poses(machine, MARKERS, points_at(SHAPE, start), start)
    again = on_contacts("human-jaw-curved", found.pose[found.determined])
    np.testing.assert_allclose(again, found.pose[found.determined], atol=1e-9)
    assert not found.determined.all()
