"""Runs with fixed steps in compiled code: `loop.c` over the kernels' functions for one evaluation.

It does what `run` does with `rk4`, step by step, and hands back what is rare: a guard that passes
zero, a state that a kernel cannot vouch for, a controller that is not written in C.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from ctypes import c_double, c_int64, c_void_p
from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from ..backends import cache
from ..backends.c.compiled_kernel import CompiledKernel, Single
from ..backends.c.shared_library import obtained, tool
from ..backends.compiler import CompilerError, find_compiler
from ..model.evaluator import Evaluator
from .controllers.bite_force import BiteForceLaw
from .controllers.computed_torque import ComputedTorqueLaw
from .controllers.joint_pd import JointPDLaw
from .loads import BoundLoad
from .loads.constant import BoundConstant
from .loads.csv import BoundTable
from .loads.food import BoundFood
from .loads.spring import BoundSpring
from .plan import ClosedLoop, OpenLoop, Plan
from .sensing import Observer

DONE, PAUSE, STEP, LOOK = range(4)
CONSTANT, TABLE, SPRING, FOOD = range(4)
OPEN, ELSEWHERE, JOINT_PD, COMPUTED_TORQUE, BITE_FORCE = range(5)
LAWS = {
    JointPDLaw: JOINT_PD,
    ComputedTorqueLaw: COMPUTED_TORQUE,
    BiteForceLaw: BITE_FORCE,
}
STATE, LANES = 16, 64
BUDGET = 20_000  # steps between two words of progress
PLACES = ("pose", "R", "T", "joint", "joint_rate", "loss", "contact_point", "rub")


class _Kernel(ctypes.Structure):
    _fields_ = [(name, c_void_p) for name in ("one", "table", "into", "out")]


class _Load(ctypes.Structure):
    _fields_ = [
        *((name, c_int64) for name in ("kind", "mode", "count")),
        ("point", c_double * 3),
        ("numbers", c_double * 8),
        *((name, c_void_p) for name in ("times", "rows")),
    ]


class _Plant(ctypes.Structure):
    _fields_ = [
        *((name, c_int64) for name in ("m", "n", "k", "loads", "guards")),
        *((n, c_void_p) for n in ("order", "guard_kind", "guard_index", "guard_value")),
        *((name, c_void_p) for name in ("low", "high", "past")),
        *((name, c_int64) for name in PLACES),
        ("instant", _Kernel),
        ("forward", _Kernel),
        ("load", c_void_p),
    ]


class _Observer(ctypes.Structure):
    _fields_ = [
        *((n, c_int64) for n in ("on", "difference", "joint", "A")),
        *((n, c_double) for n in ("smoothing", "period")),
        ("at", _Kernel),
        *((n, c_void_p) for n in ("order", "resolution", "weight", "scale", "turning")),
        *((n, c_void_p) for n in ("q", "q1", "before", "rate", "first")),
    ]


class _Bite(ctypes.Structure):
    _fields_ = [
        *((n, c_int64) for n in ("R", "T", "inertia")),
        ("point", c_double * 3),
        ("direction", c_double * 3),
        *((n, c_double) for n in ("proportional", "integral", "damping")),
        *((n, c_double) for n in ("threshold", "release", "period")),
        ("at", _Kernel),
        *((n, c_void_p) for n in ("felt", "memory", "force")),
    ]


class _Run(ctypes.Structure):
    _fields_ = [
        ("plant", _Plant),
        *((n, c_int64) for n in ("corners", "corner", "fresh", "budget", "drive", "tick")),
        *((n, c_int64) for n in ("delay", "gravity", "rows")),
        *((n, c_void_p) for n in ("corner_time", "is_tick")),
        *((n, c_double) for n in ("step", "t")),
        *((n, c_void_p) for n in ("y", "effort", "min", "max", "cut")),
        *((n, c_void_p) for n in ("effort_times", "efforts", "aims", "stiffness", "damping")),
        ("inverse", _Kernel),
        *((n, c_void_p) for n in ("inverse_order", "command", "counts", "estimate", "times")),
        *((n, c_int64) for n in ("count", "next")),
        *((n, c_void_p) for n in ("kept_state", "kept_effort", "kept_modes", "kept_tick")),
        ("observer", _Observer),
        ("bite", _Bite),
    ]


@lru_cache(maxsize=1)
def _library() -> Any:
    """The loop, from the cache or built.

    Raises: CompilerError: where it cannot be built.
    """
    source = Path(str(files(__package__) / "loop.c"))
    compiler = find_compiler()

    def make(folder: Path) -> tuple[Path, dict[str, Any]]:
        compiler.build(folder / "loop.so", source)
        return folder / "loop.so", {"flags": list(compiler.flags)}

    return obtained(cache.digest(source.read_bytes(), tool(compiler)), make, _opened)[1]


def _opened(path: str) -> ctypes.CDLL:
    library = ctypes.CDLL(path)
    library.advance.argtypes = [c_void_p]
    return library


@dataclass(frozen=True)
class Side:
    """What a controller in Python and one in C share, look by look.

    aims: (K, 3 m + 2 n + 1) q, q', q'', joint, joint rate, force at every tick.
    command, count: (K, n);  estimate: (K, 2 m);  force: (K,);  memory: of the law.
    """

    aims: np.ndarray
    command: np.ndarray
    count: np.ndarray
    estimate: np.ndarray
    force: np.ndarray
    memory: np.ndarray
    observer: Observer | None


def loop_of(plan: Plan, *shared: Any) -> Loop | None:
    """The compiled loop of a plan, or None where there is none for it; see `Loop`."""
    if plan.method != "rk4" or 2 * len(plan.q) + 4 > STATE or len(plan.low) > LANES:
        return None
    if isinstance(plan.drive, ClosedLoop) and plan.drive.period is None:
        return None
    if any(_load(load) is None for load in plan.loads):
        return None
    needed = plan.model.kernel("instant"), plan.model.kernel("forward", ("contact",))
    if not all(isinstance(kernel, CompiledKernel) for kernel in needed):
        return None
    try:
        return Loop(plan, _library(), *shared)
    except CompilerError:
        return None


class Loop:
    """A plan in compiled code, on the arrays of the run that owns it.

    y, effort, cut: state, efforts as they act (n,), and which of them limits cut; to be changed
    between calls as `go_on` is called.
    budget: steps that `advance` takes at most.
    """

    def __init__(
        self,
        plan: Plan,
        library: Any,
        guards: list[tuple[int, int, float]],
        past: np.ndarray,
        results: tuple[np.ndarray, ...],
        side: Side | None,
    ) -> None:
        """The loop.

        Args:
            guards: kind (0 bound, 1 lift off, 2 speed), contact or chain, and sign of the push or
            limit;  past: (guards,) of bool.
            results: state, effort, modes, tick;  side: the controller's, if there is one.
        """
        self._library = library
        self._keep: list[Any] = [plan, side, *results]
        self._run = run = _Run()
        m, n, k = len(plan.q), len(plan.low), len(plan.model.mechanism.contacts)
        self.y, self.effort = np.zeros(plan.size), np.zeros(n)
        self.cut = np.zeros(n, dtype=np.uint8)
        self._past, self.budget = past, BUDGET
        self._flags = np.zeros(len(past), dtype=np.uint8)
        plant = run.plant
        plant.m, plant.n, plant.k, plant.loads, plant.guards = m, n, k, len(plan.loads), len(guards)
        instant, where, order = self._kernel(plan.model, "instant")
        for name in PLACES:
            setattr(plant, name, where[name])
        plant.instant = instant
        plant.forward = self._kernel(plan.model, "forward", ("contact",))[0]
        plant.order = self._at(np.array(order, dtype=np.int64))
        lanes = {chain: lane for lane, chain in enumerate(order)}
        index = [lanes[i] if kind == 2 else i for kind, i, _ in guards]
        plant.guard_kind = self._at(np.array([g[0] for g in guards], dtype=np.int64))
        plant.guard_index = self._at(np.array(index, dtype=np.int64))
        plant.guard_value = self._at(np.array([g[2] for g in guards], dtype=float))
        bounds = _bounds(plan)
        plant.low, plant.high = self._at(bounds[0]), self._at(bounds[1])
        plant.past = self._flags.ctypes.data
        self._loads = (_Load * max(len(plan.loads), 1))()
        self._fill_all(plan.loads)
        plant.load = ctypes.addressof(self._loads)
        self._time(plan)
        run.y, run.effort = self.y.ctypes.data, self.effort.ctypes.data
        run.min, run.max = self._at(plan.low), self._at(plan.high)
        run.cut = self.cut.ctypes.data
        if side is None:
            assert isinstance(plan.drive, OpenLoop)
            run.drive, run.rows = OPEN, len(plan.drive.times)
            run.effort_times = self._at(plan.drive.times)
            run.efforts = self._at(plan.drive.efforts)
        else:
            self._control(plan, side)
        run.times, run.count = self._at(plan.times), len(plan.times)
        state, effort, modes, tick = results
        run.kept_state, run.kept_effort = state.ctypes.data, effort.ctypes.data
        run.kept_modes, run.kept_tick = modes.ctypes.data, tick.ctypes.data

    @property
    def t(self) -> float:
        """Where it is [s]."""
        return self._run.t

    @property
    def next(self) -> int:
        """Of the results' times, the first that is not reached."""
        return self._run.next

    @property
    def tick(self) -> int:
        """The controller's last look."""
        return self._run.tick

    @property
    def corner(self) -> int:
        """Between which corner and the next it is."""
        return self._run.corner

    @corner.setter
    def corner(self, value: int) -> None:
        self._run.corner = value

    @property
    def by_itself(self) -> bool:
        """Whether the controller is in C, too, if there is one."""
        return bool(self._run.drive != ELSEWHERE)

    @property
    def at_a_look(self) -> bool:
        """Whether the controller is to look before it goes on."""
        return bool(self._run.fresh and self._is_tick[self._run.corner])

    def advance(self) -> int:
        """Go on; returns DONE, PAUSE (nothing happened yet), or what the caller has to see to."""
        self._flags[:] = self._past
        self._run.budget = self.budget
        return int(self._library.advance(ctypes.addressof(self._run)))

    def go_on(self, t: float, next_: int, tick: int, fresh: bool) -> None:
        """From here, after the caller has done something."""
        run = self._run
        run.t, run.next, run.tick, run.fresh = t, next_, tick, fresh

    def set_modes(self, modes: Sequence[int]) -> None:
        """Of the loads."""
        for load, mode in zip(self._loads, modes, strict=False):
            load.mode = mode

    def change(self, drive: OpenLoop | ClosedLoop, loads: Sequence[BoundLoad]) -> None:
        """Go on with other numbers in the law and in the loads, which stay what they are."""
        self._fill_all(loads)
        if self._run.drive > ELSEWHERE:
            assert isinstance(drive, ClosedLoop)
            self._gains(drive.law)

    # -- what it reads ------------------------------------------------------------------------

    def _time(self, plan: Plan) -> None:
        run, corners, ticks = self._run, plan.corners(), plan.ticks()
        is_tick = self._is_tick = np.zeros(len(corners), dtype=np.uint8)
        if len(ticks):
            nearest = np.clip(np.searchsorted(corners, ticks - 1e-12), 0, len(corners) - 1)
            is_tick[nearest] = 1
            is_tick[-1] = 0
        assert plan.settings.step is not None
        run.corners, run.corner, run.fresh, run.tick = len(corners), 0, 1, -1
        run.corner_time, run.is_tick = self._at(corners), self._at(is_tick)
        run.step = plan.settings.step

    def _control(self, plan: Plan, side: Side) -> None:
        run, drive = self._run, plan.drive
        assert isinstance(drive, ClosedLoop)
        law = drive.law
        run.aims, run.delay = side.aims.ctypes.data, drive.delay
        run.command, run.counts = side.command.ctypes.data, side.count.ctypes.data
        run.estimate = side.estimate.ctypes.data
        run.drive = LAWS.get(type(law), ELSEWHERE) if _plain(law.model) else ELSEWHERE
        if run.drive == ELSEWHERE:
            return
        run.gravity = getattr(law, "gravity", False)
        run.inverse, _, order = self._kernel(law.model, "inverse", ())
        run.inverse_order = self._at(np.array(order, dtype=np.int64))
        if side.observer is not None:
            self._observe(law.model, side.observer)
        if isinstance(law, BiteForceLaw):
            bite = run.bite
            bite.at, where, _ = self._kernel(law.model, "instant", True)
            bite.R, bite.T, bite.inertia = where["R"], where["T"], where["inertia_matrix"]
            bite.felt = self._at(np.array([x.place == law.place for x in plan.loads], np.uint8))
            bite.memory, bite.force = side.memory.ctypes.data, side.force.ctypes.data
        self._gains(law)

    def _observe(self, model: Evaluator, observer: Observer) -> None:
        to, sensing = self._run.observer, observer.sensing
        to.at, where, order = self._kernel(model, "instant")
        to.on, to.difference = True, sensing.difference
        to.joint, to.A = where["joint"], where["A"]
        to.smoothing, to.period = sensing.smoothing, observer.period
        to.order = self._at(np.array(order, dtype=np.int64))
        to.resolution, to.weight = self._at(sensing.resolution), self._at(observer.weight)
        to.scale, to.turning = self._at(observer.scale), self._at(observer.turning.view(np.uint8))
        for name in ("q", "q1", "before", "rate", "first"):
            setattr(to, name, getattr(observer, name).ctypes.data)
        self._keep.append(observer)

    def _gains(self, law: Any) -> None:
        self._run.stiffness, self._run.damping = self._at(law.stiffness), self._at(law.damping)
        if isinstance(law, BiteForceLaw):
            bite = self._run.bite
            assert law.point is not None
            bite.point[:], bite.direction[:] = law.point.tolist(), law.direction.tolist()
            bite.proportional, bite.integral = law.proportional, law.integral
            bite.damping, bite.threshold = law.bite_damping, law.threshold
            bite.release, bite.period = law.release, law.period

    def _kernel(
        self, model: Evaluator, question: str, *details: Any
    ) -> tuple[_Kernel, dict[str, int], tuple[int, ...]]:
        """A kernel, where its results begin, and where its lanes stand among the chains."""
        kernel = model.kernel(question, *details)
        assert isinstance(kernel, CompiledKernel)
        single: Single = kernel.single()
        self._keep += [kernel, single]
        found = _Kernel(*single.addresses)
        where, start = {}, 0
        for result in kernel.interface.results:
            where[result.name] = start
            start += kernel.interface.width(result)
        return found, where, kernel.order

    def _fill_all(self, loads: Sequence[BoundLoad]) -> None:
        for to, load in zip(self._loads, loads, strict=False):
            self._fill(to, load)

    def _fill(self, to: _Load, load: BoundLoad) -> None:
        told = _load(load)
        assert told is not None
        to.kind, numbers = told
        to.point[:] = load.point.tolist()
        to.numbers[: len(numbers)] = numbers
        if isinstance(load, BoundTable):
            to.count = len(load.times)
            to.times, to.rows = self._at(load.times), self._at(load.wrench)

    def _at(self, array: np.ndarray) -> int:
        """Address of an array's numbers, kept as long as this is."""
        own = np.ascontiguousarray(array)
        self._keep.append(own)
        return own.ctypes.data


def _plain(model: Evaluator) -> bool:
    """Whether `Evaluator.one` is one call of a kernel."""
    kernel = model.kernel("inverse", ())
    return not model.chooses_efforts and isinstance(kernel, CompiledKernel)


def _load(load: BoundLoad) -> tuple[int, list[float]] | None:
    """Kind and numbers of a load in C, or None where it is none."""
    match load:
        case BoundConstant():
            return CONSTANT, list(load.wrench)
        case BoundTable():
            return (TABLE, []) if len(load.times) > 1 else None
        case BoundSpring():
            return SPRING, [*load.direction, load.stiffness, load.damping, load.rest]
        case BoundFood():
            numbers = (load.thickness, load.stiffness, load.damping)
            return FOOD, [*load.direction, *numbers, load.break_force, load.break_thickness]
    return None


def _bounds(plan: Plan) -> np.ndarray:
    """Bounds of the contact points, (2, k, 3) [m]: low and high, infinite where there is none."""
    contacts = plan.model.mechanism.contacts
    found = np.empty((2, len(contacts), 3))
    for i, contact in enumerate(contacts):
        for axis, name in enumerate("xyz"):
            interval = getattr(contact.bounds, name)
            found[:, i, axis] = (-np.inf, np.inf) if interval is None else interval
    return found
