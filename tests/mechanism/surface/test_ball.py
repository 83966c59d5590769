"""A ball on a wall: the surface on which its centre stays."""

from __future__ import annotations

import numpy as np
import pytest
from support.surfaces import close, jet, jets

from condyle.mechanism import Contact
from condyle.mechanism.home import home_problem, home_residual
from condyle.mechanism.surface import (
    Cylinder,
    Ellipsoid,
    Expression,
    Parallel,
    Plane,
    Quadratic,
    Sphere,
)

POINT = (0.003, -0.002, 0.005)
RNG = np.random.default_rng(0)


def ball(surface, point=POINT, radius: float = 0.004, side: str = "below") -> Contact:
    return Contact(name="b", point=tuple(point), surface=surface, ball_radius=radius, side=side)


@pytest.mark.parametrize(("side", "sign"), [("below", -1), ("above", 1)])
def test_walls_without_curvature(side: str, sign: int) -> None:
    """A plane moves along its normal, and so does what is one without saying so."""
    plane = Plane(slope=(-1.1, 0.2), offset=0.01)
    steepness = np.sqrt(1 + 1.1**2 + 0.2**2)
    exact = ball(plane, side=side).offset_surface
    assert exact.kind == "plane" and exact.slope == plane.slope
    assert exact.offset == pytest.approx(0.01 + sign * 0.004 * steepness, abs=1e-18)
    flat = Quadratic(slope=(-1.1, 0.2), offset=0.01)
    for wall in (flat, Expression(lambda p: p[2] + 1.1 * p[0] - 0.2 * p[1] - 0.01)):
        general = ball(wall, side=side).offset_surface
        for p in POINT + RNG.normal(0, 0.005, (3, 3)):
            assert float(general.phi(p)) == pytest.approx(exact.phi(p) / steepness, abs=1e-17)


@pytest.mark.parametrize(("side", "radius"), [("inside", 0.026), ("outside", 0.034)])
def test_round_walls(side: str, radius: float) -> None:
    """Sphere and cylinder change their radius; a round ellipsoid, its foot by Newton, agrees."""
    sphere = Sphere(centre=(0.01, 0.0, 0.02), radius=0.03)
    cylinder = Cylinder(point=(0.0, 0.01, 0.0), axis=(0.0, 3.0, 4.0), radius=0.03)
    for surface in (sphere, cylinder):
        locus = ball(surface, side=side).offset_surface
        assert type(locus) is type(surface)
        assert locus.radius == pytest.approx(radius, abs=1e-18)
    centre, u = np.array(sphere.centre), np.array([2.0, -1.0, 2.0]) / 3
    small = Sphere(centre=sphere.centre, radius=0.006)
    ellipsoid = Ellipsoid(centre=sphere.centre, semi_axes=(0.006,) * 3, rotation=(0.1, 0.2, 0.3))
    point = centre + u * (0.001 if side == "inside" else 0.011)  # a socket that fits closely
    exact, general = (ball(s, point, 0.005, side).offset_surface for s in (small, ellipsoid))
    assert isinstance(general, Parallel) and not isinstance(exact, Parallel)
    for v in u + RNG.normal(0, 0.3, (5, 3)):
        on = centre + v / np.linalg.norm(v) * exact.radius
        a, b = jet(exact, on), jet(general, on)
        assert abs(b.value) < 1e-16
        close(b.gradient, a.gradient, 1e-12)
        across = np.eye(3) - np.outer(a.gradient, a.gradient)
        close(across @ b.second @ across, across @ a.second @ across, 1e-11)


def trough(curvature: float) -> Quadratic:
    """z = curvature x^2 / 2: a gutter with its bottom on the Y axis."""
    return Quadratic(offset=0.0, slope=(0.0, 0.0), xx=curvature / 2)


def test_a_ball_that_fits_closely_goes_along() -> None:
    """Nearly as tight as the wall at the bottom, and the same branch all the way up the flank."""
    curvature, radius = 150.0, 0.006  # radius of curvature at the bottom 6.67 mm
    contact = ball(trough(curvature), (0.0, 0.0, radius), radius, "above")
    assert home_problem(contact) is None
    assert contact.offset_surface.grip() == pytest.approx(1 - radius * curvature, abs=1e-12)
    for x in np.linspace(-0.01, 0.01, 7):
        foot, slope = np.array([x, 0.0, curvature * x * x / 2]), curvature * x
        n = np.array([-slope, 0.0, 1.0]) / np.hypot(slope, 1.0)
        got = jet(contact.offset_surface, foot + radius * n)
        assert abs(got.value) < 1e-15
        close(got.gradient, n, 1e-12)
        bend = -curvature / np.hypot(slope, 1.0) ** 3  # signed curvature of the wall
        t = np.array([n[2], 0.0, -n[0]])
        close(got.second, bend / (1 + radius * bend) * np.outer(t, t), 1e-10)


def test_balls_that_are_too_big_or_off_the_surface() -> None:
    for radius in (0.0067, 0.02):
        contact = ball(trough(150.0), (0.0, 0.0, radius), radius, "above")
        assert home_residual(contact) == pytest.approx(0, abs=1e-15)  # at the bottom, and stuck
        problem = home_problem(contact)
        assert problem is not None and f"radius {radius * 1e3:g} mm on the side" in problem
        assert "cannot touch" in problem
        assert home_problem(ball(trough(150.0), (0.0, 0.0, -radius), radius, "below")) is None
    contact = ball(trough(20.0), (0.0, 0.0, 0.0042), 0.004, "above")
    assert home_residual(contact) == pytest.approx(0.0002, abs=1e-12)
    problem = home_problem(contact)
    assert problem is not None and "+0.2 mm off" in problem


def test_a_number_is_always_a_distance() -> None:
    """Where Newton has not converged phi is not finite; it is never a wrong distance."""
    radius = 0.006
    locus = ball(trough(150.0), (0.0, 0.0, radius), radius, "above").offset_surface
    finite, told, walls = 0, jets(locus), jets(locus.wall)
    for p in np.random.default_rng(3).uniform(-0.05, 0.05, (30, 3)):
        got = told(p)
        if not np.isfinite(got.value):
            continue
        finite += 1
        foot = p - (got.value + radius) * got.gradient
        wall = walls(foot)
        assert abs(wall.value) < 1e-9
        close(got.gradient, wall.gradient / np.linalg.norm(wall.gradient), 1e-7)
    assert 5 < finite < 30
