"""One run of the benchmark: rows, ratios, and the facts they depend on."""

from __future__ import annotations

import os
import platform
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from condyle import __version__
from condyle.backends.compiler import find_compiler
from condyle.dynamics import FORMULATIONS
from condyle.mechanism import bundled_text, load_mechanism
from condyle.model.model import Model
from condyle.progress import step

from . import peers
from .device import device_probes
from .distributions import distribution_probes
from .exported import PORTABLE, WIDE, exported_probes
from .motion import SECOND, motion_rows
from .own import (
    BOUNDED,
    EVERYTHING,
    FORWARD,
    FRICTION,
    LEAST_NORM,
    MAP,
    SOLVE,
    WRITTEN,
    Timer,
    asked_probes,
    jaw_probes,
    limit_probes,
    map_probes,
    own_probes,
    policy_probes,
    reachable_samples,
    ready_rows,
    thread_probes,
)
from .peers import closed_loops
from .programs import BINDING
from .rows import Probe, Row, timed
from .simulating import LOOP, simulation_probes
from .slopes import slope_probes, slope_ratios
from .sweeps import ALL, sweep_ratios, sweep_rows

REFERENCE = "masticatory"
CYCLE = "one cycle of the clock"
OPERATION = "one operation on vectors at best"
ROUNDS = 40  # in which each row has about a second, other engines' included
OTHERS = ("masticatory-curved", "gough-stewart", "hexaglide")


@dataclass(frozen=True)
class Benchmark:
    """Results of a run.

    ratios: name -> value, the bars of the project.
    facts:  machine, versions, compiler, flags, clock, floor.
    """

    rows: list[Row]
    ratios: dict[str, float]
    facts: dict[str, Any]
    unavailable: dict[str, str]

    def data(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "rows": [{k: v for k, v in asdict(row).items() if k != "times"} for row in self.rows],
            "ratios": self.ratios,
            "facts": self.facts,
            "unavailable": self.unavailable,
        }

    def __str__(self) -> str:
        width = max(len(row.name) for row in self.rows)
        lines = [f"{'':<{width}}  {'median':>12}  {'spread':>7}  {'error':>8}"]
        for r in self.rows:
            wide = f"{r.spread / r.seconds:.0%}" if r.seconds else ""
            numbers = f"{_time(r.seconds):>12}  {wide:>7}  {r.error:8.1e}"
            lines.append(f"{r.name:<{width}}  {numbers}  {r.note}")
        lines += ["", *(f"{name}: {value:.3g}" for name, value in self.ratios.items())]
        lines += [f"not run: {name} ({why})" for name, why in self.unavailable.items()]
        f = self.facts
        lines.append(
            f"{f['processor']}, {f['clock'] / 1e9:.2f} GHz measured, {f['lanes']} lanes; "
            f"condyle {f['versions']['condyle']}, {f['compiler']} {' '.join(f['flags'])}"
        )
        return "\n".join(lines)


def run_benchmark(seconds: float = 1.0) -> Benchmark:
    """Measure everything, on one core but for what is about two; takes some minutes.

    Everything is timed in turn, round after round, and ratios are taken within rounds: a machine
    that others slow down for a while still gives fair ones.

    Args: seconds: about how long each row is timed.
    """
    rounds = max(5, round(seconds * ROUNDS))
    unavailable: dict[str, str] = {}
    timer = Timer()
    probes = [Probe(CYCLE, lambda: 1 / timer.clock_rate(), 0.0)]
    with _one_core() as processors:
        with step("building kernels"):
            probes += own_probes(load_mechanism(REFERENCE), list(FORMULATIONS))
            for name in OTHERS:
                probes += own_probes(load_mechanism(name), ["virtual_power"])
        with step("building other engines"):
            probes += _peer_probes(unavailable)
        probes += [*asked_probes(load_mechanism(REFERENCE)), *map_probes(load_mechanism(REFERENCE))]
        probes += slope_probes(load_mechanism(REFERENCE), timer, unavailable)
        with step("building exported C"):
            probes += exported_probes(load_mechanism(REFERENCE))
        probes += [
            *policy_probes(load_mechanism(REFERENCE)),
            *jaw_probes(load_mechanism("human-jaw")),
        ]
        with step("solving every distribution"):
            probes += distribution_probes()
        probes += limit_probes(load_mechanism(REFERENCE), load_mechanism("human-jaw"), unavailable)
        probes += simulation_probes(load_mechanism(REFERENCE))
        try:
            probes += device_probes(Model(REFERENCE, backend="numpy"))
        except Exception as error:  # of CuPy's own kinds, where there is no device
            unavailable["CUDA"] = str(error).partition("\n")[0]
        probes.append(Probe(OPERATION, timer.vector_operation, 0.0))
        rows = _timed(probes, rounds)
        with step("swinging for a second"):
            rows += motion_rows(REFERENCE, closed_loops, unavailable)
        with step("starting afresh"):
            rows += ready_rows(REFERENCE)
    if processors > 1:
        rows += _timed(list(thread_probes(load_mechanism(REFERENCE))), rounds)
        with step("solving studies"):
            rows += sweep_rows()
    compiler = find_compiler()
    facts = {
        "processor": _processor(),
        "clock": 1 / rows[0].seconds,
        "lanes": compiler.lanes,
        "compiler": compiler.command[0],
        "flags": list(compiler.flags),
        "rounds": rounds,
        "python": platform.python_version(),
        "versions": {"condyle": __version__, **{p: version(p) for p in ("casadi", "numpy")}},
    }
    return Benchmark(rows, _ratios(rows, compiler.lanes), facts, unavailable)


@contextmanager
def _one_core() -> Iterator[int]:
    """Keeps this process on one processor; yields how many it had."""
    if not hasattr(os, "sched_getaffinity"):
        yield os.cpu_count() or 1
        return
    processors = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {max(processors)})
    try:
        yield len(processors)
    finally:
        os.sched_setaffinity(0, processors)


def _timed(probes: list[Probe], rounds: int) -> list[Row]:
    """Rows in the order of the probes, which are timed in the order of `_heat`."""
    ordered = sorted(probes, key=_heat)
    with step("timing", rounds) as advance:
        rows = list(timed(ordered, rounds, lambda number: advance(min(number, 1))))
    names = [probe.name for probe in probes]
    return sorted(rows, key=lambda row: names.index(row.name))


def _heat(probe: Probe) -> int:
    """Processors slow down for a while after wide vectors were busy: what keeps them so is last."""
    if probe.name == OPERATION:
        return 3
    if "batch" in probe.name and "numpy" not in probe.name:
        return 2
    return 0 if probe.name == CYCLE or probe.name.startswith("peer") else 1


def _peer_probes(unavailable: dict[str, str]) -> Iterator[Probe]:
    """The other engines that can be had."""
    raw = tomllib.loads(bundled_text(REFERENCE))
    mechanism = load_mechanism(REFERENCE)
    model = Model(mechanism, backend="numpy")
    m = mechanism.degrees_of_freedom
    samples = reachable_samples(model, 64)
    q, q1, q2 = (np.ascontiguousarray(samples[:, i * m : (i + 1) * m]) for i in range(3))
    force = np.ascontiguousarray(samples[:, 3 * m :])
    wrench = np.hstack([force, np.zeros((64, 3))])
    right = model.inverse_dynamics(q, q1, q2, wrench, "right_molar").effort
    for name, make in peers.PEERS.items():
        peer = make()
        able, why = peer.available()
        if not able:
            unavailable[name] = why
            continue
        try:
            peer.prepare(raw, Path(__file__).parent / "peers" / "build")
            error = float(np.abs(peer.solve(q, q1, q2, force) - right).max() / np.abs(right).max())
        except (peers.PeerError, OSError) as problem:
            unavailable[name] = str(problem).splitlines()[0]
            continue

        def run(peer: Any = peer) -> float:
            return median(peer.time_one(q, q1, q2, force, 0.0))

        note = f"ready in {peer.facts['prepare_seconds']:.1f} s"
        yield Probe(f"peer {name}: one", run, error, None, note)


def _ratios(rows: list[Row], lanes: int) -> dict[str, float]:
    """The bars, from rows of this run."""
    by_name = {row.name: row for row in rows}
    own, curved = f"{REFERENCE} virtual_power", "masticatory-curved virtual_power"
    one, batch = by_name[f"{own}: one"], by_name[f"{own}: batch"]
    ratios: dict[str, float] = {}
    # The cut tree is the problem as it stands; the free couplers leave half of it to hand-written
    # code, and are the quickest way to use Pinocchio that we know.
    for tree, what in (("tree", "the cut tree"), ("free", "free couplers, the rest by hand")):
        cpp = [row for name, row in by_name.items() if name.startswith(f"peer pinocchio-{tree}")]
        if cpp:
            best = min(cpp, key=lambda row: row.seconds)
            ratios[f"one evaluation, times faster than Pinocchio C++ ({what})"] = best.over(one)
            ratios[f"batch, times faster than Pinocchio C++ ({what})"] = best.over(batch)
    straight = by_name[f"{REFERENCE} CasADi straight-line C, gcc: one"]
    ratios["one evaluation, times faster than straight-line C"] = straight.over(one)
    assert batch.operations is not None
    cycles = batch.operations / (2 * lanes)
    ratios["floor of the batch [ns a sample]"] = cycles * by_name[CYCLE].seconds * 1e9
    ratios["batch over its floor"] = batch.over(by_name[CYCLE]) / cycles
    # Processors slow down while wide vectors are busy.
    ratios["batch over as many fused multiply-adds"] = batch.over(by_name[OPERATION]) / (2 * cycles)
    for what, row in (("one evaluation", one), ("batch", batch)):
        shape = row.name.rsplit(": ", 1)[1]
        forward = by_name[f"{REFERENCE} {FORWARD}: {shape}"]
        ratios[f"{what}, forward over inverse dynamics"] = forward.over(row)
        with_forces = by_name[f"{own} + contact forces: {shape}"]
        ratios[f"{what} with contact forces over without"] = with_forces.over(row)
        ratios[f"{what}, curved over planar"] = by_name[f"{curved}: {shape}"].over(row)
        for formulation in ("momentum", "lagrange"):
            slower = by_name[f"{REFERENCE} {formulation}: {shape}"]
            ratios[f"{what}, {formulation} over virtual_power"] = slower.over(row)
    for formulation in ("momentum", "lagrange"):
        routes = (by_name[f"{REFERENCE} {formulation}{r}: one"] for r in (", direct", ""))
        ratios[f"one evaluation, {formulation}, direct over core"] = next(routes).over(next(routes))
    swings = [row for row in rows if SECOND in row.name]
    ours = next((row for row in swings if not row.name.startswith("peer")), None)
    for engine in ("mujoco", "pinocchio"):
        theirs = [row for row in swings if row.name.startswith(f"peer {engine}")]
        if ours and theirs and ours.error <= min(row.error for row in theirs):
            least_time = min(row.seconds for row in theirs)
            ratios[f"{SECOND}, times faster than {engine}, and nearer"] = least_time / ours.seconds
    for what in (WIDE, PORTABLE):
        ratios[f"one evaluation, {what} over the kernel"] = by_name[f"{REFERENCE} {what}"].over(one)
    least = by_name[f"{REFERENCE}: {LEAST_NORM}"]
    for what, name in (("bounded", BOUNDED), ("friction at two contacts", FRICTION)):
        ratios[f"{what} over least norm"] = by_name[f"{REFERENCE}: {name}"].over(least)
    for label in (REFERENCE, "human-jaw"):
        limited = by_name[f"{label}: {BINDING}"]
        for solver in ("DAQP", "quadprog", "HiGHS", "OSQP"):
            if other := by_name.get(f"{limited.name}, {solver}"):
                ratios[f"{label}, bounded, times faster than {solver}"] = other.over(limited)
    asked, everything = by_name[f"{REFERENCE}: efforts"], by_name[f"{REFERENCE}: {EVERYTHING}"]
    ratios[f"{EVERYTHING} over efforts alone"] = everything.over(asked)
    ratios[f"{EVERYTHING} over {WRITTEN}"] = everything.over(by_name[f"{REFERENCE}: {WRITTEN}"])
    ratios[f"{SOLVE} over efforts alone"] = by_name[f"{REFERENCE}: {SOLVE}"].over(asked)
    loop = by_name[f"{REFERENCE}: {LOOP}"]
    ratios["control at 1 kHz, plant at 10 kHz, times real time"] = 1 / loop.seconds
    for size in ("100", "5000"):
        few = [by_name.get(f"{own}: batch of {size}, {t}") for t in ("one thread", "two threads")]
        if few[0] and few[1]:
            ratios[f"two threads over one, {size} samples"] = few[1].over(few[0])
    mapped = by_name[f"{REFERENCE}: {MAP}"].seconds
    ratios["map of 1e6 poses, reach and ratio, one core [s]"] = 1e6 * mapped
    threads = [by_name.get(f"{own}: batch, {what}") for what in ("one thread", "two threads")]
    if threads[0] and threads[1]:
        ratios["two threads, times faster than one"] = threads[0].over(threads[1])
    ratios |= slope_ratios(REFERENCE, by_name)
    ratios |= sweep_ratios(by_name) if ALL in by_name else {}
    ready = f"{REFERENCE}: file to ready kernel"
    ratios["file to ready kernel, cold [s]"] = by_name[f"{ready}, cold"].seconds
    ratios["file to ready kernel, cached [s]"] = by_name[f"{ready}, cached"].seconds
    return ratios


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        return next(line.split(":", 1)[1].strip() for line in lines if "model name" in line)
    except (OSError, StopIteration):
        return platform.processor() or platform.machine()


def _time(seconds: float) -> str:
    for unit, scale in (("s", 1.0), ("ms", 1e3), ("us", 1e6)):
        if seconds * scale >= 1:
            return f"{seconds * scale:.3g} {unit}"
    return f"{seconds * 1e9:.1f} ns"


__all__ = ["Benchmark", "run_benchmark"]
