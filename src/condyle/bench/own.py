"""Our own rows: kernels of every formulation, the interpreter, and CasADi's straight-line C."""

from __future__ import annotations

import ctypes
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from functools import partial
from importlib.resources import files
from pathlib import Path

import numpy as np

from ..kernels.compiled import Kernel
from ..kernels.compiler import find_compiler
from ..mechanism.mechanism import Mechanism
from ..model import Model
from .rows import Row, spread
from .straight_line import torque_function

SAMPLES = 4096
TOLERANCE = 1e-9


class Timer:
    """The C timing loops, built once."""

    def __init__(self) -> None:
        source = files(__package__) / "timer.c"
        library = Path(tempfile.mkdtemp(prefix="condyle-bench-")) / "timer.so"
        find_compiler().build(Path(str(source)), library)
        self.library = ctypes.CDLL(str(library))
        for name in ("time_one", "time_batch", "time_casadi", "clock_rate"):
            getattr(self.library, name).restype = ctypes.c_double

    def clock_rate(self) -> float:
        """Cycles a second, measured: the best of a few runs."""
        return max(self.library.clock_rate(ctypes.c_long(30_000_000)) for _ in range(5))


def reachable_samples(model: Model, count: int, seed: int = 0) -> np.ndarray:
    """Random states (q, q', q'', F) that the mechanism reaches, (count, 3 m + 3)."""
    rng = np.random.default_rng(seed)
    m = model.mechanism.degrees_of_freedom
    scale = np.array([model.characteristic_length if c in "XYZ" else 1 for c in model.independent])
    found: list[np.ndarray] = []
    while sum(map(len, found)) < count:
        q, q1, q2 = (rng.uniform(-s, s, (count, m)) * scale for s in (0.05, 0.5, 5.0))
        force = rng.normal(0, 5, (count, 3))
        load = np.hstack([force, np.zeros((count, 3)), np.zeros((count, 3))])
        ok = model.torques(q, q1, q2, load)[1] == 0
        found.append(np.hstack([q, q1, q2, force])[ok])
    return np.concatenate(found)[:count]


def own_rows(
    mechanism: Mechanism, seconds: float, formulations: list[str], threads: bool
) -> Iterator[Row]:
    """Rows of one mechanism."""
    timer = Timer()
    point = np.array(mechanism.platform.points.get("right_molar", (0.01, 0.02, 0.005)))
    reference = Model(mechanism, backend="interpreted")
    m = mechanism.degrees_of_freedom
    samples = reachable_samples(reference, SAMPLES)
    load = np.hstack([samples[:, 3 * m :], np.zeros((SAMPLES, 3)), np.tile(point, (SAMPLES, 1))])
    states = [samples[:, i * m : (i + 1) * m] for i in range(3)]
    right = reference.torques(states[0], states[1], states[2], load)[0].torque
    name = mechanism.name
    for formulation in formulations:
        for outputs in ((), ("contact",)) if formulation == "virtual_power" else ((),):
            kernel = Kernel(mechanism, formulation, "core", point, outputs)
            label = f"{name} {formulation}" + (" + contact forces" if outputs else "")
            yield from _kernel_rows(label, kernel, timer, samples, right, seconds)
            if threads and not outputs and formulation == "virtual_power":
                yield _threads_row(label, kernel, samples, seconds)
    yield _interpreter_row(f"{name} interpreter", reference, states, load, seconds)
    if all(c.locus.form == "plane" for c in mechanism.contacts):
        label = f"{name} CasADi straight-line C, gcc"
        yield from _straight_rows(label, mechanism, point, timer, samples, right, seconds)


def _kernel_rows(
    label: str,
    kernel: Kernel,
    timer: Timer,
    samples: np.ndarray,
    right: np.ndarray,
    seconds: float,
) -> Iterator[Row]:
    one, batch, table = (ctypes.c_void_p(a) for a in kernel.address)
    packed = np.ascontiguousarray(samples)
    columns = np.asfortranarray(samples)
    out = np.empty(64 * len(samples))
    got = np.array([kernel.one(s) for s in samples[:256]])[:, : right.shape[1]]
    # Lanes stand family by family in what C returns.
    wrong = _error(kernel.in_order(got), right[:256])
    for dependent, what in ((0, "one"), (1, "one, dependent")):
        run = partial(
            timer.library.time_one,
            one,
            table,
            _at(packed),
            len(packed),
            packed.shape[1],
            _at(out),
            dependent,
        )
        yield Row(f"{label}: {what}", *_timed(run, seconds), wrong, kernel.facts["operations"])
    pointers = (ctypes.c_void_p * columns.shape[1])(
        *(columns[:, j].ctypes.data for j in range(columns.shape[1]))
    )
    status = np.empty(len(samples), dtype=np.uint8)
    wrong = _error(kernel.in_order(kernel.run(columns)[0]["torque"]), right)
    run = partial(
        timer.library.time_batch,
        batch,
        table,
        pointers,
        ctypes.c_size_t(len(samples)),
        _at(out),
        _at(status),
    )
    yield Row(f"{label}: batch", *_timed(run, seconds), wrong, kernel.facts["operations"])


def _threads_row(label: str, kernel: Kernel, samples: np.ndarray, seconds: float) -> Row:
    """Two threads over one, by the same call from Python on many samples."""
    many = np.asfortranarray(np.tile(samples, (64, 1)))

    def run(threads: int) -> float:
        start = time.perf_counter()
        kernel.run(many, threads=threads)
        return (time.perf_counter() - start) / len(many)

    one, two = (_timed(partial(run, t), seconds) for t in (1, 2))
    row = Row(f"{label}: batch, two threads", *two, 0.0, kernel.facts["operations"])
    row.note = f"{one[0] / two[0]:.2f} x one thread ({one[0] * 1e9:.1f} ns)"
    return row


def _interpreter_row(
    label: str, model: Model, states: list[np.ndarray], load: np.ndarray, seconds: float
) -> Row:
    def run() -> float:
        start = time.perf_counter()
        model.torques(states[0], states[1], states[2], load)
        return (time.perf_counter() - start) / len(load)

    return Row(f"{label}: batch", *_timed(run, seconds), 0.0, None)


def _straight_rows(
    label: str,
    mechanism: Mechanism,
    point: np.ndarray,
    timer: Timer,
    samples: np.ndarray,
    right: np.ndarray,
    seconds: float,
) -> Iterator[Row]:
    function = torque_function(mechanism, "virtual_power", point)
    folder = Path(tempfile.mkdtemp(prefix="condyle-bench-"))
    (folder / "straight.c").write_text(_generated(function), encoding="utf-8")
    library = folder / "straight.so"
    find_compiler().build(folder / "straight.c", library)
    call = ctypes.CDLL(str(library)).straight_line
    size_w, size_iw = function.sz_w(), function.sz_iw()
    w, iw = np.empty(size_w + 1), np.empty(size_iw + 1, dtype=np.int64)
    packed, out = np.ascontiguousarray(samples), np.empty(16)
    got = np.asarray(function(samples[:256].T).full()).T
    for dependent, what in ((0, "one"), (1, "one, dependent")):
        run = partial(
            timer.library.time_casadi,
            call,
            _at(packed),
            len(packed),
            packed.shape[1],
            _at(out),
            _at(iw),
            _at(w),
            dependent,
        )
        yield Row(f"{label}: {what}", *_timed(run, seconds), _error(got, right[:256]), None)


def _generated(function) -> str:
    import casadi as ca

    generator = ca.CodeGenerator("straight", {"with_header": False})
    generator.add(function)
    return generator.dump()


def ready_rows(mechanism: str) -> Iterator[Row]:
    """Seconds from file to ready kernel in a fresh process, import included: cold and cached."""
    program = (
        "import time; t = time.perf_counter()\n"
        "import numpy as np, condyle\n"
        "from condyle.kernels.compiled import Kernel\n"
        f"m = condyle.load({mechanism!r})\n"
        "k = Kernel(m, 'virtual_power', 'core', np.array([0.01, 0.02, 0.005]))\n"
        "k.one(np.zeros(k.inputs))\n"
        "print(time.perf_counter() - t)\n"
    )
    with tempfile.TemporaryDirectory(prefix="condyle-bench-") as cache:
        times: list[float] = []
        for _ in range(6):
            done = subprocess.run(
                [sys.executable, "-c", program],
                env=_environment(CONDYLE_CACHE=cache),
                capture_output=True,
                text=True,
                check=True,
            )
            times.append(float(done.stdout.split()[-1]))
    yield Row(f"{mechanism}: file to ready kernel, cold", times[0], 0.0, 0.0, None)
    yield Row(f"{mechanism}: file to ready kernel, cached", *spread(times[1:]), 0.0, None)


def _environment(**extra: str) -> dict[str, str]:
    import os

    return {**os.environ, **extra}


def _timed(run: Callable[[], float], seconds: float) -> tuple[float, float]:
    """Median and spread of repeats for about so many seconds."""
    run()
    times: list[float] = []
    end = time.perf_counter() + seconds
    while len(times) < 5 or time.perf_counter() < end:
        times.append(run())
    return spread(times)


def _error(got: np.ndarray, right: np.ndarray) -> float:
    return float(np.abs(got - right).max() / np.abs(right).max())


def _at(a: np.ndarray) -> ctypes.c_void_p:
    return ctypes.c_void_p(a.ctypes.data)
