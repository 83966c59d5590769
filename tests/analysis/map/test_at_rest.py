"""Efforts, loads, speeds and stiffness at rest, each by other means."""

from itertools import product

import numpy as np
import pytest
from oracles.rotations import platform_motion
from scipy.optimize import linprog
from support.loads import load_point_of, parts
from support.machines import model as model_from

import condyle
from condyle.analysis.map import load_capacity
from condyle.analysis.map.axes import grid_of
from condyle.mechanism.chain import limits

SIGNS = [*product((1, -1), repeat=2)]
OVER = ["X=0:5:4 mm", "beta=0:8:4 deg"]


def test_efforts_are_those_of_inverse_dynamics() -> None:
    model = model_from("masticatory")
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


@pytest.mark.parametrize("program", [False, True])
@pytest.mark.parametrize("side", ["", "below", "above"])
def test_largest_load_is_that_of_a_linear_program(
    monkeypatch: pytest.MonkeyPatch, side: str, program: bool
) -> None:
    """max s: J^T tau + N lambda = Q_0 - s w, limits of tau, and of lambda where it is unilateral.

    Q_0 and w come from inverse dynamics in the whole pose, which knows nothing of zonotopes.
    """
    mechanism = condyle.load_mechanism("masticatory")
    keys = {"side": side, "one_sided": True} if side else {}
    names = mechanism.contact_names
    mechanism = mechanism.set({f"contact.{n}.{k}": v for n in names for k, v in keys.items()})
    if program:
        monkeypatch.setattr(load_capacity, "MANY", 0)
    model = condyle.derive(mechanism)
    direction = np.array([0.3, 0.0, -1.0]) / np.hypot(0.3, 1)
    over = OVER if not program else ["X=0:5:2 mm"]
    found = condyle.workspace_map(model, over, ["load_limit", "pose"], direction=direction)
    poses, loads = found.pose.values.reshape(-1, 6), found.load_limit.values.ravel()
    good = np.isfinite(poses).all(axis=1)
    assert good.any() and np.isnan(loads[~good]).all()
    expected = [by_program(model, pose, direction, side) for pose in poses[good]]
    np.testing.assert_allclose(loads[good], expected, rtol=1e-7)
    assert len(set(np.round(expected, 6))) > 1


def by_program(model: condyle.Model, pose: np.ndarray, direction: np.ndarray, side: str) -> float:
    motion = platform_motion(pose)

    def line(point: np.ndarray, along: np.ndarray) -> np.ndarray:
        """A force at a point of the platform, as forces on the pose's coordinates."""
        return np.concatenate([along, motion.axes.T @ np.cross(motion.R @ point, along)])

    q = pose[None, [0, 1, 3, 4]]
    n = np.array([1.1, 0, 1.0]) / np.hypot(1.1, 1)
    contacts = [line(contact.point, n) for contact in model.mechanism.contacts]
    force = line(load_point_of(model, None), direction)
    A = np.column_stack([model.jacobians(q).J_theta[0].T, *contacts, force])
    own = [limits(chain) for chain in model.mechanism.chains]
    push = {"": (None, None), "below": (None, 0), "above": (0, None)}[side]
    bounds = [*((x.low, x.high) for x in own), push, push, (0, None)]
    gravity = model.gravity(q, space="X")[0]
    result = linprog(-np.eye(9)[8], A_eq=A * 1e2, b_eq=gravity * 1e2, bounds=bounds)
    return float(-result.fun) if result.status == 0 else -np.inf


def test_holding_by_facets_and_by_chosen_efforts(monkeypatch: pytest.MonkeyPatch) -> None:
    """Many columns leave the question to the distribution; where both can answer they agree."""
    model = model_from("masticatory")
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


def test_speed_is_the_least_of_all_directions() -> None:
    model = model_from("hexaglide")
    found = condyle.workspace_map(model, ["X=-20:20:3 mm"], "speed")
    rng = np.random.default_rng(0)
    ways = rng.normal(size=(5_000, 5))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    length = model.characteristic_length
    rates = ways / [1, 1, length, length, length]
    for value, speed in zip(found.X.values, found.speed.values, strict=True):
        J = model.jacobians(np.array([[value, 0, 0, 0, 0]]))
        joints = np.abs(rates @ (J.J_theta[0] @ J.M_J[0]).T)
        most = np.array([limits(chain).speed for chain in model.mechanism.chains])
        allowed = (most / joints).min(axis=1)
        assert allowed.min() >= speed * (1 - 1e-12)
        assert allowed.min() == pytest.approx(speed, rel=0.1)


def test_stiffness_is_the_curvature_of_the_springs_energy() -> None:
    """E = sum k (theta(q) - theta(q_0))^2 / 2, its second differences from mapped joints."""
    model = model_from("masticatory")
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
    for i, j in product(range(4), repeat=2):
        steps = [a * h[i] * np.eye(4)[i] + b * h[j] * np.eye(4)[j] for a, b in SIGNS]
        E = energy(q + np.array(steps))
        H[i, j] = (E[0] - E[1] - E[2] + E[3]) / (4 * h[i] * h[j])
    matrix = found.stiffness_matrix.values
    np.testing.assert_allclose(matrix, H, atol=1e-4 * np.abs(H).max(), rtol=1e-3)
    scale = np.array([1, 1, *[1 / model.characteristic_length] * 2])
    expected = np.linalg.eigvalsh(scale[:, None] * matrix * scale)
    np.testing.assert_allclose(found.stiffness.values, expected, rtol=1e-9)
