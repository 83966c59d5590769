"""Compiled loops: the same as in Python, step by step; events, laws and results included."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Literal

import casadi as ca
import numpy as np
import pytest

import condyle
from condyle.questions.builder import Lanes
from condyle.questions.law.controller import EACH_COORDINATE, Control, ControllerTable
from condyle.questions.load.acting import LoadTable, Place
from condyle.simulation import CONTROLLERS, LOADS, running
from condyle.simulation.bind import bind
from condyle.simulation.gains import report
from condyle.simulation.plan import Plan, Trace
from condyle.simulation.scenario import scenario_from

pytestmark = pytest.mark.usefixtures("compiler_command")

BASE = {"duration": 0.2, "rate": 700.0, "method": "rk4", "step": 2e-4}
TORQUE = {"kind": "computed_torque", "stiffness": 400.0, "rate": 500.0}
FOOD = {"kind": "food", "food": "bolus", "point": "right_molar"}
SPRING = {"kind": "spring", "point": "incisor", "stiffness": 150.0, "damping": 1.5, "rest": 1e-3}
PUSH = {"kind": "constant", "force": [0.3, -0.2, -1.0], "moment": [0.0, 1e-3, 0.0]}
CASES: dict[str, dict[str, Any]] = {
    "falls until it is out of reach": {"start": {"dbeta": 0.1}},
    "computed torque, late, with loads": {
        "controller": {**TORQUE, "delay": 2},
        "load": [FOOD, SPRING, PUSH],
    },
    "servo drives": {
        "controller": {"kind": "joint_pd", "stiffness": 2.0, "damping": 0.02, "rate": 1000.0},
        "load": [SPRING],
    },
    "servo drives without gravity": {
        "controller": {
            "kind": "joint_pd", "stiffness": 2.0, "damping": 0.02, "rate": 1000.0, "gravity": False,
        },
    },
    "impedance": {
        "controller": {"kind": "impedance", "stiffness": 2e3, "damping": 30.0, "rate": 500.0},
    },
    "a bite, and food that breaks": {
        "start": {"beta": 0.08},
        "controller": {"kind": "bite_force", "stiffness": 900.0, "force": 40.0, "rate": 500.0},
        "load": [{**FOOD, "thickness": 4e-3, "break_force": 3.0}],
    },
    "encoders": {"controller": TORQUE, "sensors": {"encoder_resolution": 1e-4}},
    "encoders with a filter, and drives": {
        "controller": {"kind": "joint_pd", "stiffness": 2.0, "damping": 0.02, "rate": 500.0},
        "sensors": {"encoder_resolution": 1e-5, "velocity_cutoff": 100.0},
    },
    "a bite by what a filter says": {
        "start": {"beta": 0.08},
        "controller": {
            "kind": "bite_force", "stiffness": 900.0, "force": 40.0, "rate": 500.0, "delay": 1,
        },
        "sensors": {"encoder_noise": 1e-5, "encoder_resolution": 1e-5},
        "observer": {"kind": "kalman"},
        "load": [{**FOOD, "thickness": 4e-3}, SPRING],
    },
    "tachometers, and a bite": {
        "start": {"beta": 0.08},
        "controller": {
            "kind": "bite_force", "stiffness": 900.0, "force": 40.0, "rate": 500.0, "delay": 1,
            "proportional": 0.2,
        },
        "sensors": {"encoder_resolution": 1e-5, "velocity": "exact"},
        "load": [{**FOOD, "thickness": 4e-3}, SPRING],
    },
}  # fmt: skip


def plan_of(tables: dict[str, Any], model: condyle.Model) -> Plan:
    return bind(model, scenario_from({**BASE, **tables}))


def in_python(plan: Plan) -> Trace:
    return running.run(plan, compiled=False)


@pytest.fixture(scope="module")
def model() -> condyle.Model:
    return condyle.derive("masticatory")


def same(found: Trace, expected: Trace, bound: float = 1e-10) -> None:
    assert found.t.tolist() == expected.t.tolist()
    assert found.tick.tolist() == expected.tick.tolist()
    assert found.modes.tolist() == expected.modes.tolist()
    for name in ("state", "effort", "command", "count", "estimate", "force"):
        one, other = getattr(found, name), getattr(expected, name)
        scale = np.abs(other).max(initial=1e-3)
        np.testing.assert_allclose(one, other, rtol=0, atol=bound * scale, err_msg=name)
    events, others = (
        [(e.kind, e.owner, e.ends, pytest.approx(e.time, abs=1e-8)) for e in trace.events]
        for trace in (found, expected)
    )
    assert [e[:3] for e in events] == [e[:3] for e in others]
    assert [e.time for e in found.events] == [pytest.approx(o.time) for o in expected.events]


@pytest.mark.parametrize("name", CASES)
def test_the_same_as_in_python(name: str, model: condyle.Model) -> None:
    plan = plan_of(CASES[name], model)
    assert running.Run([plan]).steps is not None
    found = running.run(plan)
    same(found, in_python(plan))
    if "food" in name:
        assert {"food_touched", "food_broken"} <= {e.kind for e in found.events}


def test_open_loop_between_rows(model: condyle.Model, tmp_path: Any) -> None:
    names = ",".join(f"tau_{name}" for name in model.mechanism.chain_names)
    rows = [
        f"{t},{','.join(str(0.01 * (i + 1) * t) for i in range(6))}" for t in (0.02, 0.05, 0.09)
    ]
    (tmp_path / "efforts.csv").write_text("\n".join([f"t,{names}", *rows]))
    plan = bind(
        model,
        scenario_from(
            {**BASE, "duration": 0.1, "efforts": {"file": "efforts.csv"}}, folder=tmp_path
        ),
    )
    same(running.run(plan), in_python(plan))


def test_a_table_of_loads(model: condyle.Model, tmp_path: Any) -> None:
    (tmp_path / "load.csv").write_text("t,Fz,Mx\n0.01,0,0\n0.02,-2,0.001\n0.05,-1,0\n")
    load = {"kind": "csv", "file": "load.csv", "point": "incisor"}
    tables = {**BASE, "duration": 0.08, "controller": TORQUE, "load": [load]}
    plan = bind(model, scenario_from(tables, folder=tmp_path))
    same(running.run(plan), in_python(plan))


def test_states_that_a_kernel_does_not_vouch_for_are_pythons(
    model: condyle.Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where C has to give back every tick and every step, the run is Python's."""
    plan = plan_of({"duration": 0.02, "controller": TORQUE}, model)
    expected = in_python(plan)
    run = running.Run([plan])
    assert run.steps is not None
    calls = []

    def doubtful(budget: int) -> int:
        struct, steps = run.clock, run.steps
        if struct.breakpoint + 1 >= len(plan.breakpoints()[0]):
            return running.DONE
        calls.append(struct.breakpoint)
        ticks = np.isclose(plan.ticks(), struct.t, atol=1e-9)
        assert steps is not None
        return running.SAMPLE if struct.fresh and ticks.any() else running.STEP

    monkeypatch.setattr(run.steps, "advance", doubtful)
    same(run.traces()[0], expected)
    assert len(calls) > 20


def test_what_it_is_not_for(model: condyle.Model) -> None:
    for tables in (
        {"method": "DOP853", "step": None},
        {"controller": {**TORQUE, "ideal": True, "rate": None}},
    ):
        merged = {k: v for k, v in {**BASE, **tables}.items() if v is not None}
        assert running.Run([bind(model, scenario_from(merged))]).steps is None
    loads = [lambda t, s, v: (0.0, 0.0, -1.0)]
    plan = bind(model, scenario_from(BASE), loads=loads)
    assert running.Run([plan]).steps is None
    plan = bind(condyle.derive("masticatory", backend="numpy"), scenario_from(BASE))
    assert running.Run([plan]).steps is None


def test_in_lockstep(model: condyle.Model) -> None:
    """Runs of a crowd are the runs alone, those with events among them; samples too."""

    def tables(i: int) -> dict[str, Any]:
        return {
            "start": {"beta": 0.05 + 5e-4 * i, "dbeta": -0.5},
            "controller": {**TORQUE, "stiffness": 300.0 + 5 * i, "delay": 1},
            "sensors": {"encoder_resolution": 1e-5},
            "load": [{**FOOD, "thickness": 4e-3 + 1e-4 * i}],
        }

    plans = [plan_of(tables(i), model) for i in range(11)]
    plans += [plan_of({"start": {"dbeta": 0.02 * i}, "duration": 0.01}, model) for i in range(3)]
    alone = [running.run(plan) for plan in plans]
    for found, expected in zip(running.run_all(plans), alone, strict=True):
        same(found, expected, 1e-12)
    quiet = [not trace.events for trace in alone]
    assert any(quiet) and not all(quiet)


def test_side_by_side(model: condyle.Model) -> None:
    """Many runs are the runs alone, whatever the threads."""
    tables = [{**BASE, "duration": 0.02, "start": {"dbeta": 0.02 * i}} for i in range(5)]
    alone = [condyle.simulate(model, one) for one in tables]
    many = [condyle.simulate(model, tables, threads=threads) for threads in (1, 3)]
    for one, other, expected in zip(*many, alone, strict=True):
        np.testing.assert_array_equal(one["pose"], other["pose"])
        assert np.abs(one["pose"] - expected["pose"]).max() < 1e-13
    tables[3]["start"] = {"dZ": 1.0}
    with pytest.raises(condyle.CondyleError, match=r"scenario 4: 1 problem\n.*start: dZ"):
        condyle.simulate(model, tables)


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
    def wrench(at: Place) -> ca.SX:
        return -at.numbers.drag * at.v


def test_laws_from_outside_run_in_compiled_code(
    model: condyle.Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A controller and a load that are registered here, beside functions in Python."""
    monkeypatch.setitem(CONTROLLERS, "damped", Damped)
    monkeypatch.setitem(LOADS, "wind", Wind)
    tables = {
        "duration": 0.05,
        "start": {"beta": 0.02, "dX": 0.1},
        "controller": {"kind": "damped", "damping": 40.0, "rate": 1000.0},
        "load": [{"kind": "wind", "drag": 5.0, "point": "incisor"}],
    }
    plan = plan_of(tables, model)
    run = running.Run([plan])
    assert run.steps is not None and not report(plan).stable  # nothing holds the place
    found = run.traces()[0]
    same(found, in_python(plan))
    assert run.control is not None
    memory = run.control.samples[:, run.control.columns.result("memory"), 0]
    np.testing.assert_array_equal(memory[:, 0], 4.0 + np.arange(50))

    def law(now: Any, reference: Any) -> np.ndarray:
        q2 = reference.q2 + 40.0 * (reference.q1 - now.q1)
        return model.unchecked().inverse_dynamics(now.q, now.q1, q2)

    bare = {name: value for name, value in tables.items() if name not in ("controller", "load")}
    function = bind(
        model,
        scenario_from({**BASE, **bare}),
        controller=law,
        loads=[(lambda t, s, v: -5.0 * v, "incisor")],
    )
    np.testing.assert_allclose(running.run(function).state, found.state, rtol=0, atol=1e-9)


def test_laws_from_outside_in_lockstep(
    model: condyle.Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(CONTROLLERS, "damped", Damped)
    monkeypatch.setitem(LOADS, "wind", Wind)
    plans = [
        plan_of(
            {
                "duration": 0.05,
                "start": {"beta": 0.02, "dX": 0.02 * i},
                "controller": {"kind": "damped", "damping": 30.0 + i, "rate": 1000.0},
                "load": [{"kind": "wind", "drag": 5.0 - i, "point": "incisor"}],
            },
            model,
        )
        for i in range(4)
    ]
    alone = [running.run(plan) for plan in plans]
    for alone_only in ("_between", "_tick"):
        monkeypatch.setattr(running.Run, alone_only, None)
    for found, expected in zip(running.run_all(plans), alone, strict=True):
        same(found, expected, 1e-12)


def test_drives_that_chatter_stay_in_compiled_code() -> None:
    """Limits cut efforts in hundreds of ticks; none of them comes back to Python."""
    machine = condyle.load_mechanism("masticatory")
    limits = {f"chain.{name}.actuator.torque_limit": 0.02 for name in machine.chain_names}
    hard = {"kind": "joint_pd", "stiffness": 200.0, "damping": 1.0, "rate": 2000.0}
    tables = {"duration": 0.3, "controller": hard, "start": {"beta": 0.02}}
    run = running.Run([plan_of(tables, condyle.derive(machine.set(limits)))])
    assert run.steps is not None
    advance, codes = run.steps.advance, []
    run.steps.advance = lambda budget: codes.append(advance(budget)) or codes[-1]  # type: ignore
    trace = run.traces()[0]
    assert trace.ended is None and sum(run.logs[0].counts.values()) > 300
    assert {event.kind for event in trace.events} == {"saturated"}
    assert set(codes) == {running.DONE, running.PAUSE} and len(codes) < 10


@pytest.mark.slow
@pytest.mark.parametrize("name", ["encoders", "computed torque, late, with loads", "impedance"])
def test_variants_in_lockstep(model: condyle.Model, name: str) -> None:
    """Each with numbers of its own, one of which is no mechanism, against each by itself."""
    scenario = {**BASE, "start": {"beta": 0.05, "dbeta": -0.3}, **CASES[name]}
    machine = model.mechanism
    axis = np.array(machine.get("chain.masseter_left.base"))
    batch = model.variants(
        {
            "platform.mass": [0.2, 0.3, -1.0, 0.26, 0.28],
            "chain.masseter_left.base": axis + np.outer(np.arange(5), (1e-5, 0.0, 0.0)),
            "platform.points.incisor[1]": [0.0, 0.0, 0.0, 0.0, 2e-3],
        }
    )
    seen: list[int] = []
    crowd = running.Run.__init__

    def noted(run: Any, plans: Any, *rest: Any) -> None:
        seen.append(len(plans))
        crowd(run, plans, *rest)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(running.Run, "__init__", noted)
        found = batch.simulate(scenario)
    assert 4 in seen and found[2] is None
    for i in (0, 1, 3, 4):
        own = condyle.simulate(condyle.derive(batch.mechanism(i)), scenario)
        for variable in ("pose", "effort", "energy", "contact_force"):
            got, wanted = found[i][variable].values, own[variable].values
            assert np.abs(got - wanted).max() < 1e-10 * np.abs(wanted).max(), variable
        assert [e["kind"] for e in found[i].condyle.events] == [
            e["kind"] for e in own.condyle.events
        ]
    assert np.abs(found[0]["effort"].values - found[1]["effort"].values).max() > 1e-6
