"""Compiled efforts within limits against every active set tried one by one, and general code."""

from dataclasses import replace

import numpy as np
import pytest

from condyle.backends.c.limits import WithinLimits
from condyle.distribution import CERTIFIED, OBJECTIVES, Status, distribute

from .cases import random_problem
from .oracle import best_active_set, full, least_stretch, signs
from .test_oracle import TOLERANCE

# Efforts, contacts, contacts with friction: 0, 1 and 2 efforts that are free.
SHAPES = [(6, 2, 0), (6, 2, 2), (5, 2, 1), (4, 2, 2), (4, 3, 1), (8, 0, 0)]


def compiled(problem, name):
    objective, T = OBJECTIVES[name], np.ascontiguousarray
    n, k, push = problem.n, problem.k, problem.pushes * objective.limits
    low, high = problem.limits
    if not objective.limits:
        low, high = np.full(n, -np.inf), np.full(n, np.inf)
    contact_low = np.where(push > 0, problem.preload, -np.inf)
    contact_high = np.where(push < 0, -problem.preload, np.inf)
    return WithinLimits(n, k).solve(
        T(problem.Q.T),
        T(problem.J.transpose(2, 1, 0)),
        T(problem.normal.transpose(1, 2, 0)),
        T(problem.friction.transpose(1, 2, 0)),
        (problem.friction != 0).any(axis=(0, 2)),
        (low, high, objective.scale(problem), contact_low, contact_high),
        objective.weight(problem),
    )


def drawn(seed, shape, count):
    rng = np.random.default_rng(seed)
    n, k, friction = shape
    return random_problem(
        rng,
        n,
        k,
        count,
        friction,
        one_sided=bool(seed % 2),
        preload=float(rng.choice([0.0, 1.0])),
        tight=float(rng.choice([0.3, 0.6, 1.0])),
        pull=seed % 3 == 0,
    )


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("name", ["minimum_norm", "bounded", "weighted"])
def test_least_of_all_active_sets(name, shape):
    weight = 1e-4 if name == "weighted" else 0.0
    for seed in range(4):
        problem = replace(drawn(seed, shape, 3), contact_weight=weight)
        found = compiled(problem, name)
        scale = problem.scale if name == "weighted" else np.ones(problem.n)
        for i in np.flatnonzero(~found.unsure):
            programs = [
                full(problem, i, sign, scale, name != "minimum_norm", weight)
                for sign in signs(problem)
            ]
            answers = [a for a in map(best_active_set, programs) if a is not None]
            assert found.infeasible[i] == (not answers)
            if answers:
                best = min(answers, key=lambda answer: answer[0])[1]
                mine = np.r_[found.effort[:, i], found.force[:, i]]
                np.testing.assert_allclose(mine, best, rtol=0, atol=TOLERANCE * np.abs(best).max())
                assert found.certificate[:, i].max() <= CERTIFIED
            else:
                least = min(map(least_stretch, programs))
                np.testing.assert_allclose(found.shortfall[i], least, rtol=1e-7)


@pytest.mark.parametrize("shape", SHAPES)
def test_as_general_code_and_seldom_unsure(shape):
    """Newton's method on the dual, DAQP and HiGHS share nothing with polygons."""
    seen, unsure, count = set(), 0, 40
    for seed in range(6):
        problem = drawn(seed, shape, count)
        found, wanted = compiled(problem, "bounded"), distribute(problem, "bounded")
        sure = ~found.unsure
        unsure += (~sure & (wanted.status != Status.jammed)).sum()
        status = np.where(found.infeasible, Status.infeasible, Status.ok)
        assert (status == wanted.status)[sure].all()
        good = sure & (wanted.status == Status.ok)
        size = np.abs(wanted.effort[good]).max(initial=0.0)
        assert np.abs(found.effort.T - wanted.effort)[good].max(initial=0.0) <= 1e-9 * size
        np.testing.assert_allclose(found.shortfall[sure], wanted.shortfall[sure], rtol=1e-9)
        seen |= set(wanted.status[sure].tolist())
    assert seen == {Status.ok, Status.infeasible}
    assert unsure <= 0.02 * 6 * count


def test_limits_that_are_met_exactly_and_mirrored_efforts():
    """A machine with planes of symmetry has parallel sides; a limit may be the answer itself."""
    lines = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    J = np.zeros((1, 8, 6))
    J[0, :3, :3] = J[0, 3:6, :3] = lines
    J[0, 3:6, 3:] = np.cross([0.0, 0.1, 0.2], lines)
    J[0, 6:, :3], J[0, 6:, 3:] = [0.0, 0.6, 0.8], [[0.1, 0, 0], [0.0, 0.08, -0.06]]
    effort = np.array([1.0, -2, 3, -4, 5, 6, 7, -8])
    problem = replace(
        drawn(0, (8, 0, 0), 1), J=J, Q=np.einsum("rni,n->ri", J, effort), friction=None
    )
    for size in (1.0, 1.0 - 1e-12, 0.9, 0.5, 0.1):
        wide = distribute(replace(problem, low=None, high=None), "minimum_norm").effort[0]
        largest = size * np.abs(wide).max()
        tight = replace(problem, low=np.full(8, -largest), high=np.full(8, largest))
        found, wanted = compiled(tight, "bounded"), distribute(tight, "bounded")
        if found.unsure[0]:
            continue
        assert found.infeasible[0] == (wanted.status[0] == Status.infeasible)
        np.testing.assert_allclose(found.effort[:, 0], wanted.effort[0], atol=1e-9 * largest)
        np.testing.assert_allclose(found.shortfall, wanted.shortfall, rtol=1e-9)


def test_what_is_no_number_or_singular_is_left_to_others():
    problem = drawn(1, (6, 2, 0), 3)
    problem.Q[0, 0], problem.J[1, 2, 3] = np.nan, np.inf
    problem.normal[2, 1] = 2 * problem.normal[2, 0]
    assert compiled(problem, "bounded").unsure.all()
