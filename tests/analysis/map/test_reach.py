"""Maps against inverse kinematics from the mechanism's file alone."""

import numpy as np
import pytest
import xarray as xr
from oracles.rotations import per_twist
from support.machines import model as model_from

import condyle

from .inverse import couplers, poses, spare

OVER = ["X=-6:14:60 mm", "beta=-15:35:60 deg"]


@pytest.fixture(scope="module")
def jaw() -> xr.Dataset:
    """3 600 poses of which chains forbid many."""
    quantities = ["pose", "joint", "ratio", "transmission"]
    hold = "Y=1 mm,alpha=2 deg"
    return condyle.workspace_map(model_from("masticatory"), OVER, quantities, hold)


@pytest.fixture(scope="module")
def brute(jaw: xr.Dataset) -> tuple[np.ndarray, np.ndarray]:
    """Poses, and what the couplers have left."""
    X, beta = (a.ravel() for a in np.meshgrid(jaw.X, jaw.beta, indexing="ij"))
    pose = poses(X, 0 * X + 1e-3, 0 * X + np.radians(2), beta)
    return pose, spare(pose)


@pytest.mark.slow
def test_reach_and_who_forbids(jaw: xr.Dataset, brute: tuple[np.ndarray, np.ndarray]) -> None:
    _, left = brute
    clear = (np.abs(left) > 1e-9).all(axis=1)
    assert clear.sum() > 3590
    status, cause = jaw.status.values.ravel(), jaw.cause.values.ravel()
    reached = (left > 0).all(axis=1)
    assert 0.2 < reached.mean() < 0.8
    np.testing.assert_array_equal((status == 0)[clear], reached[clear])
    first = np.where(reached, 0, 1 + (left < 0).argmax(axis=1))
    np.testing.assert_array_equal(cause[clear], first[clear])
    assert len(np.unique(cause)) > 2
    assert jaw.cause.flag_meanings.split()[1] == "chain_temporalis_left"


def test_poses_and_joints(jaw: xr.Dataset, brute: tuple[np.ndarray, np.ndarray]) -> None:
    pose, _ = brute
    good = jaw.status.values.ravel() == 0
    found = jaw.pose.values.reshape(-1, 6)
    np.testing.assert_allclose(found[good], pose[good], atol=1e-12)
    assert np.isnan(found[~good]).all() and np.isnan(jaw.ratio.values.ravel()[~good]).all()
    joint = jaw.joint.values.reshape(-1, 6)
    assert np.abs(couplers(pose[good], joint[good])).max() < 1e-11


def test_ratio_of_differences_of_the_joints(jaw: xr.Dataset) -> None:
    """J_W = -J_A dtheta/dq, with dtheta/dq by differences of mapped joint coordinates."""
    model = model_from("masticatory")
    q = np.array([[0.002, 0.001, 0.03, 0.05], [0.004, -0.001, 0.01, -0.02]])
    h, S = 1e-6, np.vstack([np.eye(4), -np.eye(4)])
    slope = np.stack(
        [(joints(model, q + h * e) - joints(model, q - h * e)) / (2 * h) for e in np.eye(4)], axis=2
    )
    cranks = [chain.lengths["crank"] for chain in model.mechanism.chains]
    for i, state in enumerate(q):
        one = at(model, state, ["transmission", "ratio"])
        pose, *ends = model.inverse_kinematics([state, *(state + h * S)]).pose
        M_J = (np.array(ends[:4]) - ends[4:]).T / (2 * h)
        rates = per_twist(pose, M_J, model.characteristic_length)
        transmission = one.transmission.values.ravel()
        J_W = transmission[:, None] * np.array(cranks)[:, None] * slope[i] @ rates
        sigma = np.linalg.svd(J_W, compute_uv=False)
        size = np.abs(transmission)
        expected = min(sigma[-1] / sigma[0], size.min() / size.max())
        assert one.ratio.values.ravel()[0] == pytest.approx(expected, rel=1e-7)


def joints(model: condyle.Model, q: np.ndarray) -> np.ndarray:
    return np.array([at(model, state, ["joint"]).joint.values.ravel() for state in q])


def at(model: condyle.Model, q: np.ndarray, quantities: list[str]) -> xr.Dataset:
    """A map of which the first point is q."""
    hold = dict(zip(model.independent[1:], q[1:], strict=True))
    over = {model.independent[0]: (q[0], q[0] + 1.0, 2)}
    return condyle.workspace_map(model, over, quantities, hold).isel({model.independent[0]: 0})


@pytest.mark.parametrize("name", ["masticatory-curved", "hexaglide"])
def test_surveys_agree_with_evaluations(name: str) -> None:
    """Where contacts are iterated or closed in closed form, near home and beyond the reach."""
    model = model_from(name)
    rng = np.random.default_rng(1)
    spans = [0.3 * model.characteristic_length if c in "XYZ" else 0.4 for c in model.independent]
    q = rng.uniform(-1, 1, (150, len(spans))) * spans
    still = np.zeros_like(q)
    right = model.inverse_dynamics(q, still, still, outputs="all")
    found = model.poses.survey(q, ("pose", "joint", "ratio", "points", "rates"))
    np.testing.assert_array_equal(found.status == 1, right.status == 1)
    good = right.status == 0
    assert 20 < good.sum() < 150
    c = right.configuration
    np.testing.assert_allclose(found.values["pose"].T[good], right.pose[good], atol=1e-13)
    np.testing.assert_allclose(found.values["joint"].T[good], c.joint[good], atol=1e-11)
    ratio = np.minimum(found.inverse_ratio, found.direct_ratio)[good]
    np.testing.assert_allclose(ratio, c.singularity.ratio[good], atol=1e-12)
    points = np.moveaxis(found.values["points"], -1, 0)[good]
    np.testing.assert_allclose(points, c.contact_point[good], atol=1e-13)
    jacobians = model.jacobians(q[good])
    rates = np.moveaxis(found.values["rates"], -1, 0).transpose(0, 2, 1)[good]
    expected = jacobians.J_theta @ jacobians.M_J
    np.testing.assert_allclose(rates, expected, atol=1e-9 * np.abs(expected).max())
