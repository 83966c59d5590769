"""A^T tau = b and singular values: what is left of the equations, whether tau is the shortest."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from typing import Any

import casadi as ca
import numpy as np
import pytest
from mpmath import mp

from condyle.dynamics.least_norm import gram_schmidt, normal_equations
from condyle.dynamics.minimum_norm import minimum_norm
from condyle.dynamics.singular_values import singular_values

Array = np.ndarray
Solver = Callable[..., Any]
EPS = np.finfo(float).eps
SIZES = [(4, 1), (5, 2), (5, 3), (4, 4), (8, 4), (6, 6)]
every_size = pytest.mark.parametrize("n, m", SIZES)


def total(terms: Sequence[ca.SX]) -> ca.SX:
    """Every chain is a group of its own here."""
    return ca.sum2(ca.horzcat(*terms))


@cache
def compiled(method: Solver, n: int, m: int, sides: int = 0) -> ca.Function:
    A, b = ca.SX.sym("A", n, m), ca.SX.sym("b", m, sides)
    lanes = [A[i, :].T for i in range(n)]
    if method is singular_values:
        return ca.Function("values", [A], [*singular_values(total, lanes)])
    tau, quality, _ = method(total, lanes, b)
    assert len(tau) == n
    return ca.Function("solve", [A, b], [ca.vertcat(*tau), quality])


def solve(solver: Solver, A: Array, b: Array) -> tuple[Array, float]:
    b = b.reshape(len(b), -1)
    tau, quality = compiled(solver, *A.shape, b.shape[1])(A, b)
    return tau.full(), float(quality)


def values(A: Array) -> tuple[Array, Array]:
    """Singular values, (N, m), and quality, (N,), of N matrices."""
    count, n, m = A.shape
    sigma, quality = compiled(singular_values, n, m).map(count)(
        A.transpose(1, 0, 2).reshape(n, count * m)
    )
    return sigma.full().T, quality.full().ravel()


def with_values(rng: np.random.Generator, n: int, sigma: Array) -> Array:
    """Matrices of given singular values, (..., m)."""
    m = sigma.shape[-1]
    U = np.linalg.qr(rng.normal(size=(*sigma.shape[:-1], n, m)))[0]
    V = np.linalg.qr(rng.normal(size=(*sigma.shape[:-1], m, m)))[0]
    return np.asarray(U * sigma[..., None, :] @ V)


def graded(rng: np.random.Generator, n: int, m: int, condition: float) -> Array:
    """A matrix with singular values from 1 down to 1 / condition."""
    return with_values(rng, n, np.geomspace(1, 1 / condition if m > 1 else 1, m))


def sides(rng: np.random.Generator, A: Array) -> Array:
    """Right-hand sides of every size of solution, (m, 6): any, and such as small tau bring."""
    n, m = A.shape
    return np.hstack([rng.normal(size=(m, 3)), A.T @ rng.normal(size=(n, 3))])


def residual(A: Array, tau: Array, b: Array) -> float:
    """The largest |A^T tau - b|, row by row over |a_i| |tau|; extended precision where there is."""
    wide = np.longdouble
    left = np.abs(A.astype(wide).T @ tau.astype(wide) - b.astype(wide))
    return float((left / np.linalg.norm(A, axis=0)[:, None] / np.linalg.norm(tau, axis=0)).max())


@every_size
def test_minimum_norm_loses_the_condition_number_and_no_more(n: int, m: int) -> None:
    """Against 60 digits. At 1e9 normal equations, which square it, would leave no digit."""
    rng = np.random.default_rng([n, m, 4])
    A = np.array([graded(rng, n, m, condition) for condition in (1, 1e3, 1e9, 1)])
    b, scale = rng.normal(size=(4, m, 2)), rng.uniform(0.1, 10, m)
    A[3, 0, 0] = np.nan
    tau = minimum_norm(A, scale, b)
    assert np.isnan(tau[3]).all()
    for one, right, found in zip(A[:3], b, tau, strict=False):
        with mp.workdps(60):
            F = mp.matrix(one)
            columns = [F * mp.lu_solve(F.T * F, mp.matrix(column)) for column in right.T]
        wanted = np.array([[float(x) for x in column] for column in columns]).T
        bound = 10 * np.linalg.cond(one / scale) * EPS * np.abs(wanted).max()
        np.testing.assert_allclose(found, wanted, rtol=0, atol=bound)


@every_size
def test_gram_schmidt_keeps_equilibrium(n: int, m: int) -> None:
    """Its residual is rounding times |A| |tau|, with columns of any length."""
    rng = np.random.default_rng([n, m])
    for condition in 10.0 ** np.arange(0, 13, 2):
        for scales in (np.ones(m), 10.0 ** rng.uniform(-4, 4, m)):
            A = graded(rng, n, m, condition) * scales
            for b in sides(rng, A).T:
                tau, quality = solve(gram_schmidt, A, b)
                assert residual(A, tau, b[:, None]) < 3 * n * EPS and 0 < quality <= 1


@every_size
def test_what_equilibrium_loses_is_less_than_the_condition_number(n: int, m: int) -> None:
    """The promise: |A^T tau - b| under 1e-12 |b| times the condition number, of either solver."""
    rng = np.random.default_rng([n, m, 1])
    chosen = 0
    for condition in 10.0 ** rng.uniform(0, 9, 100):
        A = graded(rng, n, m, condition) * 10.0 ** rng.uniform(-1, 1, m)
        b = sides(rng, A)
        tau, quality = solve(normal_equations, A, b)
        chosen += quality > 0
        if quality < 0:
            tau, _ = solve(gram_schmidt, A, b)
        assert np.linalg.norm(A.T @ tau - b) < 1e-12 * np.linalg.cond(A) * np.linalg.norm(b)
    assert chosen > 0 and (m == 1 or chosen < 100)


@every_size
def test_where_normal_equations_stay(n: int, m: int) -> None:
    """Where they say that they hold they do, and they hold for every good condition."""
    rng = np.random.default_rng([n, m, 2])
    for condition in 10.0 ** rng.uniform(0, 4, 150):
        A = graded(rng, n, m, condition)
        A = A / np.linalg.norm(A, axis=0)
        b, scales = sides(rng, A)[:, :1], 2.0 ** rng.integers(-20, 20, m)
        tau, quality = solve(normal_equations, A * scales, b * scales[:, None])
        assert quality == solve(normal_equations, A, b)[1]
        assert quality < 0 or residual(A, tau, b) < 5e-13
        assert quality > 0 or np.linalg.cond(A) > 50 / np.sqrt(m)


@pytest.mark.parametrize("solver", [normal_equations, gram_schmidt])
@every_size
def test_torques_are_the_shortest(solver: Solver, n: int, m: int) -> None:
    """tau has nothing across the columns of A, and is numpy's; right-hand sides do not mix."""
    rng, normal = np.random.default_rng([n, m, 3]), solver is normal_equations
    for condition in (1, 10) if normal else (1, 1e3, 1e6, 1e9):
        A = graded(rng, n, m, condition)
        b = sides(rng, A)
        tau, _ = solve(solver, A, b)
        U, sigma, Vt = np.linalg.svd(A, full_matrices=False)
        size = np.linalg.norm(tau, axis=0)
        assert (np.linalg.norm(tau - U @ (U.T @ tau), axis=0) < 2e-14 * condition * size).all()
        wanted = U @ ((Vt @ b) / sigma[:, None])
        bound = 50 * condition * (condition if normal else 1) * EPS
        assert (np.linalg.norm(tau - wanted, axis=0) < bound * size).all()


def test_what_cannot_be_solved_is_said() -> None:
    """A singular matrix, and numbers that are none; nothing to solve needs no second look."""
    A = np.random.default_rng(6).integers(-5, 6, (6, 3)).astype(float)
    tau, quality = solve(normal_equations, A, np.zeros(3))
    assert (tau == 0).all() and quality == 1
    singular = np.column_stack([A[:, :2], A[:, 0] - A[:, 1]])
    for b in (np.ones(3), np.array([1.0, 0, 0])):
        assert solve(normal_equations, singular, b)[1] == -1
        assert not solve(gram_schmidt, singular, b)[1] > 1e-14
    for i in range(3):
        spoilt, b = A.copy(), np.ones(3)
        spoilt[1, i] = np.nan
        assert solve(normal_equations, spoilt, b)[1] == -1
        b[i] = np.nan
        assert solve(normal_equations, A, b)[1] == -1


# -- singular values -----------------------------------------------------------------------


def kinds(rng: np.random.Generator, n: int, m: int) -> dict[str, Array]:
    """A thousand matrices of each kind."""
    shape = (1000, m)
    near = 10.0 ** rng.uniform(-17, 0, shape) * rng.integers(0, 2, shape)
    heaps = rng.choice([0.2, 1], shape) + 10.0 ** rng.uniform(-17, -3, shape)
    small = rng.uniform(0.1, 1, shape)
    if m > 1:
        small[:, -1] = 10.0 ** rng.uniform(-18, -2, len(small))
    drawn = {
        "far apart": 10.0 ** rng.uniform(-2.5, 0, shape), "alike": 1 + near,
        "in two heaps": heaps, "next to singular": small,
    }  # fmt: skip
    found = {kind: with_values(rng, n, sigma) for kind, sigma in drawn.items()}
    return found | {"any": rng.normal(size=(1000, n, m))}


@every_size
def test_they_are_lapack_s(n: int, m: int) -> None:
    """To 1e-13 of the largest; the smallest to some roundings of it where one alone is small."""
    for kind, A in kinds(np.random.default_rng([n, m]), n, m).items():
        sigma, quality = values(A)
        assert (quality > 0).mean() > 0.997 and {*quality} <= {1, -1}
        wanted = np.linalg.svd(A, compute_uv=False)
        error = np.abs(sigma - wanted)[quality > 0] / wanted[quality > 0, :1]
        assert error.max() < 1e-13
        assert kind not in ("any", "next to singular") or error[:, -1].max() < 5e-15


@every_size
def test_units_do_not_matter_and_what_is_no_number_is_said(n: int, m: int) -> None:
    A = np.random.default_rng(0).normal(size=(n * m, n, m))
    plain = values(A)
    for scale in (1e-40, 1e-9, 1e12, 1e40):
        again = values(A * scale)
        np.testing.assert_allclose(again[0], plain[0] * scale, rtol=1e-12)
        assert (plain[1] == again[1]).all()
    for bad in (np.nan, np.inf):
        for i in range(n * m):
            A[i].flat[i] = bad
        sigma, quality = values(A)
        assert (quality == -1).all() and not np.isfinite(sigma).any()


@every_size
def test_singular_and_orthogonal_columns(n: int, m: int) -> None:
    """A column that is zero, another one again, or their sum: the smallest value is 0. Orthogonal
    ones, where there is nothing to rotate, have their lengths."""
    A = np.random.default_rng(1).integers(-9, 10, (3 * m, n, m)).astype(float)
    for k in range(m):
        A[3 * k, :, k] = 0
        A[3 * k + 1, :, k] = A[3 * k + 1, :, k - 1]
        A[3 * k + 2, :, k] = np.delete(A[3 * k + 2], k, axis=1).sum(axis=1)
    if m > 1:
        sigma, quality = values(A)
        assert (quality > 0).all() and (sigma[:, -1] < 1e-14 * sigma[:, 0]).all()
    unit, rising = np.eye(n)[:, :m], np.arange(1, m + 1)
    lengths = np.array([unit, unit[:, ::-1], -3 * unit, unit * rising, unit / rising, 0 * unit])
    sigma, quality = values(lengths)
    assert (quality[:-1] > 0).all() and (sigma[-1] == 0).all()
    wanted = np.sort(np.linalg.norm(lengths, axis=1))[:, ::-1]
    np.testing.assert_allclose(sigma, wanted, rtol=1e-14, atol=0)


@pytest.mark.parametrize("n, m", [(5, 3), (4, 4), (6, 6)])
def test_what_is_certain_is_right_and_the_rest_is_said(n: int, m: int) -> None:
    """Singular values over twelve decades: several are small, and some samples are sent on."""
    rng = np.random.default_rng(3)
    A = with_values(rng, n, 10.0 ** rng.uniform(-12, 0, (1000, m)))
    sigma, quality = values(A)
    wanted = np.linalg.svd(A, compute_uv=False)
    good = quality > 0
    assert 0.01 < good.mean() < 0.9 and set(quality) == {1, -1}
    assert (np.abs(sigma - wanted)[good] < 1e-13 * wanted[good, :1]).all()
    # The second smallest decides.
    assert good[wanted[:, -2] > 3e-3 * wanted[:, 0]].mean() > 0.997


def test_they_cost_little() -> None:
    for n, m, bound in ((4, 1, 21), (4, 2, 80), (4, 4, 900), (6, 6, 2500)):
        assert compiled(singular_values, n, m).n_instructions() < bound
