"""Singular values in a fixed number of operations, against LAPACK's."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import casadi as ca
import numpy as np
import pytest

from condyle.dynamics.singular_values import singular_values

SIZES = [(4, 1), (6, 1), (4, 2), (6, 2), (4, 3), (5, 3), (4, 4), (8, 4), (6, 5), (6, 6), (9, 6)]
COUNT = 2000


def total(terms: Sequence[ca.SX]) -> ca.SX:
    """Every chain is a group of its own here."""
    return ca.sum2(ca.horzcat(*terms))


@cache
def compiled(n: int, m: int) -> ca.Function:
    A = ca.SX.sym("A", n, m)
    sigma, quality = singular_values(total, [A[i, :].T for i in range(n)])
    return ca.Function("values", [A], [sigma, quality])


def values(A: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Singular values, (N, m), and quality, (N,), of N matrices."""
    count, n, m = A.shape
    sigma, quality = compiled(n, m).map(count)(A.transpose(1, 0, 2).reshape(n, count * m))
    return sigma.full().T, quality.full().ravel()


def with_values(rng: np.random.Generator, n: int, sigma: np.ndarray) -> np.ndarray:
    """Matrices of given singular values, (N, m)."""
    count, m = sigma.shape
    U = np.linalg.qr(rng.normal(size=(count, n, m)))[0]
    V = np.linalg.qr(rng.normal(size=(count, m, m)))[0]
    return U * sigma[:, None, :] @ V


def matrices(kind: str, n: int, m: int) -> np.ndarray:
    rng = np.random.default_rng([n, m])
    shape = (COUNT, m)
    if kind == "any":
        return rng.normal(size=(COUNT, n, m))
    if kind == "far apart":
        return with_values(rng, n, 10.0 ** rng.uniform(-2.5, 0, shape))
    if kind == "alike":
        near = 10.0 ** rng.uniform(-17, 0, shape) * rng.integers(0, 2, shape)
        return with_values(rng, n, 1 + near)
    if kind == "in two heaps":
        return with_values(
            rng, n, rng.choice([0.2, 1], shape) + 10.0 ** rng.uniform(-17, -3, shape)
        )
    assert kind == "next to singular"
    sigma = rng.uniform(0.1, 1, shape)
    if m > 1:
        sigma[:, -1] = 10.0 ** rng.uniform(-18, -2, COUNT)
    return with_values(rng, n, sigma)


KINDS = ["any", "far apart", "alike", "in two heaps", "next to singular"]


@pytest.mark.parametrize("n, m", SIZES)
@pytest.mark.parametrize("kind", KINDS)
def test_they_are_the_singular_values(kind: str, n: int, m: int) -> None:
    """To 1e-13 of the largest; the smallest to some roundings of it where one alone is small."""
    A = matrices(kind, n, m)
    sigma, quality = values(A)
    assert (quality > 0).mean() > 0.997
    wanted = np.linalg.svd(A, compute_uv=False)
    error = np.abs(sigma - wanted)[quality > 0] / wanted[quality > 0, :1]
    assert error.max() < 1e-13
    if kind in ("any", "next to singular"):
        assert error[:, -1].max() < 5e-15


@pytest.mark.parametrize("n, m", SIZES)
@pytest.mark.parametrize("scale", [1e-40, 1e-9, 1e12, 1e40])
def test_units_do_not_matter(n: int, m: int, scale: float) -> None:
    A = np.random.default_rng(0).normal(size=(20, n, m))
    plain, again = values(A), values(A * scale)
    np.testing.assert_allclose(again[0], plain[0] * scale, rtol=1e-12)
    assert (plain[1] == again[1]).all()


@pytest.mark.parametrize("n, m", [size for size in SIZES if size[1] > 1])
def test_singular_matrices(n: int, m: int) -> None:
    """A column that is zero, or another one again, or their sum: the smallest value is 0."""
    rng = np.random.default_rng(1)
    A = rng.integers(-9, 10, (3 * m, n, m)).astype(float)
    for k in range(m):
        A[3 * k, :, k] = 0
        A[3 * k + 1, :, k] = A[3 * k + 1, :, k - 1]
        A[3 * k + 2, :, k] = np.delete(A[3 * k + 2], k, axis=1).sum(axis=1)
    sigma, quality = values(A)
    assert (quality > 0).all()
    assert (sigma[:, -1] < 1e-14 * sigma[:, 0]).all()


@pytest.mark.parametrize("n, m", SIZES)
def test_nothing_to_rotate(n: int, m: int) -> None:
    """Orthogonal columns, of one length or several; no matrix at all."""
    unit = np.eye(n)[:, :m]
    for A in (
        unit,
        unit[:, ::-1],
        -3 * unit,
        unit * np.arange(1, m + 1),
        unit / np.arange(1, m + 1),
    ):
        sigma, quality = values(A[None])
        assert quality > 0
        np.testing.assert_allclose(
            sigma[0], np.sort(np.linalg.norm(A, axis=0))[::-1], rtol=1e-14, atol=0
        )
    assert (values(np.zeros((1, n, m)))[0] == 0).all()


@pytest.mark.parametrize("n, m", SIZES)
def test_what_is_no_number_is_said(n: int, m: int) -> None:
    A = np.random.default_rng(2).normal(size=(n * m, n, m))
    for bad in (np.nan, np.inf):
        for i in range(n * m):
            A[i].flat[i] = bad
        sigma, quality = values(A)
        assert (quality == -1).all() and not np.isfinite(sigma).any()


@pytest.mark.parametrize("n, m", [(6, 3), (4, 4), (6, 6)])
def test_what_is_certain_is_right_and_the_rest_is_said(n: int, m: int) -> None:
    """Singular values over twelve decades: several are small, and some samples are sent on."""
    rng = np.random.default_rng(3)
    A = with_values(rng, n, 10.0 ** rng.uniform(-12, 0, (COUNT, m)))
    sigma, quality = values(A)
    wanted = np.linalg.svd(A, compute_uv=False)
    good = quality > 0
    assert 0.01 < good.mean() < 0.9 and set(quality) == {1, -1}
    assert (np.abs(sigma - wanted)[good] < 1e-13 * wanted[good, :1]).all()
    # The second smallest decides.
    assert good[wanted[:, -2] > 3e-3 * wanted[:, 0]].mean() > 0.997


@pytest.mark.parametrize("n, m, bound", [(4, 1, 21), (4, 2, 80), (4, 4, 900), (6, 6, 2500)])
def test_they_cost_little(n: int, m: int, bound: int) -> None:
    assert compiled(n, m).n_instructions() < bound
