"""The certificate itself: each of its parts sees what it is there to see."""

import numpy as np
import pytest

from condyle.distribution.certificate import excess, residual, settle, slack
from condyle.distribution.law import Square
from condyle.distribution.quadratic import least_squares
from condyle.distribution.reduced import reduce
from condyle.distribution.result import CERTIFIED

from .cases import random_problem

LITTLE = 1e-7


@pytest.fixture
def solved():
    problem = random_problem(np.random.default_rng(0), 7, 2, 20, tight=1.0, one_sided=True)
    r = reduce(problem, np.zeros((20, 2), int), np.ones(7), 0.0, True)
    answer = least_squares(r, np.zeros((6, 20)), np.full(20, np.inf))
    rows = np.flatnonzero(answer.found)
    assert len(rows) > 10
    return r.take(rows), answer.take(rows)


def test_an_answer_is_proved(solved):
    r, answer = solved
    for part in (residual(r, answer), excess(r, answer), slack(r, Square(), answer)):
        assert part.max() <= CERTIFIED


def test_equations_not_met(solved):
    r, answer = solved
    size = np.abs(answer.x).max(axis=0)
    answer.x[0] += LITTLE * size
    assert (residual(r, answer) > CERTIFIED).all()
    assert not settle(r, Square(), answer).found.any()


def test_contact_force_that_is_not_that_of_the_equations(solved):
    r, answer = solved
    answer.force = answer.force + LITTLE * (1 + np.abs(answer.force))
    assert (residual(r, answer) > CERTIFIED).all()


def test_limits_exceeded(solved):
    r, answer = solved
    answer.x[0] = r.high[0] + LITTLE * np.abs(answer.x).max(axis=0)
    assert (excess(r, answer) > CERTIFIED).all()


def test_contacts_that_do_not_push(solved):
    r, answer = solved
    big = np.abs(answer.force).max(axis=0) + np.abs(answer.x).max(axis=0)
    for contact in range(2):
        low, high = r.contact_low[contact], r.contact_high[contact]
        answer.force[contact] = np.where(np.isfinite(low), low - 1e-6 * big, high + 1e-6 * big)
    assert (excess(r, answer) > CERTIFIED).all()


def test_efforts_that_balance_but_are_not_least(solved):
    r, answer = solved
    for i in range(r.count):
        # Along the null space of the equations, away from the least.
        null = np.linalg.svd(r.G[: r.m, :, i])[2][-1]
        answer.x[:, i] += 1e-6 * np.abs(answer.x[:, i]).max() * null
    answer.force = r.forces(answer.x)
    assert (residual(r, answer) <= CERTIFIED).all()
    assert (slack(r, Square(), answer) > CERTIFIED).mean() > 0.8


def test_multipliers_of_the_wrong_sign(solved):
    r, answer = solved
    acts = (answer.u[r.m :] != 0).any(axis=0)
    assert acts.any()
    answer.u[r.m :] *= -1
    assert (slack(r, Square(), answer)[acts] > CERTIFIED).all()
