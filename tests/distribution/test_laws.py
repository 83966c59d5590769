"""What must not matter: other rows, their order, units; and efforts that do not jump."""

from dataclasses import replace

import numpy as np
import pytest

from condyle.distribution import OBJECTIVES, Status, distribute, within

from .cases import INCISOR, MOLAR_RIGHT, human_jaw, random_problem

NAMES = sorted(OBJECTIVES)


def mixed(name, count=300):
    """Samples with and without answers, with friction."""
    rng = np.random.default_rng(11)
    return random_problem(
        rng, 8, 2, count, friction=1, one_sided=True, tight=0.8, pull=name == "cubic"
    )


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
    problem = mixed(name, 60)
    result = distribute(problem, name)
    assert name == "minimum_norm" or len(set(result.status)) > 1
    order = np.random.default_rng(0).permutation(60)
    shuffled = distribute(problem.take(order), name)
    same(shuffled, distribute(problem, name).__class__(*(a[order] for a in vars(result).values())))
    for i in range(0, 60, 7):
        alone = distribute(problem.take(np.array([i])), name)
        same(alone, result.__class__(*(a[i : i + 1] for a in vars(result).values())))


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(("force", "length"), [(1e-3, 1.0), (1.0, 1e3), (1e6, 1e-3)])
def test_units_do_not_matter(name, force, length):
    """Newtons and metres, or kilonewtons and millimetres."""
    problem = mixed(name)
    unit = np.repeat([1.0, length], 3)
    changed = replace(
        problem,
        Q=problem.Q * force * unit,
        J=problem.J * unit,
        normal=problem.normal * unit,
        friction=problem.friction * unit,
        offset=problem.offset * force,
        low=problem.low * force,
        high=problem.high * force,
        preload=problem.preload * force,
    )
    a, b = distribute(problem, name), distribute(changed, name)
    np.testing.assert_array_equal(a.status, b.status)
    ok = a.status == Status.ok
    size = np.abs(a.effort[ok]).max()
    # Where two vertices of minimax's linear program nearly meet, its ties are known less well.
    tolerance = 1e-7 if name == "minimax" else 1e-9
    np.testing.assert_allclose(b.effort[ok] / force, a.effort[ok], rtol=0, atol=tolerance * size)
    short = np.isfinite(a.shortfall)
    np.testing.assert_allclose(b.shortfall[short], a.shortfall[short], rtol=1e-8)


@pytest.mark.parametrize("name", ["bounded", "weighted", "cubic", "minimax"])
def test_efforts_do_not_jump(name):
    """The bite moves from the molar to the incisor and grows; twice as fine, half the step."""
    steps = []
    for count in (200, 400):
        way = np.linspace(0.0, 1.0, count)
        near, far = human_jaw(50 + 100 * way, MOLAR_RIGHT), human_jaw(50 + 100 * way, INCISOR)
        problem = replace(near, Q=near.Q + way[:, None] * (far.Q - near.Q))
        result = distribute(problem, name)
        assert (result.status == Status.ok).all()
        steps.append(np.abs(np.diff(result.effort / problem.high, axis=0)).max())
    assert steps[1] < 0.75 * steps[0]


def test_offset_moves_limits_and_objective_with_the_effort():
    rng = np.random.default_rng(0)
    problem = random_problem(rng, 6, 2, 20, tight=2.0)
    loss = rng.normal(size=(20, 6))
    shifted = replace(problem, offset=loss, Q=problem.Q - np.einsum("rni,rn->ri", problem.J, loss))
    same(distribute(shifted), distribute(problem))


def test_weight_of_contacts_takes_load_off_them():
    problem = human_jaw(np.array([100.0]), MOLAR_RIGHT)
    loads, efforts = [], []
    for weight in (0.0, 1e-5, 1e-4, 1e-3, 1e-2):
        result = distribute(
            replace(problem, contact_weight=weight, reference_force=1.0), "weighted"
        )
        assert result.status[0] == Status.ok
        loads.append(float((result.contact_force**2).sum()))
        efforts.append(float(((result.effort / problem.high) ** 2).sum()))
    assert (np.diff(loads) < 0).all()
    assert (np.diff(efforts) > 0).all()


def test_a_contact_weight_is_one_number_for_arrays_and_models():
    """W has no unit: N_ref is the strongest muscle's force, 190.4 N, in both."""
    import condyle

    home, wrench = np.zeros(4), [0, 0, -100.0, 0, 0, 0]
    chosen = condyle.Distribution("weighted", contact_weight=30)
    model = condyle.derive("human-jaw", backend="numpy", distribution=chosen)
    of_model = model.inverse_dynamics(home, home, home, wrench, "right_molar").contact_force
    problem = human_jaw(np.array([100.0]), MOLAR_RIGHT, contact_weight=30)
    of_arrays = distribute(problem, "weighted").contact_force[0]
    np.testing.assert_allclose(np.abs(of_model), np.abs(of_arrays), rtol=1e-3)
    assert problem.force_weight == 30 / 190.4**2
    assert replace(problem, reference_force=10.0).force_weight == 0.3


def test_limits_that_do_not_bind_leave_the_least_norm():
    rng = np.random.default_rng(0)
    problem = random_problem(rng, 7, 1, 50, tight=100.0)
    same(distribute(problem, "bounded"), distribute(problem, "minimum_norm"))


def test_where_least_norm_is_within_limits_it_is_the_answer():
    rng = np.random.default_rng(0)
    problem = random_problem(rng, 7, 1, 80, tight=1.0, one_sided=True)
    problem = replace(problem, preload=1.0)
    least, bounded = distribute(problem, "minimum_norm"), distribute(problem, "bounded")
    kept = within(problem, least.effort, least.contact_force)
    assert 5 < kept.sum() < 75
    same_effort = np.abs(bounded.effort - least.effort).max(axis=1) < 1e-9
    np.testing.assert_array_equal(same_effort, kept)
