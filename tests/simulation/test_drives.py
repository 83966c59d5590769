"""Drives that give: gears with elasticity and play, motors that are not as assumed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from simulation.rails import rail
from simulation.scenarios import RK4

import condyle
from condyle.simulation import running
from condyle.simulation.bind import bind
from condyle.simulation.live import Live
from condyle.simulation.scenario import Scenario

MASS, INERTIA, STIFFNESS = 2.0, 0.5, 800.0
ACTUATOR = {"rotor_inertia": INERTIA / 16, "gear": 4.0}


SMALL = 1e-5  # of rotor and gear, so that a platform of 1000 t does not notice them
BREAKS, SLIDES, SOFT = 5 * SMALL, 3 * SMALL, STIFFNESS * SMALL  # N, N: at rest, and sliding; N/m
GRIPPED = {"gear_stiffness": SOFT, "static_friction": BREAKS}


def gripped() -> condyle.Model:
    """A platform that moves on as it does, behind a rotor with static friction."""
    return rail(1e6, actuator={"rotor_inertia": INERTIA * SMALL, "coulomb": SLIDES})


@pytest.fixture
def pushed(tmp_path: Path) -> Any:
    """A scenario with efforts over time."""

    def scenario(t: Any, effort: Any, drives: dict[str, Any], **more: Any) -> dict[str, Any]:
        path = tmp_path / "efforts.csv"
        pairs = np.column_stack([t, effort]).tolist()
        rows = "".join(f"{when!r},{value!r}\n" for when, value in pairs)
        path.write_text("t,tau_leg\n" + rows, encoding="utf-8")
        run = {"duration": 1.0, "rtol": 1e-11, "rate": 200.0, "efforts": {"file": str(path)}}
        return {**run, "drives": drives, **more}

    return scenario


def test_two_masses_on_a_spring(pushed: Any) -> None:
    """A step of force on the rotor: both move with their mass centre, and swing about it."""
    step = pushed([0, 1e-9, 1], [0, 3.0, 3.0], {"gear_stiffness": STIFFNESS})
    found = condyle.simulate(rail(MASS, actuator=ACTUATOR), step)
    t, total = found.time.values, MASS + INERTIA
    w = np.sqrt(STIFFNESS * total / (MASS * INERTIA))
    middle, apart = 3.0 * t**2 / 2 / total, 3.0 * (1 - np.cos(w * t)) / (INERTIA * w**2)
    np.testing.assert_allclose(found.pose.values[:, 0], middle - apart * INERTIA / total, atol=1e-8)
    np.testing.assert_allclose(
        found.motor_joint.values[:, 0], middle + apart * MASS / total, atol=1e-8
    )
    np.testing.assert_allclose(found.effort.values[:, 0], STIFFNESS * apart, atol=1e-5)


PLAY, DRAG = 2e-3, 4.0  # m, N s/m
PUSH, RATE = 10.0, 9.0  # N, rad/s


def dragged(until: np.ndarray, damping: float) -> np.ndarray:
    """Platform and rotor across play under a sine on the platform, flank by flank: (4, N).

    x, x', psi, psi'; between flanks that engage or leave each part is linear.
    """

    def forces(flank: int) -> Any:
        def rate(t: float, y: np.ndarray) -> list[float]:
            bent = y[2] - y[0] - flank * PLAY / 2
            T = flank * max(flank * (STIFFNESS * bent + damping * (y[3] - y[1])), 0.0)
            push = PUSH * np.cos(RATE * t)
            return [y[1], (push + T) / MASS, y[3], (-T - DRAG * y[3]) / INERTIA]

        return rate

    def ends(flank: int) -> list[Any]:
        sides = (-1, 1) if flank == 0 else (flank,)
        found = [lambda _, y, s=s: s * (y[2] - y[0]) - PLAY / 2 for s in sides]
        for event in found:
            event.terminal, event.direction = True, 1 if flank == 0 else -1
        return found

    t, y, flank, states, switches = 0.0, np.zeros(4), 0, [], 0
    while True:
        rows = until[(until >= t)]
        part = solve_ivp(forces(flank), (t, until[-1]), y, method="DOP853", rtol=1e-12, atol=1e-14,
                         t_eval=rows, events=ends(flank), max_step=0.01)  # fmt: skip
        states.append(part.y)
        if not part.status:
            assert switches > 10
            return np.concatenate(states, axis=1)
        side = next(i for i, times in enumerate(part.t_events) if times.size)
        t, y = float(part.t_events[side][0]), part.y_events[side][0]
        flank, switches = (0 if flank else (-1, 1)[side]), switches + 1


@pytest.mark.parametrize("damping", [0.0, 6.0])
def test_backlash_in_a_sine(damping: float) -> None:
    """Flanks that damp meet with a jump of the force."""
    model = rail(MASS, actuator=ACTUATOR | {"viscous": DRAG})
    drives = {"gear_stiffness": STIFFNESS, "gear_damping": damping, "backlash": PLAY}
    run = {"duration": 3.0, "rtol": 1e-12, "rate": 100.0, "drives": drives}
    found = condyle.simulate(
        model, run, loads=[lambda t, s, v: np.array([PUSH * np.cos(RATE * t), 0.0, 0.0])]
    )
    expected = dragged(found.time.values, damping)
    np.testing.assert_allclose(found.pose.values[:, 0], expected[0], rtol=0, atol=1e-8)
    np.testing.assert_allclose(found.motor_joint.values[:, 0], expected[2], rtol=0, atol=1e-8)
    books = found.energy.to_series().unstack()
    left = books.kinetic + books.potential + books.actuator_losses - books.load - books.actuators
    np.testing.assert_allclose(left, 0.0, atol=1e-8)


def test_motors_that_are_not_as_assumed(pushed: Any) -> None:
    """A force that rises passes what the current gives: twice, in either direction."""
    drives = {"motor_constant": 0.5, "motor_constant_error": -0.1, "current_limit": 2.0}
    found = condyle.simulate(
        rail(20 * MASS, actuator={"gear": 4.0}),
        pushed([0, 0.5, 1.5], [0, 10.0, -10.0], drives, duration=1.5),
    )
    asked = np.interp(found.time.values, [0, 0.5, 1.5], [0, 10.0, -10.0])
    np.testing.assert_allclose(found.effort.values[:, 0], 0.9 * np.clip(asked, -4, 4), atol=1e-12)
    events = [(event["kind"], event["time"]) for event in found.condyle.events]
    assert [kind for kind, _ in events] == ["current", "current"]
    assert [time for _, time in events] == pytest.approx([0.2, 1.2], abs=1e-9)


@pytest.mark.usefixtures("compiler_command")
def test_in_compiled_code(pushed: Any) -> None:
    """Step by step as in Python, under a controller that reads the motor's side of the gear."""
    drives = {
        "gear_stiffness": STIFFNESS,
        "gear_damping": 2.0,
        "backlash": PLAY,
        "encoders": "motor",
    }
    law = {"kind": "joint_pd", "stiffness": 300.0, "damping": 30.0, "rate": 500.0}
    run = {**RK4, "duration": 0.2, "controller": law, "sensors": {"encoder_resolution": 1e-6}}
    model = rail(MASS, actuator=ACTUATOR)
    plan = bind(model, Scenario.read({**run, "drives": drives, "start": {"dX": 0.3}}))
    batch = running.Batch([plan])
    assert batch.steps is not None
    found, expected = batch.traces()[0], running.run(plan, compiled=False)
    for name in ("state", "command", "count"):
        np.testing.assert_allclose(getattr(found, name), getattr(expected, name), atol=1e-9)
    motor = found.state[:, plan.size - 2]
    assert np.abs(motor - found.state[:, 0]).max() > PLAY / 2
    ticks = slice(0, -1, 2)
    np.testing.assert_allclose(found.count[found.tick[ticks], 0], motor[ticks], atol=1e-6)


@pytest.mark.usefixtures("compiler_command")
def test_rotors_with_static_friction_in_compiled_code() -> None:
    """What breaks away and what comes to rest is left to Python. In fixed steps as in those that an
    integrator chooses, from 1e-8 s on for rotors so light, with slides shorter than a step; where
    one of them is without static friction, it ends too."""
    machine = condyle.load_mechanism("masticatory")
    losses = {"rotor_inertia": 4e-5, "coulomb": 0.1, "viscous": 1e-3}
    chains = [f"chain.{name}.actuator.{key}" for name in machine.chain_names for key in losses]
    model = condyle.derive(machine.set(dict(zip(chains, [*losses.values()] * 6, strict=True))))
    static = [0.2, 0.15, 0.1, 0.2, 0.12, 0.2]
    gears = {"gear_stiffness": 40.0, "gear_damping": 0.02, "static_friction": static}
    law = {"kind": "joint_pd", "stiffness": 20.0, "damping": 0.3, "rate": 500.0}
    run = {"duration": 0.04, "controller": law, "sensors": {"velocity": "exact"},
           "drives": gears, "start": {"beta": 0.05}}  # fmt: skip
    plan = bind(model, Scenario.read({**run, "method": "rk4", "step": 2e-5}))
    batch = running.Batch([plan])
    assert batch.steps is not None
    found, expected = batch.traces()[0], running.run(plan, compiled=False)
    np.testing.assert_allclose(found.state, expected.state, atol=1e-9)
    np.testing.assert_array_equal(found.modes, expected.modes)
    kinds = {(event.kind, event.owner) for event in found.events}
    assert len({owner for kind, owner in kinds if kind == "drive_sticks"}) > 1
    by_error = running.run(bind(model, Scenario.read({**run, "rtol": 1e-9})))
    np.testing.assert_allclose(found.state[:, :4], by_error.state[:, :4], atol=1e-5)
    gears["static_friction"] = [0.2, 0.15, 0.0, 0.2, 0.12, 0.2]
    run |= {"duration": 0.02, "sensors": {"encoder_resolution": 1e-5}, "rtol": 1e-8}
    mixed = running.run(bind(model, Scenario.read(run)))
    kinds = {(event.kind, event.owner) for event in mixed.events}
    assert mixed.t[-1] == 0.02 and ("drive_sticks", machine.chain_names[2]) not in kinds


@pytest.mark.parametrize(
    ("drives", "text"),
    [
        ({"backlash": 1e-3}, "drives.backlash: a rigid gear has none; give gear_stiffness"),
        ({"gear_stiffness": 1.0}, "give actuator.rotor_inertia"),
        ({"motor_constant_error": -1.0}, "expected more than -1"),
        ({"current_limit": 1.0}, "give drives.motor_constant too"),
        ({"static_friction": 1.0}, "drives.static_friction: a rigid gear has none"),
        (GRIPPED | {"static_friction": SLIDES / 2}, "no less than actuator.coulomb"),
        ({"gear_stiffness": [1.0, 2.0]}, "expected one number, or 1"),
    ],
)
def test_what_does_not_fit(drives: dict[str, Any], text: str) -> None:
    model = gripped() if "static_friction" in drives else rail(MASS)
    with pytest.raises(condyle.ScenarioError, match=text):
        condyle.simulate(model, {"drives": drives})
    rough = rail(1.0, ACTUATOR, friction={"coefficient": 0.3, "static_coefficient": 0.5})
    with pytest.raises(condyle.ScenarioError, match="not beside contacts that stick"):
        condyle.simulate(rough, {"drives": GRIPPED})


def test_what_takes_drives_as_rigid() -> None:
    law = {"kind": "joint_pd", "stiffness": 300.0, "damping": 30.0}
    run = {"controller": law, "drives": {"motor_constant_error": 0.1}}
    with pytest.raises(condyle.UnsupportedError, match=r"remove \[drives\]"):
        condyle.check_gains(rail(MASS), run)
    with pytest.raises(condyle.UnsupportedError, match=r"remove \[drives\]"):
        Live(bind(rail(MASS), Scenario.read(run)))


def test_a_rotor_that_a_gear_drags_sticks_and_slips() -> None:
    """As a mass on a belt: at first it moves too; then it grips until the gear pulls enough."""
    speed, k = 0.05, SOFT
    w, loose, swing = np.sqrt(STIFFNESS / INERTIA), SLIDES / k, (BREAKS - SLIDES) / k
    run = {"duration": 1.0, "rtol": 1e-11, "rate": 400.0, "start": {"dX": speed}}
    found = condyle.simulate(gripped(), run | {"drives": GRIPPED})
    t = found.time.values
    first = np.arcsin(speed / (loose * w)) / w  # it comes to rest
    bent = loose * (1 - np.cos(w * first))
    breaks = first + (BREAKS / k - bent) / speed
    slides = 2 * (np.pi - np.arctan(swing * w / speed)) / w
    period = slides + 2 * swing / speed
    rounds, since = np.divmod(t - breaks, period)
    tau = np.minimum(since, slides)
    stretched = loose + swing * np.cos(w * tau) + speed / w * np.sin(w * tau)
    expected = speed * (breaks + rounds * period + tau) - stretched
    start = speed * t - loose * (1 - np.cos(w * t))
    expected = np.where(t < first, start, np.where(rounds < 0, speed * first - bent, expected))
    np.testing.assert_allclose(found.motor_joint.values[:, 0], expected, rtol=0, atol=1e-9)
    away = breaks + period * np.arange(9)
    rest = np.concatenate([[first], away + slides])
    assert (away < t[-1]).sum() > 3
    assert _when(found, "drive_slips") == pytest.approx(away[away < t[-1]], abs=1e-8)
    assert _when(found, "drive_sticks") == pytest.approx(rest[rest < t[-1]], abs=1e-8)


def _when(found: Any, kind: str) -> list[float]:
    return [event["time"] for event in found.condyle.events if event["kind"] == kind]


def test_a_motor_breaks_away(pushed: Any) -> None:
    """Its effort rises, and what the gear bears with it: it turns, comes to rest, and breaks away
    again; then the other way, as the effort falls. What friction takes is in the books."""
    k, rises = SOFT, 40 * SMALL
    w, loose, swing = np.sqrt(STIFFNESS / INERTIA), SLIDES / k, (BREAKS - SLIDES) / k
    efforts = [0, rises / 2, -rises]
    found = condyle.simulate(gripped(), pushed([0, 0.5, 2.0], efforts, GRIPPED, duration=1.5))
    t, motor = found.time.values, found.motor_joint.values[:, 0]
    away = BREAKS / rises

    def turned_at(t: Any) -> Any:
        """I psi'' = rises t - SLIDES - k psi, from rest at `away`."""
        tau = w * (t - away)
        return rises * t / k - loose - swing * np.cos(tau) - rises / (k * w) * np.sin(tau)

    rest = away + 2 * (np.pi - np.arctan(swing * w * k / rises)) / w
    np.testing.assert_allclose(motor[t < away], 0.0, rtol=0, atol=1e-12)
    while_turning = (t > away) & (t < rest)
    expected = turned_at(t[while_turning])
    np.testing.assert_allclose(motor[while_turning], expected, rtol=0, atol=1e-9)
    slips, sticks = _when(found, "drive_slips"), _when(found, "drive_sticks")
    assert (slips[0], sticks[0]) == pytest.approx((away, rest), abs=1e-9)
    bears = k * turned_at(rest)
    assert slips[1] == pytest.approx((bears + BREAKS) / rises, abs=1e-9)
    assert len(slips) > 4 and motor[-1] < motor.max() - 0.01
    books = found.energy.to_series().unstack()
    left = books.kinetic + books.potential + books.actuator_losses - books.load - books.actuators
    np.testing.assert_allclose(left, 0.0, atol=1e-8 * SMALL)
    assert (np.diff(books.actuator_losses) >= 0).all() and books.actuator_losses.iloc[-1] > 0


@pytest.mark.parametrize("beta", [0.02, 0.08])
def test_play_under_contacts_that_lift_and_land(beta: float) -> None:
    """Runs that ended as stiff, where flanks met."""
    machine = condyle.load_mechanism("masticatory")
    changes: dict[str, Any] = {}
    for name in machine.contact_names:
        changes |= {f"contact.{name}.side": "below", f"contact.{name}.one_sided": True}
    losses = {"rotor_inertia": 4e-5, "coulomb": 0.05, "viscous": 1e-3, "smoothing_speed": 0.01}
    for name in machine.chain_names:
        changes |= {f"chain.{name}.actuator.{key}": x for key, x in losses.items()}
    gears = {"gear_stiffness": 40.0, "gear_damping": 0.02, "backlash": 1e-3}
    law = {"kind": "joint_pd", "stiffness": 5.0, "damping": 0.1, "rate": 500.0}
    run = {"duration": 0.03, "controller": law, "sensors": {}, "drives": gears}
    run |= {"start": {"beta": beta}, "contacts": {"kind": "rigid"}}
    found = condyle.simulate(machine.set(changes), run)
    assert found.time.values[-1] == 0.03 and not any(e["ends"] for e in found.condyle.events)
    books = found.energy.to_series().unstack()
    scale = np.abs(books).max().max()
    signs = dict.fromkeys(books.columns, 1.0) | {"load": -1.0, "actuators": -1.0}
    left = sum(sign * books[name] for name, sign in signs.items())
    np.testing.assert_allclose(left, left.iloc[0], atol=1e-3 * scale)
