"""Efforts, loads, speeds and stiffness at rest, each by other means."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import linprog
from support.loads import load_point_of, parts

import condyle
from condyle.analysis.map import load_capacity
from condyle.analysis.map.axes import grid_of
from condyle.mechanism.chain import limits

from .conftest import Models

OVER = ["X=0:5:4 mm", "beta=0:8:4 deg"]


def test_efforts_are_those_of_inverse_dynamics(model_of: Models) -> None:
    model = model_of("masticatory")
    found = condyle.workspace_map(
        model, OVER, ["effort", "contact_force"], load="Fz=-20 N,My=0.3", load_point="incisor"
    )
    grid = grid_of(model.mechanism, OVER)
    q = grid.block(0, grid.size)
    point = model.mechanism.platform.points["incisor"]
    load = np.tile([0, 0, -20, 0, 0.3, 0, *point], (len(q), 1))
    right = model.inverse_dynamics(q, 0 * q, 0 * q, *parts(load))
    assert np.isfinite(right.effort).all(axis=1).sum() == len(q) - 1  # one is out of reach
    np.testing.assert_allclose(found.effort.values.reshape(-1, 6), right.effort, rtol=1e-13)
    force = found.contact_force.values.reshape(-1, 2)
    np.testing.assert_allclose(force, right.contact_force, rtol=1e-13)


@pytest.mark.parametrize("side", ["", "below", "above"])
@pytest.mark.parametrize("program", [False, True])
def test_largest_load_is_that_of_a_linear_program(
    model_of: Models, monkeypatch: pytest.MonkeyPatch, side: str, program: bool
) -> None:
    """max s: J^T tau + N lambda = Q_0 - s w, limits of tau, and of lambda where it is unilateral.

    Q_0 and w come from inverse dynamics in the whole pose, which knows nothing of zonotopes.
    """
    mechanism = condyle.load_mechanism("masticatory")
    if side:
        changes: dict[str, object] = {f"contact.{n}.side": side for n in mechanism.contact_names}
        changes |= {f"contact.{n}.one_sided": True for n in mechanism.contact_names}
        mechanism = mechanism.set(changes)
    if program:
        monkeypatch.setattr(load_capacity, "MANY", 0)
    model = condyle.derive(mechanism, backend="numpy")
    direction = np.array([0.3, 0.0, -1.0]) / np.hypot(0.3, 1)
    over = OVER if not program else ["X=0:5:2 mm"]
    found = condyle.workspace_map(model, over, ["load_limit", "pose"], direction=direction)
    poses, loads = found.pose.values.reshape(-1, 6), found.load_limit.values.ravel()
    good = np.isfinite(poses).all(axis=1)
    assert good.any() and np.isnan(loads[~good]).all()
    poses, loads = poses[good], loads[good]
    expected = [by_program(model, pose, direction, side) for pose in poses]
    np.testing.assert_allclose(loads, expected, rtol=1e-7)
    assert len(set(np.round(expected, 6))) > 1


def test_holding_by_facets_and_by_chosen_efforts(
    model_of: Models, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Many columns leave the question to the distribution; where both can answer they agree."""
    model = model_of("masticatory")
    grid = grid_of(model.mechanism, ["X=-3:4:8 mm", "beta=-6:6:8 deg"])
    q = grid.block(0, grid.size)
    survey = model.poses.survey(q, ("pose",))
    pose = survey.values["pose"].T[survey.reached]
    load = np.array([0, 0, -240.0, 0, 0, 0, *load_point_of(model, "incisor")])
    own = load_capacity.LoadCapacity.of(model)
    held = own.holds(pose, load)
    assert 5 < held.sum() < len(held) - 5
    monkeypatch.setattr(load_capacity, "MANY", 0)
    np.testing.assert_array_equal(own.holds(pose, load), held)


def by_program(model: condyle.Model, pose: np.ndarray, direction: np.ndarray, side: str) -> float:
    q = pose[None, [0, 1, 3, 4]]
    J = model.jacobians(q).J_theta[0]  # (n, 6)
    gravity = model.gravity(q, space="X")[0]
    E = condyle_rotation(pose)
    point = load_point_of(model, None)
    force = np.concatenate([direction, E[1].T @ np.cross(E[0] @ point, direction)])
    normals = []
    for contact in model.mechanism.contacts:
        n = np.array([1.1, 0, 1.0]) / np.hypot(1.1, 1)
        normals.append(np.concatenate([n, E[1].T @ np.cross(E[0] @ contact.point, n)]))
    A = np.column_stack([J.T, np.array(normals).T, force])
    own = [limits(chain) for chain in model.mechanism.chains]
    push = {"": (None, None), "below": (None, 0), "above": (0, None)}[side]
    bounds = [*((x.low, x.high) for x in own), push, push, (0, None)]
    cost = np.r_[np.zeros(8), -1.0]
    result = linprog(cost, A_eq=A * 1e2, b_eq=gravity * 1e2, bounds=bounds)
    return float(-result.fun) if result.status == 0 else -np.inf


def condyle_rotation(pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """R, and the axes of the angles' rates."""
    from oracles.rotations import platform_motion

    motion = platform_motion(pose)
    return motion.R, motion.axes


def test_speed_is_the_least_of_all_directions(model_of: Models) -> None:
    model = model_of("hexaglide")
    found = condyle.workspace_map(model, ["X=-20:20:3 mm"], "speed")
    rng = np.random.default_rng(0)
    ways = rng.normal(size=(20_000, 5))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    length = model.characteristic_length
    rates = ways / [1, 1, length, length, length]
    for value, speed in zip(found.X.values, found.speed.values, strict=True):
        J = model.jacobians(np.array([[value, 0, 0, 0, 0]]))
        joints = np.abs(rates @ (J.J_theta[0] @ J.M_J[0]).T)
        most = np.array([limits(chain).speed for chain in model.mechanism.chains])
        allowed = (most / joints).min(axis=1)
        assert allowed.min() >= speed * (1 - 1e-12)
        assert allowed.min() == pytest.approx(speed, rel=0.05)


def test_stiffness_is_the_curvature_of_the_springs_energy(model_of: Models) -> None:
    """E = sum k (theta(q) - theta(q_0))^2 / 2, its second differences from mapped joints."""
    model = model_of("masticatory")
    names, k = model.mechanism.chain_names, np.array([50.0, 60, 70, 80, 90, 100])
    stiffness = dict(zip(names, k, strict=True))
    q = np.array([0.002, 0.0, 0.0, 0.03])
    hold = {"Y": 0.0, "alpha": 0.0, "beta": 0.03}
    found = condyle.workspace_map(
        model, {"X": (0.002, 0.003, 2)}, "stiffness", hold, stiffness=stiffness
    ).isel(X=0)

    def energy(states: np.ndarray) -> np.ndarray:
        joint = model.poses.survey(np.vstack([q, states]), ("joint",)).values["joint"].T
        return 0.5 * ((joint[1:] - joint[0]) ** 2) @ k

    h = np.array([1e-5, 1e-5, 2e-4, 2e-4])
    H = np.empty((4, 4))
    for i in range(4):
        for j in range(4):
            steps = [
                a * h[i] * np.eye(4)[i] + b * h[j] * np.eye(4)[j] for a in (1, -1) for b in (1, -1)
            ]
            E = energy(q + np.array(steps))
            H[i, j] = (E[0] - E[1] - E[2] + E[3]) / (4 * h[i] * h[j])
    matrix = found.stiffness_matrix.values
    np.testing.assert_allclose(matrix, H, atol=1e-4 * np.abs(H).max(), rtol=1e-3)
    scale = np.array([1, 1, *[1 / model.characteristic_length] * 2])
    expected = np.linalg.eigvalsh(scale[:, None] * matrix * scale)
    np.testing.assert_allclose(found.stiffness.values, expected, rtol=1e-9)
