"""Patterns of friction: consistency, the least of all, jamming."""

import numpy as np
import pytest

from condyle.distribution import OBJECTIVES, Problem, Status, distribute

from .cases import random_problem, wrenches

pytestmark = pytest.mark.slow


def wedge(sign):
    """One contact, as many efforts as equations, so that each pattern has one solution.

    With w across all rows of J, lambda = w.Q / (w.N - sigma w.T). Where w.T > |w.N| both
    patterns are consistent for one sign of w.Q, and neither is for the other.
    """
    rng = np.random.default_rng(2)
    J = wrenches(rng, (1, 5), 0.1)
    w = np.linalg.svd(J[0])[2][-1]
    normal, rub = rng.normal(size=6), rng.normal(size=6)
    normal += (0.5 - w @ normal) * w
    rub += (1.0 - w @ rub) * w
    Q = rng.normal(size=6)
    Q += (sign * 2.0 - w @ Q) * w
    return Problem(
        Q[None], J, normal[None, None], rub[None, None], np.zeros(5) - 1e3, np.zeros(5) + 1e3
    )


@pytest.mark.parametrize("name", sorted(set(OBJECTIVES) - {"cubic"}))
def test_jammed_where_no_pattern_is_consistent(name):
    result = distribute(wedge(+1), name)
    assert result.status[0] == Status.jammed
    assert np.isnan(result.effort).all() and np.isnan(result.contact_force).all()


def test_limits_too_tight_are_not_jamming():
    problem = wedge(-1)
    tight = Problem(
        problem.Q, problem.J, problem.normal, problem.friction, np.full(5, -1e-3), np.full(5, 1e-3)
    )
    result = distribute(tight)
    assert result.status[0] == Status.infeasible
    assert np.isfinite(result.shortfall[0]) and result.shortfall[0] > 1


def test_of_two_consistent_patterns_the_lesser():
    problem = wedge(-1)
    result = distribute(problem, "minimum_norm")
    assert result.status[0] == Status.ok
    norms = []
    for sigma in (1, -1):
        D = problem.normal[0, 0] - sigma * problem.friction[0, 0]
        z = np.linalg.solve(np.vstack([problem.J[0], D]).T, problem.Q[0])
        assert sigma * z[-1] >= 0
        norms.append(np.linalg.norm(z[:5]))
    assert np.linalg.norm(result.effort[0]) == pytest.approx(min(norms), rel=1e-10)
    assert abs(norms[0] - norms[1]) > 1e-3 * max(norms)


@pytest.mark.parametrize("k", [1, 2, 3, 4, 5])
def test_signs_agree_with_forces(k):
    rng = np.random.default_rng(k)
    problem = random_problem(rng, 8 - k, k, 25, friction=k, tight=50.0)
    result = distribute(problem, "bounded")
    ok = result.status == Status.ok
    assert ok.sum() > 15
    assert (result.pattern[ok] * result.contact_force[ok] >= 0).all()
    D = problem.normal - result.pattern[:, :, None] * problem.friction
    balance = np.einsum("rni,rn->ri", problem.J, result.effort)
    balance += np.einsum("rki,rk->ri", D, result.contact_force)
    np.testing.assert_allclose(balance[ok], problem.Q[ok], atol=1e-8)


def test_at_rest_friction_is_as_if_it_were_not():
    """A sample without sliding among others that slide."""
    rng = np.random.default_rng(0)
    problem = random_problem(rng, 6, 2, 6, friction=2, tight=50.0)
    problem.friction[3] = 0.0
    result = distribute(problem)
    smooth = distribute(
        Problem(problem.Q, problem.J, problem.normal, None, problem.low, problem.high)
    )
    np.testing.assert_allclose(result.effort[3], smooth.effort[3], rtol=1e-10)
    assert np.abs(result.effort[0] - smooth.effort[0]).max() > 1e-3


def test_little_friction_changes_little():
    rng = np.random.default_rng(7)
    problem = random_problem(rng, 6, 2, 30, friction=2, tight=50.0)
    little = Problem(
        problem.Q, problem.J, problem.normal, 1e-7 * problem.friction, problem.low, problem.high
    )
    none = Problem(problem.Q, problem.J, problem.normal, None, problem.low, problem.high)
    a, b = distribute(little), distribute(none)
    assert (a.status == b.status).all()
    ok = a.status == Status.ok
    np.testing.assert_allclose(a.effort[ok], b.effort[ok], atol=1e-4)
