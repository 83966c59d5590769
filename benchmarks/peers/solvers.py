"""Quadratic programs by other solvers, one at a time from Python, as their users call them.

    least |x|^2 / 2   with   A x = b,   low <= x <= high,   least <= B x <= most

No solver imports condyle. A function takes (A, b, low, high, B, least, most), arrays of numbers
with infinite bounds, and returns x; it is imported where it is first called.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

Array = np.ndarray
Solver = Callable[[Array, Array, Array, Array, Array, Array, Array], Array]


def daqp(A: Array, b: Array, low: Array, high: Array, B: Array, least: Array, most: Array) -> Array:
    import daqp

    n, m = A.shape[1], len(b)
    sense = np.zeros(n + m + len(B), dtype=np.int32)
    sense[n : n + m] = 5  # an equation
    rows = np.ascontiguousarray(np.vstack([A, B]))
    above, below = np.concatenate([high, b, most]), np.concatenate([low, b, least])
    x, _, flag, _ = daqp.solve(np.eye(n), np.zeros(n), rows, above, below, sense)
    assert flag == 1
    return np.array(x)


def quadprog(
    A: Array, b: Array, low: Array, high: Array, B: Array, least: Array, most: Array
) -> Array:
    import quadprog

    n = A.shape[1]
    rows = np.vstack([A, np.eye(n), -np.eye(n), B, -B])
    right = np.concatenate([b, low, -high, least, -most])
    kept = np.isfinite(right)
    found = quadprog.solve_qp(np.eye(n), np.zeros(n), rows[kept].T, right[kept], meq=len(b))
    return np.array(found[0])


def highs(
    A: Array, b: Array, low: Array, high: Array, B: Array, least: Array, most: Array
) -> Array:
    import highspy

    n, rows = A.shape[1], np.vstack([A, B])
    model = highspy.HighsModel()
    lp, hessian = model.lp_, model.hessian_
    lp.num_col_, lp.num_row_ = n, len(rows)
    lp.col_cost_, lp.col_lower_, lp.col_upper_ = np.zeros(n), low, high
    lp.row_lower_, lp.row_upper_ = np.concatenate([b, least]), np.concatenate([b, most])
    matrix = lp.a_matrix_
    matrix.format_ = highspy.MatrixFormat.kRowwise
    matrix.start_ = np.arange(len(rows) + 1) * n
    matrix.index_, matrix.value_ = np.tile(np.arange(n), len(rows)), rows.ravel()
    hessian.dim_, hessian.format_ = n, highspy.HessianFormat.kTriangular
    hessian.start_, hessian.index_, hessian.value_ = np.arange(n + 1), np.arange(n), np.ones(n)
    solver = highspy.Highs()
    solver.setOptionValue("output_flag", False)
    solver.passModel(model)
    solver.run()
    return np.array(solver.getSolution().col_value)


def osqp(A: Array, b: Array, low: Array, high: Array, B: Array, least: Array, most: Array) -> Array:
    import osqp
    from scipy.sparse import csc_matrix, identity

    n = A.shape[1]
    solver = osqp.OSQP()
    above, below = np.concatenate([b, high, most]), np.concatenate([b, low, least])
    options: dict[str, Any] = {"verbose": False, "eps_abs": 1e-9, "eps_rel": 1e-9}
    rows = csc_matrix(np.vstack([A, np.eye(n), B]))
    solver.setup(
        identity(n, format="csc"), np.zeros(n), rows, below, above, max_iter=100_000, **options
    )
    return np.array(solver.solve(raise_error=True).x)


SOLVERS: dict[str, Solver] = {"DAQP": daqp, "quadprog": quadprog, "HiGHS": highs, "OSQP": osqp}
