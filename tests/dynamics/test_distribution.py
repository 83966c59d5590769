"""Which torques are chosen: the least 2-norm, to the digits that the condition number leaves; and
with friction, losses and limits the least of all active sets, on Pinocchio's dynamics."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from oracles.null_space import least_of_patterns
from oracles.random_mechanism import random_mechanism
from oracles.rotations import platform_motion
from oracles.rubbing import losses, touching
from support.families import close, of_raw
from support.loads import parts
from support.rubbing import Rubbing, drawn

from condyle.dynamics.minimum_norm import minimum_norm
from condyle.mechanism.chain import limits
from condyle.model.distributing import Distribution
from condyle.model.model import Model
from condyle.status import Status


@pytest.mark.parametrize("n, m", [(6, 6), (6, 4), (8, 4), (5, 1)])
def test_least_norm(n: int, m: int) -> None:
    """It solves the equations, is numpy's, and any other solution is longer."""
    rng = np.random.default_rng(n + m)
    A, b = rng.normal(size=(20, n, m)), rng.normal(size=(20, m, 3))
    tau = minimum_norm(A, rng.uniform(0.1, 10, m), b)
    np.testing.assert_allclose(A.transpose(0, 2, 1) @ tau, b, atol=1e-12)
    np.testing.assert_allclose(tau, np.linalg.pinv(A.transpose(0, 2, 1)) @ b, atol=1e-11)
    for i in range(20 if n > m else 0):
        null = np.linalg.svd(A[i].T)[2][m:]
        other = tau[i] + 0.1 * (rng.normal(size=(3, n - m)) @ null).T
        np.testing.assert_allclose(A[i].T @ other, b[i], atol=1e-12)
        assert (np.linalg.norm(other, axis=0) > np.linalg.norm(tau[i], axis=0)).all()


def exact(A: list[list[Fraction]], b: list[Fraction]) -> list[Fraction]:
    """A^-1 b by elimination, without rounding."""
    rows = [[*row, value] for row, value in zip(A, b, strict=True)]
    for i in range(len(rows)):
        pivot = next(r for r in range(i, len(rows)) if rows[r][i])
        rows[i], rows[pivot] = rows[pivot], rows[i]
        rows[i] = [value / rows[i][i] for value in rows[i]]
        for r in set(range(len(rows))) - {i}:
            rows[r] = [x - rows[r][i] * y for x, y in zip(rows[r], rows[i], strict=True)]
    return [row[-1] for row in rows]


@pytest.mark.parametrize("n", [6, 8])
def test_an_ill_conditioned_jacobian_costs_its_condition_number_and_no_more(n: int) -> None:
    """Condition 1e9: normal equations, which square it, would leave no digit."""
    rng = np.random.default_rng(0)
    A = rng.integers(-9, 10, (n, 4)).astype(float)
    A[:, 3] = A[:, 0] + A[:, 1] + 2.0**-30 * A[:, 3]
    b = rng.integers(-9, 10, 4).astype(float)
    F = np.array([[Fraction(x) for x in row] for row in A])
    wanted = (F @ exact((F.T @ F).tolist(), [Fraction(x) for x in b])).astype(float)
    tau = minimum_norm(A[None], np.ones(4), b[None, :, None])[0, :, 0]
    condition = np.linalg.cond(A)
    assert 1e9 < condition < 1e11
    assert np.abs(tau - wanted).max() < 10 * condition * 2e-16 * np.abs(wanted).max()


@pytest.mark.parametrize("contacts, chains", [(2, 8), (5, 6)])
def test_models_choose_the_least_norm(contacts: int, chains: int) -> None:
    c = of_raw(random_mechanism(np.random.default_rng(9), contacts=contacts, chains=chains))
    model, s, m = c.model(), c.states, 6 - contacts
    tau = model.inverse_dynamics(s["q"], s["qd"], s["qdd"], *parts(c.load)).effort
    for q, effort in zip(s["q"], tau, strict=True):
        still = np.zeros((m, m))
        units = model.inverse_dynamics(np.tile(q, (m, 1)), np.eye(m), still, outputs="joint_rate")
        A = units.joint_rate.T
        close(effort, np.linalg.pinv(A.T) @ (A.T @ effort), 1e-11)


# -- friction, losses, limits --------------------------------------------------------------

TOLERANCE = 1e-8
LEAST: dict[str, dict[str, Any]] = {
    "k2 n7 curved": {"chains": 7, "surface": "quadratic", "families": ("RSS", "PSS"), "seed": 33},
    "k1 ball": {"ball_radius": 3.0, "surface": "sphere", "contacts": 1, "seed": 34},
    "k3 legs": {"families": ("SPS",), "contacts": 3, "mu": 0.5, "seed": 36},
}
PUSHED: dict[str, dict[str, Any]] = {
    "k2": {"limit": 4.0, "seed": 42},
    "k2 smooth": {"mu": 0, "limit": 5.0, "seed": 47},
    "k3": {"contacts": 3, "limit": 5.0, "chains": 5, "seed": 45},
    "k2 legs": {"families": ("SPS",), "limit": 4.0, "seed": 46},
}


def by_pinocchio(case: Rubbing, i: int, low: np.ndarray, high: np.ndarray) -> Any:
    """The least of all patterns of one sample; forces and moments of friction as points move."""
    pytest.importorskip("pinocchio", reason="pinocchio is not installed (`test` extra)")
    from oracles.pinocchio_engine import PinocchioEngine

    s, engine = case.states, PinocchioEngine(case.raw)
    pose, rate, second = (s[name][i] for name in ("pose", "pose_rate", "pose_acceleration"))
    found = engine.inverse_dynamics(pose, rate, second, s["wrench"][i], s["load_point"])
    at, _, drag = touching(engine.d, case.raw, pose, rate)
    T = np.hstack([drag, np.cross(at, drag) @ platform_motion(pose).axes])
    loss = losses(case.raw, found["joint_rate"], found["joint_acceleration"])
    J = found["J_theta"]
    return least_of_patterns(J, found["C_normal"], T, found["Q"] + J.T @ loss, low, high)


def check(case: Rubbing, model: Model, low: np.ndarray, high: np.ndarray) -> set[int]:
    """Every sample; returns the statuses that there were."""
    got = model.inverse_dynamics(*case.arguments)
    n = len(model.mechanism.chains)
    for i, status in enumerate(got.status):
        wanted = by_pinocchio(case, i, low, high)
        assert (status == Status.ok) == (wanted is not None)
        if wanted is not None:
            effort, force = wanted[1][:n], wanted[1][n:]
            close(got.effort[i], effort, TOLERANCE)
            close(got.contact_force[i], force, TOLERANCE, floor=np.abs(effort).max())
    return set(got.status.tolist())


@pytest.mark.slow
@pytest.mark.parametrize("name", LEAST)
def test_least_norm_with_friction_and_actuators(name: str) -> None:
    case = drawn(**{"count": 2, **LEAST[name]})
    free = np.full(len(case.mechanism.chains) + len(case.mechanism.contacts), np.inf)
    assert check(case, Model(case.mechanism, backend="numpy"), -free, free) == {Status.ok}


@pytest.mark.slow
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
