"""Whether a ball that touches its wall overlaps it elsewhere, as in a valley narrower than it.

With psi = +-phi, positive on the ball's side, a ball of radius r overlaps its wall where psi is
negative in it. It touches the wall at w, where psi = 0 and its gradient is a. If no eigenvalue of
the second derivative of psi is below -K, then at any point w + t of the ball, where
|t|^2 <= 2 r n . t,

    psi >= a . t - K |t|^2 / 2 >= (|a| - r K) n . t:

no overlap is possible where r K <= |a|. What this leaves is searched: psi is least on the sphere at
one of its local minima, from all of which Newton starts.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np

from . import of_form
from .parallel import equation_of, spread_directions, touching_of

TOLERANCE = 1e-5  # metres of an overlap that is accepted, as of a contact off its wall at home
DIRECTIONS, NEIGHBOURS = 1000, 8
MANY, BLOCK = 2000, 64  # balls at a time: of a first look, and of the search
# Of more balls than few the bend of a wall of any kind is sampled, and taken with a margin.
FEW, SAMPLES, MARGIN = 16, 4000, 1.5
NEWTON, LONGEST_STEP = 8, 0.1  # steps on the sphere, and radians of one
DIGITS = 1e-7  # metres of a distance in a message
NOWHERE_ENDS = ((-np.inf, np.inf),) * 3
Ends = tuple[tuple[float, float], ...]


def is_parallel(form: str) -> bool:
    """Whether balls of this surface of their centres can overlap their walls at all.

    They cannot where it is of the wall's own kind, nor on `ParallelQuadric`: with all 1 + mu h
    positive no other point of a wall of second order is nearer.
    """
    return form.startswith("parallel ")


def may_overlap(form: str, constants: tuple[float, ...]) -> bool:
    """Whether a ball may overlap its wall anywhere, from the surface of its centre."""
    if not is_parallel(form):
        return False
    wall = form.partition(" ")[2]
    surface = of_form(wall)
    steepness = 1.0 if surface.lifted and not surface.closed else 0.0  # of z = f(x, y), at least
    return abs(constants[0]) * _bend(wall, constants) > steepness


def overlaps(
    form: str, constants: tuple[float, ...], centres: np.ndarray, ends: Ends = NOWHERE_ENDS
) -> np.ndarray:
    """Where a ball overlaps its wall by more than 0.01 mm, (N,).

    Args: form, constants: of the surface of the ball's centre;
          centres: (N, 3) in {S} [m], on that surface;  ends: low and high x, y, z of the wall.
    """
    hit = np.zeros(len(centres), dtype=bool)
    if not may_overlap(form, constants):
        return hit
    wall = form.partition(" ")[2]
    known = np.flatnonzero(np.isfinite(centres).all(axis=1))
    bend = _bend(wall, constants)
    if bend == np.inf and len(known) > FEW:
        bend = MARGIN * _sampled_bend(wall, constants, centres[known])
    touching = touching_of(of_form(wall), len(constants) - 8)
    for rows in _blocks(known, MANY):
        steepness = np.asarray(touching(centres[rows].T, ca.DM(constants))[2])[0]
        for left in _blocks(rows[~(abs(constants[0]) * bend <= steepness)], BLOCK):
            hit[left] = _crossed(form, constants, centres[left], ends)
    return hit


def _blocks(rows: np.ndarray, size: int) -> Iterator[np.ndarray]:
    for start in range(0, len(rows), size):
        yield rows[start : start + size]


def nearest_wall(
    form: str, constants: tuple[float, ...], centre: Any, ends: Ends = NOWHERE_ENDS
) -> float:
    """Distance of the wall from the centre of a ball that overlaps it [m]; 0 beyond the wall."""
    low, high = 0.0, abs(constants[0]) - TOLERANCE
    while high - low > DIGITS:
        middle = (low + high) / 2
        crossed = _crossed(form, constants, np.array([centre]), ends, middle)[0]
        low, high = (low, middle) if crossed else (middle, high)
    return high if high > DIGITS else 0.0


def _crossed(
    form: str,
    constants: tuple[float, ...],
    centres: np.ndarray,
    ends: Ends,
    radius: float | None = None,
) -> np.ndarray:
    """Whether the wall comes nearer to centres, (N, 3), than a radius [m], (N,).

    Args: radius: default: the ball's, less the overlap that is accepted.
    """
    radius = abs(constants[0]) - TOLERANCE if radius is None else radius
    psi, w, of = _around(form.partition(" ")[2], constants, centres, radius)
    low, high = np.transpose(ends)
    found = np.zeros(len(centres), dtype=bool)
    found[of[(psi < 0) & ((w >= low) & (w <= high)).all(axis=1)]] = True
    return found


def _around(
    wall: str, constants: tuple[float, ...], centres: np.ndarray, radius: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """psi [m] at points of spheres, its local minima among them; these, (..., 3); and whose."""
    push = np.sign(constants[0])
    equation, c = equation_of(of_form(wall), len(constants) - 8), ca.DM(constants[8:])
    u, near = _directions()
    points = (centres[:, None] + radius * u).reshape(-1, 3)
    psi = push * _phi(wall, points, constants[8:])
    psi = np.where(np.isfinite(psi), psi, np.inf).reshape(len(centres), -1)
    least = np.isfinite(psi)
    for k in range(NEIGHBOURS):
        least &= psi <= psi[:, near[:, k]]
    of, start = np.nonzero(least)
    v, rings = u[start], [(psi.ravel(), points, np.repeat(np.arange(len(centres)), len(u)))]
    for _ in range(NEWTON if of.size else 0):
        w = centres[of] + radius * v
        g, a, H = (np.asarray(x) for x in equation(w.T, c))
        rings.append((push * g[0], w, of))
        slope = push * radius * a.T
        bend = push * radius**2 * H.reshape(3, -1, 3).swapaxes(0, 1)
        outward = (slope * v).sum(axis=1)[:, None, None]
        radial = v[:, :, None] * v[:, None, :]
        across = np.eye(3) - radial
        own = across @ (bend - outward * np.eye(3)) @ across + radial
        size, axes = np.linalg.eigh(_finite(own))
        along = (axes.swapaxes(1, 2) @ across @ slope[..., None])[..., 0]
        with np.errstate(all="ignore"):
            step = _finite(-along / np.abs(size))  # downhill, also beyond an inflection
        step = (axes @ step[..., None])[..., 0]
        length = np.linalg.norm(step, axis=1, keepdims=True)
        v = v + step * (LONGEST_STEP / np.maximum(length, LONGEST_STEP))
        v /= np.linalg.norm(v, axis=1, keepdims=True)
    psi, w, of = (np.concatenate(parts) for parts in zip(*rings, strict=True))
    return np.nan_to_num(psi, nan=np.inf), w, of


def _finite(x: np.ndarray) -> np.ndarray:
    return np.where(np.isfinite(x), x, 0.0)


def _bend(wall: str, constants: tuple[float, ...]) -> float:
    """K, [1/m]: no eigenvalue of the second derivative of psi is below -K."""
    surface, c = of_form(wall), constants[8:]
    if hasattr(surface, "principal"):  # of second order: the same everywhere
        H = equation_of(surface, len(c))(np.zeros(3), c)[2]
        low, *_, high = np.linalg.eigvalsh(np.asarray(H))
    else:
        low, high = surface.bends(c)
    return float(-low if constants[0] > 0 else high)


def _sampled_bend(wall: str, constants: tuple[float, ...], centres: np.ndarray) -> float:
    """K of a wall of any kind, at points spread over balls that are many."""
    u, _ = _directions()
    rows = np.linspace(0, len(centres) - 1, SAMPLES).astype(int)
    w = centres[rows] + abs(constants[0]) * u[np.arange(SAMPLES) * 7 % len(u)]
    c = ca.DM(constants[8:])
    H: np.ndarray = np.asarray(equation_of(of_form(wall), c.numel())(w.T, c)[2]).reshape(3, -1, 3)
    if not np.isfinite(H).all():
        return np.inf
    size = np.linalg.eigvalsh(-np.sign(constants[0]) * H.swapaxes(0, 1))
    return float(size.max())


@lru_cache(maxsize=1)
def _directions() -> tuple[np.ndarray, np.ndarray]:
    """Unit vectors all around, (M, 3), and which are nearest to each, (M, 8)."""
    u = spread_directions(DIRECTIONS)
    return u, np.argsort(-u @ u.T, axis=1)[:, 1 : NEIGHBOURS + 1]


def _phi(wall: str, points: np.ndarray, constants: tuple[float, ...]) -> np.ndarray:
    """phi of a wall at points, (N, 3)."""
    surface = of_form(wall)
    if surface.by_numpy:
        return np.asarray(surface.phi(points.T, np.array(constants)))
    return np.asarray(_equation(wall, len(constants))(points.T, ca.DM(constants)))[0]


@lru_cache(maxsize=64)
def _equation(wall: str, count: int) -> ca.Function:
    w, c = ca.SX.sym("w", 3), ca.SX.sym("c", count)
    own = ca.Function("wall", [w, c], [of_form(wall).phi(w, c)])
    return own.map("walls", "serial", DIRECTIONS, [1], [])
