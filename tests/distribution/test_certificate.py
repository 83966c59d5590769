"""The certificate itself: each of its parts sees what it is there to see."""

from dataclasses import replace

import numpy as np
import pytest

from condyle.distribution import CERTIFIED, OBJECTIVES
from condyle.distribution.certificate import certified, excess, residual
from condyle.distribution.eliminated import Sample

from .cases import random_problem

LITTLE, FIRST = 1e-7, np.eye(7)[0]


@pytest.fixture(scope="module")
def solved():
    """Samples and their answers."""
    problem = random_problem(np.random.default_rng(0), 7, 2, 20, tight=1.0, one_sided=True)
    samples = [Sample.of(problem, i, np.zeros(2), np.ones(7), 0.0, True) for i in range(20)]
    pairs = [(s, a) for s in samples if (a := OBJECTIVES["bounded"].solve(s)) is not None]
    assert len(pairs) > 10
    return pairs


def test_equations_not_met(solved):
    """And an answer is proved; a contact force that is not that of the equations is seen too."""
    for s, a in solved:
        again = certified(s, a.x, a.u, a.x)
        assert max(again.residual, again.excess, again.slack) <= CERTIFIED and again.proved
        assert residual(s, a.x + LITTLE * np.abs(a.x).max() * FIRST, a.force) > CERTIFIED
        assert residual(s, a.x, a.force + LITTLE * (1 + np.abs(a.force))) > CERTIFIED


def test_limits_exceeded_and_contacts_that_do_not_push(solved):
    for s, a in solved:
        over = LITTLE * np.abs(a.x).max()
        for side in (s.high + over, s.low - over):
            x = np.where(FIRST > 0, side, a.x)
            assert excess(s, x, a.force) > CERTIFIED
            assert not certified(s, x, a.u, x).proved
        big = 1e-6 * (np.abs(a.force).max() + np.abs(a.x).max())
        low = np.where(np.isfinite(s.contact_low), s.contact_low - big, s.contact_high + big)
        for contact in range(2):
            assert excess(s, a.x, np.where(np.arange(2) == contact, low, a.force)) > CERTIFIED


def test_efforts_that_balance_but_are_not_least(solved):
    """Along the null space of the equations; and multipliers of the wrong sign."""
    seen, acting = [], [(s, a) for s, a in solved if np.abs(a.u[s.m :]).max() > 1e-9]
    for s, a in solved:
        x = a.x + 1e-6 * np.abs(a.x).max() * np.linalg.svd(s.G[: s.m])[2][-1]
        any_ = np.full(2, np.inf)
        wide = replace(s, low=s.low - 1, high=s.high + 1, contact_low=-any_, contact_high=any_)
        found = certified(wide, x, a.u, x)
        assert found.residual <= CERTIFIED
        seen.append(found.slack > CERTIFIED)
    assert np.mean(seen) > 0.8 and acting
    for s, a in acting:
        u = np.concatenate([a.u[: s.m], -a.u[s.m :]])
        assert certified(s, a.x, u, a.x).slack > CERTIFIED
