"""The tick's last stage against quadratic programs of quadprog, on the equations of the plant."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
import quadprog

import condyle
from condyle.model.model import Model
from condyle.questions.law import CONTROLLERS
from condyle.questions.tick_limits import BEFORE, TickLimits

Arrays = dict[str, np.ndarray]
M, N, K, COUNT, PERIOD = 4, 6, 2, 40, 1e-3
WIDE = 1e100


@cache
def jaw(friction: float = 0.0) -> Model:
    machine = condyle.load_mechanism("masticatory")
    if friction:
        machine = machine.set({f"contact.{c}.friction.coefficient": friction for c in machine.contact_names})
    return Model(machine, backend="numpy")


@cache
def states(scale: float = 1.0) -> Arrays:
    """At random: states, an acceleration to ask for and a force at O_M."""
    rng = np.random.default_rng(7)
    return {
        "q": rng.uniform(-1, 1, (COUNT, M)) * [0.002, 0.002, 0.02, 0.03],
        "q1": 0.3 * rng.normal(size=(COUNT, M)) * [0.03, 0.03, 1, 1],
        "q2": scale * rng.normal(size=(COUNT, M)) * [2, 2, 60, 60],
    }


def column(values: Any) -> np.ndarray:
    """One of all samples, or (COUNT, size)."""
    found = np.asarray(values, dtype=float)
    return found[:, None] if found.shape == (COUNT,) else found


def tick(
    parts: TickLimits, low: Any, high: Any, model: Model, scale: float = 1.0, **ports: Any
) -> Arrays:
    """Computed torque with no gains: it asks for q2."""
    s, table = states(scale), CONTROLLERS["computed_torque"]
    names = {"q_d": "q", "q1_d": "q1", "q2_d": "q2", "q": "q", "q1": "q1"}
    given = {port: s[name] for port, name in names.items()}
    kernel = model.kernel("tick", table, (), None, parts)
    sizes = {p.name: p.size * (N if p.lanes else 1) for p in kernel.interface.ports}
    defaults = {"scale": 1.0, "contact_low": -np.inf, "contact_high": np.inf, "period": PERIOD}
    given |= {"low": low, "high": high, **ports}
    full = {
        name: np.broadcast_to(column(given.get(name, defaults.get(name, 0.0))), (COUNT, size))
        for name, size in sizes.items()
    }
    answer = kernel.run(full)
    assert not answer.status.any()
    return {name: a.T for name, a in answer.values.items()}


def plant(model: Model, effort: np.ndarray, i: int) -> tuple[np.ndarray, np.ndarray]:
    """q'' and contact forces under efforts."""
    s = states()
    found = model.forward_dynamics(s["q"][i], s["q1"][i], effort)
    return np.asarray(found.acceleration), np.asarray(found.contact_force)


def affine(model: Model, i: int) -> tuple[np.ndarray, np.ndarray]:
    """(q'', lambda) = start + gain effort: the plant is affine in efforts, without friction."""
    rows = [np.concatenate(plant(model, e, i)) for e in (np.zeros(N), *np.eye(N))]
    return rows[0], np.stack(rows[1:], axis=1) - rows[0][:, None]


def program(H: np.ndarray, c: np.ndarray, rows: list[tuple[np.ndarray, float]], equal: int) -> np.ndarray:
    """min x.H x / 2 - c.x, row.x >= room, the first `equal` of them equations."""
    G = np.array([row for row, _ in rows]).T
    size = np.maximum(np.linalg.norm(G, axis=0), 1e-300)
    return quadprog.solve_qp(H, c, G / size, np.array([x for _, x in rows]) / size, equal)[0]


def wanted(
    model: Model,
    i: int,
    low: np.ndarray,
    high: np.ndarray,
    push: float,
    weight: float = 0.0,
    aim: float = 0.0,
    scale: float = 1.0,
) -> tuple[np.ndarray, float]:
    """Efforts by two programs: the q'' that least efforts would carry on to what was asked for,
    then the least efforts for it; and how large those of the first are."""
    start, gain = affine(model, i)
    metric = np.linalg.cholesky(np.linalg.inv(gain[:M] @ gain[:M].T)).T
    asked = states(scale)["q2"][i]
    ends = [(row, x) for row, x in zip(np.eye(N), low, strict=True)]
    ends += [(-row, -x) for row, x in zip(np.eye(N), high, strict=True)]
    ends += [(gain[M + k], push - start[M + k]) for k in range(K) if np.isfinite(push)]
    ends = [(row, x) for row, x in ends if abs(x) < WIDE]
    far, by = metric @ (asked - start[:M]), metric @ gain[:M]
    tiny = 1e-9 * np.trace(by.T @ by) * np.eye(N)
    effort = program(by.T @ by + tiny, by.T @ far, ends, 0) if ends else np.linalg.pinv(by) @ far
    reached = metric @ (start[:M] + gain[:M] @ effort - asked)
    contact, left = gain[M:], aim - start[M:]
    H, c = np.eye(N) + weight * contact.T @ contact, weight * contact.T @ left
    same = [(row, float(row @ effort)) for row in gain[:M]]
    try:
        effort = program(H, c, [*same, *ends], M)
    except ValueError:  # the first program's ends, to rounding
        loose = [(row, x - 1e-9 * max(1.0, abs(x))) for row, x in ends]
        effort = program(H, c, [*same, *loose], M)
    return effort, float(np.linalg.norm(reached))


LIMITS = {"wide": (9.0, 1.0), "tight": (0.02, 1.0), "hopeless": (0.004, 3.0)}


@pytest.mark.parametrize("case", LIMITS)
@pytest.mark.parametrize("push", [-np.inf, 0.3])
def test_efforts_are_the_least_within_limits(case: str, push: float) -> None:
    limit, scale = LIMITS[case]
    parts = TickLimits(chooses=True)
    low, high = np.full(N, -limit), np.full(N, limit)
    before: Any = {}
    for _ in range(3):  # as at ticks of a state that stays
        found = tick(parts, low, high, jaw(), scale, contact_low=push, **before)
        before = {port: found[name] for port, name in BEFORE.items()}
    for i in range(COUNT):
        effort, far = wanted(jaw(), i, low, high, push, scale=scale)
        own = found["effort"][i]
        assert (np.abs(own) <= limit * (1 + 1e-12)).all()
        q2, force = plant(jaw(), own, i)
        _, gain = affine(jaw(), i)
        more = np.linalg.lstsq(gain[:M], states(scale)["q2"][i] - q2)[0]
        size = float(np.abs(effort).max())
        assert np.linalg.norm(more) <= far * (1 + 1e-6) + 1e-6 * size
        assert (force >= push - 1e-4).all()
        if far < 1e-6 * size:
            np.testing.assert_allclose(own, effort, rtol=0, atol=1e-5 * np.abs(effort).max())
