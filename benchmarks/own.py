"""Our own rows: kernels of every formulation, numpy, and CasADi's straight-line C."""

from __future__ import annotations

import ctypes
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import casadi as ca
import numpy as np

from condyle.analysis.map import workspace_map
from condyle.backends.c.compiled_kernel import CompiledKernel
from condyle.backends.compiler import find_compiler
from condyle.backends.kernel import Kernel
from condyle.mechanism.contact import Friction
from condyle.mechanism.mechanism import Mechanism
from condyle.model.model import Model
from condyle.motion import Motion, reference_load, reference_motion
from condyle.questions.file_numbers import numbers_of
from condyle.questions.inverse import inverse
from condyle.questions.numbers import has_closed_form, specialised
from condyle.questions.structure import structure_of

from .programs import Bites, program_probes, tight
from .rows import Probe, Row, spread
from .straight_line import torque_function

SAMPLES = 1000  # in a cache, and no power of two, which columns would have to share places for
JAW_SAMPLES = 5001  # of a motion, as people solve it
LEAST_NORM = "torques and contact forces of 5001"
BOUNDED = f"{LEAST_NORM}, within limits that are inactive"
FRICTION = f"{LEAST_NORM}, friction at two contacts"
FORWARD = "forward dynamics"
MANY = 100_000  # samples of what people call
MAPPED = 200_000
MAP = "map of reach and ratio, a pose"
EVERYTHING, WRITTEN = "all outputs", "as many numbers written to memory"
SOLVE = "solve along a landmark's path"


class Timer:
    """The C timing loops, built once."""

    def __init__(self) -> None:
        library = Path(tempfile.mkdtemp(prefix="condyle-bench-")) / "timer.so"
        find_compiler().build(library, Path(__file__).with_name("timer.c"))
        self.library = ctypes.CDLL(str(library))
        names = ("time_one", "time_batch", "time_casadi", "time_springs")
        for name in (*names, "clock_rate", "vector_operation"):
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
        wrench = np.hstack([force, np.zeros((count, 3))])
        ok = model.inverse_dynamics(q, q1, q2, wrench).status == 0
        found.append(np.hstack([q, q1, q2, force])[ok])
    return np.concatenate(found)[:count]


@dataclass(frozen=True)
class Case:
    """States and loads of a mechanism, and their efforts by numpy."""

    mechanism: Mechanism
    samples: np.ndarray
    load: np.ndarray
    point: np.ndarray
    right: np.ndarray

    @staticmethod
    def of(mechanism: Mechanism) -> Case:
        point = np.array(mechanism.platform.points.get("right_molar", (0.01, 0.02, 0.005)))
        reference = Model(mechanism, backend="numpy")
        m = mechanism.degrees_of_freedom
        samples = reachable_samples(reference, SAMPLES)
        load = np.hstack(
            [samples[:, 3 * m :], np.zeros((SAMPLES, 3)), np.tile(point, (SAMPLES, 1))]
        )
        case = Case(mechanism, samples, load, point, np.empty(0))
        return replace(case, right=reference.inverse_dynamics(*case.arguments).effort)

    @property
    def states(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        m = self.mechanism.degrees_of_freedom
        q, q1, q2 = (self.samples[:, i * m : (i + 1) * m] for i in range(3))
        return q, q1, q2

    @property
    def arguments(self) -> tuple[np.ndarray, ...]:
        """q, v, a, wrench and point, as models take them."""
        return *self.states, self.load[:, :6], self.load[:, 6:]

    @property
    def columns(self) -> np.ndarray:
        """What a kernel of inverse dynamics reads, (SAMPLES, 3 m + 9)."""
        return np.hstack([*self.states, self.load])

    def many(self, count: int) -> tuple[np.ndarray, ...]:
        """The arguments of `count` samples, as columns."""
        rows = np.arange(count) % SAMPLES
        return tuple(np.asfortranarray(a[rows]) for a in self.arguments)


def own_probes(mechanism: Mechanism, formulations: list[str]) -> Iterator[Probe]:
    """What is timed of one mechanism."""
    timer, case, name = Timer(), Case.of(mechanism), mechanism.name
    for formulation in formulations:
        label = f"{name} {formulation}"
        variants: list[tuple[str, str, tuple[str, ...]]] = [("", "core", ())]
        if formulation == "virtual_power":
            variants.append((" + contact forces", "core", ("contact",)))
        elif has_closed_form(mechanism):
            variants.append((", direct", "direct", ()))
        for what, route, outputs in variants:
            model = Model(mechanism, formulation=formulation, route=route, backend="compiled")
            kernel = model.kernel("inverse", outputs)
            found = model.inverse_dynamics(*case.arguments).effort
            yield from _kernel_probes(label + what, kernel, case.columns, case.right, found, timer)
    yield from _forward_probes(f"{name} {FORWARD}", case, timer)
    numpy = Model(mechanism, backend="numpy")
    yield python_probe(
        f"{name} numpy: batch", lambda: numpy.inverse_dynamics(*case.arguments), SAMPLES
    )
    if all(c.offset_surface.form == "plane" for c in mechanism.contacts):
        yield from _straight_probes(f"{name} CasADi straight-line C, gcc", timer, case)


def _forward_probes(label: str, case: Case, timer: Timer) -> Iterator[Probe]:
    """Accelerations and contact forces, from the efforts that inverse dynamics finds."""
    model = Model(case.mechanism, backend="compiled")
    kernel = model.kernel("forward", ("contact",))
    q, q1, q2 = case.states
    assert isinstance(kernel, CompiledKernel)
    given = np.hstack([q, q1, case.right[:, list(kernel.order)], case.load])
    found = model.forward_dynamics(q, q1, case.right, *case.arguments[3:]).acceleration
    yield from _kernel_probes(label, kernel, given, q2, found, timer)


def _kernel_probes(
    label: str,
    kernel: Kernel,
    given: np.ndarray,
    right: np.ndarray,
    found: np.ndarray,
    timer: Timer,
) -> Iterator[Probe]:
    """One kernel in C.

    Args: given: its columns;  right: its first result, (SAMPLES, size);  found: that by batches.
    """
    assert isinstance(kernel, CompiledKernel)
    packed, columns = np.ascontiguousarray(given), np.asfortranarray(given)
    out, status = np.empty(96 * SAMPLES), np.empty(SAMPLES, dtype=np.uint8)
    got = np.array([kernel.evaluate(s)[0] for s in packed[:256]])[:, : right.shape[1]]
    if kernel.interface.results[0].lanes:
        # Lanes stand family by family in what C returns.
        got = got[:, np.argsort(kernel.order)]
    wrong = _error(got, right[:256])
    operations = kernel.facts["operations"]
    for dependent, what in ((0, "one"), (1, "one, dependent")):

        def run(dependent: int = dependent) -> float:
            one, _, table = _addresses(kernel)
            return timer.library.time_one(
                one, table, _at(packed), len(packed) - 1, packed.shape[1], _at(out), dependent
            )

        yield Probe(f"{label}: {what}", run, wrong, operations)
    count = columns.shape[1]
    strides = (ctypes.c_ssize_t * count)(*[1] * count)

    def blocks() -> float:
        _, batch, table = _addresses(kernel)
        # Taken here, so that the columns stay as long as what reads them.
        pointers = (ctypes.c_void_p * count)(*(columns[:, j].ctypes.data for j in range(count)))
        return timer.library.time_batch(
            batch, table, pointers, strides, ctypes.c_size_t(SAMPLES), _at(out), _at(status)
        )

    yield Probe(f"{label}: batch", blocks, _error(found, right), operations)


def _addresses(kernel: CompiledKernel) -> list[ctypes.c_void_p]:
    """Of `one`, `batch` and the table, while the kernel that owns them is there."""
    return [ctypes.c_void_p(address) for address in kernel.address]


def thread_probes(mechanism: Mechanism) -> Iterator[Probe]:
    """One thread and two, by the same call from Python on few and on many samples."""
    model, case = Model(mechanism, backend="compiled"), Case.of(mechanism)
    label = f"{mechanism.name} virtual_power: batch"
    for count in (100, 5000, 200_000):
        given = case.many(count)
        size = "" if count == 200_000 else f" of {count}"
        for threads, what in ((1, "one thread"), (2, "two threads")):
            call = partial(model.inverse_dynamics, *given, threads=threads)
            yield python_probe(f"{label}{size}, {what}", call, count)


def asked_probes(mechanism: Mechanism) -> Iterator[Probe]:
    """What people call, from Python, on as many samples: efforts, everything, and `solve`."""
    model, case = Model(mechanism, backend="compiled"), Case.of(mechanism)
    label, given = mechanism.name, case.many(MANY)
    for what, outputs in (("efforts", ()), (EVERYTHING, "all")):
        call = partial(model.inverse_dynamics, *given, outputs=outputs)
        yield python_probe(f"{label}: {what}", call, MANY)
    size = sum(a.nbytes for a in vars(call()).values() if isinstance(a, np.ndarray)) // 8
    yield python_probe(f"{label}: {WRITTEN}", partial(np.full, size, 1.0), MANY)
    t = np.linspace(0, 5, MANY)
    chew, bite = reference_motion(), reference_load()
    path = Motion.from_arrays(chew.t, chew.value, chew.names, landmark="incisor", times=t)
    yield python_probe(f"{label}: {SOLVE}", lambda: model.solve(path, bite), MANY)


def map_probes(mechanism: Mechanism) -> Iterator[Probe]:
    """A map over two coordinates, on one core: what can be reached, and the singularity ratio."""
    model = Model(mechanism, backend="compiled")
    over = {"X": (-5e-3, 5e-3, 400), "beta": (-0.1, 0.35, MAPPED // 400)}
    call = partial(workspace_map, model, over, "ratio", threads=1)
    yield python_probe(f"{mechanism.name}: {MAP}", call, MAPPED)


def policy_probes(mechanism: Mechanism) -> Iterator[Probe]:
    """What limits and friction cost where limits are inactive, as people call it."""
    case, label = Case.of(mechanism), mechanism.name
    given = case.many(JAW_SAMPLES)
    rubbing = Friction(coefficient=0.1)
    rough = mechanism.replace(
        contacts=tuple(c.model_copy(update={"friction": rubbing}) for c in mechanism.contacts)
    )
    wide = tight(mechanism, 1e6)  # which no effort comes near
    for name, machine, policy in (
        (LEAST_NORM, mechanism, "minimum_norm"),
        (BOUNDED, wide, "bounded"),
        (FRICTION, rough, "minimum_norm"),
    ):
        model = Model(machine, backend="compiled", distribution=policy)
        outputs = ("pose",)  # with the motion, which `bounded` needs, so that all have the same
        call = partial(model.inverse_dynamics, *given, outputs=outputs, threads=1)
        yield python_probe(f"{label}: {name}", call, JAW_SAMPLES)


def limit_probes(
    mechanism: Mechanism, jaw: Mechanism, unavailable: dict[str, str]
) -> Iterator[Probe]:
    """Limits that bind at one sample in three, and bites of a jaw, beside other solvers."""
    given = Case.of(mechanism).many(JAW_SAMPLES)
    free = Model(mechanism, backend="compiled").inverse_dynamics(*given).effort
    greatest = float(np.quantile(np.abs(free).max(axis=1), 2 / 3))
    model = Model(tight(mechanism, greatest), backend="compiled", distribution="bounded")
    fits = model.inverse_dynamics(*given).status == 0
    binding = tuple(a[fits] for a in given)
    yield from program_probes(Bites(mechanism.name, model, binding), unavailable)
    model = Model(jaw, backend="compiled", distribution="bounded")
    still = np.zeros((JAW_SAMPLES, jaw.degrees_of_freedom))
    bite, at = np.zeros((JAW_SAMPLES, 6)), jaw.platform.points["right_molar"]
    bite[:, 2], point = np.linspace(0, -600, JAW_SAMPLES), np.tile(at, (JAW_SAMPLES, 1))
    yield from program_probes(
        Bites(jaw.name, model, (still, still, still, bite, point)), unavailable
    )


def jaw_probes(mechanism: Mechanism) -> Iterator[Probe]:
    """Muscles of a jaw that opens and bites, by objective."""
    for objective in ("bounded", "cubic"):
        model = Model(mechanism, backend="compiled", distribution=objective)
        t = np.linspace(0, 5, JAW_SAMPLES)[:, None]
        unit = np.array([1e-3 if name in "XYZ" else 0.03 for name in model.independent])
        turn = 2 * np.pi
        q = unit * np.sin(turn * t)
        q1, q2 = unit * turn * np.cos(turn * t), -(turn**2) * q
        bite = np.zeros((len(t), 6))
        bite[:, 2] = -100 * np.sin(turn / 2 * t[:, 0]) ** 2  # N
        call = partial(model.inverse_dynamics, q, q1, q2, bite, "right_molar", threads=1)
        assert (call().status == 0).all()
        yield python_probe(f"{mechanism.name}: {objective}", call, JAW_SAMPLES)


def python_probe(name: str, call: Callable[[], object], count: int) -> Probe:
    """A call from Python that evaluates `count` samples, all of them right by definition."""

    def run() -> float:
        start = time.perf_counter()
        found = call()
        elapsed = time.perf_counter() - start
        del found  # freeing it is not what is timed
        return elapsed / count

    return Probe(name, run, 0.0)


def _straight_probes(label: str, timer: Timer, case: Case) -> Iterator[Probe]:
    function, order = straight_line(case)
    run = straight_run(function, case.samples, timer)
    got = np.asarray(function(case.samples[:256].T).full()).T[:, np.argsort(order)]
    for dependent, what in ((0, "one"), (1, "one, dependent")):
        yield Probe(f"{label}: {what}", partial(run, dependent), _error(got, case.right[:256]))


def straight_line(case: Case) -> tuple[ca.Function, tuple[int, ...]]:
    """Efforts as CasADi computes them, of `Case.samples`, and their order."""
    structure = structure_of(case.mechanism)
    numbers = numbers_of(structure, case.mechanism)
    program = inverse(specialised(structure, numbers)).main
    return torque_function(program, numbers, case.point), numbers.order


def straight_run(
    function: ca.Function, samples: np.ndarray, timer: Timer
) -> Callable[[int], float]:
    """Builds CasADi's C of a function; what it gives runs all samples: seconds of one."""
    folder = Path(tempfile.mkdtemp(prefix="condyle-bench-"))
    (folder / "straight.c").write_text(_generated(function), encoding="utf-8")
    library = folder / "straight.so"
    find_compiler().build(library, folder / "straight.c")
    call = getattr(ctypes.CDLL(str(library)), function.name())
    w, iw = np.empty(function.sz_w() + 1), np.empty(function.sz_iw() + 1, dtype=np.int64)
    packed, out = np.ascontiguousarray(samples), np.empty(function.numel_out())
    shape = packed.shape

    def run(dependent: int = 0) -> float:
        return timer.library.time_casadi(
            call, _at(packed), *shape, _at(out), _at(iw), _at(w), dependent
        )

    return run


def _generated(function: ca.Function) -> str:
    generator = ca.CodeGenerator("straight", {"with_header": False})
    generator.add(function)
    return generator.dump()


def ready_rows(mechanism: str) -> Iterator[Row]:
    """Seconds from file to ready kernel in a fresh process, import included: cold and cached."""
    program = (
        "import time; t = time.perf_counter()\n"
        "import numpy as np, condyle\n"
        "from condyle.model.model import Model\n"
        f"k = Model(condyle.load_mechanism({mechanism!r})).kernel('inverse', ())\n"
        "k.evaluate(np.zeros(k.interface.columns))\n"
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
