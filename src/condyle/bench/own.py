"""Our own rows: kernels of every formulation, the interpreter, and CasADi's straight-line C."""

from __future__ import annotations

import ctypes
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from functools import partial
from importlib.resources import files
from pathlib import Path

import casadi as ca
import numpy as np

from ..backends.compiler import find_compiler
from ..dynamics.equations import has_closed_form
from ..kernels.compiled import Kernel
from ..mechanism.mechanism import Mechanism
from ..model import Model
from .rows import Probe, Row, spread
from .straight_line import torque_function

SAMPLES = 1000  # in a cache, and no power of two, which columns would have to share places for
INTERPRETED = 256  # samples a call of the interpreter


class Timer:
    """The C timing loops, built once."""

    def __init__(self) -> None:
        source = files(__package__) / "timer.c"
        library = Path(tempfile.mkdtemp(prefix="condyle-bench-")) / "timer.so"
        find_compiler().build(Path(str(source)), library)
        self.library = ctypes.CDLL(str(library))
        for name in ("time_one", "time_batch", "time_casadi", "clock_rate", "vector_operation"):
            getattr(self.library, name).restype = ctypes.c_double

    def clock_rate(self) -> float:
        """Cycles a second, measured: the best of a few runs."""
        return max(self.library.clock_rate(ctypes.c_long(3_000_000)) for _ in range(3))

    def vector_operation(self) -> float:
        """Seconds a fused multiply-add of vectors takes while they are busy: the best of a few."""
        return min(self.library.vector_operation(ctypes.c_long(1_200_000)) for _ in range(3))


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


def own_probes(mechanism: Mechanism, formulations: list[str]) -> Iterator[Probe]:
    """What is timed of one mechanism."""
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
        label = f"{name} {formulation}"
        variants: list[tuple[str, str, tuple[str, ...]]] = [("", "core", ())]
        if formulation == "virtual_power":
            variants.append((" + contact forces", "core", ("contact",)))
        elif has_closed_form(mechanism):
            variants.append((", direct", "direct", ()))
        for what, route, outputs in variants:
            kernel = Kernel(mechanism, formulation, route, point, outputs)
            yield from _kernel_probes(label + what, kernel, timer, samples, right)
    q, q1, q2, wrench = (a[:INTERPRETED] for a in (*states, load))
    yield _python_probe(
        f"{name} interpreter: batch", lambda: reference.torques(q, q1, q2, wrench), INTERPRETED
    )
    if all(c.locus.form == "plane" for c in mechanism.contacts):
        label = f"{name} CasADi straight-line C, gcc"
        yield from _straight_probes(label, mechanism, point, timer, samples, right)


def _kernel_probes(
    label: str, kernel: Kernel, timer: Timer, samples: np.ndarray, right: np.ndarray
) -> Iterator[Probe]:
    packed, columns = np.ascontiguousarray(samples), np.asfortranarray(samples)
    out, status = np.empty(64 * len(samples)), np.empty(len(samples), dtype=np.uint8)
    got = np.array([kernel.one(s) for s in samples[:256]])[:, : right.shape[1]]
    # Lanes stand family by family in what C returns.
    wrong = _error(kernel.in_order(got), right[:256])
    operations = kernel.facts["operations"]
    for dependent, what in ((0, "one"), (1, "one, dependent")):

        def run(dependent: int = dependent) -> float:
            one, _, table = _addresses(kernel)
            return timer.library.time_one(
                one, table, _at(packed), len(packed), packed.shape[1], _at(out), dependent
            )

        yield Probe(f"{label}: {what}", run, wrong, operations)
    pointers = (ctypes.c_void_p * columns.shape[1])(
        *(columns[:, j].ctypes.data for j in range(columns.shape[1]))
    )

    def blocks() -> float:
        _, batch, table = _addresses(kernel)
        return timer.library.time_batch(
            batch, table, pointers, ctypes.c_size_t(len(columns)), _at(out), _at(status)
        )

    wrong = _error(kernel.in_order(kernel.run(columns)[0]["torque"]), right)
    yield Probe(f"{label}: batch", blocks, wrong, operations)


def _addresses(kernel: Kernel) -> list[ctypes.c_void_p]:
    """Of `one`, `batch` and the table, while the kernel that owns them is there."""
    return [ctypes.c_void_p(address) for address in kernel.address]


def thread_probes(mechanism: Mechanism) -> Iterator[Probe]:
    """One thread and two, by the same call from Python on many samples."""
    kernel = Kernel(mechanism, "virtual_power", "core", np.array([0.01, 0.02, 0.005]))
    samples = reachable_samples(Model(mechanism, backend="interpreted"), SAMPLES)
    many = np.asfortranarray(np.tile(samples, (200, 1)))
    label = f"{mechanism.name} virtual_power: batch"
    for threads, what in ((1, "one thread"), (2, "two threads")):
        yield _python_probe(
            f"{label}, {what}", partial(kernel.run, many, threads=threads), len(many)
        )


def _python_probe(name: str, call: Callable[[], object], count: int) -> Probe:
    """A call from Python that evaluates `count` samples, all of them right by definition."""

    def run() -> float:
        start = time.perf_counter()
        found = call()
        elapsed = time.perf_counter() - start
        del found  # freeing it is not what is timed
        return elapsed / count

    return Probe(name, run, 0.0)


def _straight_probes(
    label: str,
    mechanism: Mechanism,
    point: np.ndarray,
    timer: Timer,
    samples: np.ndarray,
    right: np.ndarray,
) -> Iterator[Probe]:
    function = torque_function(mechanism, "virtual_power", point)
    folder = Path(tempfile.mkdtemp(prefix="condyle-bench-"))
    (folder / "straight.c").write_text(_generated(function), encoding="utf-8")
    library = folder / "straight.so"
    find_compiler().build(folder / "straight.c", library)
    call = ctypes.CDLL(str(library)).straight_line
    w, iw = np.empty(function.sz_w() + 1), np.empty(function.sz_iw() + 1, dtype=np.int64)
    packed, out = np.ascontiguousarray(samples), np.empty(16)
    got = np.asarray(function(samples[:256].T).full()).T
    for dependent, what in ((0, "one"), (1, "one, dependent")):

        def run(dependent: int = dependent) -> float:
            return timer.library.time_casadi(
                call,
                _at(packed),
                len(packed),
                packed.shape[1],
                _at(out),
                _at(iw),
                _at(w),
                dependent,
            )

        yield Probe(f"{label}: {what}", run, _error(got, right[:256]))


def _generated(function: ca.Function) -> str:
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
                env={**os.environ, "CONDYLE_CACHE": cache},
                capture_output=True,
                text=True,
                check=True,
            )
            times.append(float(done.stdout.split()[-1]))
    yield Row(f"{mechanism}: file to ready kernel, cold", times[0], 0.0, 0.0, None)
    yield Row(f"{mechanism}: file to ready kernel, cached", *spread(times[1:]), 0.0, None)


def _error(got: np.ndarray, right: np.ndarray) -> float:
    return float(np.abs(got - right).max() / np.abs(right).max())


def _at(a: np.ndarray) -> ctypes.c_void_p:
    return ctypes.c_void_p(a.ctypes.data)
