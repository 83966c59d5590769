"""A scenario's controller in C: the simulation's efforts, and what it does around them."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.tools import need, run

import condyle
from condyle.errors import CondyleError
from condyle.export.controller import ControllerSource, controller_source
from condyle.simulation import running
from condyle.simulation.simulating import planned

pytestmark = pytest.mark.usefixtures("compiler_command")

OFF, HOMING, HOLD, RUN, SAFE_STOP = range(5)
FINE, LATE, LOST = range(3)
STRICT = ("-std=c99", "-O2", "-pedantic", "-Wall", "-Wextra", "-Wconversion", "-Werror")
LAW = {"kind": "computed_torque", "rate": 1000.0, "stiffness": 1e4, "delay": 1}
CHEW: dict[str, Any] = {
    "duration": 5.0,
    "method": "rk4",
    "step": 1e-4,
    "controller": LAW,
    "sensors": {"encoder_resolution": 1e-5, "velocity_cutoff": 200.0},
    "load": [{"kind": "food", "food": "bolus", "point": "right_molar"}],
}
DRIVES = {
    "duration": 1.0,
    "controller": {"kind": "joint_pd", "stiffness": 5.0, "damping": 0.03},
    "sensors": {"encoder_resolution": 1e-4},
}
SOFT = {
    "duration": 1.0,
    "controller": {"kind": "impedance", "point": "incisor", "stiffness": 500.0, "damping": 20.0},
    "sensors": {"encoder_resolution": 1e-5, "velocity": "exact"},
}
BITE: dict[str, Any] = {
    "duration": 1.0,
    "method": "rk4",
    "step": 1e-3,
    "start": {"beta": 0.08},
    "controller": {"kind": "bite_force", "stiffness": 900.0, "force": 40.0, "delay": 1},
    "sensors": {"encoder_noise": 1e-4},
    "observer": {"kind": "kalman"},
    "load": [{"kind": "food", "food": "bolus", "thickness": 4e-3}],
}
LIMITED: dict[str, Any] = {
    **BITE,
    "controller": {
        **BITE["controller"], "force": 60.0, "distribution": "bounded", "effort_rate": 40.0,
    },
}  # fmt: skip
double = ctypes.c_double


class Machine:
    """The exported controller, by ctypes."""

    def __init__(self, source: ControllerSource, folder: Path) -> None:
        for name, text in source.texts.items():
            (folder / name).write_text(text, encoding="utf-8")
        p = source.exported.prefix
        run(
            "gcc",
            *STRICT,
            "-shared",
            "-fPIC",
            "-o",
            "it.so",
            f"{p}.c",
            f"{p}_controller.c",
            "-lm",
            folder=folder,
        )
        self._library, self._prefix = ctypes.CDLL(str(folder / "it.so")), p
        self.plan = source.plan
        m, n = len(source.plan.q), len(source.plan.low)
        self.m, self.n = m, n

        class Measured(ctypes.Structure):
            _fields_ = (
                ("joint", double * n), ("joint_rate", double * n), ("force", double * 3),
                ("lost", ctypes.c_ubyte * n), ("acted", double * n),
            )  # fmt: skip

        class Reference(ctypes.Structure):
            _fields_ = (
                ("q", double * m), ("q1", double * m), ("q2", double * m), ("joint", double * n),
                ("joint_rate", double * n), ("force", double),
            )  # fmt: skip

        class Record(ctypes.Structure):
            _fields_ = (
                ("t", double), ("state", ctypes.c_int), ("status", ctypes.c_int),
                ("joint", double * n), ("joint_rate", double * n), ("effort", double * n),
                ("q", double * m), ("q1", double * m), ("q_d", double * m),
            )  # fmt: skip

        self.Measured, self.Reference, self.Record = Measured, Reference, Record
        self._memory = ctypes.create_string_buffer(1 << 14)
        self.log = (Record * 64)()
        self._settings = ctypes.c_char.in_dll(self._library, f"{p.upper()}_SETTINGS")

    def begin(self, q: np.ndarray, q1: np.ndarray, joint: Any = None, state: int = OFF) -> None:
        measured = None if joint is None else ctypes.byref(self.measured(joint))
        at = (double * self.m)(*q), (double * self.m)(*q1)
        call = getattr(self._library, f"{self._prefix}_begin")
        rows = len(self.log)
        assert not call(
            self._memory, ctypes.byref(self._settings), *at, measured, state, self.log, rows
        )

    def measured(
        self, joint: Any, rate: Any = (), force: Any = (), lost: Any = (), acted: Any = ()
    ) -> Any:
        found = self.Measured()
        given = (("joint", joint), ("joint_rate", rate), ("force", force), ("lost", lost))
        given = (*given, ("acted", acted))
        for name, values in given:
            for i, x in enumerate(values):
                getattr(found, name)[i] = x
        return found

    def reference(self, row: np.ndarray) -> Any:
        """Args: row: of `ReferencePath.at`."""
        found, at = self.Reference(), 0
        for name in ("q", "q1", "q2", "joint", "joint_rate"):
            own = getattr(found, name)
            own[:] = row[at : at + len(own)].tolist()
            at += len(own)
        found.force = row[at]
        return found

    def step(self, t: float, measured: Any, wanted: int, reference: Any) -> tuple[int, np.ndarray]:
        effort = (double * self.n)()
        call = getattr(self._library, f"{self._prefix}_step")
        call.argtypes = [ctypes.c_void_p, double, *(ctypes.c_void_p,), ctypes.c_int]
        call.argtypes = [*call.argtypes, ctypes.c_void_p, ctypes.c_void_p]
        state = call(
            self._memory, t, ctypes.byref(measured), wanted, ctypes.byref(reference), effort
        )
        return state, np.array(effort)


CASES = {"chew": CHEW, "joint_pd": DRIVES, "impedance": SOFT, "bite": BITE, "limited": LIMITED}


@pytest.mark.parametrize(
    "scenario",
    [
        pytest.param(one, marks=[pytest.mark.slow] * (one is LIMITED), id=name)
        for name, one in CASES.items()
    ],
)
def test_ticks_are_those_of_the_simulation(scenario: dict[str, Any], tmp_path: Path) -> None:
    robot = condyle.load_mechanism("masticatory")
    if scenario is LIMITED:  # too little for all of the bite
        weak = {f"chain.{name}.actuator.torque_limit": 0.3 for name in robot.chain_names}
        robot = robot.set(weak)
    source = controller_source(robot, scenario, None)
    machine, plan = Machine(source, tmp_path), source.plan
    under_way = running.Run([plan])
    (trace,) = under_way.traces()
    control = under_way.control
    assert control is not None
    columns, rows = control.columns, source.drive.path.at(plan.ticks())
    assert len(trace.command) == len(plan.ticks())  # nothing ended it
    rates = control.samples[:, columns.result("joint_rate"), 0]
    machine.begin(plan.q, plan.q1, trace.count[0], RUN)
    worst = 0.0
    for k, t in enumerate(plan.ticks()):
        before = max(k - 1 - source.drive.delay, 0)
        acted = np.clip(trace.command[before], plan.low, plan.high)
        given = machine.measured(trace.count[k], rates[k], acted=acted)
        state, effort = machine.step(t, given, RUN, machine.reference(rows[k]))
        right = np.clip(trace.command[k], plan.low, plan.high)
        worst = max(worst, float(np.abs(effort - right).max()))
        assert state == RUN
    assert worst < 1e-12 * np.abs(trace.command).max()


class Plant:
    """The masticatory robot under efforts, by condyle's forward dynamics and RK4."""

    def __init__(self) -> None:
        self.model = condyle.derive("masticatory")
        self.q, self.q1 = np.zeros(4), np.zeros(4)

    def joint(self) -> np.ndarray:
        return self.model.inverse_kinematics(self.q).joint

    def move(self, effort: np.ndarray, h: float) -> None:
        def rate(q: np.ndarray, q1: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            return q1, self.model.forward_dynamics(q, q1, effort).acceleration

        a = rate(self.q, self.q1)
        b = rate(self.q + h / 2 * a[0], self.q1 + h / 2 * a[1])
        c = rate(self.q + h / 2 * b[0], self.q1 + h / 2 * b[1])
        d = rate(self.q + h * c[0], self.q1 + h * c[1])
        self.q = self.q + h / 6 * (a[0] + 2 * b[0] + 2 * c[0] + d[0])
        self.q1 = self.q1 + h / 6 * (a[1] + 2 * b[1] + 2 * c[1] + d[1])


@pytest.fixture(scope="module")
def machine(tmp_path_factory: pytest.TempPathFactory) -> Machine:
    quiet = {**CHEW, "load": []}
    made = controller_source("masticatory", quiet, None)
    return Machine(made, tmp_path_factory.mktemp("controller"))


def shown(machine: Machine) -> Callable[[float], Any]:
    path = machine.plan.path
    assert path is not None
    return lambda t: machine.reference(path.at(np.array([t]))[0])


def test_from_off_to_run_and_off_again_without_a_bump(machine: Machine) -> None:
    plant, at = Plant(), shown(machine)
    plant.q = np.array([1e-3, 0.5e-3, 0.01, 0.03])
    machine.begin(plant.q, plant.q1)
    states, efforts = [], []
    for k in range(5000):
        t = 1e-3 * k
        wanted = OFF if t < 0.01 else HOLD if t < 2.2 else RUN if t < 4.4 else OFF
        # The reference is under way when it is joined, 1 mm and 0.03 rad from home.
        reference = at(1.2 + max(0.0, t - 2.2))
        state, effort = machine.step(t, machine.measured(plant.joint()), wanted, reference)
        states.append(state)
        efforts.append(effort)
        if state != OFF:
            plant.move(effort, 1e-3)
        if abs(t - 4.39) < 1e-9:  # it follows
            assert np.abs(plant.q - np.array(reference.q)).max() < 2e-4
    assert list(dict.fromkeys(states)) == [OFF, HOMING, HOLD, RUN, SAFE_STOP]
    assert states[-1] == OFF and not efforts[-1].any()
    steps = np.abs(np.diff(efforts, axis=0)).max(axis=1)
    assert steps.max() < 0.05  # N m in 1 ms, of 3 N m; chewing itself is as quick


def test_lost_encoders_and_late_ticks_stop_it(machine: Machine) -> None:
    at = shown(machine)(0.0)
    joint = np.zeros(6)

    def runs(lost: Callable[[int], bool], late: Callable[[int], bool]) -> list[int]:
        machine.begin(np.zeros(4), np.zeros(4), joint, RUN)
        states, t = [], 0.0
        for k in range(600):
            t += 3e-3 if late(k) else 1e-3
            given = machine.measured([9.0, *joint[1:]] if lost(k) else joint, lost=[lost(k)])
            states.append(machine.step(t, given, RUN, at)[0])
        return states

    never = lambda k: False  # noqa: E731
    assert set(runs(never, never)) == {RUN}
    assert set(runs(lambda k: k % 50 < 3, never)) == {RUN}  # three in a row are borne
    found = runs(lambda k: k > 20, never)
    assert found[20] == RUN and SAFE_STOP in found[21:26] and found[-1] == OFF
    assert machine.step(1.0, machine.measured(joint), OFF, at)[0] == OFF
    assert machine.step(1.001, machine.measured(joint), RUN, at)[0] == HOMING  # after a look
    found = runs(never, lambda k: 20 < k < 30)
    assert found[20] == RUN and SAFE_STOP in found[21:26] and found[-1] == OFF
    assert set(runs(never, lambda k: k % 50 < 3)) == {RUN}


def test_the_log_is_a_ring_of_ticks(machine: Machine) -> None:
    at = shown(machine)(0.0)
    machine.begin(np.zeros(4), np.zeros(4), np.zeros(6), RUN)
    for k in range(100):
        _, effort = machine.step(1e-3 * k, machine.measured(np.zeros(6)), RUN, at)
    times = np.array([row.t for row in machine.log])
    assert sorted(times.round(6).tolist()) == [round(1e-3 * k, 6) for k in range(36, 100)]
    last = machine.log[99 % 64]
    assert np.array_equal(np.array(last.effort), effort) and last.state == RUN


def test_it_calls_nothing_but_mathematics(tmp_path: Path) -> None:
    need("nm")
    source = controller_source("masticatory", CHEW, None)
    Machine(source, tmp_path)
    text = run("nm", "-D", "--undefined-only", "it.so", folder=tmp_path)
    called = {line.split()[-1].partition("@")[0] for line in text.splitlines()}
    allowed = {"memcpy", "memset", "remainder", "sqrt", "fabs", "fmin", "fmax", "floor", "atan2"}
    weak = {name for name in called if name.startswith("_")}
    assert called - weak <= allowed | {"sin", "cos"}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"sensors": None}, "sensors"),
        ({"controller": None, "sensors": None}, "controller"),
        ({"controller": LAW | {"ideal": True, "delay": 0}, "sensors": None}, "rate"),
        ({"controller": LAW | {"distribution": "minimax"}}, "outside the tick"),
    ],
)  # fmt: skip
def test_what_has_no_tick_is_refused(change: dict[str, Any], words: str) -> None:
    scenario = {k: v for k, v in (CHEW | change).items() if v is not None}
    with pytest.raises(CondyleError, match=words):
        controller_source("masticatory", scenario, None)


def test_the_folder(tmp_path: Path) -> None:
    made = condyle.export_controller("masticatory", DRIVES, tmp_path / "out", prefix="jaw")
    names = {path.name for path in made}
    assert names == {"jaw.h", "jaw.c", "jaw_controller.h", "jaw_controller.c", "path.csv"}
    motion = condyle.Motion.from_csv(tmp_path / "out" / "path.csv")
    (plan,) = planned(condyle.derive("masticatory"), [DRIVES])
    assert plan.path is not None
    assert np.allclose(motion.value, plan.path.states(motion.t)[0], atol=1e-12)
