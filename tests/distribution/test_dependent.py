"""Contacts that depend on each other: a block on four corners has certain efforts, and forces of
least norm."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import nnls

from condyle.distribution import Outcome, Problem, distribute

CORNERS = np.array([[x, y, 0.0] for x in (-1, 1) for y in (-1, 1)])
UP = np.array([0.0, 0.0, 1.0])
NORMAL = np.array([[*UP, *np.cross(corner, UP)] for corner in CORNERS])


def block(rng: np.random.Generator, samples: int, n: int = 6) -> Problem:
    """Loads that lie on all corners, on some, or on none of them."""
    Q = rng.normal(size=(samples, 6)) * [1, 1, 5, 5, 5, 1] + [0, 0, 5, 0, 0, 0]
    J = rng.normal(size=(samples, n, 6))
    return Problem(Q, J, np.tile(NORMAL, (samples, 1, 1)), push=np.ones(4))


@pytest.mark.parametrize("backend", ["numpy", None])
def test_a_block_on_four_corners_is_indeterminate(backend: str | None) -> None:
    p = block(np.random.default_rng(46), 20)
    result = distribute(p, "bounded", backend)  # type: ignore[arg-type]
    assert (result.status == Outcome.indeterminate).all()
    for i in range(p.count):
        tau, force = result.effort[i], result.contact_force[i]
        borne = p.Q[i] - p.J[i].T @ tau
        assert np.abs(NORMAL.T @ force - borne).max() < 1e-9 and (force >= -1e-9).all()
        # Least efforts: min |tau|^2 + w |Q - J^T tau - N y|^2, y >= 0, for a large w.
        A = np.vstack([1e4 * np.hstack([p.J[i].T, -p.J[i].T, NORMAL.T]), np.eye(6, 16)])
        A[6:, 6:12] = -np.eye(6)
        x = nnls(A, np.concatenate([1e4 * p.Q[i], np.zeros(6)]), maxiter=2000)[0]
        assert np.abs(x[:6] - x[6:12] - tau).max() < 1e-4 * max(1, np.abs(tau).max())
        # Least forces: along what bears nothing no admissible shift makes them less.
        idle = np.array([1.0, -1.0, -1.0, 1.0])
        shift = np.clip(-idle @ force / 4, -force[idle > 0].min(), force[idle < 0].min())
        assert abs(shift) < 1e-9 * np.abs(force).max()


def test_with_three_corners_all_is_determined() -> None:
    p = block(np.random.default_rng(46), 5)
    three = distribute(p.bearing([0, 1, 2]), "bounded")
    assert (three.status == Outcome.ok).all()


def test_bilateral_contacts_that_depend_stay_singular() -> None:
    p = block(np.random.default_rng(46), 2)
    assert (distribute(replace(p, push=np.zeros(4))).status == Outcome.singular).all()
