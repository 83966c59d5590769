"""No answer is worse than its bound, which follows the condition of what was solved: an independent
text beside, in 64 bits and in 60 digits."""

from __future__ import annotations

import tomllib
from typing import Any

import numpy as np
import pytest
from oracles.digits import Machine
from oracles.long_digits import PRECISE
from oracles.long_digits import Machine as LongMachine
from oracles.random_mechanism import random_mechanism
from support.machines import model as shared

import condyle
from benchmarks.accuracy import checked
from condyle.mechanism.library import bundled_text
from condyle.model.model import Model

REGULAR = 1e-11  # at home and near it
NAMES = ["gough-stewart", "masticatory", "human-jaw-curved", "RSS", "PSS"]
long_double = pytest.mark.skipif(not PRECISE, reason="numpy.longdouble has 53 bits on this machine")


@pytest.mark.ci
@long_double
@pytest.mark.parametrize("name", NAMES)
def test_many_states(name: str) -> None:
    """Half of them are next to a limit or a singularity; contact forces count too."""
    rng = np.random.default_rng(2)
    if name in ("RSS", "PSS"):
        raw = random_mechanism(rng, (name,), 7, int(name == "PSS"), ["quadratic"])
    else:
        raw = tomllib.loads(bundled_text(name))
    rows = list(checked(rng, name, raw, 100, "numpy"))
    worst = max(rows, key=lambda row: row.ratio)
    assert worst.ratio < 1.0, worst
    assert max(row.ratio for row in rows if row.question == "long") < 0.05  # what decides is exact


@pytest.mark.slow
@long_double
def test_far_from_home() -> None:
    """Legs that are nearly parallel, and next to their own gimbal lock: efforts are small
    differences of the terms of normal equations, and forces of legs that spin are large."""
    raw = random_mechanism(np.random.default_rng(3), ("SPS",), 7, 0)
    rows = list(checked(np.random.default_rng(1), "SPS", raw, 60, "numpy", 0))
    worst = max(rows, key=lambda row: row.ratio)
    assert worst.ratio < 1.0, worst


@pytest.mark.slow
@long_double
def test_next_to_a_gimbal_lock() -> None:
    """There and back, efforts' errors as the inertia magnifies them.

    A roll that is small too makes a row of the angular rates short: it is no longer parallel to
    another.
    """
    model = shared("gough-stewart")
    raw = tomllib.loads(bundled_text("gough-stewart"))
    machine, exactly = LongMachine(raw, model.independent), Machine(raw, model.independent)
    rng, distance = np.random.default_rng(0), np.repeat([1e-1, 1e-2, 1e-4, 1e-6, 3e-7], 4)
    N = len(distance)
    q, v, a = rng.normal(0, 0.05, (N, 6)), rng.normal(0, 1, (N, 6)), rng.normal(0, 5, (N, 6))
    q[:, 3] = np.where(np.arange(N) % 2, distance, q[:, 3])
    q[:, 4] = np.pi / 2 - distance
    there = model.inverse_dynamics(q, v, a)
    back = model.forward_dynamics(q, v, there.effort)
    assert not there.status.any() and not back.status.any()
    none, point = np.zeros((6, N)), np.zeros((3, N))

    def moved(v: Any, effort: Any) -> Any:
        return np.array(machine.forward(q.T, q.T, v, effort, none, point)[0]).T

    def largest(x: Any) -> Any:
        return np.abs(x).max(axis=1)

    for i in range(1, N, 10):  # efforts lose nothing here, but in 64 bits the text would
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


def states(model: Model, size: int = 8) -> tuple[np.ndarray, ...]:
    rng = np.random.default_rng(3)
    scale = [model.characteristic_length if n in "XYZ" else 1.0 for n in model.independent]
    q, v, a = rng.normal(0, 1, (3, size, len(scale))) * scale
    return 0.01 * q, v, 10 * a


@pytest.mark.parametrize("name", ["masticatory", "gough-stewart"])
def test_one_for_each_sample(name: str) -> None:
    """Forward dynamics is within it, and so is the way there and back of kinematics."""
    model = shared(name)
    q, v, a = states(model)
    found = model.inverse_dynamics(q, v, a)
    assert found.bound.shape == found.status.shape == (8,)
    assert (found.bound > 0).all() and (found.bound < REGULAR).all()
    lost = model.inverse_dynamics(100 * q, 100 * v, 100 * a), model.inverse_kinematics(1e3 * q)
    for far in lost:
        assert (np.isnan(far.bound) == (far.status != 0)).all()
    moved = model.forward_dynamics(q, v, found.effort)
    assert (moved.bound > 0).all() and (moved.bound < 1e-8).all()
    size = np.abs(a).max(axis=1)
    assert (np.abs(moved.acceleration - a).max(axis=1) < moved.bound * size).all()
    there = model.inverse_kinematics(q, v, a)
    back = model.forward_kinematics(there.joint, start=there.pose)
    unit = [model.characteristic_length] * 3 + [1.0] * 3
    for bound in (there.bound, back.bound):
        assert (bound > 0).all() and (bound < REGULAR).all()
    off = (np.abs(back.pose - there.pose) / unit).max(axis=1)
    assert (off < there.bound + back.bound).all()
    # The robust path has the same, within what differs: the condition itself, pivots in kernels.
    ports: dict[str, Any] = dict.fromkeys(("force", "moment", "point"), np.zeros((8, 3)))
    robust, _ = model.system.robust.evaluate({"q": q, "q1": v, "q2": a, **ports})
    ratio = found.bound / robust["bound"]
    assert (ratio > 0.1).all() and (ratio < 10).all()


def test_it_grows_towards_a_singularity_and_is_a_certificate_within_limits() -> None:
    """A joint's square root vanishes at the end of its reach: errors grow as its reciprocal."""
    model, ray = shared("masticatory"), np.eye(4)[0]
    near, far = 0.0, 1.0
    for _ in range(60):
        middle = (near + far) / 2
        ok = model.inverse_dynamics(middle * ray, 0 * ray, 0 * ray).status == 0
        near, far = (middle, far) if ok else (near, middle)
    steps = near * (1 - np.array([1e-2, 1e-4, 1e-6]))
    bounds = model.inverse_dynamics(steps[:, None] * ray, 0 * ray, 0 * ray).bound
    assert (bounds[1:] > 10 * bounds[:-1]).all()
    model = shared("human-jaw", distribution="weighted")
    found = model.inverse_dynamics(*(0 * x for x in states(model)))
    assert (found.bound[found.status == 0] == 1e-9).all()


@pytest.mark.usefixtures("compiler_command")
def test_single_states_have_that_of_many_and_a_solution_has_it() -> None:
    model, within = shared("masticatory", "compiled"), shared("masticatory", distribution="bounded")
    q, v, a = states(model)
    for own in (model, within):
        many = own.inverse_dynamics(q, v, a).bound
        alone = [own.inverse_dynamics(*state).bound for state in zip(q, v, a, strict=True)]
        assert np.shape(alone[0]) == () and (np.array(alone) >= 0.9 * many).all()
        assert own is within or np.allclose(alone, many, rtol=1e-3, atol=0)
    motion = condyle.Motion.from_csv(condyle.motion.bundled_reference()[0], rate=10)
    run = shared("masticatory").solve(motion)
    assert run["bound"].dims == ("time",) and float(run["bound"].max()) < REGULAR
