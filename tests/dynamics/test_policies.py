"""Friction, actuators, limits and push: dynamics by Pinocchio, active sets in the null space."""

from __future__ import annotations

from importlib.util import find_spec
from typing import Any

import numpy as np
import pytest
from oracles.null_space import least_of_patterns
from oracles.rotations import platform_motion
from oracles.rubbing import losses, touching
from support.rubbing import Rubbing, drawn

from condyle.mechanism.chain import limits
from condyle.model.distributing import Distribution
from condyle.model.model import Model
from condyle.status import Status

pytestmark = pytest.mark.slow

TOLERANCE = 1e-8
RIGID = ("RSS", "PSS", "SPS")
LEAST: dict[str, dict[str, Any]] = {
    "k1": {"contacts": 1, "seed": 31},
    "k2": {"families": ("RSS", "PSS"), "mu": 0.5, "seed": 32},
    "k2 n7 curved": {"chains": 7, "surface": "quadratic", "seed": 33},
    "k2 ball": {"ball_radius": 3.0, "surface": "sphere", "seed": 34},
    "k3": {"contacts": 3, "surface": "mixed", "seed": 35},
    "k3 legs": {"families": ("SPS",), "contacts": 3, "seed": 36},
}
PUSHED: dict[str, dict[str, Any]] = {
    "k1": {"contacts": 1, "limit": 3.0, "seed": 41},
    "k2": {"limit": 4.0, "seed": 42},
    "k2 smooth": {"mu": 0, "limit": 5.0, "seed": 47},
    "k2 ball": {"limit": 4.0, "ball_radius": 3.0, "surface": "sphere", "seed": 44},
    "k3": {"contacts": 3, "limit": 5.0, "chains": 5, "seed": 45},
    "k2 legs": {"families": ("SPS",), "limit": 4.0, "seed": 46},
}


def by_pinocchio(case: Rubbing, i: int, low: np.ndarray, high: np.ndarray) -> Any:
    """The least of all patterns of one sample; forces and moments of friction as points move."""
    if find_spec("pinocchio") is None:
        pytest.skip("pinocchio is not installed (it is in the `test` extra)")
    from oracles.pinocchio_engine import PinocchioEngine

    s, engine = case.states, PinocchioEngine(case.raw)
    pose, rate, second = (s[name][i] for name in ("pose", "pose_rate", "pose_acceleration"))
    found = engine.inverse_dynamics(pose, rate, second, s["wrench"][i], s["load_point"])
    at, _, drag = touching(engine.d, case.raw, pose, rate)
    axes = platform_motion(pose).axes
    T = np.hstack([drag, np.cross(at, drag) @ axes])
    loss = losses(case.raw, found["joint_rate"], found["joint_acceleration"])
    J = found["J_theta"]
    return least_of_patterns(J, found["C_normal"], T, found["Q"] + J.T @ loss, low, high)


def check(case: Rubbing, model: Model, low: np.ndarray, high: np.ndarray) -> set[int]:
    """Every sample; returns the statuses that there were."""
    got = model.inverse_dynamics(*case.arguments, outputs="all")
    n = len(model.mechanism.chains)
    for i, status in enumerate(got.status):
        wanted = by_pinocchio(case, i, low, high)
        assert (status == Status.ok) == (wanted is not None)
        if wanted is None:
            continue
        effort, force = wanted[1][:n], wanted[1][n:]
        size = np.abs(effort).max()
        np.testing.assert_allclose(got.effort[i], effort, atol=TOLERANCE * size)
        size = max(size, np.abs(force).max())
        np.testing.assert_allclose(got.contact_force[i], force, atol=TOLERANCE * size)
    return set(got.status.tolist())


@pytest.mark.parametrize("name", LEAST)
def test_least_norm_with_friction_and_actuators(name: str) -> None:
    case = drawn(**{"count": 2, **LEAST[name]})
    model = Model(case.mechanism, backend="numpy")
    free = np.full(len(case.mechanism.chains) + len(case.mechanism.contacts), np.inf)
    assert check(case, model, -free, free) == {Status.ok}


@pytest.mark.parametrize("name", PUSHED)
def test_limits_with_contacts_that_push(name: str) -> None:
    case = drawn(**{"count": 3, "one_sided": True, **PUSHED[name]})
    machine, preload = case.mechanism, 0.4
    both = [limits(chain) for chain in machine.chains]
    push = np.array([contact.push for contact in machine.contacts])
    low = np.r_[[x.low for x in both], np.where(push > 0, preload, -np.inf)]
    high = np.r_[[x.high for x in both], np.where(push < 0, -preload, np.inf)]
    model = Model(machine, backend="numpy", distribution=Distribution("bounded", preload=preload))
    seen = check(case, model, low, high)
    assert Status.ok in seen <= {Status.ok, Status.infeasible}
