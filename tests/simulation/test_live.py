"""Runs under a hand: the same as whole runs, whatever turns and pulls; checked against scenarios
that have those numbers from the start."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from simulation.scenarios import BITE, FOOD, PD, RK4, SPRING, TORQUE
from support.speeds import few

import condyle
from condyle.simulation import running
from condyle.simulation.bind import bind
from condyle.simulation.live import Live
from condyle.simulation.scenario import Scenario

BASE = {"duration": 0.1, **RK4}
FOODS = [FOOD | {"break_force": 60.0}, SPRING]
START = {"beta": 0.15, "dbeta": -2.0}  # closing, off the path: all numbers matter
BITING = BITE | {"stiffness": 400.0, "damping": 30.0, "force": 20.0, "proportional": 0.5}
BITING |= {"threshold": 0.5, "rise": 0.01}  # the integral too
CASES: dict[str, dict[str, Any]] = {
    "in C": {"controller": TORQUE | {"damping": 30.0}, "start": START, "load": FOODS},
    "a bite": {"controller": BITING, "start": START, "load": FOODS},
    "servo drives": {"controller": PD, "start": START},
}


def live(tables: dict[str, Any], model: condyle.Model) -> Live:
    return Live(bind(model, Scenario.read({**BASE, **tables})))


def state(tables: dict[str, Any], model: condyle.Model) -> np.ndarray:
    """q and q' at the end of a whole run."""
    plan = bind(model, Scenario.read({**BASE, **tables}))
    trace = running.run(plan)
    assert trace.t[-1] == plan.duration
    return trace.state[-1, : 2 * len(plan.q)]


def now(found: Live) -> np.ndarray:
    moment = found.state()
    velocity = found._run.state[len(moment.q) : 2 * len(moment.q)]
    return np.concatenate([moment.q, velocity])


def of_food(found: Live) -> list[str]:
    return [event.kind for event in found.events if event.owner == "food"]


@pytest.mark.parametrize("name", few(CASES, "a bite"))
def test_bit_by_bit_is_the_whole_run(
    name: str, jaw: condyle.Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    expected = state(CASES[name], jaw)
    for bound in (1e-12, 1e-6):
        found = live(CASES[name], jaw)
        for t in np.arange(0.0, 0.11, 0.0073):
            found.go_to(t)
            assert abs(found.t - min(t, 0.1)) < 1e-3  # a few steps
        found.go_to(1.0)
        assert found.over and found.ended is None and found.t == pytest.approx(0.1)
        np.testing.assert_allclose(now(found), expected, rtol=0, atol=bound)
        # Then in Python: where pauses cut a step in two, it is more exact than the whole run.
        monkeypatch.setattr(running, "steps_of", lambda *_: None)


@pytest.mark.parametrize("name", few(CASES, "a bite"))
def test_every_parameter_is_the_number_of_the_scenario(name: str, jaw: condyle.Model) -> None:
    tables = CASES[name]
    found = live(tables, jaw)
    owners = {parameter.owner for parameter in found.parameters}
    assert owners == {"controller", *(load["kind"] for load in tables.get("load", ()))}
    before = state(tables, jaw)
    for i, parameter in enumerate(found.parameters):
        value = 0.6 * parameter.value
        other = {**tables, "load": [dict(load) for load in tables.get("load", ())]}
        owned = {load["kind"]: load for load in other["load"]}
        owned["controller"] = other["controller"] = dict(tables["controller"])
        assert parameter.value == owned[parameter.owner].get(parameter.field, parameter.value)
        owned[parameter.owner][parameter.field] = value
        found.reset()
        found.set_parameter(i, value)
        found.restart()
        found.go_to(1.0)
        expected = state(other, jaw)
        np.testing.assert_allclose(now(found), expected, rtol=0, atol=1e-10, err_msg=str(parameter))
        idle = ("break_force", "threshold")  # numbers of what happens in another run
        assert parameter.field in idle or np.abs(expected - before).max() > 1e-8, parameter


def test_a_parameter_changed_on_the_way(jaw: condyle.Model) -> None:
    """The law that goes on is that of the new number: it was not there before."""
    one, other = (live(CASES["in C"], jaw) for _ in range(2))
    for found in (one, other):
        found.go_to(0.04)
    np.testing.assert_array_equal(now(one), now(other))
    stiffness = next(i for i, k in enumerate(one.parameters) if k.field == "stiffness")
    one.set_parameter(stiffness, 3e3)
    for found in (one, other):
        found.go_to(0.1)
    assert np.abs(now(one) - now(other)).max() > 1e-3
    one.reset()
    assert one.values == other.values


def test_a_hand_is_three_springs(jaw: condyle.Model) -> None:
    point = np.array(jaw.mechanism.platform.points["incisor"])
    away, k, c = np.array([0.01, -0.02, -0.015]), 120.0, 3.0
    spring = {"kind": "spring", "point": "incisor", "stiffness": k, "damping": c}
    springs = [
        spring | {"direction": u.tolist(), "rest": float(rest)}
        for u, rest in zip(np.eye(3), away, strict=True)
    ]
    found = live({"controller": CASES["in C"]["controller"]}, jaw)
    assert not found.pulling
    found.pull(point, point + away, k, c)
    assert found.pulling
    np.testing.assert_allclose(found.state().forces[-1][2], k * away[2], rtol=1e-9)
    np.testing.assert_array_equal(found.state().points[-1], point)
    found.go_to(1.0)
    expected = state({"controller": CASES["in C"]["controller"], "load": springs}, jaw)
    np.testing.assert_allclose(now(found), expected, rtol=0, atol=1e-11)
    found.let_go()
    assert not found.pulling and not found.state().forces[-1].any()


def test_food_that_grows_between_the_teeth_touches_them(jaw: condyle.Model) -> None:
    found = live(
        CASES["in C"] | {"load": [FOODS[0], SPRING | {"stiffness": 0.0, "damping": 0.0}]}, jaw
    )
    thickness = next(i for i, k in enumerate(found.parameters) if k.field == "thickness")
    found.set_parameter(thickness, 1e-4)
    found.restart()
    found.go_to(0.01)
    assert of_food(found) == [] and not found.state().forces.any()
    found.set_parameter(thickness, 0.02)
    assert of_food(found) == ["food_touched"]
    assert np.linalg.norm(found.state().forces[0]) > 1
    found.set_parameter(thickness, 1e-4)
    assert of_food(found) == ["food_touched", "food_left"]
    assert not found.state().forces.any()


def test_what_ends_it_is_kept_and_it_can_begin_again(jaw: condyle.Model) -> None:
    found = live({"duration": 5.0, "start": {"dbeta": 0.1}}, jaw)
    found.go_to(5.0)
    assert found.over and found.ended is not None and found.ended.ends
    assert 0 < (t := found.t) < 5 and np.isfinite(found.state().pose).all()
    found.go_to(5.0)
    found.let_go()
    assert found.t == t
    found.restart()
    assert found.t == 0 and not found.over and found.events == []


def test_adaptive_methods_take_steps_that_keep_pace(jaw: condyle.Model) -> None:
    plan = bind(jaw, Scenario.read({"duration": 0.02, "controller": TORQUE}))
    found = Live(plan)
    found.go_to(1.0)
    np.testing.assert_allclose(now(found), running.run(plan).state[-1, :8], rtol=0, atol=1e-7)
