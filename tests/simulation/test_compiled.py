"""Compiled loops: the same as in Python, step by step; events, laws and results included."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar, Literal

import casadi as ca
import numpy as np
import pytest
from simulation.scenarios import BITE, FILTER, FOOD, KALMAN, LOADS, PD, RK4, SPRING, TORQUE
from support.machines import model
from support.speeds import first

import condyle
from condyle.mechanism.coordinates import rotations
from condyle.model.model import Model
from condyle.questions.builder import Lanes
from condyle.questions.law.controller import EACH_COORDINATE, Control, ControllerTable
from condyle.questions.load.acting import LoadPlace, LoadTable
from condyle.simulation import CONTROLLERS, running
from condyle.simulation import LOADS as LOAD_KINDS
from condyle.simulation.bind import bind
from condyle.simulation.plan import Plan, Trace
from condyle.simulation.scenario import Scenario

pytestmark = pytest.mark.usefixtures("compiler_command")

BASE = {"duration": 0.06, "rate": 700.0, **RK4}
TACHOMETERS = {"encoder_resolution": 1e-5, "velocity": "exact"}
# All but the last run without `ci`.
CASES: dict[str, dict[str, Any]] = {
    "falls until it is out of reach": {"duration": 0.2, "start": {"dbeta": 0.1}},
    "computed torque, late, with loads": {"controller": {**TORQUE, "delay": 2}, "load": LOADS},
    "tachometers, a bite, and food that breaks": {
        "duration": 0.15,
        "start": {"beta": 0.08},
        "controller": BITE | {"delay": 1, "proportional": 0.2},
        "sensors": TACHOMETERS,
        "load": [FOOD | {"break_force": 3.0}, SPRING],
    },
    "a bite by what a filter says": {
        "start": {"beta": 0.08}, "controller": BITE | {"delay": 1}, "load": LOADS,
        **KALMAN, "sensors": {"encoder_noise": 1e-5, "encoder_resolution": 1e-5},
    },
    "servo drives, encoders with a filter": {
        "controller": PD | {"gravity": False}, "sensors": FILTER, "load": LOADS,
    },
}  # fmt: skip


def plan_of(tables: dict[str, Any], jaw: Model) -> Plan:
    return bind(jaw, Scenario.read({**BASE, **tables}))


def same(found: Trace, expected: Trace, bound: float = 1e-10) -> None:
    for name in ("t", "tick", "modes"):
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name))
    for name in ("state", "effort", "command", "count", "estimate", "force"):
        one, other = getattr(found, name), getattr(expected, name)
        scale = np.abs(other).max(initial=1e-3)
        np.testing.assert_allclose(one, other, rtol=0, atol=bound * scale, err_msg=name)
    events = [[(e.kind, e.owner, e.ends) for e in trace.events] for trace in (found, expected)]
    assert events[0] == events[1]
    assert [e.time for e in found.events] == [pytest.approx(e.time) for e in expected.events]


def same_in_python(plan: Plan) -> running.Batch:
    run = running.Batch([plan])
    assert run.steps is not None
    same(run.traces()[0], running.run(plan, compiled=False))
    return run


@pytest.mark.parametrize("name", first(CASES, 4))
def test_the_same_as_in_python(name: str, jaw: Model) -> None:
    events = {event.kind for event in same_in_python(plan_of(CASES[name], jaw)).events}
    assert "breaks" not in name or {"food_touched", "food_broken"} <= events


@pytest.mark.parametrize("friction", first([0.1, 0.0]))
def test_contacts_that_lift_and_land(
    friction: float, jaw: Model, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Python takes the steps of events alone, and the run is its own."""
    unilateral = {"side": "below", "one_sided": True, "restitution": 0.3}
    unilateral |= {"friction.coefficient": friction, "friction.smoothing_speed": 1e-3}
    every = jaw.mechanism.contact_names
    loose = condyle.derive(
        jaw.mechanism.set({f"contact.{c}.{k}": x for c in every for k, x in unilateral.items()})
    )
    (tmp_path / "push.csv").write_text("t,Fz\n0.01,0\n0.015,4\n0.018,-8\n0.03,0\n")
    push = {"kind": "csv", "file": str(tmp_path / "push.csv"), "point": "right_molar"}
    law = TORQUE | {"rate": 1000.0, "delay": 1, "distribution": "bounded", "preload": 0.1}
    tables = {"contacts": {"kind": "rigid"}, "duration": 0.03, "step": 1e-4}
    tables |= {"controller": law, "load": [push]}
    plan = plan_of(tables | {"sensors": FILTER}, loose).freed
    assert plan is not None
    run, pythons = running.Batch([plan]), list[float]()
    assert run.steps is not None

    def counted(until: float, stretch: Any = run._stretch) -> None:
        pythons.append(until)
        stretch(until)

    monkeypatch.setattr(run, "_stretch", counted)
    found = run.traces()[0]
    same(found, running.run(plan, compiled=False))
    kinds = [event.kind for event in found.events]
    assert {"contact_lifted", "contact_landed"} <= {*kinds}
    assert len(kinds) <= len(pythons) < 150  # of 300 and those after events
    R = rotations(found.state[:, 3:6])
    for contact, bears in zip(loose.mechanism.contacts, found.modes.T[1:], strict=True):
        balls = found.state[:, :3] + R @ contact.point
        gap = np.array([contact.gap(ball) for ball in balls])
        assert np.abs(gap[bears > 0]).max() < 1e-15 and gap.min() > -1e-15


def test_tables_of_efforts_and_loads_between_rows(jaw: Model, tmp_path: Path) -> None:
    names = ",".join(f"tau_{name}" for name in jaw.mechanism.chain_names)
    rows = [[t, *(0.01 * (i + 1) * t for i in range(6))] for t in (0.02, 0.05, 0.09)]
    text = "\n".join([f"t,{names}", *(",".join(map(str, row)) for row in rows)])
    (tmp_path / "efforts.csv").write_text(text)
    (tmp_path / "load.csv").write_text("t,Fz,Mx\n0.01,0,0\n0.02,-2,0.001\n0.05,-1,0\n")
    load = {"kind": "csv", "file": str(tmp_path / "load.csv"), "point": "incisor"}
    efforts = {"file": str(tmp_path / "efforts.csv")}
    for more in ({"duration": 0.1, "efforts": efforts}, {"controller": TORQUE}):
        same_in_python(plan_of({**more, "load": [load]}, jaw))


def test_states_that_a_kernel_does_not_vouch_for_are_pythons(
    jaw: Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where C has to give back every tick and every step, the run is Python's."""
    plan = plan_of({"duration": 0.02, "controller": TORQUE}, jaw)
    run, calls = running.Batch([plan]), []
    assert run.steps is not None

    def doubtful(budget: int) -> int:
        clock = run.clock
        if clock.breakpoint + 1 >= len(plan.breakpoints()[0]):
            return running.DONE
        calls.append(clock.breakpoint)
        ticks = np.isclose(plan.ticks(), clock.t, atol=1e-9)
        return running.SAMPLE if clock.fresh and ticks.any() else running.STEP

    monkeypatch.setattr(run.steps, "advance", doubtful)
    same(run.traces()[0], running.run(plan, compiled=False))
    assert len(calls) > 20


def test_what_it_is_not_for(jaw: Model) -> None:
    """Adaptive methods, laws without ticks, functions in Python, and models that run by numpy."""
    adaptive = {k: v for k, v in BASE.items() if k not in RK4}
    ideal = BASE | {"controller": {"kind": "computed_torque", "stiffness": 1.0, "ideal": True}}
    push = [lambda t, s, v: (0.0, 0.0, -1.0)]
    for one, tables, loads in (
        (jaw, adaptive, ()), (jaw, ideal, ()), (jaw, BASE, push), (model("masticatory"), BASE, ()),
    ):  # fmt: skip
        assert running.Batch([bind(one, Scenario.read(tables), loads=loads)]).steps is None


def test_in_lockstep(jaw: Model) -> None:
    """Runs of a crowd are the runs alone, those with events among them; samples too."""
    bite = CASES["tachometers, a bite, and food that breaks"]
    plans = [
        plan_of(
            bite | {
                "duration": 0.06,
                "start": {"beta": 0.05 + 5e-4 * i, "dbeta": -0.5},
                "controller": bite["controller"] | {"stiffness": 900.0 + 20 * i},
                "load": [FOOD | {"thickness": 4e-3 + 1e-4 * i}, SPRING],
            },
            jaw,
        )
        for i in range(11)
    ]  # fmt: skip
    plans += [plan_of({"start": {"dbeta": 0.02 * i}, "duration": 0.01}, jaw) for i in range(3)]
    alone = [running.run(plan) for plan in plans]
    for found, expected in zip(running.run_all(plans), alone, strict=True):
        same(found, expected, 1e-12)
    quiet = [not trace.events for trace in alone]
    assert any(quiet) and not all(quiet)


def test_side_by_side(jaw: Model) -> None:
    """Many runs are the runs alone, whatever the threads."""
    tables = [{**BASE, "duration": 0.02, "start": {"dbeta": 0.02 * i}} for i in range(5)]
    many = [condyle.simulate(jaw, tables, threads=threads) for threads in (1, 3)]
    for one, other, table in zip(*many, tables, strict=True):
        np.testing.assert_array_equal(one["pose"], other["pose"])
        assert np.abs(one["pose"] - condyle.simulate(jaw, table)["pose"]).max() < 1e-13
    tables[3]["start"] = {"dZ": 1.0}
    with pytest.raises(condyle.CondyleError, match=r"scenario 4: 1 problem\n.*start: dZ"):
        condyle.simulate(jaw, tables)


class Damped(ControllerTable):
    """What the path needs, a damper, and a count of its ticks."""

    ports: ClassVar[Mapping[str, str | int]] = {"damping": EACH_COORDINATE}
    memory: ClassVar[tuple[float, ...]] = (3.0,)

    kind: Literal["damped"]
    damping: float

    @staticmethod
    def equations(c: Control) -> tuple[Lanes, ca.SX]:
        q2 = c.reference.q2 + c.gains.damping * (c.reference.q1 - c.measured.q1)
        return c.inverse(c.measured.q, c.measured.q1, q2), c.memory + 1


class Wind(LoadTable):
    """A drag."""

    ports: ClassVar[Mapping[str, int]] = {"drag": 1}

    kind: Literal["wind"]
    drag: float

    @staticmethod
    def wrench(at: LoadPlace) -> ca.SX:
        return -at.numbers.drag * at.v


def test_laws_from_outside_run_in_compiled_code(
    jaw: Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A controller and a load registered here, beside functions in Python; also in lockstep."""
    monkeypatch.setitem(CONTROLLERS, "damped", Damped)
    monkeypatch.setitem(LOAD_KINDS, "wind", Wind)

    def tables(i: int) -> dict[str, Any]:
        return {
            "duration": 0.03,
            "start": {"beta": 0.02, "dX": 0.1 / (1 + i)},
            "controller": {"kind": "damped", "damping": 40.0 + i, "rate": 1000.0},
            "load": [{"kind": "wind", "drag": 5.0 - i, "point": "incisor"}],
        }

    plan = plan_of(tables(0), jaw)
    run, found = same_in_python(plan), running.run(plan)
    assert run.control is not None
    memory = run.control.samples[:, run.control.columns.result("memory"), 0]
    np.testing.assert_array_equal(memory[:, 0], 4.0 + np.arange(30))

    def law(now: Any, reference: Any) -> np.ndarray:
        q2 = reference.q2 + 40.0 * (reference.q1 - now.q1)
        return model("masticatory").unchecked().inverse_dynamics(now.q, now.q1, q2)

    bare = Scenario.read({**BASE, "duration": 0.03, "start": tables(0)["start"]})
    own = bind(jaw, bare, controller=law, loads=[(lambda t, s, v: -5.0 * v, "incisor")])
    np.testing.assert_allclose(running.run(own).state, found.state, rtol=0, atol=1e-9)

    plans = [plan_of(tables(i), jaw) for i in range(1, 5)]
    alone = [running.run(plan) for plan in plans]
    for alone_only in ("_between", "_tick"):
        monkeypatch.setattr(running.Batch, alone_only, None)
    for one, expected in zip(running.run_all(plans), alone, strict=True):
        same(one, expected, 1e-12)


def test_drives_that_chatter_stay_in_compiled_code(jaw: Model) -> None:
    """Limits cut efforts in hundreds of ticks; none of them comes back to Python."""
    machine = jaw.mechanism
    limits = {f"chain.{name}.actuator.torque_limit": 0.02 for name in machine.chain_names}
    hard = PD | {"stiffness": 200.0, "damping": 1.0, "rate": 2000.0}
    tables = {"duration": 0.3, "step": 2e-4, "controller": hard, "start": {"beta": 0.02}}
    run = running.Batch([plan_of(tables, condyle.derive(machine.set(limits)))])
    assert run.steps is not None
    advance, codes = run.steps.advance, []
    run.steps.advance = lambda budget: codes.append(advance(budget)) or codes[-1]  # type: ignore
    trace = run.traces()[0]
    assert trace.ended is None and sum(event.count for event in trace.events) > 300
    assert {event.kind for event in trace.events} == {"saturated"}
    assert set(codes) == {running.DONE, running.PAUSE} and len(codes) < 10


def test_speeds_that_chatter_stay_in_compiled_code(jaw: Model) -> None:
    """Events count how often the joints' speeds, by kinematics of every step, rise past the limit;
    also in Python, and in a run of a crowd."""
    names, hard = jaw.mechanism.chain_names, PD | {"stiffness": 200.0, "damping": 1.0}
    machine = jaw.mechanism.set({f"chain.{n}.actuator.torque_limit": 0.02 for n in names})
    slow = condyle.derive(machine.set({f"chain.{n}.actuator.speed_limit": 0.02 for n in names}))
    every = {"step": 5e-4, "rate": 2000.0, "duration": 0.15}
    plan = plan_of(every | {"controller": hard | {"rate": 2000.0}, "start": {"beta": 0.02}}, slow)
    run = running.Batch([plan])
    assert run.steps is not None
    advance, codes = run.steps.advance, []
    run.steps.advance = lambda budget: codes.append(advance(budget)) or codes[-1]  # type: ignore
    crowd = running.run_all([plan, plan])[1]
    for trace in (run.traces()[0], running.run(plan, compiled=False), crowd):
        q, v = np.hsplit(trace.state[:, :8], 2)
        fast = np.abs(slow.inverse_kinematics(q, v).joint_rate) > 0.02
        risen = fast[0].astype(int) + np.sum(fast[1:] & ~fast[:-1], axis=0)
        events = [e for e in trace.events if e.kind == "speed"]
        counts = [sum(e.count for e in events if e.owner == name) for name in names]
        assert np.abs(counts - risen).max() <= 1 and risen.sum() > 150  # it may rise within a step
        assert all(0 <= e.duration <= 0.15 for e in events)
    assert len(codes) < 60


def test_variants_in_lockstep(jaw: Model, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each with numbers of its own, one of which is no mechanism, against each by itself."""
    case = CASES["computed torque, late, with loads"]
    scenario = {**BASE, "duration": 0.02, "start": {"beta": 0.05, "dbeta": -0.3}, **case}
    axis = np.array(jaw.mechanism.get("chain.masseter_left.base"))
    batch = jaw.variants(
        {
            "platform.mass": [0.2, 0.3, -1.0],
            "chain.masseter_left.base": axis + np.outer(np.arange(3), (1e-5, 0.0, 0.0)),
            "platform.points.incisor[1]": [0.0, 2e-3, 0.0],
        }
    )
    seen: list[int] = []
    crowd = running.Batch.__init__

    def noted(run: Any, plans: Any, *rest: Any) -> None:
        seen.append(len(plans))
        crowd(run, plans, *rest)

    with monkeypatch.context() as patch:
        patch.setattr(running.Batch, "__init__", noted)
        found = batch.simulate(scenario)
    assert 2 in seen and found[2] is None
    for i in (0, 1):
        own = condyle.simulate(condyle.derive(batch.mechanism(i)), scenario)
        for variable in ("pose", "effort", "energy", "contact_force"):
            got, wanted = found[i][variable].values, own[variable].values
            assert np.abs(got - wanted).max() < 1e-10 * np.abs(wanted).max(), variable
        kinds = [[e["kind"] for e in run.condyle.events] for run in (found[i], own)]
        assert kinds[0] == kinds[1]
    assert np.abs(found[0]["effort"].values - found[1]["effort"].values).max() > 1e-6
