"""phi of every kind: derivatives, normals, scale, and the independent surfaces of the oracles."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from oracles.surfaces import normal, read_surface
from support.surfaces import BALL, KINDS, POINT, ball_options, close, contact, jet, table

from condyle.errors import InputError
from condyle.mechanism.surface import Expression, of_form

WALLS = [(kind, None) for kind in KINDS] + [(kind, side) for kind in KINDS for side in (0, 1)]
RNG = np.random.default_rng(1)
NEAR = [1e-3 * (POINT + RNG.normal(0, 1.5, 3)) for _ in range(4)]


def options(kind: str, side: int | None) -> dict:
    return {} if side is None else ball_options(kind, side == 0)


@pytest.mark.parametrize(("kind", "side"), WALLS)
def test_derivatives(kind: str, side: int | None) -> None:
    """Automatic derivatives against central differences; `gradient` and `bending` against both."""
    locus = contact(table(kind), **options(kind, side)).offset_surface
    p, v = ca.SX.sym("p", 3), ca.SX.sym("v", 3)
    methods = ca.Function("m", [p, v], [locus.gradient(p), locus.bending(p, v)])
    h, velocity = 1e-5, np.array([0.3, -0.5, 0.8])
    for point in NEAR:
        exact = jet(locus, point)
        steps = h * np.eye(3)
        around = [(jet(locus, point + e), jet(locus, point - e)) for e in steps]
        first = np.array([(a.value - b.value) / (2 * h) for a, b in around])
        second = np.array([(a.gradient - b.gradient) / (2 * h) for a, b in around])
        close(exact.gradient, first, 1e-6)
        close(exact.second, second, 1e-5, floor=1.0)
        close(exact.second, exact.second.T, 1e-12, floor=1.0)
        gradient, bending = methods(point, velocity)
        close(np.asarray(gradient).ravel(), exact.gradient, 1e-13)
        close(float(bending), velocity @ exact.second @ velocity, 1e-12, floor=1.0)


@pytest.mark.parametrize(("kind", "side"), WALLS)
def test_oracles_agree(kind: str, side: int | None) -> None:
    """Same zero set, normal and curvature of it as the oracles' own surfaces.

    phi may differ by a factor; on the surface that scales gradient and second derivative.
    """
    given = table(kind) | options(kind, side)
    expected = read_surface({"surface": table(kind)} | options(kind, side), 1e-3)
    locus = contact(table(kind), **options(kind, side)).offset_surface
    assert given["kind"] == locus.kind
    for point in NEAR:
        on = point.copy()
        for _ in range(20):
            gradient = expected.gradient(on)
            on = on - expected.value(on) * gradient / (gradient @ gradient)
        ours = jet(locus, on)
        n = normal(expected, on)
        size = np.linalg.norm(ours.gradient)
        assert abs(ours.value) < 1e-15
        assert 0.3 < size < 3.0  # distance-like
        close(ours.gradient / size, n, 1e-13)
        across = np.eye(3) - np.outer(n, n)
        hessian = expected.hessian(on) / np.linalg.norm(expected.gradient(on))
        close(across @ ours.second @ across / size, across @ hessian @ across, 1e-12, floor=1.0)


@pytest.mark.parametrize(("kind", "side"), WALLS)
def test_one_expression_serves_a_form(kind: str, side: int | None) -> None:
    """Kernels take phi from `of_form` and the numbers as inputs."""
    locus = contact(table(kind), **options(kind, side)).offset_surface
    other = of_form(contact(table(kind, seed=5), **options(kind, side)).offset_surface.form)
    point = ca.SX(ca.DM(NEAR[0]))
    constants = ca.SX(ca.DM(locus.constants()))
    assert float(other.phi(point, constants)) == float(locus.phi(NEAR[0]))


def test_parallel_gradient_is_a_unit_vector() -> None:
    for kind in ("quadratic", "ellipsoid", "profile"):
        locus = contact(table(kind), **ball_options(kind, True)).offset_surface
        assert locus.kind == kind
        for point in NEAR:
            assert np.linalg.norm(jet(locus, point).gradient) == pytest.approx(1, abs=1e-13)
            # A parallel surface keeps its distance: phi of the wall at the foot is zero.
            foot = point - (jet(locus, point).value - 1e-3 * BALL) * jet(locus, point).gradient
            assert abs(float(locus.wall.phi(foot))) < 1e-15


def test_expression() -> None:
    wave = Expression(lambda p: p[2] - 0.01 * ca.cos(40 * p[0]) - 0.2 * p[1])
    x, y, z = point = np.array([0.01, 0.02, 0.03])
    got = jet(wave, point)
    assert got.value == pytest.approx(z - 0.01 * np.cos(40 * x) - 0.2 * y, abs=1e-17)
    close(got.gradient, np.array([0.4 * np.sin(40 * x), -0.2, 1]), 1e-15)
    close(got.second, np.diag([16 * np.cos(40 * x), 0, 0]), 1e-15)
    assert float(of_form(wave.form).phi(point)) == float(wave.phi(point))
    assert not wave.closed and wave.constants() == (0.0,)


def test_expression_of_no_function() -> None:
    with pytest.raises(InputError, match="needs a function of a point, got 3"):
        Expression(3)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "function",
    [lambda p: 3.0, lambda p: p, lambda p: p[0] + ca.SX.sym("other"), lambda p: ca.MX.sym("x")],
)
def test_expression_of_something_else(function) -> None:
    with pytest.raises(InputError, match="surface's function"):
        Expression(function)
