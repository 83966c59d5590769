"""The profile: a natural cubic spline, extended straight, the same all across."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from support.surfaces import close, jet

from condyle.mechanism.surface import Profile
from condyle.mechanism.surface.profile import spline_pieces

KNOTS = np.array([-12.0, -7.0, -3.0, 0.0, 4.5, 8.0, 13.0]) * 1e-3
HEIGHTS = np.array([9.0, 6.5, 1.0, -2.5, -4.0, -3.0, -6.0]) * 1e-3
DIRECTION = (0.8, -0.6)
POINTS = tuple(map(tuple, np.column_stack([KNOTS, HEIGHTS]).tolist()))
SURFACE = Profile(direction=DIRECTION, points=POINTS)


def at(s: float, across: float = 0.003, z: float = 0.0) -> np.ndarray:
    dx, dy = DIRECTION
    return np.array([s * dx - across * dy, s * dy + across * dx, z])


def test_spline_between_and_at_the_knots_and_straight_beyond() -> None:
    spline = CubicSpline(KNOTS, HEIGHTS, bc_type="natural")
    u = np.array([*DIRECTION, 0.0])
    for s in [*np.linspace(KNOTS[0], KNOTS[-1], 12), *KNOTS]:
        got = jet(SURFACE, at(s))
        assert -got.value == pytest.approx(float(spline(s)), abs=1e-17)
        close(got.gradient, [0, 0, 1] - spline(s, 1) * u, 1e-13)
        close(got.second, -spline(s, 2) * np.outer(u, u), 1e-12, floor=100.0)
    for end, s in ((KNOTS[0], KNOTS[0] - 0.02), (KNOTS[-1], KNOTS[-1] + 0.02)):
        here, there = jet(SURFACE, at(end)), jet(SURFACE, at(s))
        close(there.gradient, here.gradient, 1e-14)
        assert np.abs(there.second).max() < 1e-11  # inside: hundreds
        slope = -here.gradient[:2] @ DIRECTION
        assert there.value == pytest.approx(here.value - slope * (s - end), abs=1e-16)
    assert np.ptp([jet(SURFACE, at(0.002, across)).value for across in (-0.05, 0.08)]) < 1e-17


def test_a_straight_line_is_a_plane() -> None:
    pieces = np.asarray(ca.evalf(spline_pieces(ca.DM(KNOTS), ca.DM(0.002 - 1.1 * KNOTS))))
    close(pieces[:, 1], -1.1 * np.ones(8), 1e-14)
    assert np.abs(pieces[:, 2:]).max() < 1e-9  # against slopes over lengths of millimetres


def test_a_parabola_to_spline_order() -> None:
    """The error is the boundary's: O(h^2) at the ends, gone a few knots further in."""

    def height(s: np.ndarray) -> np.ndarray:
        return 0.01 - 1.1 * s + 20 * s**2

    def errors(count: int) -> tuple[float, float]:
        s, x = np.linspace(-0.02, 0.02, count), np.linspace(-0.02, 0.02, 501)
        points = tuple(zip(s.tolist(), height(s).tolist(), strict=True))
        line = Profile(direction=(1.0, 0.0), points=points)
        off = [abs(-line.phi((v, 0.004, 0.0)) - height(v)) for v in x]
        return max(off), max(off[200:301])

    coarse, fine = errors(21), errors(41)
    assert coarse[0] / fine[0] == pytest.approx(4, rel=0.05)
    assert coarse[1] < 1e-9 and fine[1] < 1e-13
