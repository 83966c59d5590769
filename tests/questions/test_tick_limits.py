"""The tick's last stage against quadratic programs of quadprog, on the equations of the plant."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from support.machines import model
from support.points import moved

import condyle
from condyle.model.model import Model
from condyle.questions.law import CONTROLLERS
from condyle.questions.tick_limits import BEFORE, TickLimits

quadprog = pytest.importorskip("quadprog", reason="quadprog is in the `bench` extra")
Arrays = dict[str, np.ndarray]
Rows = list[tuple[np.ndarray, float]]
M, N, K, COUNT, PERIOD = 4, 6, 2, 40, 1e-3
WIDE, LIMIT = 1e100, 0.05
RNG = np.random.default_rng(7)  # states for which the ten steps of the active set are enough
Q = RNG.uniform(-1, 1, (COUNT, M)) * [0.002, 0.002, 0.02, 0.03]
Q1 = 0.3 * RNG.normal(size=(COUNT, M)) * [0.03, 0.03, 1, 1]
ASKED = RNG.normal(size=(COUNT, M)) * [2, 2, 60, 60]


def tick(
    parts: TickLimits,
    low: Any,
    high: Any,
    scale: float = 1.0,
    of: Model | None = None,
    **given: Any,
) -> Arrays:
    """Computed torque with no gains: it asks for `scale` times ASKED."""
    jaw = of or model("masticatory")
    kernel = jaw.kernel("tick", CONTROLLERS["computed_torque"], (), None, parts)
    given = {"scale": 1.0, "contact_low": -np.inf, "contact_high": np.inf, "period": PERIOD} | given
    given |= {
        "q_d": Q,
        "q1_d": Q1,
        "q2_d": scale * ASKED,
        "q": Q,
        "q1": Q1,
        "low": low,
        "high": high,
    }
    ports = {}
    for port in kernel.interface.ports:
        value = np.asarray(given.get(port.name, 0.0), dtype=float)
        value = value[:, None] if value.shape == (COUNT,) else value
        ports[port.name] = np.broadcast_to(value, (COUNT, port.size * (N if port.lanes else 1)))
    answer = kernel.run(ports)
    assert not answer.status.any()
    return {name: a.T for name, a in answer.values.items()}


def plant(effort: np.ndarray) -> np.ndarray:
    """q'' and contact forces under efforts (COUNT, N)."""
    found = model("masticatory").forward_dynamics(Q, Q1, effort)
    return np.hstack([found.acceleration, found.contact_force])


@cache
def affine() -> tuple[np.ndarray, np.ndarray]:
    """(q'', lambda) = start + gain effort: the plant is affine in efforts, without friction."""
    start, *units = (plant(np.tile(e, (COUNT, 1))) for e in (np.zeros(N), *np.eye(N)))
    return start, np.stack(units, axis=2) - start[:, :, None]


def program(H: np.ndarray, c: np.ndarray, rows: Rows, equal: int) -> np.ndarray:
    """min x.H x / 2 - c.x, row.x >= room, the first `equal` of them equations."""
    G = np.array([row for row, _ in rows]).T
    size = np.maximum(np.linalg.norm(G, axis=0), 1e-300)
    return quadprog.solve_qp(H, c, G / size, np.array([x for _, x in rows]) / size, equal)[0]


def wanted(
    i: int, low: Any, high: Any, push: float = -np.inf, weight: float = 0.0, aim: float = 0.0,
    scale: float = 1.0,
) -> tuple[np.ndarray, float]:  # fmt: skip
    """Efforts by two programs: the q'' that least efforts would carry on to what was asked for,
    then the least efforts for it; and how large those of the first are."""
    start, gain = (one[i] for one in affine())
    metric = np.linalg.cholesky(np.linalg.inv(gain[:M] @ gain[:M].T)).T
    ends = [*zip(np.eye(N), low, strict=True), *zip(-np.eye(N), -high, strict=True)]
    ends += [(gain[M + k], push - start[M + k]) for k in range(K) if np.isfinite(push)]
    far, by = metric @ (scale * ASKED[i] - start[:M]), metric @ gain[:M]
    tiny = 1e-9 * np.trace(by.T @ by) * np.eye(N)
    effort = program(by.T @ by + tiny, by.T @ far, ends, 0)
    missed = float(np.linalg.norm(by @ effort - far))
    contact, left = gain[M:], aim - start[M:]
    H, c = np.eye(N) + weight * contact.T @ contact, weight * contact.T @ left
    same = [(row, float(row @ effort)) for row in gain[:M]]
    try:
        effort = program(H, c, [*same, *ends], M)
    except ValueError:  # the first program's ends, to rounding
        loose = [(row, x - 1e-9 * max(1.0, abs(x))) for row, x in ends]
        effort = program(H, c, [*same, *loose], M)
    return effort, missed


def as_near(own: np.ndarray, i: int, missed: float, size: float, scale: float = 1.0) -> bool:
    """Whether efforts miss the q'' asked for by no more than the first program does."""
    start, gain = (one[i][:M] for one in affine())
    more = np.linalg.lstsq(gain, scale * ASKED[i] - start - gain @ own)[0]
    return bool(np.linalg.norm(more) <= missed * (1 + 1e-6) + 1e-6 * size)


@pytest.mark.parametrize("push", [-np.inf, 0.3])
def test_efforts_are_the_least_within_limits(push: float) -> None:
    """Wide limits, tight ones and hopeless ones, without and with one-sided contacts."""
    for limit, scale in ((9.0, 1.0), (0.02, 1.0), (0.004, 3.0)):
        low, high = np.full(N, -limit), np.full(N, limit)
        before: Any = {}
        for _ in range(3):  # as at ticks of a state that stays
            found = tick(TickLimits(chooses=True), low, high, scale, contact_low=push, **before)
            before = {port: found[name] for port, name in BEFORE.items()}
        assert (np.abs(found["effort"]) <= limit * (1 + 1e-12)).all()
        assert (plant(found["effort"])[:, M:] >= push - 1e-4).all()
        for i, own in enumerate(found["effort"]):
            effort, missed = wanted(i, low, high, push, scale=scale)
            size = float(np.abs(effort).max())
            assert as_near(own, i, missed, size, scale)
            if missed < 1e-6 * size:
                np.testing.assert_allclose(own, effort, rtol=0, atol=1e-5 * size)


def test_steps_that_run_out_are_said() -> None:
    """From cold, in hopeless limits: efforts are within them, and the least unless it is said."""
    low, high, parts = np.full(N, -0.004), np.full(N, 0.004), TickLimits(chooses=True)
    found = tick(parts, low, high, 3.0, contact_low=0.3)
    assert (np.abs(found["effort"]) <= 0.004 * (1 + 1e-12)).all()
    least = []
    for i, own in enumerate(found["effort"]):
        effort, missed = wanted(i, low, high, 0.3, scale=3.0)
        least.append(as_near(own, i, missed, float(np.abs(effort).max()), 3.0))
    said = found["unconverged"].ravel() > 0.5
    assert np.array(least)[~said].all() and not np.array(least)[said].all() and said.sum() < 20


def test_contact_forces_are_drawn_to_what_is_wanted() -> None:
    weight, parts = 3e-4, TickLimits(chooses=True, weighs=True)
    low, high = np.full(N, -LIMIT), np.full(N, LIMIT)
    for aim in (0.0, 1.5):
        found = tick(parts, low, high, weight=weight, contact_wanted=aim)
        for i, own in enumerate(found["effort"]):
            effort, _ = wanted(i, low, high, weight=weight, aim=aim)
            np.testing.assert_allclose(own, effort, rtol=0, atol=1e-5 * np.abs(effort).max())


def test_efforts_change_by_no_more_than_their_rate() -> None:
    last = np.random.default_rng(2).uniform(-LIMIT, LIMIT, (COUNT, N))
    rate, parts = 20.0, TickLimits(chooses=True, rated=True)
    low, high = np.maximum(-LIMIT, last - rate * PERIOD), np.minimum(LIMIT, last + rate * PERIOD)
    ports: Any = {"effort_rate": rate, "effort_before": last}
    free = tick(parts, -LIMIT, LIMIT, **ports)["effort"]
    assert np.abs(free - last).max() > rate * PERIOD
    own = tick(parts, -LIMIT, LIMIT, begun_limits_before=1.0, **ports)["effort"]
    assert (low - 1e-15 <= own).all() and (own <= high + 1e-15).all()
    for i in range(COUNT):
        _, missed = wanted(i, low[i], high[i])
        assert as_near(own[i], i, missed, LIMIT)
    plain = tick(TickLimits(rated=True), -LIMIT, LIMIT, begun_limits_before=1.0, **ports)
    np.testing.assert_allclose(plain["effort"], np.clip(plain["asked"], low, high))


@pytest.mark.slow
def test_with_friction_they_are_those_of_the_model() -> None:
    machine = condyle.load_mechanism("masticatory")
    machine = machine.set({f"contact.{c}.friction.coefficient": 0.3 for c in machine.contact_names})
    found = tick(TickLimits(chooses=True), -LIMIT, LIMIT, of=Model(machine, backend="numpy"))
    limits = {f"chain.{c}.actuator.torque_limit": LIMIT for c in machine.chain_names}
    bounded = condyle.derive(machine.set(limits), distribution="bounded", backend="numpy")
    answer = bounded.inverse_dynamics(Q, Q1, ASKED)
    good = np.asarray(answer.status) == 0
    assert good.sum() > COUNT / 2
    own, effort = found["effort"][good], answer.effort[good]
    np.testing.assert_allclose(own, effort, rtol=0, atol=1e-6 * LIMIT)


@cache
def watched() -> tuple[list[np.ndarray], np.ndarray, np.ndarray]:
    """Rates and accelerations of joints, places, velocities and accelerations of balls, by
    differences in time without acceleration; and the slopes of the accelerations in q''."""
    jaw, h = model("masticatory"), 1e-4
    times = h * np.arange(-2, 3)[:, None]
    balls = np.array([c.point for c in jaw.mechanism.contacts])
    first, second = (
        np.array([1, -8, 0, 8, -1]) / 12 / h,
        np.array([-1, 16, -30, 16, -1]) / 12 / h**2,
    )

    def along(q2: np.ndarray) -> list[np.ndarray]:
        rows = Q[:, None] + times * Q1[:, None] + times**2 / 2 * q2
        found = jaw.inverse_kinematics(rows.reshape(-1, M))
        joint = np.unwrap(np.asarray(found.joint).reshape(COUNT, 5, N), axis=1)
        places = np.array([[moved(x, p) + p for p in balls] for x in np.asarray(found.pose)])
        places = places.reshape(COUNT, 5, 3 * K)
        d = [np.einsum("t,it...->i...", w, a) for a in (joint, places) for w in (first, second)]
        return [d[0], d[1], places[:, 2], d[2], d[3]]

    free, pushed = along(np.zeros(M)), [along(unit) for unit in np.eye(M)]
    J, J_ball = (np.stack([one[k] - free[k] for one in pushed], axis=2) for k in (1, 4))
    return free, J, J_ball


def room(i: int, speed: float, rate: float, bounds: np.ndarray) -> Rows:
    """row.q'' >= room that keep rates of joints and places of balls."""
    free, J, J_ball = watched()
    v, bias, place, velocity, drift = (one[i] for one in free)
    found: Rows = []
    for sign, end in ((1, bounds[:, 1].ravel()), (-1, bounds[:, 0].ravel())):
        joints = sign * bias - rate * (speed - sign * v)
        balls = sign * drift - rate**2 * sign * (end - place) + 2 * rate * sign * velocity
        found += [*zip(-sign * J[i], joints, strict=True)]
        found += [*zip(-sign * J_ball[i], balls, strict=True)]
    return found


def test_bounds_are_kept_by_the_nearest_acceleration() -> None:
    """Of joint rates and of balls; samples where nothing keeps all of them are left out."""
    rate, jaw = 40.0, model("masticatory")
    centres = np.array([c.point for c in jaw.mechanism.contacts])
    faces = tuple((i, axis, sign) for i in range(K) for sign in (-1, 1) for axis in range(3))
    for speed, reach in ((1.5, 0.5e-3), (4.0, 0.5e-3), (1.5, 5e-3), (4.0, 5e-3)):
        bounds = centres[:, None, :] + reach * np.array([-1, 1])[None, :, None]
        ports: Any = {"speed": speed, "bound_rate": rate, "bounds": bounds.reshape(1, 12)}
        found = tick(TickLimits(faces=faces), -WIDE, WIDE, **ports)
        own, checked = plant(found["effort"])[:, :M], 0
        for i, M_r in enumerate(jaw.mass_matrix(Q)):
            try:
                q2 = program(M_r, M_r @ ASKED[i], room(i, speed, rate, bounds), 0)
            except ValueError:
                continue
            size = (np.abs(q2) + np.abs(ASKED[i])).max()
            bound = 2e-4 if found["unconverged"][i] else 5e-5
            np.testing.assert_allclose(own[i], q2, rtol=0, atol=bound * size)
            checked += int(np.abs(q2 - ASKED[i]).max() > 1e-3 * np.abs(ASKED[i]).max())
        assert checked > 5
