"""The two solvers of kernels: what is left of A^T tau = b, and whether tau is the shortest."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache

import casadi as ca
import numpy as np
import pytest

from condyle.dynamics.least_norm import Lanes, Pivots, Total, gram_schmidt, normal_equations

Solver = Callable[[Total, Lanes, ca.SX], tuple[Lanes, ca.SX, Pivots]]
ROUNDING = np.finfo(float).eps
SIZES = [(4, 1), (5, 2), (6, 3), (4, 4), (8, 4), (7, 5), (6, 6), (9, 6)]


def total(terms: Sequence[ca.SX]) -> ca.SX:
    """Every chain is a group of its own here."""
    return ca.sum2(ca.horzcat(*terms))


@cache
def compiled(solver: Solver, n: int, m: int, r: int = 1) -> ca.Function:
    A, b = ca.SX.sym("A", n, m), ca.SX.sym("b", m, r)
    tau, quality, _ = solver(total, [A[i, :].T for i in range(n)], b)
    assert len(tau) == n
    return ca.Function("solve", [A, b], [ca.vertcat(*tau), quality])


def solve(solver: Solver, A: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, float]:
    b = b.reshape(len(b), -1)
    tau, quality = compiled(solver, *A.shape, b.shape[1])(A, b)
    return tau.full(), float(quality)


def graded(rng: np.random.Generator, n: int, m: int, condition: float) -> np.ndarray:
    """A matrix with singular values from 1 down to 1 / condition."""
    U = np.linalg.qr(rng.normal(size=(n, m)))[0]
    V = np.linalg.qr(rng.normal(size=(m, m)))[0]
    return U * np.geomspace(1, 1 / condition if m > 1 else 1, m) @ V


def sides(rng: np.random.Generator, A: np.ndarray) -> np.ndarray:
    """Right-hand sides of every size of solution, (m, 6): any, and such as small tau bring."""
    n, m = A.shape
    return np.hstack([rng.normal(size=(m, 3)), A.T @ rng.normal(size=(n, 3))])


def residual(A: np.ndarray, tau: np.ndarray, b: np.ndarray) -> np.ndarray:
    """|A^T tau - b| of each right-hand side, row by row over |a_i| |tau|: (r,), the largest.

    In extended precision, where the platform has it.
    """
    wide = np.longdouble
    left = np.abs(A.astype(wide).T @ tau.astype(wide) - b.astype(wide))
    size = np.linalg.norm(A, axis=0)[:, None] * np.linalg.norm(tau, axis=0)
    return (left / size).max(axis=0).astype(float)


@pytest.mark.parametrize("n, m", SIZES)
@pytest.mark.parametrize("condition", 10.0 ** np.arange(0, 13, 2))
def test_gram_schmidt_keeps_equilibrium(n: int, m: int, condition: float) -> None:
    """Its residual is rounding times |A| |tau|, with columns of any length."""
    rng = np.random.default_rng([n, m])
    for scales in (np.ones(m), 10.0 ** rng.uniform(-4, 4, m)):
        A = graded(rng, n, m, condition) * scales
        for b in sides(rng, A).T:
            tau, quality = solve(gram_schmidt, A, b)
            assert residual(A, tau, b[:, None]).max() < 3 * n * ROUNDING
            assert 0 < quality <= 1


@pytest.mark.parametrize("n, m", SIZES)
def test_what_equilibrium_loses_is_less_than_the_condition_number(n: int, m: int) -> None:
    """The promise: |A^T tau - b| under 1e-12 |b| times the condition number, of either solver."""
    rng = np.random.default_rng([n, m, 1])
    chosen = 0
    for condition in 10.0 ** rng.uniform(0, 9, 200):
        A = graded(rng, n, m, condition) * 10.0 ** rng.uniform(-1, 1, m)
        b = sides(rng, A)
        tau, quality = solve(normal_equations, A, b)
        chosen += quality > 0
        if quality < 0:
            tau, _ = solve(gram_schmidt, A, b)
        left = np.linalg.norm(A.T @ tau - b)
        assert left < 1e-12 * np.linalg.cond(A) * np.linalg.norm(b)
    assert chosen > 0 and (m == 1 or chosen < 200)


@pytest.mark.parametrize("n, m", SIZES)
def test_where_normal_equations_stay(n: int, m: int) -> None:
    """Where they say that they hold they do, and they hold for every good condition."""
    rng = np.random.default_rng([n, m, 2])
    for condition in 10.0 ** rng.uniform(0, 4, 400):
        A = graded(rng, n, m, condition)
        A = A / np.linalg.norm(A, axis=0)
        b = sides(rng, A)[:, :1]
        scales = 2.0 ** rng.integers(-20, 20, m)
        tau, quality = solve(normal_equations, A * scales, b * scales[:, None])
        assert quality == solve(normal_equations, A, b)[1]
        if quality > 0:
            assert residual(A, tau, b).max() < 5e-13
        assert quality > 0 or np.linalg.cond(A) > 50 / np.sqrt(m)


@pytest.mark.parametrize("solver", [normal_equations, gram_schmidt])
@pytest.mark.parametrize("n, m", SIZES)
def test_torques_are_the_shortest(solver: Solver, n: int, m: int) -> None:
    """tau has nothing across the columns of A, and is numpy's."""
    rng = np.random.default_rng([n, m, 3])
    for condition in (1, 10) if solver is normal_equations else (1, 1e3, 1e6, 1e9):
        A = graded(rng, n, m, condition)
        b = sides(rng, A)
        tau, _ = solve(solver, A, b)
        U, sigma, Vt = np.linalg.svd(A, full_matrices=False)
        size = np.linalg.norm(tau, axis=0)
        assert (np.linalg.norm(tau - U @ (U.T @ tau), axis=0) < 1e-15 * 20 * condition * size).all()
        wanted = U @ ((Vt @ b) / sigma[:, None])
        bound = 50 * condition * (condition if solver is normal_equations else 1) * ROUNDING
        assert (np.linalg.norm(tau - wanted, axis=0) < bound * size).all()


def test_right_hand_sides_do_not_mix() -> None:
    rng = np.random.default_rng(4)
    A, b = graded(rng, 6, 4, 10), rng.normal(size=(4, 5))
    for solver in (normal_equations, gram_schmidt):
        together = solve(solver, A, b)[0]
        apart = np.hstack([solve(solver, A, column)[0] for column in b.T])
        np.testing.assert_allclose(together, apart, rtol=0, atol=1e-13)


def test_no_load_needs_no_torque_and_no_second_look() -> None:
    A = graded(np.random.default_rng(5), 6, 4, 10)
    tau, quality = solve(normal_equations, A, np.zeros(4))
    assert (tau == 0).all() and quality == 1


def test_what_cannot_be_solved_is_said() -> None:
    """A singular matrix, and numbers that are none."""
    rng = np.random.default_rng(6)
    A = rng.integers(-5, 6, (6, 3)).astype(float)
    singular = A.copy()
    singular[:, 2] = A[:, 0] - A[:, 1]
    for b in (np.ones(3), np.array([1.0, 0, 0])):
        assert solve(normal_equations, singular, b)[1] == -1
        assert not solve(gram_schmidt, singular, b)[1] > 1e-14
    for i in range(3):
        spoilt, b = A.copy(), np.ones(3)
        spoilt[1, i] = np.nan
        assert solve(normal_equations, spoilt, b)[1] == -1
        b[i] = np.nan
        assert solve(normal_equations, A, b)[1] == -1
