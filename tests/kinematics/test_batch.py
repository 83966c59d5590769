"""Functions of vectors at many samples."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from condyle.kinematics.batch import evaluate


def example() -> ca.Function:
    x, y, none = ca.SX.sym("x", 3), ca.SX.sym("y", 2), ca.SX.sym("none", 0)
    sparse = ca.SX(2, 3)
    sparse[0, 1], sparse[1, 2] = x[0], x[1] * y[0]
    return ca.Function("f", [x, y, none], [sparse, ca.dot(x, x), none])


@pytest.mark.parametrize("count", [0, 1, 5, 300])
def test_every_sample_by_itself(count: int) -> None:
    """Matrices column by column, zeros that no entry stores, inputs that are the same for all."""
    x, y = np.random.default_rng(0).normal(size=(count, 3)), np.array([2.0, 5.0])
    matrix, square, empty = evaluate(example(), x[:, ::-1], y, np.zeros((count, 0)))
    wanted = np.zeros((count, 6))
    wanted[:, 2], wanted[:, 5] = x[:, 2], 2 * x[:, 1]
    np.testing.assert_array_equal(matrix, wanted)
    np.testing.assert_allclose(square[:, 0], (x**2).sum(axis=1), rtol=1e-15)
    assert empty.shape == (count, 0)


def test_integers_are_numbers_too() -> None:
    f = ca.Function("f", [x := ca.SX.sym("x", 2)], [2 * x])
    np.testing.assert_array_equal(evaluate(f, np.array([[1, 2], [3, 4]]))[0], [[2, 4], [6, 8]])
