"""The muscle-recruitment criterion against SLSQP."""

from dataclasses import replace

import numpy as np
import pytest

from condyle.distribution import Status, distribute
from condyle.errors import InputError

from .cases import random_problem
from .oracle import by_slsqp, full, least_stretch, signs

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("seed", range(20))
def test_no_better_answer_is_near_or_far(seed):
    rng = np.random.default_rng(seed)
    k = seed % 4
    n = 6 - k + int(rng.integers(0, 6))
    friction = int(rng.integers(0, k + 1))
    problem = random_problem(rng, n, k, friction=friction, pull=True, tight=1.5)
    scale = problem.scale
    programs = [full(problem, 0, sign, scale, True, 0.0) for sign in signs(problem)]
    result = distribute(problem, "cubic", None)
    if result.status[0] == Status.infeasible:
        assert min(map(least_stretch, programs)) > 1
        return
    assert result.status[0] == Status.ok
    mine = value(result.effort[0], scale)
    others = []
    for f in programs:
        for start in (np.concatenate([result.effort[0], result.contact_force[0]]), np.zeros(n + k)):
            z = by_slsqp(
                f,
                lambda e: value(e, scale),
                lambda e: 3 * (e / scale) ** 2 / scale,
                np.clip(start, f.low, f.high),
            )
            if np.abs(f.C @ z - f.q).max() < 1e-7:
                others.append(value(z[:n], scale))
    # SLSQP meets its equations to 1e-7 of forces of the order of ten.
    assert not others or mine <= min(others) * (1 + 1e-6)


# On the limit, few efforts free: the dual is nearly flat and Newton on it does not end.
@pytest.mark.parametrize("share", [0.97, 0.99, 0.999, 1 - 1e-4, 1 - 1e-6])
def test_near_what_limits_allow(share):
    rng = np.random.default_rng(4)
    problem = random_problem(rng, 9, 2, 40, pull=True, tight=0.4)
    needed = distribute(problem, "cubic", None).shortfall
    for i in np.flatnonzero(needed > 1)[:8]:
        one = problem.take(np.array([i]))
        result = distribute(stretched(one, needed[i] / share), "cubic")
        assert result.status[0] == Status.ok
        assert result.dual[0] <= 1e-9


def stretched(problem, factor):
    return replace(problem, low=problem.low * factor, high=problem.high * factor)


def value(effort, scale):
    return float(((effort / scale) ** 3).sum())


def test_efforts_that_push_are_refused():
    problem = random_problem(np.random.default_rng(0), 6, 2)
    with pytest.raises(InputError, match=r"efforts \[0, 1, 2, 3, 4, 5\] may be negative"):
        distribute(problem, "cubic", None)
