"""The tick's last stage against quadratic programs of quadprog, on the equations of the plant."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from support.points import moved

import condyle
from condyle.model.model import Model
from condyle.questions.law import CONTROLLERS
from condyle.questions.tick_limits import BEFORE, TickLimits

quadprog = pytest.importorskip("quadprog", reason="quadprog is in the `bench` extra")
Arrays = dict[str, np.ndarray]
M, N, K, COUNT, PERIOD = 4, 6, 2, 40, 1e-3
WIDE = 1e100


@cache
def jaw(friction: float = 0.0) -> Model:
    machine = condyle.load_mechanism("masticatory")
    if friction:
        machine = machine.set(
            {f"contact.{c}.friction.coefficient": friction for c in machine.contact_names}
        )
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


def program(
    H: np.ndarray, c: np.ndarray, rows: list[tuple[np.ndarray, float]], equal: int
) -> np.ndarray:
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


@pytest.mark.parametrize("aim", [0.0, 1.5])
def test_contact_forces_are_drawn_to_what_is_wanted(aim: float) -> None:
    weight, limit, parts = 3e-4, 0.05, TickLimits(chooses=True, weighs=True)
    low, high = np.full(N, -limit), np.full(N, limit)
    found = tick(parts, low, high, jaw(), weight=weight, contact_wanted=aim)
    for i in range(COUNT):
        effort, _ = wanted(jaw(), i, low, high, -np.inf, weight, aim)
        atol = 1e-5 * np.abs(effort).max()
        np.testing.assert_allclose(found["effort"][i], effort, rtol=0, atol=atol)


def test_efforts_change_by_no_more_than_their_rate() -> None:
    rng, rate, limit = np.random.default_rng(2), 20.0, 0.05
    last = rng.uniform(-limit, limit, (COUNT, N))
    parts, room = TickLimits(chooses=True, rated=True), rate * PERIOD
    ports: Any = {"effort_rate": rate, "effort_before": last}
    free = tick(parts, -limit, limit, jaw(), **ports)["effort"]
    assert np.abs(free - last).max() > room
    found = tick(parts, -limit, limit, jaw(), begun_limits_before=1.0, **ports)
    for i in range(COUNT):
        low, high = np.maximum(-limit, last[i] - room), np.minimum(limit, last[i] + room)
        _, far = wanted(jaw(), i, low, high, -np.inf)
        own = found["effort"][i]
        assert (low - 1e-15 <= own).all() and (own <= high + 1e-15).all()
        _, gain = affine(jaw(), i)
        q2, _ = plant(jaw(), own, i)
        more = np.linalg.lstsq(gain[:M], states()["q2"][i] - q2)[0]
        assert np.linalg.norm(more) <= far * (1 + 1e-6) + 1e-6 * limit
    plain = tick(TickLimits(rated=True), -limit, limit, jaw(), begun_limits_before=1.0, **ports)
    np.testing.assert_allclose(
        plain["effort"],
        np.clip(plain["asked"], np.maximum(-limit, last - room), np.minimum(limit, last + room)),
    )


def test_with_friction_they_are_those_of_the_model() -> None:
    limit, rubbing = 0.05, jaw(0.3)
    found = tick(TickLimits(chooses=True), -limit, limit, rubbing)
    s, limits = (
        states(),
        {f"chain.{c}.actuator.torque_limit": limit for c in rubbing.mechanism.chain_names},
    )
    model = condyle.derive(rubbing.mechanism.set(limits), distribution="bounded", backend="numpy")
    answer = model.inverse_dynamics(s["q"], s["q1"], s["q2"])
    good = np.asarray(answer.status) == 0
    assert good.sum() > COUNT / 2
    own, effort = found["effort"][good], answer.effort[good]
    np.testing.assert_allclose(own, effort, rtol=0, atol=1e-6 * limit)


def ends(i: int, speed: float, rate: float, bounds: np.ndarray) -> list[tuple[np.ndarray, float]]:
    """row.q'' >= room that keep rates of joints and places of balls, by differences in time."""
    s, h = states(), 1e-4
    q, q1 = s["q"][i], s["q1"][i]

    def along(q2: np.ndarray) -> tuple[np.ndarray, ...]:
        """Rates and accelerations of joints, places, velocities and accelerations of balls."""
        times = h * np.arange(-2, 3)
        rows = q + times[:, None] * q1 + times[:, None] ** 2 / 2 * q2
        found = jaw().inverse_kinematics(rows)
        joint = np.unwrap(np.asarray(found.joint), axis=0)
        balls = np.array([c.point for c in jaw().mechanism.contacts])
        places = np.array([[moved(x, p) + p for p in balls] for x in np.asarray(found.pose)])
        first, second = np.array([1, -8, 0, 8, -1]) / 12, np.array([-1, 16, -30, 16, -1]) / 12
        d = [np.einsum("t,t...->...", w, a) for a in (joint, places) for w in (first, second)]
        return d[0] / h, d[1] / h**2, places[2].ravel(), (d[2] / h).ravel(), (d[3] / h**2).ravel()

    rates, bias, place, velocity, drift = along(np.zeros(M))
    columns = [along(x) for x in np.eye(M)]
    J = np.stack([c[1] - bias for c in columns], axis=1)
    J_ball = np.stack([c[4] - drift for c in columns], axis=1)
    found = []
    for sign in (1, -1):
        found += [
            (-sign * row, sign * b - rate * (speed - sign * v))
            for row, b, v in zip(J, bias, rates, strict=True)
        ]
        end = bounds[:, (sign + 1) // 2].ravel()
        found += [
            (-sign * row, sign * b - rate**2 * sign * (x - p) + 2 * rate * sign * v)
            for row, b, x, p, v in zip(J_ball, drift, end, place, velocity, strict=True)
        ]
    return found


@pytest.mark.parametrize("speed", [1.5, 4.0])
@pytest.mark.parametrize("reach", [0.5e-3, 5e-3])
def test_bounds_are_kept_by_the_nearest_acceleration(speed: float, reach: float) -> None:
    rate = 40.0
    centres = np.array([c.point for c in jaw().mechanism.contacts])
    bounds = centres[:, None, :] + reach * np.array([-1, 1])[None, :, None]
    faces = tuple((i, axis, sign) for i in range(K) for sign in (-1, 1) for axis in range(3))
    parts = TickLimits(faces=faces)
    found = tick(
        parts, -WIDE, WIDE, jaw(), speed=speed, bound_rate=rate, bounds=bounds.reshape(1, 12)
    )
    checked = 0
    for i in range(COUNT):
        M_r, asked = jaw().mass_matrix(states()["q"][i]), states()["q2"][i]
        try:
            q2 = program(M_r, M_r @ asked, ends(i, speed, rate, bounds), 0)
        except ValueError:
            continue  # nothing keeps all of them
        own, _ = plant(jaw(), found["effort"][i], i)
        size = np.abs(q2) + np.abs(asked)
        np.testing.assert_allclose(own, q2, rtol=0, atol=2e-4 * size.max())
        checked += int(np.abs(q2 - asked).max() > 1e-3 * np.abs(asked).max())
    assert checked > 5
