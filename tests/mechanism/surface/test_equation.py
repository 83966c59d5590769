"""phi of every kind: derivatives, normals, scale, and the independent surfaces of the oracles."""

from __future__ import annotations

from itertools import product
from typing import Any

import casadi as ca
import numpy as np
import pytest
from oracles.surfaces import normal, read_surface
from scipy.interpolate import CubicSpline
from support.surfaces import BALL, KINDS, POINT, ball_options, close, contact, jet, jets, table

from condyle.errors import InputError
from condyle.mechanism.surface import Expression, Parallel, Profile, of_form
from condyle.mechanism.surface.profile import spline_pieces

RNG = np.random.default_rng(1)
NEAR = [1e-3 * (POINT + RNG.normal(0, 1.5, 3)) for _ in range(2)]


@pytest.fixture(scope="module")
def walls() -> list[tuple[str, dict[str, Any], Any]]:
    """Kind, options of the ball (none, or on a side), and the surface of the ball's centre."""
    return [
        (kind, options, contact(table(kind), **options).offset_surface)
        for kind in KINDS
        for options in ({}, ball_options(kind, True), ball_options(kind, False))
    ]


def test_derivatives(walls: Any) -> None:
    """Automatic derivatives against central differences; `gradient` and `bending` against both."""
    p, v = ca.SX.sym("p", 3), ca.SX.sym("v", 3)
    h, velocity = 1e-5, np.array([0.3, -0.5, 0.8])
    told = [(*wall, jets(wall[-1])) for wall in walls]
    for (_, options, locus, at), point in product(told, NEAR):
        methods = ca.Function("m", [p, v], [locus.gradient(p), locus.bending(p, v)])
        exact = at(point)
        around = [(at(point + e), at(point - e)) for e in h * np.eye(3)]
        first = np.array([(a.value - b.value) / (2 * h) for a, b in around])
        second = np.array([(a.gradient - b.gradient) / (2 * h) for a, b in around])
        close(exact.gradient, first, 1e-6)
        close(exact.second, second, 1e-5, floor=1.0)
        close(exact.second, exact.second.T, 1e-12, floor=1.0)
        gradient, bending = methods(point, velocity)
        close(np.asarray(gradient).ravel(), exact.gradient, 1e-13)
        close(float(bending), velocity @ exact.second @ velocity, 1e-12, floor=1.0)
        if isinstance(locus, Parallel):  # it keeps its distance: the wall is zero at the foot
            assert np.linalg.norm(exact.gradient) == pytest.approx(1, abs=1e-13)
            side = 1 if options["side"] in ("inside", "below") else -1
            foot = point - (exact.value - 1e-3 * BALL * side) * exact.gradient
            assert abs(float(locus.wall.phi(foot))) < 1e-15


def test_oracles_agree(walls: Any) -> None:
    """Same zero set, normal and curvature of it as the oracles' own surfaces.

    phi may differ by a factor; on the surface that scales gradient and second derivative.
    """
    for (kind, options, locus), on in product(walls, NEAR):
        expected = read_surface({"surface": table(kind)} | options, 1e-3)
        assert locus.kind == kind
        for _ in range(20):
            gradient = expected.gradient(on)
            on = on - expected.value(on) * gradient / (gradient @ gradient)
        ours, n = jet(locus, on), normal(expected, on)
        size = np.linalg.norm(ours.gradient)
        assert abs(ours.value) < 1e-15
        assert 0.3 < size < 3.0  # distance-like
        close(ours.gradient / size, n, 1e-13)
        across = np.eye(3) - np.outer(n, n)
        hessian = expected.hessian(on) / np.linalg.norm(expected.gradient(on))
        close(across @ ours.second @ across / size, across @ hessian @ across, 1e-12, floor=1.0)


def test_one_expression_serves_a_form(walls: Any) -> None:
    """Kernels take phi from `of_form` and the numbers as inputs."""
    for kind, options, locus in walls:
        other = of_form(contact(table(kind, seed=5), **options).offset_surface.form)
        constants = ca.SX(ca.DM(locus.constants()))
        assert float(other.phi(ca.SX(ca.DM(NEAR[0])), constants)) == float(locus.phi(NEAR[0]))


def test_expression() -> None:
    wave = Expression(lambda p: p[2] - 0.01 * ca.cos(40 * p[0]) - 0.2 * p[1])
    x, y, z = point = np.array([0.01, 0.02, 0.03])
    got = jet(wave, point)
    assert got.value == pytest.approx(z - 0.01 * np.cos(40 * x) - 0.2 * y, abs=1e-17)
    close(got.gradient, np.array([0.4 * np.sin(40 * x), -0.2, 1]), 1e-15)
    close(got.second, np.diag([16 * np.cos(40 * x), 0, 0]), 1e-15)
    assert float(of_form(wave.form).phi(point)) == float(wave.phi(point))
    assert not wave.closed and wave.constants() == (0.0,)
    assert wave.form != Expression(lambda p: p[2] - 0.02 * ca.cos(40 * p[0]) - 0.2 * p[1]).form
    symbols: list[Any] = [lambda p: p[0] + ca.SX.sym("other"), lambda p: ca.MX.sym("x")]
    for function in (lambda p: 3.0, lambda p: p, *symbols):
        with pytest.raises(InputError, match="surface's function"):
            Expression(function)
    with pytest.raises(InputError, match="needs a function of a point, got 3"):
        Expression(3)  # type: ignore[arg-type]


KNOTS = np.array([-12.0, -7.0, -3.0, 0.0, 4.5, 8.0, 13.0]) * 1e-3
HEIGHTS = np.array([9.0, 6.5, 1.0, -2.5, -4.0, -3.0, -6.0]) * 1e-3
DIRECTION = (0.8, -0.6)
POINTS = tuple(map(tuple, np.column_stack([KNOTS, HEIGHTS]).tolist()))
SURFACE = Profile(direction=DIRECTION, points=POINTS)


def at(s: float, across: float = 0.003, z: float = 0.0) -> np.ndarray:
    dx, dy = DIRECTION
    return np.array([s * dx - across * dy, s * dy + across * dx, z])


def test_a_profile_is_a_natural_spline_straight_beyond_its_ends_the_same_all_across() -> None:
    spline = CubicSpline(KNOTS, HEIGHTS, bc_type="natural")
    u, told = np.array([*DIRECTION, 0.0]), jets(SURFACE)
    for s in [*np.linspace(KNOTS[0], KNOTS[-1], 12), *KNOTS]:
        got = told(at(s))
        assert -got.value == pytest.approx(float(spline(s)), abs=1e-17)
        close(got.gradient, [0, 0, 1] - spline(s, 1) * u, 1e-13)
        close(got.second, -spline(s, 2) * np.outer(u, u), 1e-12, floor=100.0)
    for end, s in ((KNOTS[0], KNOTS[0] - 0.02), (KNOTS[-1], KNOTS[-1] + 0.02)):
        here, there = told(at(end)), told(at(s))
        close(there.gradient, here.gradient, 1e-14)
        assert np.abs(there.second).max() < 1e-11  # inside: hundreds
        slope = -here.gradient[:2] @ DIRECTION
        assert there.value == pytest.approx(here.value - slope * (s - end), abs=1e-16)
    assert np.ptp([told(at(0.002, across)).value for across in (-0.05, 0.08)]) < 1e-17


def test_a_straight_line_is_a_plane() -> None:
    pieces = np.asarray(ca.evalf(spline_pieces(ca.DM(KNOTS), ca.DM(0.002 - 1.1 * KNOTS))))
    close(pieces[:, 1], -1.1 * np.ones(8), 1e-14)
    assert np.abs(pieces[:, 2:]).max() < 1e-9  # against slopes over lengths of millimetres
