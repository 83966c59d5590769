"""The profile: a natural cubic spline, extended straight, the same all across."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from support.surfaces import close, jet

from condyle.mechanism.surface import Profile, Quadratic
from condyle.mechanism.surface.profile import spline_pieces

KNOTS = np.array([-12.0, -7.0, -3.0, 0.0, 4.5, 8.0, 13.0]) * 1e-3
HEIGHTS = np.array([9.0, 6.5, 1.0, -2.5, -4.0, -3.0, -6.0]) * 1e-3
DIRECTION = (0.8, -0.6)


def profile(s: np.ndarray = KNOTS, z: np.ndarray = HEIGHTS) -> Profile:
    points = tuple(zip(map(float, s), map(float, z), strict=True))
    return Profile(direction=DIRECTION, points=points)


def at(s: float, across: float = 0.003, z: float = 0.0) -> np.ndarray:
    dx, dy = DIRECTION
    return np.array([s * dx - across * dy, s * dy + across * dx, z])


def test_spline_between_and_at_the_knots() -> None:
    spline = CubicSpline(KNOTS, HEIGHTS, bc_type="natural")
    surface = profile()
    u = np.array([*DIRECTION, 0.0])
    for s in [*np.linspace(KNOTS[0], KNOTS[-1], 37), *KNOTS]:
        got = jet(surface, at(s))
        assert -got.value == pytest.approx(float(spline(s)), abs=1e-17)
        close(got.gradient, [0, 0, 1] - spline(s, 1) * u, 1e-13)
        close(got.second, -spline(s, 2) * np.outer(u, u), 1e-12, floor=100.0)


def test_straight_beyond_the_ends() -> None:
    surface = profile()
    for end, s in ((KNOTS[0], KNOTS[0] - 0.02), (KNOTS[-1], KNOTS[-1] + 0.02)):
        here, there = jet(surface, at(end)), jet(surface, at(s))
        close(there.gradient, here.gradient, 1e-14)
        assert np.abs(there.second).max() < 1e-11  # inside: hundreds
        slope = -here.gradient[:2] @ DIRECTION
        assert there.value == pytest.approx(here.value - slope * (s - end), abs=1e-16)


def test_the_same_all_across() -> None:
    surface = profile()
    values = [jet(surface, at(0.002, across)).value for across in (-0.05, 0.0, 0.08)]
    assert np.ptp(values) < 1e-17


def test_a_straight_line_is_a_plane() -> None:
    line = ca.DM(0.002 - 1.1 * KNOTS)
    pieces = np.asarray(ca.evalf(spline_pieces(ca.DM(KNOTS), line)))
    close(pieces[:, 1], -1.1 * np.ones(8), 1e-14)
    assert np.abs(pieces[:, 2:]).max() < 1e-9  # against slopes over lengths of millimetres


def test_quadratic_to_spline_order() -> None:
    """The error is the boundary's: O(h^2) at the ends, gone a few knots further in."""
    xx = 20.0
    quadratic = Quadratic(offset=0.01, slope=(-1.1, 0.0), xx=xx)

    def errors(count: int) -> tuple[float, float]:
        s = np.linspace(-0.02, 0.02, count)
        z = 0.01 - 1.1 * s + xx * s**2
        points = tuple(zip(map(float, s), map(float, z), strict=True))
        line = Profile(direction=(1.0, 0.0), points=points)
        x = np.linspace(-0.02, 0.02, 501)
        off = [abs(line.phi((v, 0.004, 0.0)) - quadratic.phi((v, 0.004, 0.0))) for v in x]
        return max(off), max(off[200:301])

    coarse, fine = errors(21), errors(41)
    assert coarse[0] / fine[0] == pytest.approx(4, rel=0.05)
    assert coarse[1] < 1e-9 and fine[1] < 1e-13
