"""Every answer meets the conditions of optimality, with multipliers found anew by SciPy."""

import numpy as np
import pytest
from scipy.optimize import nnls

from condyle.distribution import Status, distribute

from .cases import random_problem
from .oracle import full

SLOPES = {
    "minimum_norm": lambda e, scale: e,
    "bounded": lambda e, scale: e,
    "weighted": lambda e, scale: e / scale**2,
    "cubic": lambda e, scale: e**2 / scale**3,
}
SHAPES = [(6, 2, 0, False), (7, 1, 1, True), (9, 3, 2, True), (24, 0, 0, False), (12, 0, 0, False)]


def unexplained(f, z, gradient):
    """The gradient less the best combination of allowed multipliers, relative."""
    big = np.abs(z).max()
    columns = [*f.C, *(-f.C)]
    for j in range(len(z)):
        unit = np.zeros(len(z))
        unit[j] = 1.0
        if z[j] - f.low[j] <= 1e-9 * big:
            columns.append(unit)
        if f.high[j] - z[j] <= 1e-9 * big:
            columns.append(-unit)
    A = np.array(columns).T
    A = A / np.linalg.norm(A, axis=0)
    return nnls(A, gradient / np.abs(gradient).max(), maxiter=2000)[1]


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("name", SLOPES)
def test_equations_bounds_and_multipliers(name, shape):
    n, k, friction, one_sided = shape
    rng = np.random.default_rng(n)
    problem = random_problem(
        rng,
        n,
        k,
        40,
        friction=friction,
        one_sided=one_sided,
        tight=0.8 if n < 12 else 0.3,
        pull=name == "cubic",
    )
    result = distribute(problem, name)
    ok = np.flatnonzero(result.status == Status.ok)
    assert len(ok) > 10
    assert set(result.status) <= {Status.ok, Status.infeasible}
    scale = problem.scale if name in ("weighted", "cubic") else np.ones(n)
    touched, limits = 0, name != "minimum_norm"
    for i in ok:
        f = full(problem, i, tuple(result.pattern[i]), scale, limits, 0.0)
        z = np.concatenate([result.effort[i], result.contact_force[i]])
        big = np.abs(z).max()
        assert np.abs(f.C @ z - f.q).max() <= 1e-9 * big
        assert (z >= f.low - 1e-9 * big).all() and (z <= f.high + 1e-9 * big).all()
        gradient = np.concatenate([SLOPES[name](z[:n], scale), np.zeros(k)])
        assert unexplained(f, z, gradient) <= 1e-7
        touched += (z[:n] <= f.low[:n]).any() or (z[:n] >= f.high[:n]).any()
    assert touched > 0 or not limits
