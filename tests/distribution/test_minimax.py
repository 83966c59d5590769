"""The least greatest effort against a linear program, and what breaks its ties."""

from dataclasses import replace

import numpy as np
import pytest

from condyle.distribution import Problem, Status, distribute

from .cases import random_problem
from .oracle import best_active_set, full, least_maximum, signs

pytestmark = pytest.mark.slow


# The last three leave next to nothing that fits: the choice among ties takes a second program.
@pytest.mark.parametrize("seed", [*range(40), 80, 341, 461])
def test_linear_program(seed):
    rng = np.random.default_rng(seed)
    k = seed % 4
    n = 6 - k + int(rng.integers(0, 8))
    problem = random_problem(
        rng,
        n,
        k,
        friction=int(rng.integers(0, k + 1)),
        one_sided=bool(rng.random() < 0.5),
        preload=float(rng.choice([0.0, 1.0])),
        tight=float(rng.choice([0.8, 1.5, 3.0])),
        pull=bool(rng.random() < 0.6),
    )
    scale = problem.scale
    programs = [full(problem, 0, sign, scale, True, 0.0) for sign in signs(problem)]
    least = min(least_maximum(f, scale) for f in programs)
    result = distribute(problem, "minimax")
    assert (result.status[0] == Status.ok) == np.isfinite(least)
    if np.isfinite(least):
        # HiGHS meets its constraints to 1e-10.
        assert np.abs(result.effort[0] / scale).max() == pytest.approx(least, rel=1e-8)


@pytest.mark.parametrize("seed", range(8))
def test_ties_go_to_the_least_sum_of_squares(seed):
    """Two halves of a machine that do not meet: the greater effort leaves the other half free."""
    rng = np.random.default_rng(seed)
    n = 7
    J = np.zeros((1, n, 6))
    J[0, :3, :2] = rng.normal(size=(3, 2))  # three efforts for two equations
    J[0, 3:, 2:] = rng.normal(size=(4, 4))  # four for four: no choice
    Q = np.zeros((1, 6))
    Q[0] = J[0].T @ np.concatenate([rng.normal(size=3), 20 * rng.normal(size=4)])
    problem = Problem(Q, J, np.zeros((1, 0, 6)), low=np.full(n, -99.0), high=np.full(n, 99.0))
    effort = distribute(problem, "minimax").effort[0]
    greatest = np.abs(effort).max()
    best = best_active_set(
        full(
            replace(problem, low=np.full(n, -greatest), high=np.full(n, greatest)),
            0,
            (),
            problem.scale,
            True,
            0.0,
        ),
        tolerance=1e-7,
    )
    assert best is not None
    np.testing.assert_allclose(effort, best[1], rtol=0, atol=1e-7 * greatest)
    # and that choice is the least norm of the free half
    np.testing.assert_allclose(effort[:3], np.linalg.pinv(J[0, :3, :2].T) @ Q[0, :2], atol=1e-8)


def test_all_that_fits_is_one_point():
    rng = np.random.default_rng(3)
    problem = random_problem(rng, 4, 2, tight=3, pull=True)
    effort = distribute(problem, "minimum_norm").effort[0]
    assert (effort > 0).all()
    result = distribute(replace(problem, low=np.zeros(4), high=effort), "minimax")
    assert result.status[0] == Status.ok
    np.testing.assert_allclose(result.effort[0], effort, rtol=1e-8)
