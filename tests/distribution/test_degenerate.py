"""Samples at the edge of what has an answer: each keeps its row and gets a status."""

from dataclasses import replace

import numpy as np
import pytest

from condyle.distribution import OBJECTIVES, Problem, Status, distribute
from condyle.errors import InputError

from .cases import random_problem

pytestmark = pytest.mark.slow

NAMES = sorted(OBJECTIVES)


@pytest.fixture
def problem():
    return random_problem(np.random.default_rng(0), 6, 2, 3, tight=3.0, pull=True)


@pytest.mark.parametrize("name", NAMES)
def test_dependent_efforts_are_singular(problem, name):
    J = problem.J.copy()
    J[1] = J[1, 0]
    status = distribute(replace(problem, J=J), name).status
    assert status.tolist() == [Status.ok, Status.singular, Status.ok]


@pytest.mark.parametrize("name", NAMES)
def test_dependent_contacts_are_singular(problem, name):
    normal = problem.normal.copy()
    normal[1, 1] = normal[1, 0]
    status = distribute(replace(problem, normal=normal), name).status
    assert status.tolist() == [Status.ok, Status.singular, Status.ok]


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("column", ["Q", "J", "normal", "friction", "offset"])
def test_a_number_that_is_missing(problem, name, column):
    array = getattr(problem, column).copy()
    array[1] = np.nan
    result = distribute(replace(problem, **{column: array}), name)
    assert result.status.tolist() == [Status.ok, Status.unreachable, Status.ok]
    assert np.isnan(result.effort[1]).all()


@pytest.mark.parametrize("n", [0, 3])
def test_fewer_efforts_than_equations(n):
    rng = np.random.default_rng(0)
    problem = Problem(
        rng.normal(size=(2, 6)), rng.normal(size=(2, n, 6)), rng.normal(size=(2, 2, 6))
    )
    assert distribute(problem).status.tolist() == [Status.singular] * 2


@pytest.mark.parametrize("name", NAMES)
def test_as_many_efforts_as_equations(name):
    problem = random_problem(np.random.default_rng(1), 4, 2, 5, tight=5.0, pull=True)
    result = distribute(problem, name)
    assert (result.status == Status.ok).all()
    for i in range(5):
        z = np.linalg.solve(np.vstack([problem.J[i], problem.normal[i]]).T, problem.Q[i])
        np.testing.assert_allclose(result.effort[i], z[:4], atol=1e-8)
        np.testing.assert_allclose(result.contact_force[i], z[4:], atol=1e-8)


@pytest.mark.parametrize("name", NAMES)
def test_nothing_to_balance(problem, name):
    result = distribute(replace(problem, Q=np.zeros((3, 6))), name)
    assert (result.status == Status.ok).all()
    assert not result.effort.any() and not result.contact_force.any()


@pytest.mark.parametrize("name", sorted(set(NAMES) - {"minimum_norm"}))
def test_equal_limits_that_balance(problem, name):
    one = problem.take(np.array([0]))
    effort = distribute(one).effort[0]
    result = distribute(replace(one, low=effort, high=effort), name)
    assert result.status[0] == Status.ok
    np.testing.assert_allclose(result.effort[0], effort, rtol=1e-12)


@pytest.mark.parametrize("name", sorted(set(NAMES) - {"minimum_norm"}))
def test_one_effort_that_can_do_nothing(problem, name):
    high = problem.high * 3
    high[0] = 0.0
    result = distribute(replace(problem, high=high), name)
    assert (result.status == Status.ok).all()
    assert not result.effort[:, 0].any()


@pytest.mark.parametrize("name", NAMES)
def test_no_samples(problem, name):
    result = distribute(problem.take(np.zeros(0, dtype=int)), name)
    assert result.effort.shape == (0, 6) and result.contact_force.shape == (0, 2)


@pytest.mark.parametrize("name", ["minimum_norm", "bounded", "weighted"])
@pytest.mark.parametrize("nearly", [1e-3, 1e-5, 1e-7])
def test_near_a_singularity_equations_hold(name, nearly):
    """Rows of J that nearly agree: efforts grow, and the equations are met all the same."""
    rng = np.random.default_rng(3)
    problem = random_problem(rng, 6, 2, 20)
    problem = replace(problem, low=np.full(6, -1e12), high=np.full(6, 1e12))
    J = problem.J.copy()
    for i in range(20):
        # Six rows in a space of three, and a little of the rest.
        basis = np.linalg.qr(rng.normal(size=(6, 6)))[0]
        J[i] = rng.normal(size=(6, 3)) @ basis[:3] + nearly * rng.normal(size=(6, 6))
    result = distribute(replace(problem, J=J), name)
    ok = result.status == Status.ok
    assert ok.all()
    z = np.concatenate([result.effort, result.contact_force], axis=1)
    C = np.concatenate([J, problem.normal], axis=1)
    error = np.abs(np.einsum("rzi,rz->ri", C, z) - problem.Q).max(axis=1)
    assert (error <= 1e-9 * np.abs(z).max(axis=1)).all()


def test_wrong_input(problem):
    wrong = [
        ({"low": np.full(6, 9.0), "high": np.zeros(6)}, r"limits of effort 0: \[9, 0\]"),
        ({"low": np.full(6, np.nan)}, "limits of effort 0"),
        ({"push": np.array([2.0, 0.0])}, "push must be -1, 0 or 1"),
        ({"preload": -1.0}, "preload must be a number, 0 or more; got -1"),
        ({"contact_weight": np.nan}, "contact_weight must be"),
        ({"reference_force": 0.0}, "reference_force must be"),
        ({"Q": np.zeros((3, 5))}, r"Q must be of shape \(3, 6\); got \(3, 5\)"),
        ({"high": np.zeros(5)}, r"high must be of shape \(6,\)"),
    ]
    for change, message in wrong:
        with pytest.raises(InputError, match=message):
            replace(problem, **change)
    with pytest.raises(InputError, match='unknown distribution "bound"'):
        distribute(problem, "bound")
    unlimited = replace(problem, high=np.full(6, np.inf))
    for name in ("weighted", "cubic", "minimax"):
        with pytest.raises(InputError, match="divides each effort by its limit"):
            distribute(unlimited, name)
    with pytest.raises(InputError, match="at most 5 contacts"):
        Problem(np.zeros((1, 6)), np.zeros((1, 6, 6)), np.zeros((1, 6, 6)))
