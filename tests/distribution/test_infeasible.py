"""Limits that no effort can meet, by how much, and what no limits would help."""

from dataclasses import replace

import numpy as np
import pytest
from support.speeds import few

from condyle.distribution import OBJECTIVES, Problem, Status, distribute

from .cases import INCISOR, human_jaw, random_problem, wrenches

LIMITED = sorted(name for name, objective in OBJECTIVES.items() if objective.limits)


def limits_times(problem, factor):
    return replace(problem, low=problem.low * factor, high=problem.high * factor)


@pytest.mark.parametrize("name", LIMITED)
@pytest.mark.parametrize("friction", few([0, 1, 2], 1))
def test_shortfall_is_where_it_turns(name, friction):
    rng = np.random.default_rng(friction)
    problem = random_problem(rng, 7, 2, 60, friction=friction, one_sided=True, tight=0.4, pull=True)
    result = distribute(problem, name)
    short = np.flatnonzero((result.status == Status.infeasible) & np.isfinite(result.shortfall))
    assert len(short) >= 5
    assert (result.shortfall[short] > 1).all()
    for i in short:
        one = problem.take(np.array([i]))
        for factor, status in ((1 - 1e-6, Status.infeasible), (1 + 1e-6, Status.ok)):
            again = distribute(limits_times(one, result.shortfall[i] * factor), name)
            assert again.status[0] == status


def test_same_shortfall_under_every_objective():
    problem = human_jaw(np.array([700.0, 1200.0]), INCISOR)
    found = [distribute(problem, name).shortfall for name in LIMITED]
    for shortfall in found[1:]:
        np.testing.assert_allclose(shortfall, found[0], rtol=1e-8)
    assert (found[0] > 1).all()


def test_no_limits_help_a_contact_that_must_push():
    """All efforts and the load press the platform up; the contact can only press it up too."""
    J = wrenches(np.random.default_rng(0), (1, 5), 0.1)
    up = np.array([[[0.0, 0.0, 1.0, 0.0, 0.0, 0.0]]])
    J[0, :, 2] = 0.0  # no effort acts along the contact's normal
    Q = np.array([[1.0, 2.0, -5.0, 0.1, 0.1, 0.1]])
    problem = Problem(Q, J, up, low=np.full(5, -1e3), high=np.full(5, 1e3), push=np.ones(1))
    result = distribute(problem)
    assert result.status[0] == Status.infeasible
    assert np.isinf(result.shortfall[0])
    two_sided = distribute(replace(problem, push=np.zeros(1)))
    assert two_sided.status[0] == Status.ok
    assert two_sided.contact_force[0, 0] == pytest.approx(-5.0)


def test_preload_is_kept():
    rng = np.random.default_rng(5)
    problem = random_problem(rng, 7, 2, 50, one_sided=True, tight=5.0)
    free = distribute(problem)
    least = 20.0
    held = distribute(replace(problem, preload=least))
    ok = held.status == Status.ok
    pushing = held.contact_force[ok] * problem.push
    assert ok.sum() > 25
    assert (pushing >= least * (1 - 1e-12)).all()
    assert (free.contact_force[ok] * problem.push < least).any()


def test_limits_of_nothing():
    rng = np.random.default_rng(1)
    problem = random_problem(rng, 6, 2, 2)
    problem = replace(problem, low=np.zeros(6), high=np.zeros(6))
    result = distribute(problem)
    assert result.status.tolist() == [Status.infeasible] * 2
    assert np.isinf(result.shortfall).all()
    nothing = distribute(replace(problem, Q=np.zeros((2, 6))))
    assert nothing.status.tolist() == [Status.ok] * 2
    assert not nothing.effort.any()
