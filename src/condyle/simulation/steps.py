"""Fixed steps in compiled code: `steps.c` over the kernels of plant and controller.

It takes the steps of one run, or of several in lockstep, and hands back what is rare: a guard that
changes its sign, a contact that may land, a state that a kernel cannot vouch for.
"""

from __future__ import annotations

import ctypes
from functools import lru_cache
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from ..backends import cache
from ..backends.c.compiled_kernel import CompiledKernel
from ..backends.c.shared_library import obtained, tool
from ..backends.compiler import CompilerError, find_compiler
from .columns import KernelColumns
from .control import Controller
from .events import CHATTER
from .integrators import FIXED, RUNGE_KUTTA
from .lifting import LANDING, PROJECTIONS, RigidLifting
from .plan import WORKS, Plan
from .plant import Plant
from .watch import RunGuards

DONE, PAUSE, STEP, SAMPLE = range(4)  # why `advance` returns
BUDGET = 20_000  # steps between two reports of progress

NUMBERS = "const double *"
# What C and Python share, member by member; the struct in C is written from it.
KERNEL = {
    "one": "one_function", "batch": "batch_function", "table": NUMBERS, "given": "double *",
    "found": "double *", "from": "const double *const *", "strides": "const ptrdiff_t *",
}  # fmt: skip
TABLE = {
    "times": NUMBERS, "rows": NUMBERS, "to": "double *", "count": "int64_t", "width": "int64_t",
    "lanes": "int64_t", "vanishes": "int64_t",
}  # fmt: skip
# Where runs are: t, the last tick, the next result, the breakpoint passed, whether it is `fresh`;
# `current`: whether the plant's results are those of the state.
CLOCK = {
    "t": "double", "tick": "int64_t", "next": "int64_t", "breakpoint": "int64_t",
    "fresh": "int64_t", "current": "int64_t",
}  # fmt: skip
COPY = {"to": "double *", "from": NUMBERS}
# Rigid contacts that lift and land, of one run: rows of the plant, and what `RigidLifting` takes
# for closed, for touching and for still.
LIFTING = {
    "faces": "int64_t", "freedoms": "int64_t", "active": NUMBERS, "gap": NUMBERS,
    "gap_rate": NUMBERS, "gap_response": NUMBERS, "q_response": NUMBERS, "projected": "double",
    "touching": "double", "still": "double",
}  # fmt: skip
RUN = {
    # runs, each a column of `stride`; which are alive, which are gone, what a batch said
    "runs": "int64_t", "stride": "int64_t", "alive": "const uint8_t *", "gone": "uint8_t *",
    "status": "uint8_t *", "plant": "Kernel", "control": "Kernel",
    # the state y (size, ..), of which `inputs` rows go into the plant; rates k, stage by stage
    "size": "int64_t", "inputs": "int64_t", "stages": "int64_t", "y": "double *", "y1": "double *",
    "k": "double *", "method": NUMBERS, "step": "double", "until": "double", "budget": "int64_t",
    # where the runs are, where the rate has breakpoints, and which of them are ticks
    "clock": "Clock *", "breakpoint_time": NUMBERS, "is_tick": "const uint8_t *",
    "breakpoints": "int64_t",
    # guards: rows of the plant's results, and what `RunGuards` knows of each
    "guard": "const int64_t *", "guards": "int64_t", "limit": "const uint8_t *",
    "past": "uint8_t *", "met": "double *", "again": "int64_t *",
    "table": "const Table *", "tables": "int64_t",
    # a sample: references, where they go, measured rows, results kept, what is carried on, efforts
    "references": NUMBERS, "reference": "double *", "reference_rows": "int64_t",
    "link": "const Copy *", "links": "int64_t", "carry": "const Copy *", "carried": "int64_t",
    "samples": "double *", "states": "double *", "results": "int64_t", "delay": "int64_t",
    "seen_row": "const int64_t *", "seen": "int64_t",  # of the state, what the controller knows of
    "effort": "double *", "effort_row": "const int64_t *", "efforts": "int64_t",
    # results: states at times
    "times": NUMBERS, "count": "int64_t", "kept": "double *",
    "lifting": "const Lifting *",  # or none
}  # fmt: skip
STRUCTS = {
    "Kernel": KERNEL, "Table": TABLE, "Clock": CLOCK, "Copy": COPY, "Lifting": LIFTING, "Run": RUN,
}  # fmt: skip
FACES = 12  # of contacts that lift and land, at most
HEAD = f"""#define CHATTER {CHATTER}
#define FACES {FACES}
#define PROJECTIONS {PROJECTIONS}
#define LANDING {LANDING:.1f}
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
typedef int (*one_function)(const double *, const double *, double *);
typedef void (*batch_function)(const double *, const double *const *, const ptrdiff_t *, size_t,
                               double *, size_t, uint8_t *);
"""


def _structure(name: str) -> Any:
    plain = {"int64_t": ctypes.c_int64, "double": ctypes.c_double}
    fields = [
        (member, _TYPES[kind] if kind in _TYPES else plain.get(kind, ctypes.c_void_p))
        for member, kind in STRUCTS[name].items()
    ]
    return type(name, (ctypes.Structure,), {"_fields_": fields})


_TYPES: dict[str, Any] = {}
for _name in STRUCTS:
    _TYPES[_name] = _structure(_name)


class Clock(_TYPES["Clock"]):  # type: ignore[misc,valid-type]
    """Where runs are, read and set by compiled code and by its owner."""

    def __init__(self) -> None:
        super().__init__(tick=-1, fresh=1)


@lru_cache(maxsize=1)
def _library() -> Any:
    """The loop, from the cache or built.

    Raises: CompilerError: where it cannot be built.
    """
    room, compiler = files("condyle"), find_compiler()
    structs = [
        f"typedef struct {{\n{''.join(f'    {kind} {n};{chr(10)}' for n, kind in members.items())}"
        f"}} {name};\n"
        for name, members in STRUCTS.items()
    ]
    parts = ("backends/c/runge_kutta.h", "backends/c/elimination.h", "simulation/steps.c")
    texts = [(room / part).read_text(encoding="utf-8") for part in parts]
    source = "\n".join([HEAD, *structs, *texts])

    def make(folder: Path) -> tuple[Path, dict[str, Any]]:
        (folder / "steps.c").write_text(source, encoding="utf-8")
        compiler.build(folder / "steps.so", folder / "steps.c")
        return folder / "steps.so", {"flags": list(compiler.flags)}

    return obtained(cache.digest(source, tool(compiler)), make, _opened)[1]


def _opened(path: str) -> ctypes.CDLL:
    library = ctypes.CDLL(path)
    library.advance.argtypes = [ctypes.c_void_p]
    return library


def steps_of(plant: Plant, control: Controller | None, *shared: Any) -> Stepper | None:
    """Compiled steps of a plan, or None where there are none for it; see `Stepper`."""
    plan = plant.plan
    if plan.method not in FIXED or plan.functions or plant.laws is not None:
        return None
    if plan.lifting is not None and len(plan.lifting.names) > FACES:
        return None
    if control is not None and (control.outside or not len(control.ticks)):
        return None
    m = len(plan.q)
    lags = [plant.columns.rows(port) for port in plan.lags]
    if lags and np.concatenate(lags).min() != 2 * m + len(WORKS):
        return None  # the state is not the first inputs
    both = [plant.columns, *([] if control is None else [control.columns])]
    if not all(isinstance(columns.kernel, CompiledKernel) for columns in both):
        return None
    try:
        return Stepper(plan, _library(), plant, control, *shared)
    except CompilerError:
        return None


class Stepper:
    """Runs in compiled code, on the rows of plant and controller and the arrays of who owns them.

    Attributes: gone: (runs,), which of them the owner has to see to.
    """

    def __init__(
        self,
        plan: Plan,
        library: Any,
        plant: Plant,
        control: Controller | None,
        lifting: RigidLifting | None,
        clock: Clock,
        watch: RunGuards,
        y: np.ndarray,
        alive: np.ndarray,
        samples: np.ndarray,
    ) -> None:
        """The steps of runs.

        Args: y: (size, stride);  alive: (runs,);  samples: (N, size, stride).
        """
        self._library = library
        self._keep: list[Any] = [plant, control, lifting, clock, watch, y, alive, samples]
        runs, stride = alive.size, plant.columns.stride
        self.run = run = _TYPES["Run"]()
        self.gone: np.ndarray = np.zeros(runs, dtype=np.uint8)
        run.runs, run.stride, run.budget = runs, stride, BUDGET
        run.alive, run.gone = alive.ctypes.data, self.gone.ctypes.data
        run.status = self._at(np.zeros(runs, dtype=np.uint8))
        run.plant = self._kernel(plant.columns)
        run.size, run.stages = plan.size, len(RUNGE_KUTTA)
        run.inputs = plan.size if plan.lags else 2 * len(plan.q)
        run.y, run.y1 = y.ctypes.data, self._at(np.zeros_like(y))
        run.k = self._at(np.zeros((len(RUNGE_KUTTA) + 1, *y.shape)))
        run.method = self._at(np.concatenate([np.array(row, float) for row in RUNGE_KUTTA]))
        run.step = plan.settings.step
        times, is_tick = plan.breakpoints()
        run.breakpoint_time, run.is_tick = self._at(times), self._at(is_tick)
        run.breakpoints, run.clock = len(times), ctypes.addressof(clock)
        rows = np.array([guard.row for guard in watch.guards], dtype=np.int64)
        run.guard, run.guards, run.limit = self._at(rows), len(rows), self._at(watch.limit)
        for name in ("past", "met", "again"):
            setattr(run, name, getattr(watch, name).ctypes.data)
        self._feed(plant)
        seen = np.arange(plan.size) if plan.lifting is None else plan.lifting.seen_rows
        if control is not None:
            self._control(seen, plant, control, y)
        if lifting is not None:
            self._lift(plan, plant.columns, lifting)
        run.times, run.count, run.kept = self._at(plan.times), len(samples), samples.ctypes.data

    def advance(self, budget: int = BUDGET) -> int:
        """Go on; returns DONE, PAUSE (nothing happened yet), or what the owner has to see to."""
        self.gone[:], self.run.budget = 0, budget
        return int(self._library.advance(ctypes.addressof(self.run)))

    def _feed(self, plant: Plant) -> None:
        tables = (_TYPES["Table"] * max(len(plant.tables), 1))()
        for to, table in zip(tables, plant.tables, strict=False):
            rows, columns = plant.columns.rows(table.port), plant.columns
            to.times, to.rows = self._at(table.times), self._at(table.rows[:, np.argsort(rows)])
            to.to = columns.address(int(rows.min()))
            to.count, to.width, to.lanes = table.rows.shape
            to.vanishes = table.vanishes
        self._keep.append(tables)
        self.run.table, self.run.tables = ctypes.addressof(tables), len(plant.tables)

    def _lift(self, plan: Plan, columns: KernelColumns, lifting: RigidLifting) -> None:
        own = _TYPES["Lifting"](faces=len(lifting.active), freedoms=len(plan.q))
        own.active = columns.address(int(columns.rows("active")[0]))
        for name in ("gap", "gap_rate", "gap_response", "q_response"):
            setattr(own, name, columns.address(int(columns.result(name)[0]), found=True))
        own.projected, own.touching, own.still = lifting.closed, lifting.touching, lifting.still
        self._keep.append(own)
        self.run.lifting = ctypes.addressof(own)

    def _control(self, seen: np.ndarray, plant: Plant, control: Controller, y: np.ndarray) -> None:
        run, columns = self.run, control.columns
        run.control = self._kernel(columns)
        run.references = control.references.ctypes.data
        run.reference = columns.address(control.first)
        run.reference_rows = control.references.shape[1]
        measured = [(plant.columns, found, port) for port, found in control.measured.items()]
        links = [
            (columns.address(to), source.address(row, found=True))
            for source, name, port in measured
            if source.result(name).size
            for to, row in zip(columns.rows(port), source.result(name), strict=True)
        ]
        if control.filters:
            acted = zip(columns.rows("acted"), plant.columns.rows("effort"), strict=True)
            links += [(columns.address(to), plant.columns.address(row)) for to, row in acted]
        if columns.has("q"):
            to = [*columns.rows("q"), *columns.rows("q1")]
            links += [
                (columns.address(row), y[i:].ctypes.data)
                for i, row in zip(seen[: len(to)].tolist(), to, strict=True)
            ]
        run.link, run.links = self._copies(links), len(links)
        pairs = zip(control.carry_to, control.carry_from, strict=True)
        carry = [(columns.address(to), columns.address(row, found=True)) for to, row in pairs]
        run.carry, run.carried = self._copies(carry), len(carry)
        run.samples, run.states = control.samples.ctypes.data, control.states.ctypes.data
        run.seen_row, run.seen = self._at(seen.astype(np.int64)), len(seen)
        run.results = columns.results
        run.delay = control.drive.delay
        rows = plant.columns.rows("effort")
        run.effort = plant.columns.address(int(rows.min()))
        order = columns.result("effort")[np.argsort(rows)]
        run.effort_row, run.efforts = self._at(order.astype(np.int64)), len(order)

    def _kernel(self, columns: KernelColumns) -> Any:
        single, batch, table = columns.kernel.address  # type: ignore[attr-defined]
        pointers, strides = columns.pointers()
        self._keep += [columns, pointers, strides]
        given, outputs = columns.address(0), columns.address(0, found=True)
        places = ctypes.addressof(pointers), ctypes.addressof(strides)
        return _TYPES["Kernel"](single, batch, table, given, outputs, *places)

    def _copies(self, pairs: list[tuple[int, int]]) -> int:
        copies = (_TYPES["Copy"] * max(len(pairs), 1))(*pairs)
        self._keep.append(copies)
        return ctypes.addressof(copies)

    def _at(self, array: np.ndarray) -> int:
        """Address of an array's numbers, kept as long as this is."""
        own = np.ascontiguousarray(array)
        self._keep.append(own)
        return own.ctypes.data
