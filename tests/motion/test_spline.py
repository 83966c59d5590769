"""Interpolating splines against those of SciPy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline

from condyle.motion.spline import Spline


@pytest.mark.parametrize("degree", [3, 5])
@pytest.mark.parametrize("count", [6, 7, 12, 32, 33, 64, 201, 2000])
def test_agrees_with_scipy(count: int, degree: int) -> None:
    rng = np.random.default_rng(count)
    t = np.cumsum(rng.uniform(0.2, 1.0, count)) * 1e-2
    values = np.column_stack([np.sin(3 * t), np.cos(40 * t), rng.normal(size=count)])
    own, peer = Spline.through(t, values, degree), make_interp_spline(t, values, k=degree)
    wanted = np.concatenate([t, np.linspace(t[0], t[-1], 501)])
    np.testing.assert_allclose(own(t), values, atol=1e-13)
    for nu in range(4):
        off = np.abs(own(wanted, nu) - peer(wanted, nu)).max()
        assert off <= 1e-12 * np.abs(peer(wanted, nu)).max(), nu


def test_polynomials_of_its_degree_are_met_exactly() -> None:
    t = np.linspace(0.0, 2.0, 40)
    own = Spline.through(t, np.polynomial.Polynomial([1, -2, 0.5, 0.25, -1, 0.3])(t))
    poly = np.polynomial.Polynomial([1, -2, 0.5, 0.25, -1, 0.3])
    between = np.linspace(0.0, 2.0, 333)
    for nu in range(4):
        wanted = poly.deriv(nu)(between) if nu else poly(between)
        np.testing.assert_allclose(own(between, nu), wanted, rtol=0, atol=1e-9)
