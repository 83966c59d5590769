"""The question `allocation` against every active set tried one by one, and the robust solver."""

from dataclasses import replace

import numpy as np
import pytest

from condyle.distribution import Status, distribute
from condyle.distribution.distribute import _kernel

from .cases import MOLAR_RIGHT, human_jaw, random_problem
from .oracle import best_active_set, full, least_stretch, signs
from .test_oracle import TOLERANCE

pytestmark = pytest.mark.slow

# Efforts, contacts, contacts with friction.
SHAPES = [(6, 2, 0), (5, 2, 1), (4, 2, 2), (4, 3, 1), (8, 0, 0)]


def drawn(seed, shape, count, **more):
    n, k, friction = shape
    options = {"one_sided": bool(seed % 2), "pull": seed % 3 == 0} | more
    rng = np.random.default_rng(seed)
    preload, tight = float(rng.choice([0.0, 1.0])), float(rng.choice([0.3, 0.6, 1.0]))
    return random_problem(rng, n, k, count, friction, preload=preload, tight=tight, **options)


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("name", ["minimum_norm", "bounded", "weighted"])
def test_least_of_all_active_sets(name, shape):
    weight = 1e-4 if name == "weighted" else 0.0
    for seed in range(4):
        problem = replace(drawn(seed, shape, 3), contact_weight=weight, reference_force=1.0)
        found = distribute(problem, name, "numpy")
        scale = problem.scale if name == "weighted" else np.ones(problem.n)
        for i in range(3):
            programs = [
                full(problem, i, sign, scale, name != "minimum_norm", weight)
                for sign in signs(problem)
            ]
            answers = [a for a in map(best_active_set, programs) if a is not None]
            assert found.status[i] == (Status.ok if answers else Status.infeasible)
            if answers:
                best = min(answers, key=lambda answer: answer[0])[1]
                mine = np.r_[found.effort[i], found.contact_force[i]]
                np.testing.assert_allclose(mine, best, rtol=0, atol=TOLERANCE * np.abs(best).max())
            else:
                least = min(map(least_stretch, programs))
                np.testing.assert_allclose(found.shortfall[i], least, rtol=1e-7)


@pytest.mark.parametrize(
    ("name", "shape"), [*(("bounded", s) for s in SHAPES), ("cubic", (9, 2, 1))]
)
def test_as_the_robust_solver(name, shape):
    """Active sets of DAQP share nothing with Newton's method on the dual."""
    seen, pull = set(), {"pull": True} if name == "cubic" else {}
    for seed in range(4):
        problem = drawn(seed, shape, 40, **pull)
        found, wanted = distribute(problem, name, "numpy"), distribute(problem, name, None)
        np.testing.assert_array_equal(found.status, wanted.status)
        good = wanted.status == Status.ok
        size = np.abs(wanted.effort[good]).max(initial=0.0)
        assert np.abs(found.effort - wanted.effort)[good].max(initial=0.0) <= 1e-9 * size
        np.testing.assert_allclose(found.shortfall, wanted.shortfall, rtol=1e-9)
        seen |= set(wanted.status.tolist())
    assert seen >= {Status.ok, Status.infeasible}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["bounded", "weighted", "cubic"])
def test_few_bites_of_the_jaw_are_left_to_others(name, monkeypatch):
    """As compiled code finds them; from far within the limits to what no bite reaches."""
    problem = human_jaw(np.linspace(1.0, 1500.0, 400), MOLAR_RIGHT)
    fits = np.flatnonzero(distribute(problem, "bounded").status == Status.ok)
    assert 100 < len(fits) < 400
    alone = []
    monkeypatch.setitem(distribute.__globals__, "_alone", lambda p, i, *rest: alone.append(i))
    found = distribute(problem.take(fits), name, "compiled")
    assert len(alone) <= 0.06 * len(fits)
    assert found.residual[found.status == Status.ok].max() <= 1e-13


def test_limits_that_are_met_exactly_and_mirrored_efforts():
    """A machine with planes of symmetry; a limit may be the answer itself."""
    lines = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    J = np.zeros((1, 8, 6))
    J[0, :3, :3] = J[0, 3:6, :3] = lines
    J[0, 3:6, 3:] = np.cross([0.0, 0.1, 0.2], lines)
    J[0, 6:, :3], J[0, 6:, 3:] = [0.0, 0.6, 0.8], [[0.1, 0, 0], [0.0, 0.08, -0.06]]
    effort = np.array([1.0, -2, 3, -4, 5, 6, 7, -8])
    problem = replace(
        drawn(0, (8, 0, 0), 1), J=J, Q=np.einsum("rni,n->ri", J, effort), friction=None
    )
    wide = distribute(replace(problem, low=None, high=None), "minimum_norm", None).effort[0]
    for size in (1.0, 1.0 - 1e-12, 0.9, 0.5, 0.1):
        largest = size * np.abs(wide).max()
        tight = replace(problem, low=np.full(8, -largest), high=np.full(8, largest))
        found, wanted = (distribute(tight, "bounded", backend) for backend in ("numpy", None))
        assert found.status[0] == wanted.status[0]
        np.testing.assert_allclose(found.effort[0], wanted.effort[0], atol=1e-9 * largest)
        np.testing.assert_allclose(found.shortfall, wanted.shortfall, rtol=1e-9)


def test_a_contact_that_must_push_and_may_not_has_no_efforts():
    """Its pattern asks for a force of the other sign than its preload."""
    problem = drawn(1, (6, 2, 2), 30, one_sided=True)
    problem = replace(problem, preload=5.0, low=np.full(6, -1e3), high=np.full(6, 1e3))
    found, wanted = distribute(problem, "bounded", "numpy"), distribute(problem, "bounded", None)
    assert (found.pattern == wanted.pattern).all() and (found.status == wanted.status).all()


@pytest.mark.slow
def test_compiled_as_by_numpy():
    problem = human_jaw(np.linspace(1.0, 900.0, 50), MOLAR_RIGHT)
    compiled, plain = (distribute(problem, "bounded", name) for name in ("compiled", "numpy"))
    np.testing.assert_allclose(compiled.effort, plain.effort, rtol=0, atol=1e-10)
    assert _kernel(24, 2, "square", False, "compiled").name == "compiled"
