"""The fit of one rigid body: against SciPy's, a minimiser, and what gaps leave."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from condyle.markers.marker_checks import outlier
from condyle.markers.rigid import common_shape, continuous_angles, fit

SHAPE = np.array([[80, 30, 20], [50, 45, 25], [82, -28, 22], [48, -44, 35.0]]) * 1e-3


def moved(rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    R = Rotation.random(count, random_state=rng).as_matrix()
    p = rng.normal(0, 1, (count, 3))
    return R, p, SHAPE @ R.transpose(0, 2, 1) + p[:, None]


def test_exact_motions_come_back() -> None:
    R, p, points = moved(np.random.default_rng(0), 50)
    found = fit(SHAPE, points)
    np.testing.assert_allclose(found.rotation, R, atol=1e-13)
    np.testing.assert_allclose(found.position, p, atol=1e-13)
    assert found.largest().max() < 1e-14 * 100
    np.testing.assert_allclose(found.back(points), np.broadcast_to(SHAPE, points.shape), atol=1e-13)
    for body in (SHAPE, SHAPE * [1, 1, 0]):  # mirror images are never taken for rotations
        mirrored = fit(body, (body * [1, -1, 1])[None])
        assert np.linalg.det(mirrored.rotation[0]) == pytest.approx(1)


def test_no_other_motion_fits_better() -> None:
    """Against SciPy's least squares over rotation vector and translation."""
    rng = np.random.default_rng(1)
    _, _, points = moved(rng, 6)
    points += rng.normal(0, 2e-3, points.shape)
    points[2, 1] = np.nan  # one marker of a frame not seen
    found = fit(SHAPE, points)
    for k in range(6):
        seen = np.isfinite(points[k, :, 0])

        def off(x: np.ndarray, k: int = k, seen: np.ndarray = seen) -> np.ndarray:
            turned = SHAPE[seen] @ Rotation.from_rotvec(x[:3]).as_matrix().T
            return (turned + x[3:] - points[k, seen]).ravel()

        start = [*Rotation.from_matrix(found.rotation[k]).as_rotvec(), 0, 0, 0]
        best = least_squares(off, start, xtol=1e-15, ftol=1e-15, gtol=1e-15)
        assert np.nansum(found.residual[k] ** 2) == pytest.approx(2 * best.cost, rel=1e-9)
        turned = Rotation.from_rotvec(best.x[:3]).as_matrix()
        np.testing.assert_allclose(found.rotation[k], turned, atol=1e-6)


def test_too_few_or_lined_up_markers_hold_no_body() -> None:
    _, _, points = moved(np.random.default_rng(2), 3)
    points[0, :2] = np.nan
    assert fit(SHAPE, points).determined.tolist() == [False, True, True]
    line = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [1, 1, 0]]) * 0.05
    there = np.stack([line, line])
    there[0, 3] = np.nan
    assert fit(line, there).determined.tolist() == [False, True]
    assert np.isnan(fit(line, there).largest()[0])


def test_a_shape_keeps_its_size_while_the_head_moves() -> None:
    """A plain mean over a turning body would shrink it."""
    angles = np.linspace(-0.5, 0.5, 41)[:, None] * [0.3, 1.0, -0.5]
    points = SHAPE @ Rotation.from_rotvec(angles).as_matrix().transpose(0, 2, 1)
    points[5:20, 1] = np.nan  # not all markers see the same part of it
    shape = common_shape(points)
    distances = [np.linalg.norm(a[:, None] - a, axis=-1) for a in (shape, SHAPE)]
    np.testing.assert_allclose(*distances, atol=1e-10)
    # It is where the body was on the whole: not turned more than the asymmetry of what was seen.
    assert Rotation.from_matrix(fit(SHAPE, shape[None]).rotation[0]).magnitude() < 0.1


def test_angles_are_continuous_and_those_of_the_convention() -> None:
    t = np.linspace(0, 1, 400)
    angles = np.column_stack([9 * t, 1.2 * np.sin(9 * t), -12 * t])
    R = Rotation.from_euler("XYZ", angles).as_matrix()
    R[7] = np.nan
    found = continuous_angles(R)
    assert np.isnan(found[7]).all()
    np.testing.assert_allclose(np.delete(found, 7, 0), np.delete(angles, 7, 0), atol=1e-12)


def test_the_odd_one_is_the_one_without_which_the_others_fit_best() -> None:
    """Also where the limit is so wide that without others the rest would be within it too.
    Three markers do not tell."""
    for odd in range(4):
        points = SHAPE + np.array([0.3, -0.2, 1.0])
        points[odd] += [0.004, 0.008, -0.008]
        found = outlier(SHAPE, points, within=0.05)
        assert found is not None and found[0] == odd
        assert found[1] == pytest.approx(0.012, rel=1e-9)
        points[odd - 1] = np.nan
        assert outlier(SHAPE, points, within=2e-3) is None
