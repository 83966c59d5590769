"""Random problems, and the human jaw at home."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from condyle.distribution import Problem

JAW = Path(__file__).parent / "human_jaw.csv"
MOLAR_RIGHT = np.array([-1.12e-3, -29.41e-3, 9.84e-3])
INCISOR = np.array([37.43e-3, 0.0, 5.68e-3])
CONDYLES = np.array([[-40.98e-3, 51.78e-3, 43.56e-3], [-40.98e-3, -51.78e-3, 43.56e-3]])
WEIGHT = 0.2 * 9.81  # of the mandible [N]


def random_problem(
    rng: np.random.Generator,
    n: int,
    k: int,
    count: int = 1,
    friction: int = 0,
    one_sided: bool = False,
    preload: float = 0.0,
    tight: float = 0.6,
    pull: bool = False,
    lever: float = 0.1,
    offset: bool = False,
) -> Problem:
    """Forces in directions and at points of a machine of size `lever` [m], limits included.

    tight: limits relative to the least norm's greatest effort; pull: lower limits of 0.
    """
    J = wrenches(rng, (count, n), lever)
    normal = wrenches(rng, (count, k), lever)
    rub = np.zeros((count, k, 6))
    if friction:
        mu = rng.uniform(0.05, 0.6, (1, friction, 1))
        rub[:, :friction] = mu * wrenches(rng, (count, friction), lever)
    effort = rng.normal(size=(count, n)) * 10
    effort = np.abs(effort) if pull else effort
    force = rng.normal(size=(count, k)) * 10
    push = rng.choice([-1.0, 1.0], k) if one_sided else np.zeros(k)
    force = np.where(push != 0, push * np.abs(force), force)
    D = normal - np.sign(force)[..., None] * rub
    shift = rng.normal(size=(count, n)) if offset else np.zeros((count, n))
    Q = np.einsum("rni,rn->ri", J, effort - shift) + np.einsum("rki,rk->ri", D, force)
    size = tight * np.abs(effort).max() * rng.uniform(0.5, 2, n) if n else np.zeros(0)
    low = np.zeros(n) if pull else -size * rng.uniform(0.3, 1.0, n)
    return Problem(Q, J, normal, rub, low, size, push, preload, shift)


def wrenches(rng: np.random.Generator, shape: tuple[int, ...], lever: float) -> np.ndarray:
    """Unit forces in random directions at random points, (*shape, 6)."""
    direction = rng.normal(size=(*shape, 3))
    direction /= np.linalg.norm(direction, axis=-1, keepdims=True)
    return np.concatenate(
        [direction, np.cross(lever * rng.normal(size=(*shape, 3)), direction)], axis=-1
    )


def human_jaw(force: np.ndarray, point: np.ndarray, **more: object) -> Problem:
    """The human jaw at home, teeth closed, with bite forces down at a point of the mandible.

    Args: force: (N,) [N].
    """
    rows = list(csv.DictReader(JAW.open()))
    base, jaw = (
        np.array([[float(row[f"{end}_{axis}_mm"]) for axis in "xyz"] for row in rows]) / 1e3
        for end in ("base", "jaw")
    )
    greatest = np.array([float(row["max_force_N"]) for row in rows])
    line = base - jaw
    line /= np.linalg.norm(line, axis=1, keepdims=True)
    # z = -tan(40 deg) x: the fossa is above the condyle and pushes it down.
    slope = np.radians(40.0)
    down = -np.array([np.sin(slope), 0.0, np.cos(slope)])
    J = np.hstack([line, np.cross(jaw, line)])
    normal = np.hstack([np.tile(down, (2, 1)), np.cross(CONDYLES, down)])
    bite = np.array([[0.0, 0.0, -f] for f in force])
    load = np.hstack([bite - [0.0, 0.0, WEIGHT], np.cross(point, bite)])
    count = len(force)
    given = {"low": np.zeros(24), "high": greatest, "push": np.ones(2)} | more
    return Problem(-load, np.tile(J, (count, 1, 1)), np.tile(normal, (count, 1, 1)), **given)
