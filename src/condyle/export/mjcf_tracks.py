"""How a point stays on a surface by joints: slides and hinges, exactly where there are such.

A plane is two slides, a sphere two hinges about its centre, a cylinder a slide and a hinge. Over
any other surface two slides u and v run along the directions of principal curvature, and a height
w = g(u) + h(v) follows them by polynomials of degree four, which MuJoCo has as equations between
joints. That is exact for surfaces of second order seen along Z, and else a fit.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from ..errors import UnsupportedError
from ..kinematics.surface_points import surface_heights
from ..mechanism import Contact
from ..mechanism.surface.freedom import Freedom, principal_directions, tangents

DEGREE = 4  # of MuJoCo's polynomials
GRID = 21
NOISE = 1e-9  # metres: a fit as near as this is exact, and a term as small is none


@dataclass(frozen=True)
class BodyJoints:
    """The joints of one body; `law`: the second is that polynomial of the first, (5,)."""

    freedoms: tuple[Freedom, ...]
    law: np.ndarray | None = None


@dataclass(frozen=True)
class BodyTrack:
    """Bodies on each other, the first on the base.

    error: how far the last one's point may be off the surface [m], 0 where it cannot;
    reach: up to so far from home [m], or None: within the bounds.
    """

    stages: tuple[BodyJoints, ...]
    error: float = 0.0
    reach: float | None = None


def track(contact: Contact, size: float) -> BodyTrack:
    """The joints that keep a ball's centre where its contact lets it be.

    Args: size: a length of the mechanism [m], for the reach of a fit without bounds.
    """
    surface, point = contact.offset_surface, np.array(contact.point)
    normal = _derivatives(surface, point)[0]
    n = normal / np.linalg.norm(normal)
    if joints := surface.joints(point, n):
        return BodyTrack((BodyJoints(joints),))
    return _fit(contact, point, n, size)


def _fit(contact: Contact, point: np.ndarray, n: np.ndarray, size: float) -> BodyTrack:
    """w = g(u) + h(v), by least squares over a grid."""
    surface = contact.offset_surface
    frame, level = np.eye(3), surface.level_directions()
    if level is None:
        frame = np.vstack([tangents(n), n])
        level = principal_directions(frame[:2] @ _derivatives(surface, point)[1] @ frame[:2].T)
    frame[:2] = level @ frame[:2]
    samples, reach = _samples(contact, point, frame, size)
    length = np.abs(samples[:, :2]).max()
    powers = np.arange(1, DEGREE + 1)
    u, v = ((samples[:, i : i + 1] / length) ** powers for i in (0, 1))
    fit = np.linalg.lstsq(np.hstack([u, v]), samples[:, 2], rcond=None)[0]
    fit[np.abs(fit) < NOISE] = 0.0
    error = float(np.abs(np.hstack([u, v]) @ fit - samples[:, 2]).max())
    first, second = (np.append(0.0, half / length**powers) for half in (fit[:4], fit[4:]))
    s, t, w = (Freedom("slide", axis, point) for axis in frame)
    stages: tuple[BodyJoints, ...] = (BodyJoints((s, w), first), BodyJoints((t, w), second))
    if not second.any():
        stages = (BodyJoints((s, w, t), first),)
    return BodyTrack(stages, error if error > 10 * NOISE else 0.0, reach)


def _samples(
    contact: Contact, point: np.ndarray, frame: np.ndarray, size: float
) -> tuple[np.ndarray, float | None]:
    """(u, v, w) of points of the surface within the bounds, (N, 3), else within a reach [m]."""
    spans = [getattr(contact.bounds, axis) for axis in "xyz"]
    given = [np.abs(np.subtract(s, p)).max() for s, p in zip(spans, point, strict=True) if s]
    reach = None if given else 0.2 * size
    half = float(np.linalg.norm(given)) if reach is None else reach
    line = np.linspace(-half, half, GRID)
    flat = np.column_stack([a.ravel() for a in np.meshgrid(line, line)])
    surface = contact.offset_surface
    height, step = surface_heights(surface, point, frame, flat)
    at = point + np.column_stack([flat, height]) @ frame
    good = (step < 1e-12 + 1e-9 * half) & (np.abs(height) <= 2 * half)
    for axis, span in enumerate(spans):
        if span is not None:
            good &= (at[:, axis] >= span[0]) & (at[:, axis] <= span[1])
    if reach is not None:
        good &= np.linalg.norm(flat, axis=1) <= reach
    if good.sum() < 4 * DEGREE:
        raise UnsupportedError(
            f'contact "{contact.name}": its {surface.kind} cannot be followed about home; '
            "mjcf needs a surface that is smooth within the bounds"
        )
    return np.column_stack([flat, height])[good], reach


def _derivatives(surface: object, point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Gradient (3,) and second derivative (3, 3) of phi at a point."""
    p = ca.SX.sym("p", 3)
    gradient = surface.gradient(p)  # type: ignore[attr-defined]
    function = ca.Function("d", [p], [gradient, ca.jacobian(gradient, p)])
    first, second = function(point)
    return np.asarray(first).ravel(), np.asarray(second)
