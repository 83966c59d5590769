"""A scenario's controller in C: the simulation's efforts, and what it does around them."""

from __future__ import annotations

import ctypes
import re
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from export.conftest import Library, limited, shared, weak
from support.speeds import few
from support.tools import need, run

import condyle
from benchmarks.hostile import hostile_ticks
from condyle.errors import CondyleError
from condyle.export import export
from condyle.export.c_package import DUAL
from condyle.export.controller import ControllerSource, controller_source
from condyle.export.controller_states import CAUSES, EVENTS, NEXT, STATES, states_page
from condyle.simulation import running
from condyle.simulation.reference_path import path_of
from condyle.simulation.simulating import planned

OFF, HOMING, HOLD, RUN, SAFE_STOP = range(5)
LAW = {"kind": "computed_torque", "rate": 1000.0, "stiffness": 1e4, "delay": 1}
# Short: simulated by numpy.
CHEW: dict[str, Any] = {
    "duration": 0.04,
    "method": "rk4",
    "step": 1e-3,
    "start": {"X": 5e-4, "beta": 0.05},
    "controller": LAW,
    "sensors": {"encoder_resolution": 1e-5, "velocity_cutoff": 200.0},
    "safety": {"trips": {"speed": 10.0}},  # it starts 0.05 rad off its path
    "load": [{"kind": "food", "food": "bolus", "point": "right_molar"}],
}
DRIVES: dict[str, Any] = {
    "duration": 0.04,
    "start": {"beta": 0.02},
    "controller": {"kind": "joint_pd", "stiffness": 5.0, "damping": 0.03},
    "sensors": {"encoder_resolution": 1e-4},
}
BITE: dict[str, Any] = CHEW | {
    "start": {"beta": 0.08},
    "controller": {
        "kind": "bite_force", "stiffness": 900.0, "force": 60.0, "delay": 1,
        "distribution": "bounded", "effort_rate": 40.0,
    },
    "sensors": {"encoder_noise": 1e-4},
    "observer": {"kind": "kalman"},
    "load": [{"kind": "food", "food": "bolus", "thickness": 4e-3}],
}  # fmt: skip
LIMIT = 0.03
INSIDE = """
#include "@prefix@_controller.h"
int inside_why(const void *c);
int inside_why(const void *c) { return ((const @prefix@_controller *)c)->why; }
int inside_faults(const void *c);
int inside_faults(const void *c) { return (int)((const @prefix@_controller *)c)->faults; }
int inside_enable(const void *c);
int inside_enable(const void *c) { return ((const @prefix@_controller *)c)->enable; }
void inside_trips(void *c, const double *to);
void inside_trips(void *c, const double *to)
{
    @prefix@_settings *s = &((@prefix@_controller *)c)->settings;
    int i;
    s->tracking = to[0], s->overtaxed = to[1], s->contact = to[2], s->jump = to[3];
    s->stuck = to[4];
    for (i = 0; i < @PREFIX@_JOINTS; i++) s->speed[i] = to[5];
}
int inside_unconverged(const void *c);
int inside_unconverged(const void *c)
{
    return (int)((const @prefix@_controller *)c)->unconverged;
}
int inside_logged(const void *c);
int inside_logged(const void *c) { return (int)((const @prefix@_controller *)c)->logged; }
"""
double = ctypes.c_double


def structure(*fields: tuple[str, Any]) -> type[ctypes.Structure]:
    return type("Struct", (ctypes.Structure,), {"_fields_": fields})


class Machine:
    """The exported controller, by ctypes."""

    def __init__(self, source: ControllerSource, folder: Path) -> None:
        for name, text in source.texts.items():
            (folder / name).write_text(text, encoding="utf-8")
        p = source.exported.prefix
        (folder / "inside.c").write_text(
            INSIDE.replace("@prefix@", p).replace("@PREFIX@", p.upper())
        )
        self.library, self._prefix = shared(folder, f"{p}.c", f"{p}_controller.c", "inside.c"), p
        self.source, self.plan = source, source.plan
        q, joints = double * len(source.plan.q), double * len(source.plan.low)
        states, chains = (("q", q), ("q1", q)), (("joint", joints), ("joint_rate", joints))
        lost = ("lost", ctypes.c_ubyte * len(source.plan.low))
        acted = (("acted", joints),) * ("acted[" in source.texts[f"{p}_controller.h"])
        inputs = [(name, ctypes.c_ubyte) for name in ("inhibit", "drive_fault", "e_stop")]
        inputs.append(("index", lost[1]))
        self.Measured = structure(*chains, ("force", double * 3), lost, *acted, *inputs)
        self.Reference = structure(*states, ("q2", q), *chains, ("force", double))
        status = ("state", ctypes.c_int), ("status", ctypes.c_int)
        row = structure(("t", double), *status, *chains, ("effort", joints), *states, ("q_d", q))
        self.effort, self._q = joints, q
        self._memory, self.log = ctypes.create_string_buffer(1 << 14), (row * 64)()
        self._settings = ctypes.c_char.in_dll(self.library, f"{p.upper()}_SETTINGS")

    def inside(self, name: str) -> int:
        """A field of the controller: why, faults, enable."""
        return int(getattr(self.library, f"inside_{name}")(self._memory))

    def begin(self, q: Iterable[float], q1: Iterable[float], joint: Any, state: int) -> None:
        measured = None if joint is None else ctypes.byref(self.measured(joint))
        at = ctypes.byref(self._settings), self._q(*q), self._q(*q1), measured
        call = getattr(self.library, f"{self._prefix}_begin")
        assert call(self._memory, *at, state, self.log, len(self.log)) == 0

    def measured(self, joint: Any, **given: Any) -> Any:
        found = self.Measured()
        for name, values in {"joint": joint, **given}.items():
            if isinstance(values, int):
                setattr(found, name, values)
            elif hasattr(found, name):
                getattr(found, name)[: len(values)] = [*values]
        return found

    def rows(self, times: Any) -> np.ndarray:
        """What the scenario follows."""
        assert self.plan.path is not None
        return self.plan.path.at(np.asarray(times))

    def reference(self, row: np.ndarray) -> Any:
        """Args: row: of `rows`."""
        found, at = self.Reference(), 0
        for name in ("q", "q1", "q2", "joint", "joint_rate"):
            own = getattr(found, name)
            own[:] = row[at : at + len(own)].tolist()
            at += len(own)
        found.force = row[at]
        return found

    def joints(self, q: Any) -> np.ndarray:
        """Where joints are at q, (m,)."""
        found, none = self.Reference(), self._q()
        call = getattr(self.library, f"{self._prefix}_reference_at")
        assert call(self._q(*q), none, none, double(), ctypes.byref(found)) == 0
        return np.array(found.joint)

    def step(self, t: float, measured: Any, wanted: int, reference: Any) -> tuple[int, np.ndarray]:
        effort, call = self.effort(), getattr(self.library, f"{self._prefix}_step")
        inputs = ctypes.byref(measured), wanted, ctypes.byref(reference)
        return call(self._memory, double(t), *inputs, effort), np.array(effort)


@pytest.fixture(scope="module")
def machine(tmp_path_factory: pytest.TempPathFactory) -> Machine:
    need("gcc")
    return Machine(
        controller_source("masticatory", CHEW, None), tmp_path_factory.mktemp("controller")
    )


@pytest.fixture(scope="module")
def plant(tmp_path_factory: pytest.TempPathFactory) -> Library:
    """A jaw under gravity and efforts: forward dynamics, and joints."""
    need("gcc")
    jaw = export(condyle.load_mechanism("masticatory"), ("forward", "joints"), prefix="plant")
    return Library(jaw, tmp_path_factory.mktemp("plant"))


def moved(
    plant: Library, q: np.ndarray, q1: np.ndarray, effort: np.ndarray, h: float
) -> tuple[np.ndarray, np.ndarray]:
    """The state after h [s] of four steps."""
    for _ in range(4):
        q1 = q1 + h / 4 * plant("forward", q=q, q1=q1, effort=effort)[1]["acceleration"]
        q = q + h / 4 * q1
    return q, q1


@pytest.mark.parametrize("name", few(["chew", "bite", "drives"], "chew", "bite"))
def test_ticks_are_those_of_the_simulation(name: str, machine: Machine, tmp_path: Path) -> None:
    """Fed with what the simulation measures: its efforts, within limits where there are some.

    Those are decided on by squares of what rounding leaves.
    """
    if name != "chew":
        pressed = BITE | {"controller": BITE["controller"] | {"preload": 2.0}}
        robot, scenario = (limited(LIMIT), pressed) if name == "bite" else (weak(LIMIT), DRIVES)
        machine = Machine(controller_source(robot, scenario, None), tmp_path)
    plan, drive = machine.plan, machine.source.drive
    under_way = running.Batch([plan])
    (trace,) = under_way.traces()
    control = under_way.control
    assert control is not None and len(trace.command) == len(plan.ticks())  # nothing ended it
    rates = control.samples[:, control.columns.result("joint_rate"), 0]
    machine.begin(plan.q, plan.q1, trace.count[0], RUN)
    commands, rows = np.clip(trace.command, plan.low, plan.high), machine.rows(plan.ticks())
    bound = 1e-12 * (DUAL if name == "bite" else 1.0) * np.abs(trace.command).max()
    for k, t in enumerate(plan.ticks()):
        acted = commands[max(k - 1 - drive.delay, 0)]
        given = machine.measured(trace.count[k], joint_rate=rates[k], acted=acted)
        state, effort = machine.step(t, given, RUN, machine.reference(rows[k]))
        assert state == RUN and np.abs(effort - commands[k]).max() < bound
    assert (np.abs(commands).max() > 0.999 * LIMIT) or name == "drives"
    unconverged = control.samples[:, control.columns.result("unconverged"), 0].sum()
    assert machine.inside("unconverged") == unconverged == (name == "bite")  # the first


def test_from_off_to_run_and_off_again_without_a_bump(machine: Machine, plant: Library) -> None:
    """A jaw under the efforts."""
    q, q1, h = np.array([1e-3, 0.5e-3, 0.01, 0.03]), np.zeros(4), 1e-3
    machine.begin(q, q1, None, OFF)
    states, efforts, times = [], [], h * np.arange(5000)
    # The reference is under way when it is joined, 1 mm and 0.03 rad from home.
    rows = machine.rows(1.2 + np.maximum(0.0, times - 2.2))
    for t, row in zip(times, rows, strict=True):
        wanted = OFF if t < 0.01 else HOLD if t < 2.2 else RUN if t < 4.4 else OFF
        reference = machine.reference(row)
        measured = machine.measured(plant("joints", q=q)[1]["joint"])
        state, effort = machine.step(t, measured, wanted, reference)
        states.append(state)
        efforts.append(effort)
        if state != OFF:
            q, q1 = moved(plant, q, q1, effort, h)
        if abs(t - 4.39) < 1e-9:  # it follows
            assert np.abs(q - np.array(reference.q)).max() < 2e-4
    assert list(dict.fromkeys(states)) == [OFF, HOMING, HOLD, RUN, SAFE_STOP]
    assert states[-1] == OFF and not efforts[-1].any()
    steps = np.abs(np.diff(efforts, axis=0)).max(axis=1)
    assert steps.max() < 0.05  # N m in 1 ms, of 3 N m; chewing itself is as quick


def test_lost_encoders_and_late_ticks_stop_it_and_the_log_is_a_ring(machine: Machine) -> None:
    at, joint = machine.reference(machine.rows([0.0])[0]), np.zeros(6)

    def runs(lost: Callable[[int], bool], late: Callable[[int], bool]) -> list[int]:
        machine.begin(np.zeros(4), np.zeros(4), joint, RUN)
        states, t = [], 0.0
        for k in range(600):
            t += 3e-3 if late(k) else 1e-3
            given = machine.measured([9.0, *joint[1:]] if lost(k) else joint, lost=[lost(k)])
            state, effort = machine.step(t, given, RUN, at)
            states.append(state)
            last = machine.log[k % 64]
            assert (last.t, last.state) == (t, state) and np.array_equal(last.effort, effort)
        assert len({row.t for row in machine.log}) == 64
        return states

    never = lambda k: False  # noqa: E731
    seldom = lambda k: k % 50 < 3  # noqa: E731 - three in a row are borne
    assert {*runs(never, never), *runs(seldom, never), *runs(never, seldom)} == {RUN}
    for found in (runs(never, lambda k: 20 < k < 30), runs(lambda k: k > 20, never)):
        assert found[20] == RUN and SAFE_STOP in found[21:26] and found[-1] == OFF
    assert machine.step(1.0, machine.measured(joint), OFF, at)[0] == OFF
    assert machine.step(1.001, machine.measured(joint), RUN, at)[0] == HOMING  # after a look


def test_a_lost_encoder_goes_on_at_its_rate(machine: Machine) -> None:
    """A crank turns evenly; the log keeps what the law was given."""
    at, speed = machine.reference(machine.rows([0.0])[0]), 1e-4  # rad a tick
    machine.begin(np.zeros(4), np.zeros(4), np.zeros(6), RUN)
    for k in range(103):
        joint = [9.0 if k >= 100 else speed * k, *np.zeros(5)]
        machine.step(1e-3 * k, machine.measured(joint, lost=[k >= 100]), RUN, at)
        assert abs(machine.log[k % 64].joint[0] - speed * k) < 0.1 * speed


def test_it_calls_nothing_but_mathematics(machine: Machine) -> None:
    need("nm")
    text = run("nm", "-D", "--undefined-only", machine.library._name, folder=Path())
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
)
def test_what_has_no_tick_is_refused(change: dict[str, Any], words: str) -> None:
    scenario = {k: v for k, v in (CHEW | change).items() if v is not None}
    with pytest.raises(CondyleError, match=words):
        controller_source("masticatory", scenario, None)


def test_the_folder(tmp_path: Path) -> None:
    made = condyle.export_controller("masticatory", DRIVES, tmp_path / "out", prefix="jaw")
    names = {path.name for path in made}
    code = {"jaw.h", "jaw.c", "jaw_controller.h", "jaw_controller.c", "path.csv"}
    assert names == code | {"Makefile", "facts.awk"}
    motion = condyle.Motion.from_csv(tmp_path / "out" / "path.csv")
    (plan,) = planned(condyle.derive("masticatory"), [DRIVES])
    assert plan.path is not None
    assert np.allclose(motion.value, plan.path.states(motion.t)[0], atol=1e-12)


def test_the_tick_of_the_page_closes_the_loop(tmp_path: Path) -> None:
    """The controller that docs/how-to/controller.md shows, with `forward` as the plant and `joints`
    as its encoders, is condyle's own simulation: the same path, gains, low-pass and rate, through
    efforts that limits cut."""
    need("gcc")
    page = Path(__file__).parents[2] / "docs" / "how-to" / "controller.md"
    shown = page.read_text(encoding="utf-8").split("```c\n")[1].split("```")[0]
    shown = shown.replace("masticatory", "jaw").replace("MASTICATORY", "JAW")
    T, ticks = 1e-3, 40
    questions = ("observer", "computed_torque", "forward", "joints")
    exported = export(weak(), questions, prefix="jaw", lanes=0)
    declared = shown.partition("int tick")[2].partition("{")[0]
    exported = replace(exported, source=f"{exported.source}int tick{declared};\n{shown}")
    t = np.linspace(0, T * ticks, 101)
    s = t / t[-1]
    rise = s**4 * (35 - 84 * s + 70 * s**2 - 20 * s**3)
    columns = {"X": 0.0005 * rise, "Y": 0.0002 * rise, "alpha": 2e-3 * rise, "beta": 0.01 * rise}
    motion = condyle.Motion.from_arrays(t, columns)
    law = {"kind": "computed_torque", "stiffness": 900.0, "damping": 60.0, "rate": 1 / T}
    sensors = {"velocity_cutoff": np.log(2) / (2 * np.pi * T)}  # smoothing of a half
    how = {"duration": ticks * T, "rate": 1 / T, "method": "rk4", "step": T}
    model = condyle.derive(exported.mechanism)
    own = condyle.simulate(model, {**how, "controller": law, "sensors": sensors}, motion=motion)
    assert any(event["kind"] == "saturated" for event in own.condyle.events)
    q, q1 = (
        own[name].sel(coordinate=own["independent"].values).values for name in ("pose", "pose_rate")
    )
    path = path_of(model, motion, None, None).at(T * np.arange(ticks))
    jaw = Library(exported, tmp_path)

    def rate(y: np.ndarray) -> np.ndarray:
        status, found = jaw("forward", q=y[:4], q1=y[4:], effort=effort)
        assert status == 0
        return np.concatenate([y[4:], found["acceleration"]])

    y, effort = np.zeros(8), np.zeros(6)
    for k in range(ticks):
        assert np.abs(np.concatenate([q[k], q1[k]]) - y).max() < 1e-9
        joint = jaw("joints", q=y[:4], q1=y[4:])[1]["joint"]
        arrays = [joint, *np.split(path[k, :12].copy(), 3), effort]
        assert jaw.library.tick(*(a.ctypes.data_as(ctypes.c_void_p) for a in arrays)) == 0
        assert np.abs(own["effort"][k] - effort).max() < 1e-9
        a = rate(y)
        b = rate(y + T / 2 * a)
        c = rate(y + T / 2 * b)
        y = y + T / 6 * (a + 2 * b + 2 * c + rate(y + T * c))


class Attack:
    """A machine under a reference that moves, one tick after the other."""

    def __init__(self, machine: Machine, state: int = RUN) -> None:
        self.machine, self.state, self.k, self.now = machine, state, 0, 0.0
        self.rows = machine.rows(np.zeros(1))
        self.at = machine.reference(self.rows[0])
        machine.begin(np.zeros(4), np.zeros(4), np.zeros(6), state)

    def ticks(self, count: int, wanted: int = RUN, **given: Any) -> np.ndarray:
        """Efforts, (count, 6). Args: given: `dt` [s], `now`, functions of the tick or numbers."""
        efforts = []
        for _ in range(count):
            now = {k: f(self.k) if callable(f) else f for k, f in given.items()}
            t = now.pop("now", self.now + now.pop("dt", 1e-3))
            self.now = t if np.isfinite(t) else self.now
            joint = now.pop("joint", np.zeros(6))
            measured = self.machine.measured(joint, **now)
            self.state, effort = self.machine.step(t, measured, wanted, self.at)
            efforts.append(effort)
            self.k += 1
        return np.array(efforts)

    @property
    def why(self) -> str:
        return [*CAUSES][self.machine.inside("why")]


@pytest.mark.parametrize(
    ("given", "why"),
    [
        ({"now": np.nan}, "LATE"),
        ({"now": 0.0}, "LATE"),
        ({"dt": 0.02}, "LATE"),  # one gap
        ({"dt": lambda k: 3e-3 if k % 2 else 1e-3}, "LATE"),
        ({"lost": lambda k: [k % 4 > 0]}, "LOST"),
        ({"joint": [np.inf] * 6}, "LOST"),
        ({"inhibit": 1}, "INHIBIT"),
        ({"drive_fault": 255}, "DRIVE_FAULT"),
        ({"e_stop": 2}, "E_STOP"),
        ({"joint_rate": [np.nan] * 6}, "LOST"),
    ],
)
def test_what_is_wrong_stops_it_under_a_name(
    machine: Machine, given: dict[str, Any], why: str
) -> None:
    attack = Attack(machine)
    attack.ticks(10)
    assert (attack.state, attack.why, machine.inside("enable")) == (RUN, "FINE", 1)
    attack.ticks(40, **given)
    assert attack.state == (OFF if why == "DRIVE_FAULT" else SAFE_STOP) and attack.why == why
    assert machine.inside("faults") == 1 << [*CAUSES].index(why)
    attack.ticks(1000, **given)
    assert attack.state == OFF and not machine.inside("enable")
    attack.ticks(20)
    assert attack.state == OFF and attack.why == why  # nobody has looked
    attack.ticks(1, OFF)
    attack.ticks(1)
    assert (attack.state, attack.why) == (HOMING, "FINE")


@pytest.mark.parametrize("wanted", [SAFE_STOP, HOMING, -1, 17, 2**31 - 1])
@pytest.mark.parametrize("state", [HOMING, HOLD, RUN])
def test_asking_to_stop_stops_and_does_not_start(machine: Machine, wanted: int, state: int) -> None:
    attack = Attack(machine, state)
    attack.ticks(1, wanted)
    assert attack.state == SAFE_STOP
    attack.ticks(600, wanted)
    assert (attack.state, attack.why) == (OFF, "FINE")


def test_clocks_that_jump_neither_exceed_limits_nor_keep_it_from_homing(machine: Machine) -> None:
    """1000 s back in a safe stop; a clock that begins at -100 s."""
    attack = Attack(machine)
    attack.ticks(10, joint=[0.02] * 6)
    attack.ticks(10, SAFE_STOP)
    efforts = attack.ticks(10, SAFE_STOP, dt=lambda k: -1000.0 if k == 22 else 1e-3)
    assert np.isfinite(efforts).all()
    assert (efforts <= machine.plan.high).all() and (efforts >= machine.plan.low).all()
    attack = Attack(machine, OFF)
    attack.now = -100.0
    attack.ticks(2200, HOLD)
    assert attack.state == HOLD


def test_changes_of_state_are_smooth_while_the_reference_moves(machine: Machine) -> None:
    """What is followed, q_d of the log, has no step of position, rate or acceleration."""
    attack, times = Attack(machine, RUN), 1e-3 * np.arange(3000)
    wishes = np.select([times < 0.05, times < 0.6], [RUN, HOLD], RUN)
    followed = []
    phase = 20.0 * times
    for k, wanted in enumerate(wishes):
        row = machine.rows([0.0])[0].copy()
        row[3], row[7] = 0.01 * np.sin(phase[k]), 0.2 * np.cos(phase[k])
        row[11] = -4.0 * np.sin(phase[k])
        found = machine.reference(row)
        call = getattr(machine.library, f"{machine._prefix}_reference_at")
        q, q1, q2 = (machine._q(*row[i : i + 4]) for i in (0, 4, 8))
        assert call(q, q1, q2, double(0.0), ctypes.byref(found)) == 0
        attack.at = found
        attack.ticks(1, int(wanted), joint=[*found.joint])
        followed.append(machine.log[k % 64].q_d[3])
    assert attack.state == RUN and abs(followed[-1] - 0.01 * np.sin(phase[-1])) < 1e-15
    assert np.abs(np.diff(followed, 3)).max() < 4e-7  # a jump of 0.2 rad/s would be 2e-4
    assert np.ptp(followed[200:600]) < 1e-15  # it holds


def test_homing_starts_from_the_speed_that_it_has(machine: Machine) -> None:
    """Moved by hand at 0.2 rad/s."""
    attack, followed = Attack(machine, OFF), []
    for k in range(120):
        joint = machine.joints([0.0, 0.0, 0.0, 2e-4 * k])
        attack.ticks(1, HOLD if k >= 100 else OFF, joint=[*joint])
        followed.append(machine.log[k % 64].q_d[3])
    assert attack.state == HOMING
    assert np.abs(np.diff(followed[95:106]) - 2e-4).max() < 2e-5  # 0 from rest


def test_counters_wrap(machine: Machine, tmp_path: Path) -> None:
    """The ring begins again before its counter ends, and no counter is a `long`."""
    attack = Attack(machine)
    for ticks in (40, 200, 500):
        attack.ticks(ticks)
        assert machine.inside("logged") < 2 * len(machine.log)
    texts = (machine.source.texts[f"{machine._prefix}_controller.{s}"] for s in "ch")
    assert not any("long" in text.split() for text in texts)


def test_the_brake_is_stable_where_ticks_are_slow_and_rates_are_filtered(tmp_path: Path) -> None:
    """200 Hz and a low-pass: the machine, thrown, comes to rest within its speed limit."""
    slow = CHEW | {
        "method": "rk4", "duration": 0.1, "start": {},
        "controller": LAW | {"rate": 200.0, "stiffness": 400.0},
        "sensors": {"encoder_resolution": 1e-5, "velocity_cutoff": 80.0},
    }  # fmt: skip
    machine = Machine(controller_source("masticatory", slow, None), tmp_path)
    (tmp_path / "plant").mkdir()
    robot = machine.plan.model.mechanism.set({"gravity": (0.0, 0.0, 0.0)})
    plant = Library(export(robot, ("forward", "joints"), prefix="plant"), tmp_path / "plant")
    q, q1 = np.zeros(4), np.array([0.0, 0.0, 0.0, 0.5])
    at = machine.reference(machine.rows([0.0])[0])
    machine.begin(q, q1, None, RUN)
    speeds, effort = [], np.zeros(6)
    for k in range(140):
        found = plant("joints", q=q, q1=q1)[1]
        speeds.append(np.abs(found["joint_rate"]).max())
        given = machine.measured(found["joint"])
        _, effort = machine.step(5e-3 * k, given, OFF, at)
        q, q1 = moved(plant, q, q1, effort, 5e-3)
    assert max(speeds) < 1.2 * speeds[0] and speeds[100] < 0.1 * speeds[0]


@pytest.mark.parametrize("stop", ["brake", "hold_then_release", "hold"])
def test_a_stop_holds_as_long_as_it_is_told_to(stop: str, plant: Library, tmp_path: Path) -> None:
    scenario = CHEW | {"safety": {"stop": stop, "hold": 0.65}}
    machine = Machine(controller_source("masticatory", scenario, None), tmp_path)
    attack = Attack(machine)
    attack.ticks(10)
    ends = [attack.ticks(600, SAFE_STOP)[-1], attack.ticks(600, SAFE_STOP)[-1]]
    held = {"brake": (False, False), "hold_then_release": (True, False), "hold": (True, True)}
    assert tuple(bool(effort.any()) for effort in ends) == held[stop]
    attack.ticks(550, OFF)
    assert attack.state == OFF
    attack = Attack(machine)
    attack.ticks(10)
    attack.ticks(550, e_stop=1)  # the law is not asked
    assert attack.state == OFF
    # Under gravity it stays while it is held, and falls slowly as long as the brake is on.
    attack, q, q1, speeds = Attack(machine, HOLD), np.zeros(4), np.zeros(4), []
    while attack.k < 1250:
        found = plant("joints", q=q, q1=q1)[1]
        (effort,) = attack.ticks(1, HOLD if attack.k < 50 else SAFE_STOP, joint=found["joint"])
        if attack.state == OFF:
            break
        speeds.append(np.abs(found["joint_rate"]).max())
        q, q1 = moved(plant, q, q1, effort, 1e-3)
    still = {"brake": 50, "hold_then_release": 700, "hold": 1250}[stop]
    assert len(speeds) == min(still + 500, 1250)
    assert max(speeds[:still]) < 0.01 and max(speeds) < 1.6  # rad/s, as the page says


def test_a_force_felt_in_hold_is_no_bite(tmp_path: Path) -> None:
    """3 N, with a rate of the reference that closes, as homing has."""
    scenario = CHEW | {"controller": BITE["controller"] | {"integral": 50.0}}
    machine = Machine(controller_source("masticatory", scenario, None), tmp_path)
    attack = Attack(machine, OFF)
    attack.at.force, attack.at.q[3] = 60.0, -0.01
    attack.ticks(2100, HOLD, force=lambda k: [0.0, 0.0, -3.0 if k > 900 else 0.0])
    assert attack.state == HOLD
    at_rest = attack.ticks(3000, HOLD, force=[0.0, 0.0, -3.0])
    assert np.abs(at_rest - at_rest[0]).max() < 1e-3


def test_hostile_ticks_reach_every_state_and_nothing_passes_the_limits(tmp_path: Path) -> None:
    """Under sanitizers; `python -m benchmarks.hostile 1e7` runs more. Edges: those of the table."""
    need("gcc")
    counts = hostile_ticks(10_000, tmp_path)
    assert counts.bad == 0
    allowed = {
        OFF: {OFF, HOMING, SAFE_STOP},  # homing, and a fault in the same tick
        HOMING: {HOMING, HOLD, SAFE_STOP, OFF},
        HOLD: {HOLD, RUN, SAFE_STOP, OFF},
        RUN: {RUN, HOLD, SAFE_STOP, OFF},
        SAFE_STOP: {SAFE_STOP, OFF},
    }
    for state, row in enumerate(counts.edges):
        assert row[state] and {*np.flatnonzero(row)} <= allowed[state]


def test_the_table_of_states_is_that_of_the_machine(machine: Machine) -> None:
    """Every state under every wish, by a walk of the C."""
    events = [*EVENTS]
    for wanted, event in ((OFF, 0), (HOLD, 1), (RUN, 2), (SAFE_STOP, 3)):
        for state in (OFF, HOMING, HOLD, RUN, SAFE_STOP):
            for given, name in (({}, events[event]), ({"drive_fault": 1}, "CUT")):
                attack = Attack(machine, state)
                attack.ticks(1, wanted, **given)
                assert [*STATES][attack.state] == NEXT[[*STATES][state]][events.index(name)]


def test_the_page_names_what_the_header_has(machine: Machine) -> None:
    """Values of faults, and of states by their place, as a C compiler counts them."""
    rows = [line.split("|")[1:-1] for line in states_page().splitlines() if line[:1] == "|"]
    cells = [[cell.strip(" *`") for cell in row] for row in rows]
    header = machine.source.texts[f"{machine._prefix}_controller.h"]
    prefix = machine._prefix.upper()
    blocks = [b.split("}")[0] for b in header.split("enum {")[1:]]
    enums = [[w for w in re.findall(rf"{prefix}_(\w+)(?=[, ])", block)] for block in blocks]
    states = next(names for names in enums if names[0] == "OFF")
    causes = next(names for names in enums if names[0] == "FINE")
    assert [row[0] for row in cells if row[0] in STATES] == [*states, *states]
    assert [(row[0], row[1]) for row in cells if len(row) == 5 and row[0] in CAUSES] == [
        (name, str(value)) for value, name in enumerate(causes)
    ]
    flags = re.findall(r"unsigned char (.*);", header.split("_measured;")[0])
    names = {name.partition("[")[0] for name in ", ".join(flags).split(", ")}
    assert names == {"lost", "inhibit", "drive_fault", "e_stop", "index"} <= {r[0] for r in cells}
    page = Path(__file__).parents[2] / "docs" / "how-to" / "commissioning.md"
    assert '--8<-- "controller-states.md"' in page.read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def machines(tmp_path_factory: pytest.TempPathFactory) -> tuple[Machine, Machine]:
    """Strong drives and weak ones, with a tick that knows contact forces."""
    need("gcc")
    scenario = CHEW | {"controller": LAW | {"distribution": "bounded"}}
    strong, feeble = (
        Machine(controller_source(robot, scenario, None), tmp_path_factory.mktemp("trips"))
        for robot in ("masticatory", weak())
    )
    return strong, feeble


TRIPS = ("tracking", "overtaxed", "contact", "jump", "stuck", "speed")


@pytest.mark.parametrize(
    ("trip", "threshold", "angles", "why"),
    [
        ("tracking", 1e-3, lambda k: 1e-3 * k, "TRACKING"),
        ("overtaxed", 0.02, lambda k: -0.05, "OVERTAXED"),
        ("contact", 0.02, lambda k: -0.05, "CONTACT"),
        ("jump", 1e-3, lambda k: 0.03 * (k % 2), "ENCODER"),
        ("stuck", 1e-3, None, "ENCODER"),
        ("speed", 0.2, lambda k: 2e-3 * k, "SPEED"),
        ("speed", 1e9, np.nan, "NO_POSE"),
    ],
)
def test_each_trip_stops_it_under_its_name(
    machines: tuple[Machine, Machine], trip: str, threshold: float, angles: Any, why: str
) -> None:
    """Joints of a jaw that opens by `angles`; None: they stand, and the reference moves."""
    machine = machines[trip == "overtaxed"]
    attack = Attack(machine)

    def joints(angle: float) -> list[float]:
        row = attack.rows[0].copy()
        row[3] = angle
        found = machine.reference(row)
        call = getattr(machine.library, f"{machine._prefix}_reference_at")
        at = (machine._q(*row[i : i + 4]) for i in (0, 4, 8))
        assert call(*at, double(), ctypes.byref(found)) == 0
        return [*found.joint]

    def runs(*to: float) -> list[float]:
        machine.library.inside_trips(machine._memory, (double * 6)(*to))
        for k in range(40):
            given = [100.0] * 6
            if angles is None:
                attack.at.joint[:], given = joints(1e-3 * k), joints(0.0)
            elif callable(angles):
                given = joints(angles(k))
            attack.ticks(1, joint=given)
        return given

    if why != "NO_POSE":  # without the threshold it runs
        runs(*[np.inf] * 6)
        assert (attack.state, attack.why) == (RUN, "FINE")
        attack = Attack(machine)
    given = runs(*(threshold if name == trip else np.inf for name in TRIPS))
    bit = 1 << [*CAUSES].index(why)
    assert (attack.state, attack.why) == (SAFE_STOP, why)
    assert (machine.inside("faults"), machine.inside("enable")) == (bit, 1)
    attack.ticks(600, joint=given, e_stop=1)
    assert (attack.state, attack.why, machine.inside("enable")) == (OFF, why, 0)
    assert machine.inside("faults") == bit | 1 << [*CAUSES].index("E_STOP")


def test_hybrid_does_not_press_outside_run(tmp_path: Path) -> None:
    """Where it held still its force would rise, and the integral wind up."""
    law = LAW | {"kind": "hybrid", "directions": [[0.0, 0.0, 1.0]], "forces": 30.0}
    machine = Machine(controller_source("masticatory", CHEW | {"controller": law}, None), tmp_path)
    attack = Attack(machine, HOLD)
    efforts = attack.ticks(400, HOLD)
    assert attack.state == HOLD and np.abs(efforts[-1] - efforts[0]).max() < 1e-9
    pressed = attack.ticks(400, RUN)
    assert np.abs(pressed[-1] - efforts[-1]).max() > 0.01


SEARCH = {"reach": {"beta": 0.06}, "tolerance": 0.02, "within": 1.0, "press": 0.05}
COUNTS = np.array([1.0, -2.0, 0.0, 0.3, 7.0, 0.1])  # of encoders at home, wherever they began
FAIL = {"tolerance": 1e-3}


@pytest.mark.parametrize(
    ("until", "change", "ends"),
    [
        ("index", {}, HOLD), ("stop", {}, HOLD), ("index", FAIL, OFF), ("stop", FAIL, OFF),
        ("index", {"reach": {"beta": 0.01}}, OFF),
    ],
)  # fmt: skip
def test_homing_finds_what_encoders_are_off(
    until: str, change: Any, ends: int, tmp_path: Path
) -> None:
    """It begins 3 mrad off; marks are at 0.03 rad, at 0.04 a stop that nothing slides along."""
    need("gcc")
    beta = 0.04 if until == "stop" else 0.03
    model = condyle.derive("masticatory")
    at, zero = model.inverse_kinematics([0, 0, 0, beta]).joint, np.array(model.mechanism.zeros)
    search = SEARCH | {"until": until, "at": tuple(at)} | change
    safety = {"search": search, "homing": 0.5, "stopping": 0.1}
    machine = Machine(controller_source(model, CHEW | {"safety": safety}, None), tmp_path)
    attack, q, states = Attack(machine, OFF), np.array([0.0, 0.0, 0.0, 0.003]), []
    true = machine.joints(q)
    for k in range(2200):
        before, true = true, machine.joints(q)
        passed = [int(x) for x in (before < at) != (true < at)]
        (effort,) = attack.ticks(1, HOLD, joint=[*(true + COUNTS)], index=passed)
        states.append(attack.state)
        row = machine.log[k % 64]
        ahead = q + np.array(row.q_d) - np.array(row.q)
        if attack.state in (HOMING, HOLD) and (until == "index" or ahead[3] < beta):
            q = ahead  # what it takes for q goes where it should, until a stop
        elif attack.state == HOMING:
            q = np.array([0, 0, 0, beta])
        if k < 100:
            assert (np.abs(effort) <= 0.2 * machine.plan.high * (1 + 1e-12)).all()
    assert attack.state == ends
    if ends == OFF:
        assert attack.why == "NO_MARK" and SAFE_STOP in states and HOLD not in states
        return
    # At the reference, and readings are what they should be; another time it knows.
    off = np.abs(np.array(row.joint) - zero - true).max()
    assert off < (1e-9 if until == "stop" else 2e-4) and np.abs(q).max() < 2e-4
    for wanted, end in ((OFF, OFF), (HOLD, HOLD)):
        attack.ticks(600, wanted, joint=[*(true + COUNTS)])
        assert attack.state == end


def test_a_search_that_leads_nowhere_is_refused() -> None:
    search = SEARCH | {"until": "stop", "at": 0.0, "reach": {"Z": 1e-3}}
    with pytest.raises(CondyleError, match=r"reach: got Z; expected .* X, Y, alpha, beta"):
        controller_source("masticatory", CHEW | {"safety": {"search": search}}, None)
