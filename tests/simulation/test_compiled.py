"""Compiled loops: the same as in Python, step by step; events, laws and results included."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import condyle
from condyle.backends.compiler import CompilerError, find_compiler
from condyle.simulation import run as running
from condyle.simulation.bind import bind
from condyle.simulation.plan import Plan, Trace
from condyle.simulation.scenario import scenario_from

try:
    find_compiler()
except CompilerError:
    pytest.skip("needs a C compiler", allow_module_level=True)

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
    "a law that Python has": {
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


def plan_of(told: dict[str, Any], model: condyle.Model) -> Plan:
    return bind(model, scenario_from({**BASE, **told}))


def in_python(plan: Plan, monkeypatch: pytest.MonkeyPatch) -> Trace:
    with monkeypatch.context() as patch:
        patch.setattr(running, "loop_of", lambda *_: None)
        return running.run(plan)


@pytest.fixture(scope="module")
def model() -> condyle.Model:
    return condyle.derive("masticatory")


def same(found: Trace, expected: Trace) -> None:
    assert found.t.tolist() == expected.t.tolist()
    assert found.tick.tolist() == expected.tick.tolist()
    assert found.modes.tolist() == expected.modes.tolist()
    for name in ("state", "effort", "command", "count", "estimate", "force"):
        one, other = getattr(found, name), getattr(expected, name)
        scale = np.abs(other).max(initial=1e-3)
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-10 * scale, err_msg=name)
    events, others = (
        [(e.kind, e.owner, e.ends, pytest.approx(e.time, abs=1e-8)) for e in trace.events]
        for trace in (found, expected)
    )
    assert [e[:3] for e in events] == [e[:3] for e in others]
    assert [e.time for e in found.events] == [pytest.approx(o.time) for o in expected.events]


@pytest.mark.parametrize("name", CASES)
def test_the_same_as_in_python(
    name: str, model: condyle.Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan = plan_of(CASES[name], model)
    quick = running.Run(plan).quick()
    assert quick is not None and (quick.by_itself == ("Python" not in name))
    found = running.run(plan)
    same(found, in_python(plan, monkeypatch))
    if "food" in name:
        assert {"food_touched", "food_broken"} <= {e.kind for e in found.events}


def test_open_loop_between_rows(
    model: condyle.Model, tmp_path: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
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
    same(running.run(plan), in_python(plan, monkeypatch))


def test_a_table_of_loads(
    model: condyle.Model, tmp_path: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "load.csv").write_text("t,Fz,Mx\n0.01,0,0\n0.02,-2,0.001\n0.05,-1,0\n")
    load = {"kind": "csv", "file": "load.csv", "point": "incisor"}
    told = {**BASE, "duration": 0.08, "controller": TORQUE, "load": [load]}
    plan = bind(model, scenario_from(told, folder=tmp_path))
    same(running.run(plan), in_python(plan, monkeypatch))


def test_states_that_a_kernel_does_not_vouch_for_are_pythons(
    model: condyle.Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where C has to give back every step, the run is Python's."""
    plan = plan_of({"duration": 0.02, "controller": TORQUE}, model)
    expected = in_python(plan, monkeypatch)
    run = running.Run(plan)
    quick = run.quick()
    assert quick is not None
    calls = []

    class Doubtful(type(quick)):  # type: ignore[misc]
        def advance(self) -> int:
            if self.corner + 1 >= len(plan.corners()):
                return running.DONE
            calls.append(self.corner)
            return running.LOOK if self.at_a_look else running.STEP

    quick.__class__ = Doubtful
    monkeypatch.setattr(run, "quick", lambda: quick)
    same(run.trace(), expected)
    assert len(calls) > 20


def test_what_it_is_not_for(model: condyle.Model) -> None:
    for told in (
        {"method": "DOP853", "step": None},
        {"controller": {**TORQUE, "ideal": True, "rate": None}},
    ):
        merged = {k: v for k, v in {**BASE, **told}.items() if v is not None}
        assert running.Run(bind(model, scenario_from(merged))).quick() is None
    loads = [lambda t, s, v: (0.0, 0.0, -1.0)]
    plan = bind(model, scenario_from(BASE), loads=loads)
    assert running.Run(plan).quick() is None
    plan = bind(condyle.derive("masticatory", backend="numpy"), scenario_from(BASE))
    assert running.Run(plan).quick() is None


def test_side_by_side(model: condyle.Model) -> None:
    """Many runs on threads are the runs alone, bit by bit."""
    told = [{**BASE, "duration": 0.02, "start": {"dbeta": 0.02 * i}} for i in range(5)]
    alone = [condyle.simulate(model, one) for one in told]
    for threads in (1, 3):
        found = condyle.simulate_all(model, told, threads=threads)
        for one, other in zip(found, alone, strict=True):
            np.testing.assert_array_equal(one["pose"], other["pose"])
    told[3]["start"] = {"dZ": 1.0}
    with pytest.raises(condyle.CondyleError, match=r"scenario 4: 1 problem\n.*start: dZ"):
        condyle.simulate_all(model, told)
