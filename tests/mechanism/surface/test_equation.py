"""phi of every kind: derivatives, normals, scale, and the independent surfaces of the oracles."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import pytest
from oracles.surfaces import normal, read_surface
from support.surfaces import BALL, KINDS, POINT, ball_options, close, contact, jet, table

from condyle.errors import InputError
from condyle.mechanism.surface import Expression, Parallel, of_form

WALLS = [(kind, side) for kind in KINDS for side in (None, True, False)]  # no ball, or on a side
RNG = np.random.default_rng(1)
NEAR = [1e-3 * (POINT + RNG.normal(0, 1.5, 3)) for _ in range(2)]


@pytest.fixture(params=WALLS, ids=lambda wall: f"{wall[0]}-{wall[1]}")
def wall(request: pytest.FixtureRequest) -> tuple[str, dict[str, Any], Any]:
    """Kind, options of the ball, and the surface of the ball's centre."""
    kind, side = request.param
    options = {} if side is None else ball_options(kind, side)
    return kind, options, contact(table(kind), **options).offset_surface


def test_derivatives(wall: Any) -> None:
    """Automatic derivatives against central differences; `gradient` and `bending` against both."""
    *_, locus = wall
    p, v = ca.SX.sym("p", 3), ca.SX.sym("v", 3)
    methods = ca.Function("m", [p, v], [locus.gradient(p), locus.bending(p, v)])
    h, velocity = 1e-5, np.array([0.3, -0.5, 0.8])
    for point in NEAR:
        exact = jet(locus, point)
        around = [(jet(locus, point + e), jet(locus, point - e)) for e in h * np.eye(3)]
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
            foot = point - (exact.value - 1e-3 * BALL * locus_side(wall)) * exact.gradient
            assert abs(float(locus.wall.phi(foot))) < 1e-15


def locus_side(wall: Any) -> int:
    return 1 if wall[1]["side"] in ("inside", "below") else -1


def test_oracles_agree(wall: Any) -> None:
    """Same zero set, normal and curvature of it as the oracles' own surfaces.

    phi may differ by a factor; on the surface that scales gradient and second derivative.
    """
    kind, options, locus = wall
    expected = read_surface({"surface": table(kind)} | options, 1e-3)
    assert locus.kind == kind
    for on in NEAR:
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


def test_one_expression_serves_a_form(wall: Any) -> None:
    """Kernels take phi from `of_form` and the numbers as inputs."""
    kind, options, locus = wall
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
