"""No answer is worse than its bound: an independent text beside, in 64 bits and in 60 digits."""

from __future__ import annotations

import tomllib
from typing import Any

import numpy as np
import pytest
from oracles.digits import Machine
from oracles.long_digits import PRECISE
from oracles.long_digits import Machine as LongMachine
from oracles.random_mechanism import random_mechanism

import condyle
from benchmarks.accuracy import Row, checked
from condyle.mechanism.library import bundled_text

EXCEPTIONS = {"human-jaw-curved": 4.0}  # knots of its profiles, 0.1 mm apart, magnify rounding


def required(rows: list[Row]) -> None:
    worst = max(rows, key=lambda row: row.ratio)
    assert worst.ratio < EXCEPTIONS.get(worst.mechanism, 1.0), worst
    assert max(row.ratio for row in rows if row.question == "long") < 0.05  # what decides is exact


@pytest.mark.ci
@pytest.mark.skipif(not PRECISE, reason="numpy.longdouble has 53 bits on this machine")
@pytest.mark.parametrize("name", ["gough-stewart", "human-jaw", "human-jaw-curved", "masticatory"])
def test_bundled(name: str) -> None:
    """Half of the states are next to a limit or a singularity; contact forces count too."""
    raw = tomllib.loads(bundled_text(name))
    required(list(checked(np.random.default_rng(1), name, raw, 250, "numpy")))


@pytest.mark.ci
@pytest.mark.skipif(not PRECISE, reason="numpy.longdouble has 53 bits on this machine")
@pytest.mark.parametrize(("families", "k"), [(("RSS",), 0), (("PSS",), 1)])
def test_random(families: tuple[str, ...], k: int) -> None:
    rng = np.random.default_rng(2)
    raw = random_mechanism(rng, families, 7, k, ["quadratic"])
    required(list(checked(rng, "/".join(families), raw, 250, "numpy")))


@pytest.mark.slow
@pytest.mark.skipif(not PRECISE, reason="numpy.longdouble has 53 bits on this machine")
def test_next_to_a_gimbal_lock() -> None:
    """There and back, efforts' errors as the inertia magnifies them.

    A roll that is small too makes a row of the angular rates short: it is no longer parallel to
    another.
    """
    model = condyle.derive("gough-stewart", backend="numpy")
    raw = tomllib.loads(bundled_text("gough-stewart"))
    machine, exactly = LongMachine(raw, model.independent), Machine(raw, model.independent)
    rng = np.random.default_rng(0)
    distance = np.repeat([1e-1, 1e-2, 1e-4, 1e-6, 3e-7], 6)
    N = len(distance)
    q, v, a = rng.normal(0, 0.05, (N, 6)), rng.normal(0, 1, (N, 6)), rng.normal(0, 5, (N, 6))
    q[:, 3] = np.where(np.arange(N) % 2, distance, q[:, 3])
    q[:, 4] = np.pi / 2 - distance
    there = model.inverse_dynamics(q, v, a)
    back = model.forward_dynamics(q, v, there.effort)
    assert not there.status.any() and not back.status.any()
    none, point = np.zeros((6, N)), np.zeros((3, N))

    def moved(v: Any, effort: Any) -> Any:
        return rows(machine.forward(q.T, q.T, v, effort, none, point)[0])

    for i in range(1, N, 6):  # efforts lose nothing here, but in 64 bits the text would
        row, _ = exactly.inverse(q[i], q[i], v[i], a[i], none[:, 0], point[:, 0])
        off = max(abs(x - y) for x, y in zip(there.effort[i], row, strict=True))
        assert off < there.bound[i] * max(map(abs, row))
    exact, gravity = moved(v.T, there.effort.T), moved(none, none)
    size = np.maximum(largest(exact), largest(gravity))
    for part in (moved(v.T, none), moved(none, there.effort.T)):
        size = np.maximum(size, largest(part - gravity))
    assert np.all(largest(back.acceleration - exact) < back.bound * size)
    # What the accelerations are off because the efforts are.
    units = there.bound * largest(there.effort) * np.eye(6)[:, :, None]
    own = sum(largest(moved(none, unit) - gravity) for unit in units)
    assert np.all(largest(back.acceleration - a) < back.bound * size + own)


def rows(x: Any) -> Any:
    return np.array(x).T


def largest(x: Any) -> Any:
    return np.abs(x).max(axis=1)
