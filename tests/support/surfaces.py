"""Surfaces of every kind as tables of a file [mm], and what a surface says at a point."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from oracles.random_mechanism import SURFACES, random_surface
from pydantic import TypeAdapter

from condyle.mechanism import Contact

POINT = np.array([-26.0, 7.0, 12.0])  # mm
SLOPE = np.array([-0.8, 0.3])
CLOSED = ("sphere", "cylinder", "ellipsoid")
KINDS = SURFACES
BALL = 4.0  # mm


def table(kind: str, seed: int = 0) -> dict[str, Any]:
    """A surface through POINT with SLOPE there (a profile: along its direction)."""
    return random_surface(np.random.default_rng(seed), kind, POINT, SLOPE)


def ball_options(kind: str, first: bool) -> dict[str, Any]:
    """Options of a ball on the first side (against the normal) or the second."""
    sides = ("inside", "outside") if kind in CLOSED else ("below", "above")
    return {"ball_radius": BALL, "side": sides[0 if first else 1]}


def contact(surface: dict[str, Any], point: np.ndarray = POINT, **options: Any) -> Contact:
    """A contact as a file in millimetres would give it."""
    data = {"name": "ball", "point": [float(x) for x in point], "surface": surface, **options}
    return TypeAdapter(Contact).validate_python(data, context={"per_metre": 1000.0})


@dataclass(frozen=True)
class Jet:
    """phi, its gradient (3,) and second derivative (3, 3) at a point."""

    value: float
    gradient: np.ndarray
    second: np.ndarray


def jets(surface: Any) -> Callable[[np.ndarray], Jet]:
    """Of any point, by automatic differentiation of phi, the constants being symbols."""
    p, c = ca.SX.sym("p", 3), ca.SX.sym("c", len(surface.constants()))
    phi = surface.phi(p, c)
    second, gradient = ca.hessian(phi, p)
    function = ca.Function("jet", [p, c], [phi, gradient, second])

    def at(point: np.ndarray) -> Jet:
        value, slope, curvature = function(point, surface.constants())
        return Jet(float(value), np.asarray(slope).ravel(), np.asarray(ca.densify(curvature)))

    return at


def jet(surface: Any, point: np.ndarray) -> Jet:
    """Of one point."""
    return jets(surface)(point)


def close(got: Any, wanted: Any, tolerance: float, floor: float = 0.0) -> None:
    """Equal relative to the largest entry (or `floor`)."""
    scale = max(float(np.abs(wanted).max(initial=0)), floor)
    np.testing.assert_allclose(got, wanted, rtol=0, atol=tolerance * scale)
