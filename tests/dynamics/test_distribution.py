"""Torques of least 2-norm, to the last digits that the condition number leaves."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from oracles.random_mechanism import random_mechanism, random_state, toml_text
from support.loads import load_point_of, parts, with_point

import condyle
from condyle.dynamics.minimum_norm import minimum_norm
from condyle.mechanism import parse

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("n, m", [(6, 6), (6, 4), (8, 4), (5, 1)])
def test_least_norm(n: int, m: int) -> None:
    """It solves the equations, is numpy's, and any other solution is longer."""
    rng = np.random.default_rng(n + m)
    A, b = rng.normal(size=(20, n, m)), rng.normal(size=(20, m, 3))
    tau = minimum_norm(A, rng.uniform(0.1, 10, m), b)
    np.testing.assert_allclose(A.transpose(0, 2, 1) @ tau, b, atol=1e-12)
    np.testing.assert_allclose(tau, np.linalg.pinv(A.transpose(0, 2, 1)) @ b, atol=1e-11)
    for i in range(20 if n > m else 0):
        null = np.linalg.svd(A[i].T)[2][m:]
        other = tau[i] + 0.1 * (rng.normal(size=(3, n - m)) @ null).T
        np.testing.assert_allclose(A[i].T @ other, b[i], atol=1e-12)
        assert (np.linalg.norm(other, axis=0) > np.linalg.norm(tau[i], axis=0)).all()


def exact(A: list[list[Fraction]], b: list[Fraction]) -> list[Fraction]:
    """A^-1 b by elimination, without rounding."""
    rows = [[*row, value] for row, value in zip(A, b, strict=True)]
    for i in range(len(rows)):
        pivot = next(r for r in range(i, len(rows)) if rows[r][i])
        rows[i], rows[pivot] = rows[pivot], rows[i]
        rows[i] = [value / rows[i][i] for value in rows[i]]
        for r in set(range(len(rows))) - {i}:
            rows[r] = [x - rows[r][i] * y for x, y in zip(rows[r], rows[i], strict=True)]
    return [row[-1] for row in rows]


@pytest.mark.parametrize("n", [6, 8])
def test_an_ill_conditioned_jacobian_costs_its_condition_number_and_no_more(n: int) -> None:
    """Condition 1e9: normal equations, which square it, would leave no digit."""
    rng = np.random.default_rng(0)
    A = rng.integers(-9, 10, (n, 4)).astype(float)
    A[:, 3] = A[:, 0] + A[:, 1] + 2.0**-30 * A[:, 3]
    b = rng.integers(-9, 10, 4).astype(float)
    F = [[Fraction(x) for x in row] for row in A]
    gram = [[sum((r[i] * r[j] for r in F), Fraction()) for j in range(4)] for i in range(4)]
    y = exact(gram, [Fraction(x) for x in b])
    wanted = np.array(
        [float(sum((x * w for x, w in zip(r, y, strict=True)), Fraction())) for r in F]
    )
    tau = minimum_norm(A[None], np.ones(4), b[None, :, None])[0, :, 0]
    condition = np.linalg.cond(A)
    assert 1e9 < condition < 1e11
    assert np.abs(tau - wanted).max() < 10 * condition * 2e-16 * np.abs(wanted).max()


@pytest.mark.parametrize(
    "contacts, chains, backend",
    [
        *((k, n, "numpy") for k, n in ((2, 8), (1, 6), (5, 6))),
        pytest.param(2, 8, "compiled", marks=pytest.mark.slow),
    ],
)
def test_models_choose_the_least_norm(contacts: int, chains: int, backend: str) -> None:
    raw = random_mechanism(np.random.default_rng(9), contacts=contacts, chains=chains)
    model = condyle.derive(parse(toml_text(raw)), backend=backend)
    states = random_state(np.random.default_rng(2), raw, 3)
    load = with_point(states["wrench"], load_point_of(model, None))
    m = 6 - contacts
    for i in range(3):
        q, q1, q2 = (states[key][i] for key in ("q", "qd", "qdd"))
        zero = np.zeros((m, m))
        A = model.inverse_dynamics(np.tile(q, (m, 1)), np.eye(m), zero, outputs="all").joint_rate.T
        tau = model.inverse_dynamics(q[None], q1[None], q2[None], *parts(load[i : i + 1])).effort[0]
        least = np.linalg.pinv(A.T) @ (A.T @ tau)
        np.testing.assert_allclose(tau, least, atol=1e-11 * np.abs(tau).max())
