"""What must not matter: other rows, their order, units; the human jaw."""

from dataclasses import replace

import numpy as np
import pytest

import condyle
from condyle.distribution import CERTIFIED, OBJECTIVES, Outcome, distribute, within

from .cases import INCISOR, MOLAR_RIGHT, human_jaw, random_problem

NAMES = sorted(OBJECTIVES)


def mixed(name):
    """Samples with and without answers, with friction."""
    rng, pull = np.random.default_rng(11), name == "cubic"
    return random_problem(rng, 6, 2, 30, 1, one_sided=True, tight=0.8, pull=pull)


def same(a, b, tolerance=1e-10):
    np.testing.assert_array_equal(a.status, b.status)
    for name in ("effort", "contact_force", "shortfall"):
        x, y = getattr(a, name), getattr(b, name)
        finite = np.isfinite(y)
        np.testing.assert_array_equal(np.isfinite(x), finite)
        size = np.abs(y[finite]).max(initial=1.0)
        np.testing.assert_allclose(x[finite], y[finite], rtol=0, atol=tolerance * size)


@pytest.mark.parametrize("name", NAMES)
def test_rows_do_not_know_of_each_other(name):
    problem = mixed(name)
    result = distribute(problem, name)
    assert name == "minimum_norm" or len(set(result.status)) > 1
    order = np.random.default_rng(0).permutation(30)
    for rows in (order, *order[:5, None]):
        some = result.__class__(*(a[rows] for a in vars(result).values()))
        same(distribute(problem.take(rows), name), some)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(("force", "length"), [(1e-3, 1e3), (1e6, 1e-3)])
def test_units_do_not_matter(name, force, length):
    """Newtons and metres, or kilonewtons and millimetres."""
    problem = mixed(name)
    unit = np.repeat([1.0, length], 3)
    scaled = {n: getattr(problem, n) * force for n in ("offset", "low", "high", "preload")}
    scaled |= {n: getattr(problem, n) * unit for n in ("J", "normal", "friction")}
    changed = replace(problem, Q=problem.Q * force * unit, **scaled)
    a, b = distribute(problem, name), distribute(changed, name)
    np.testing.assert_array_equal(a.status, b.status)
    ok = a.status == Outcome.ok
    size = np.abs(a.effort[ok]).max()
    # Where two vertices of minimax's linear program nearly meet, its ties are known less well.
    tolerance = 1e-7 if name == "minimax" else 1e-9
    np.testing.assert_allclose(b.effort[ok] / force, a.effort[ok], rtol=0, atol=tolerance * size)
    short = np.isfinite(a.shortfall)
    np.testing.assert_allclose(b.shortfall[short], a.shortfall[short], rtol=1e-8)


def test_a_contact_weight_is_one_number_for_arrays_and_models():
    """W has no unit: N_ref is the strongest muscle's force, 190.4 N, in both."""
    home, wrench = np.zeros(4), [0, 0, -100.0, 0, 0, 0]
    chosen = condyle.Distribution("weighted", contact_weight=30)
    model = condyle.derive("human-jaw", backend="numpy", distribution=chosen)
    of_model = model.inverse_dynamics(home, home, home, wrench, "right_molar").contact_force
    problem = human_jaw(np.array([100.0]), MOLAR_RIGHT, contact_weight=30)
    of_arrays = distribute(problem, "weighted").contact_force[0]
    np.testing.assert_allclose(np.abs(of_model), np.abs(of_arrays), rtol=1e-3)
    assert problem.force_weight == 30 / 190.4**2
    assert replace(problem, reference_force=10.0).force_weight == 0.3


def test_where_least_norm_is_within_limits_it_is_the_answer():
    problem = random_problem(np.random.default_rng(0), 6, 1, 80, tight=1.0, one_sided=True)
    problem = replace(problem, preload=1.0)
    least, bounded = distribute(problem, "minimum_norm"), distribute(problem, "bounded")
    kept = within(problem, least.effort, least.contact_force)
    assert 5 < kept.sum() < 75
    same_effort = np.abs(bounded.effort - least.effort).max(axis=1) < 1e-9
    np.testing.assert_array_equal(same_effort, kept)


# Numbers found independently with the same data.


def test_bites_of_the_human_jaw():
    """On the right first molar 600 N bring the first muscle to its limit, 550 N do not."""
    problem = human_jaw(np.array([100.0, 550.0, 600.0]), MOLAR_RIGHT)
    result = distribute(problem, "cubic")
    np.testing.assert_allclose(result.contact_force[0], [25.2, 18.5], atol=0.05)
    first, below, at = (result.effort / problem.high).max(axis=1)
    assert first == pytest.approx(0.178, abs=5e-4)
    assert below < 0.999 and at == pytest.approx(1.0)
    result = distribute(human_jaw(np.array([100.0]), INCISOR), "cubic")
    np.testing.assert_allclose(result.contact_force[0], 92.9, atol=0.06)


@pytest.mark.parametrize("name", NAMES)
def test_every_objective_is_certified_up_to_what_the_jaw_can_bite(name):
    result = distribute(human_jaw(np.linspace(1.0, 1500.0, 60), MOLAR_RIGHT), name)
    ok = result.status == Outcome.ok
    assert set(result.status) <= {Outcome.ok, Outcome.infeasible}
    assert ok.all() or name != "minimum_norm"
    assert ok[:20].all()
    for part in (result.residual, result.primal, result.dual):
        assert part[ok].max() <= CERTIFIED
    # Once it cannot bite harder it cannot bite harder still.
    assert (np.diff(ok.astype(int)) <= 0).all()
