"""Static friction at contacts: what holds, what slides, and when, against closed forms."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from simulation.rails import rail

import condyle
from condyle.mechanism.contact import Friction
from condyle.simulation import running
from condyle.simulation.bind import bind
from condyle.simulation.live import Live
from condyle.simulation.scenario import Scenario

G, MASS = 9.81, 2.0
ROUGH = {"coefficient": 0.3, "static_coefficient": 0.5}


def incline(angle: float, **more: Any) -> condyle.Model:
    gravity = [G * np.sin(angle), 0.0, -G * np.cos(angle)]
    return rail(MASS, gravity=gravity, friction=ROUGH, **more)


@pytest.mark.parametrize("past", [-1e-3, 1e-3])
def test_a_block_on_an_incline(past: float) -> None:
    """It holds below the static angle, without creeping, and slides above it."""
    angle = np.arctan(ROUGH["static_coefficient"]) + past
    found = condyle.simulate(incline(angle), {"duration": 0.5, "rtol": 1e-10, "rate": 100.0})
    t, x = found.time.values, found.pose.values[:, 0]
    slides = G * (np.sin(angle) - ROUGH["coefficient"] * np.cos(angle))
    np.testing.assert_allclose(x, slides * t**2 / 2 if past > 0 else 0 * t, atol=1e-9)


def test_stick_slip() -> None:
    """A mass that a spring drags at a steady speed, as one on a belt: the same again and again."""
    k, speed, N = 400.0, 0.05, MASS * G
    w, loose, tight = np.sqrt(k / MASS), 0.3 * N / k, 0.5 * N / k  # m, of the spring
    swing, sticks = tight - loose, 2 * (tight - loose) / speed
    slides = 2 * (np.pi - np.arctan(swing * w / speed)) / w
    period = sticks + slides
    run = {"duration": 3.0, "rtol": 1e-11, "rate": 200.0}
    model = rail(MASS, friction=ROUGH, gravity=[0, 0, -G])
    found = condyle.simulate(
        model, run, loads=[lambda t, s, v: np.array([k * (speed * t - s[0]), 0.0, 0.0])]
    )
    t = found.time.values
    rounds, began = np.divmod(t - tight / speed, period)
    tau = np.minimum(began, slides)
    bent = loose + swing * np.cos(w * tau) + speed / w * np.sin(w * tau)
    x = tight + speed * (rounds * period + tau) - bent
    np.testing.assert_allclose(found.pose.values[:, 0], np.where(rounds < 0, 0, x), atol=1e-8)
    slips = tight / speed + period * np.arange(6)
    assert _times(found, "contact_slips") == pytest.approx(slips[slips < t[-1]], abs=1e-8)
    assert _times(found, "contact_sticks") == pytest.approx(
        (slips + slides)[slips + slides < t[-1]], abs=1e-8
    )


def _times(found: Any, kind: str) -> list[float]:
    events = [event for event in found.condyle.events if event["kind"] == kind]
    return [event["time"] for event in events if event["owner"] == "contact_0"]


@pytest.mark.usefixtures("compiler_command")
def test_a_spring_swings_out() -> None:
    """Each half swing is shorter by 2 mu N / k, until the spring pulls less than static friction.

    In Python, and step by step in compiled code, which leaves it what slips and stops."""
    k, N, start = 400.0, MASS * G, 0.11
    loose, half = 0.3 * N / k, np.pi * np.sqrt(MASS / k)
    spring = {"kind": "spring", "point": "centre", "direction": [1, 0, 0], "stiffness": k}
    run = {"duration": 1.5, "rtol": 1e-11, "rate": 100.0, "start": {"X": start}, "load": [spring]}
    # In fixed steps, less than what the speed changes in one.
    model = rail(MASS, friction=ROUGH | {"smoothing_speed": 0.01}, gravity=[0, 0, -G])
    found = condyle.simulate(model, run)
    turns = [start]
    while abs(turns[-1]) > 0.5 * N / k:
        turns.append(-np.sign(turns[-1]) * (abs(turns[-1]) - 2 * loose))
    t = found.time.values
    count = np.minimum(t // half, len(turns) - 1).astype(int)
    side = np.sign(turns)[count]
    swung = side * loose + (np.array(turns)[count] - side * loose) * np.cos(
        np.pi * (t / half - count)
    )
    x = np.where(count == len(turns) - 1, turns[-1], swung)
    assert len(turns) == 4
    np.testing.assert_allclose(found.pose.values[:, 0], x, atol=1e-8)
    assert _times(found, "contact_sticks")[-1] == pytest.approx(half * (len(turns) - 1), abs=1e-8)
    books = found.energy.to_series().unstack()
    left = books.kinetic + books.contact_friction - books.load
    np.testing.assert_allclose(left, 0.0, atol=1e-8)
    at_rest = found.time.values > half * (len(turns) - 1)
    friction = found.friction_force.sel(axis="x").sum("contact").values
    np.testing.assert_allclose(friction[at_rest], k * turns[-1], atol=1e-6)
    plan = bind(model, Scenario.read({**run, "method": "rk4", "step": 1e-4}))
    batch = running.Batch([plan])
    one, other = batch.traces()[0], running.run(plan, compiled=False)
    np.testing.assert_allclose(one.state, other.state, atol=1e-9)
    np.testing.assert_array_equal(one.modes, other.modes)
    np.testing.assert_allclose(one.state[:, 0], x, atol=1e-6)


def test_a_ball_that_rolls() -> None:
    """Where the ball sticks to a curved wall it rolls without sliding, and takes no energy."""
    machine = condyle.load_mechanism("sphere-in-cylinder")
    (probe,) = machine.contacts
    friction = {"coefficient": 0.3, "static_coefficient": 8.0}
    turning = np.array([0.3, 0.4, 0.2])
    rates = [*np.cross(probe.touching_point, turning), *turning]
    start = dict(zip(("dX", "dY", "dZ", "dalpha", "dbeta", "dgamma"), rates, strict=True))
    del start["dZ"]
    model = condyle.derive(machine.set("contact.probe.friction", friction))
    found = condyle.simulate(model, {"duration": 0.05, "rtol": 1e-11, "start": start})
    assert not found.condyle.events
    assert np.abs(found.sliding_speed.values).max() < 1e-10
    kept = found.energy.sel(account=["kinetic", "potential"]).sum("account").values
    np.testing.assert_allclose(kept, kept[0], rtol=0, atol=1e-11)
    np.testing.assert_allclose(found.share.sum("part"), found.effort, atol=1e-12)


def test_where_contacts_do_not_stick() -> None:
    with pytest.raises(
        condyle.MechanismError, match=r"no less than a coefficient above 0, got 0\.1"
    ):
        Friction(coefficient=0.3, static_coefficient=0.1)
    model, law = incline(0.1), {"kind": "joint_pd", "stiffness": 9.0, "damping": 9.0}
    with pytest.raises(condyle.UnsupportedError, match="no static friction; remove static_coeff"):
        condyle.check_gains(model, {"controller": law})
    with pytest.raises(condyle.UnsupportedError, match="no static friction: remove static_coeff"):
        Live(bind(model, Scenario.read({})))
    probe = condyle.load_mechanism("sphere-in-cylinder").set("contact.probe.friction", ROUGH)
    with pytest.raises(
        condyle.ScenarioError, match=r"remove friction\.static_coefficient from probe"
    ):
        condyle.simulate(probe, {"contacts": {"kind": "rigid"}})
