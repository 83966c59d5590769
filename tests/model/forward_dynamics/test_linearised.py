"""A and B of the linearised motion are the slopes of forward dynamics."""

from __future__ import annotations

import numpy as np
import pytest

from .cases import by_numpy, case, close, efforts, load_of, state

STEP = 1e-3  # of each coordinate's size


@pytest.mark.parametrize("name", ["RSS k2 n8 quadratic", "PSS k4", "masticatory", "gough-stewart"])
def test_slopes(name: str) -> None:
    """Against central differences of sixth order, whose steps are small beside the state."""
    c, model = case(name), by_numpy(name)
    q, q1 = state(c, model)
    effort, load = efforts(c), load_of(c)
    about = model.linearise(q, q1, effort, *load)
    A, B = about.A, about.B
    m, n = q.shape[1], effort.shape[1]
    assert A.shape == (len(q), 2 * m, 2 * m)
    assert B.shape == (len(q), 2 * m, n)
    np.testing.assert_array_equal(A[:, :m, :m], 0)
    np.testing.assert_array_equal(A[:, :m, m:], np.broadcast_to(np.eye(m), (len(q), m, m)))
    np.testing.assert_array_equal(B[:, :m], 0)
    x = np.hstack([q, q1, effort])
    angles = [name not in "XYZ" for name in model.independent]
    sizes = np.where(angles, 0.05, 1e-3)
    units = STEP * np.r_[sizes, 20 * sizes, np.full(n, np.abs(effort).max())]

    def at(moved: np.ndarray) -> np.ndarray:
        return model.forward_dynamics(*np.hsplit(moved, [m, 2 * m]), *load).acceleration

    found = np.concatenate([A, B], axis=2)[:, m:]
    for j, unit in enumerate(np.diag(units)):
        ends = [at(x + i * unit) - at(x - i * unit) for i in (1, 2, 3)]
        slope = (45 * ends[0] - 9 * ends[1] + ends[2]) / 60
        close(found[:, :, j] * units[j], slope, 1e-6, floor=1e-6 * np.abs(at(x)).max())
