"""The edge of what has an answer: degenerate samples, limits that no effort can meet, friction."""

from dataclasses import replace

import numpy as np
import pytest

from condyle.distribution import OBJECTIVES, Outcome, Problem, distribute
from condyle.errors import InputError

from .cases import INCISOR, human_jaw, random_problem, wrenches

NAMES = sorted(OBJECTIVES)
LIMITED = [name for name in NAMES if OBJECTIVES[name].limits]
each, each_limited = (pytest.mark.parametrize("name", names) for names in (NAMES, LIMITED))


@pytest.fixture
def problem():
    return random_problem(np.random.default_rng(0), 6, 2, 3, tight=3.0, pull=True)


# -- each sample keeps its row and gets a status -------------------------------------------


@each
def test_samples_that_are_singular_miss_a_number_or_have_nothing_to_balance(problem, name):
    J, normal = problem.J.copy(), problem.normal.copy()
    J[1] = J[1, 0]
    normal[1, 1] = normal[1, 0]
    spoiled = [("J", J, Outcome.singular), ("normal", normal, Outcome.singular)]
    for column in ("Q", "J", "normal", "friction", "offset"):
        array = getattr(problem, column).copy()
        array[1] = np.nan
        spoiled.append((column, array, Outcome.unreachable))
    for column, array, status in spoiled:
        result = distribute(replace(problem, **{column: array}), name)
        assert result.status.tolist() == [Outcome.ok, status, Outcome.ok], column
        assert np.isnan(result.effort[1]).all()
    result = distribute(replace(problem, Q=np.zeros((3, 6))), name)
    assert (result.status == Outcome.ok).all()
    assert not result.effort.any() and not result.contact_force.any()
    result = distribute(problem.take(np.zeros(0, dtype=int)), name)
    assert result.effort.shape == (0, 6) and result.contact_force.shape == (0, 2)


@each
def test_as_many_efforts_as_equations(name):
    """And with fewer there is no answer."""
    problem = random_problem(np.random.default_rng(1), 4, 2, 5, tight=5.0, pull=True)
    result = distribute(problem, name)
    assert (result.status == Outcome.ok).all()
    for i in range(5):
        z = np.linalg.solve(np.vstack([problem.J[i], problem.normal[i]]).T, problem.Q[i])
        np.testing.assert_allclose(result.effort[i], z[:4], atol=1e-8)
        np.testing.assert_allclose(result.contact_force[i], z[4:], atol=1e-8)
    for n in (0, 3):
        few = Problem(problem.Q[:2], problem.J[:2, :n], problem.normal[:2])
        assert distribute(few).status.tolist() == [Outcome.singular] * 2


@each_limited
def test_equal_limits_that_balance_and_an_effort_that_can_do_nothing(problem, name):
    one = problem.take(np.array([0]))
    effort = distribute(one).effort[0]
    result = distribute(replace(one, low=effort, high=effort), name)
    assert result.status[0] == Outcome.ok
    np.testing.assert_allclose(result.effort[0], effort, rtol=1e-12)
    high = problem.high * 3
    high[0] = 0.0
    result = distribute(replace(problem, high=high), name)
    assert (result.status == Outcome.ok).all()
    assert not result.effort[:, 0].any()


@pytest.mark.parametrize("name", ["minimum_norm", "bounded", "weighted"])
def test_near_a_singularity_equations_hold(name):
    """Rows of J that nearly agree: efforts grow, and the equations are met all the same."""
    for nearly in (1e-3, 1e-5, 1e-7):
        rng, wide = np.random.default_rng(3), np.full(6, 1e12)
        problem = random_problem(rng, 6, 2, 20)
        J = problem.J.copy()
        for i in range(20):  # six rows in a space of three, and a little of the rest
            basis = np.linalg.qr(rng.normal(size=(6, 6)))[0]
            J[i] = rng.normal(size=(6, 3)) @ basis[:3] + nearly * rng.normal(size=(6, 6))
        result = distribute(replace(problem, J=J, low=-wide, high=wide), name)
        assert (result.status == Outcome.ok).all()
        z = np.concatenate([result.effort, result.contact_force], axis=1)
        C = np.concatenate([J, problem.normal], axis=1)
        error = np.abs(np.einsum("rzi,rz->ri", C, z) - problem.Q).max(axis=1)
        assert (error <= 1e-9 * np.abs(z).max(axis=1)).all()


def test_wrong_input(problem):
    for change, message in [
        ({"low": np.full(6, 9.0), "high": np.zeros(6)}, r"limits of effort 0: \[9, 0\]"),
        ({"low": np.full(6, np.nan)}, "limits of effort 0"),
        ({"push": np.array([2.0, 0.0])}, "push must be -1, 0 or 1"),
        ({"preload": -1.0}, "preload must be a number, 0 or more; got -1"),
        ({"contact_weight": np.nan}, "contact_weight must be"),
        ({"reference_force": 0.0}, "reference_force must be"),
        ({"Q": np.zeros((3, 5))}, r"Q must be of shape \(3, 6\); got \(3, 5\)"),
        ({"high": np.zeros(5)}, r"high must be of shape \(6,\)"),
    ]:
        with pytest.raises(InputError, match=message):
            replace(problem, **change)
    with pytest.raises(InputError, match='unknown distribution "bound"'):
        distribute(problem, "bound")
    for name in ("weighted", "cubic", "minimax"):
        with pytest.raises(InputError, match="divides each effort by its limit"):
            distribute(replace(problem, high=np.full(6, np.inf)), name)
    with pytest.raises(InputError, match="at most 5 contacts"):
        Problem(np.zeros((1, 6)), np.zeros((1, 6, 6)), np.zeros((1, 6, 6)))
    with pytest.raises(InputError, match=r"efforts \[0, 1, 2, 3, 4, 5\] may be negative"):
        distribute(random_problem(np.random.default_rng(0), 6, 2), "cubic", None)


# -- limits that no effort can meet, by how much, and what no limits would help ------------


@pytest.mark.slow
@each_limited
def test_shortfall_is_where_it_turns(name):
    """And the same under every objective."""
    short = 0
    for friction, tried in ((0, 2), (1, 2), (2, 1)):
        rng = np.random.default_rng(friction)
        problem = random_problem(rng, 6, 2, 4 * tried + 4, friction, True, tight=0.4, pull=True)
        result = distribute(problem, name)
        held = (result.status == Outcome.infeasible) & np.isfinite(result.shortfall)
        assert (result.shortfall[held] > 1).all()
        for i in np.flatnonzero(held)[:tried]:
            one = problem.take(np.array([i]))
            for by, status in ((1 - 1e-6, Outcome.infeasible), (1 + 1e-6, Outcome.ok)):
                factor = result.shortfall[i] * by
                wider = replace(one, low=one.low * factor, high=one.high * factor)
                assert distribute(wider, name).status[0] == status
            short += 1
    assert short == 5
    jaw = human_jaw(np.array([700.0, 1200.0]), INCISOR)
    first, other = (distribute(jaw, x).shortfall for x in (LIMITED[0], name))
    np.testing.assert_allclose(other, first, rtol=1e-8)
    assert (first > 1).all()


def test_no_limits_help_a_contact_that_must_push(problem):
    """All efforts and the load press the platform up; the contact can only press it up too."""
    J = wrenches(np.random.default_rng(0), (1, 5), 0.1)
    up = np.array([[[0.0, 0.0, 1.0, 0.0, 0.0, 0.0]]])
    J[0, :, 2] = 0.0  # no effort acts along the contact's normal
    Q, wide = np.array([[1.0, 2.0, -5.0, 0.1, 0.1, 0.1]]), np.full(5, 1e3)
    pushed = Problem(Q, J, up, low=-wide, high=wide, push=np.ones(1))
    result = distribute(pushed)
    assert result.status[0] == Outcome.infeasible
    assert np.isinf(result.shortfall[0])
    two_sided = distribute(replace(pushed, push=np.zeros(1)))
    assert two_sided.status[0] == Outcome.ok
    assert two_sided.contact_force[0, 0] == pytest.approx(-5.0)
    none = replace(problem, low=np.zeros(6), high=np.zeros(6))  # limits of nothing
    result = distribute(none)
    assert result.status.tolist() == [Outcome.infeasible] * 3
    assert np.isinf(result.shortfall).all()
    result = distribute(replace(none, Q=np.zeros((3, 6))))
    assert result.status.tolist() == [Outcome.ok] * 3 and not result.effort.any()


# -- patterns of friction: consistency, the least of all, jamming --------------------------


def wedge(sign, limit=1e3):
    """One contact, as many efforts as equations, so that each pattern has one solution.

    With w across all rows of J, lambda = w.Q / (w.N - sigma w.T). Where w.T > |w.N| both
    patterns are consistent for one sign of w.Q, and neither is for the other.
    """
    rng = np.random.default_rng(2)
    J, limits = wrenches(rng, (1, 5), 0.1), np.full(5, limit)
    w = np.linalg.svd(J[0])[2][-1]
    vectors, along = rng.normal(size=(3, 6)), np.array([0.5, 1.0, 2.0 * sign])
    normal, rub, Q = vectors + np.outer(along - vectors @ w, w)
    return Problem(Q[None], J, normal[None, None], rub[None, None], -limits, limits)


@pytest.mark.parametrize("name", [name for name in NAMES if name != "cubic"])
def test_jammed_where_no_pattern_is_consistent(name):
    """Limits that are too tight are not jamming."""
    result = distribute(wedge(+1), name)
    assert result.status[0] == Outcome.jammed
    assert np.isnan(result.effort).all() and np.isnan(result.contact_force).all()
    result = distribute(wedge(-1, 1e-3))
    assert result.status[0] == Outcome.infeasible
    assert np.isfinite(result.shortfall[0]) and result.shortfall[0] > 1


def test_friction_of_nothing_or_little_changes_nothing_or_little():
    """A sample without sliding among others that slide; and coefficients of 1e-7."""
    problem = random_problem(np.random.default_rng(0), 6, 2, 30, friction=2, tight=50.0)
    friction = problem.friction.copy()
    friction[3] = 0.0
    result, smooth, little = (
        distribute(replace(problem, friction=f)) for f in (friction, None, 1e-7 * problem.friction)
    )
    np.testing.assert_allclose(result.effort[3], smooth.effort[3], rtol=1e-10)
    assert np.abs(result.effort[0] - smooth.effort[0]).max() > 1e-3
    assert (little.status == smooth.status).all()
    ok = little.status == Outcome.ok
    np.testing.assert_allclose(little.effort[ok], smooth.effort[ok], atol=1e-4)
