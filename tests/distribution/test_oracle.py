"""Sums of squares against every active set tried one by one."""

from dataclasses import replace

import numpy as np
import pytest

from condyle.distribution import CERTIFIED, Status, distribute

from .cases import random_problem
from .oracle import best_active_set, full, least_stretch, signs

pytestmark = pytest.mark.slow

# Both sides solve well-conditioned systems of a dozen unknowns; the worst of 2000 was 1e-10.
TOLERANCE = 1e-8


def cases(seed):
    rng = np.random.default_rng(seed)
    k = seed % 4
    n = min(6 - k + int(rng.integers(0, 3)), 7)
    return random_problem(
        rng,
        n,
        k,
        friction=int(rng.integers(0, k + 1)),
        one_sided=bool(rng.random() < 0.5),
        preload=float(rng.choice([0.0, 1.0])),
        tight=float(rng.choice([0.6, 1.0, 1.5, 3.0])),
        pull=bool(rng.random() < 0.3),
        offset=bool(rng.random() < 0.3),
    )


@pytest.mark.parametrize("seed", range(32))
@pytest.mark.parametrize("name", ["minimum_norm", "bounded", "weighted"])
def test_least_of_all_active_sets(name, seed):
    problem = cases(seed)
    if name == "weighted" and seed % 2:
        problem = replace(problem, contact_weight=1e-4, reference_force=1.0)
    weight = problem.contact_weight if name == "weighted" else 0.0
    scale = problem.scale if name == "weighted" else np.ones(problem.n)
    limits = name != "minimum_norm"
    programs = [full(problem, 0, sign, scale, limits, weight) for sign in signs(problem)]
    answers = [a for a in map(best_active_set, programs) if a is not None]
    result = distribute(problem, name, None)
    if answers:
        best = min(answers, key=lambda answer: answer[0])[1]
        assert result.status[0] == Status.ok
        found = np.concatenate([result.effort[0], result.contact_force[0]])
        np.testing.assert_allclose(found, best, rtol=0, atol=TOLERANCE * np.abs(best).max())
        assert max(result.residual[0], result.primal[0], result.dual[0]) <= CERTIFIED
    else:
        assert result.status[0] == Status.infeasible
        np.testing.assert_allclose(
            result.shortfall[0], min(map(least_stretch, programs)), rtol=1e-7
        )
        assert np.isnan(result.effort).all()


def test_both_outcomes_are_among_the_cases():
    status = [int(distribute(cases(seed), backend=None).status[0]) for seed in range(32)]
    assert status.count(Status.ok) > 8
    assert status.count(Status.infeasible) > 4
