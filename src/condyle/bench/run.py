"""One run of the benchmark: rows, ratios, and the facts they depend on."""

from __future__ import annotations

import importlib
import os
import platform
import sys
import tempfile
import tomllib
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from .. import __version__
from ..dynamics import FORMULATIONS
from ..kernels.compiler import find_compiler
from ..mechanism import bundled_text, load
from ..model import Model
from ..progress import step
from .own import TOLERANCE, Timer, own_rows, reachable_samples, ready_rows
from .rows import Row, spread

REFERENCE = "masticatory"
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
            "rows": [asdict(row) for row in self.rows],
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
    """Measure everything on one core; takes a minute or two.

    Args: seconds: timing, a row.
    """
    processors = os.sched_getaffinity(0) if hasattr(os, "sched_getaffinity") else set()
    rows: list[Row] = []
    unavailable: dict[str, str] = {}

    def add(found: Iterator[Row], what: str) -> None:
        with step(f"timing {what}"):
            for row in found:
                if row.error > TOLERANCE:
                    row.note = f"WRONG by {row.error:.1e}; its time means nothing"
                rows.append(row)

    if processors:
        os.sched_setaffinity(0, {max(processors)})
    try:
        add(own_rows(load(REFERENCE), seconds, list(FORMULATIONS), threads=False), REFERENCE)
        for name in OTHERS:
            add(own_rows(load(name), seconds, ["virtual_power"], threads=False), name)
        add(_peer_rows(seconds, unavailable), "other engines")
        add(ready_rows(REFERENCE), "a fresh start")
        clock = Timer().clock_rate()
    finally:
        if processors:
            os.sched_setaffinity(0, processors)
    if len(processors) > 1:
        add(_two_threads(seconds), "two threads")
    compiler = find_compiler()
    facts = {
        "processor": _processor(),
        "clock": clock,
        "lanes": compiler.lanes,
        "compiler": compiler.command[0],
        "flags": list(compiler.flags),
        "python": platform.python_version(),
        "versions": {"condyle": __version__, **{p: version(p) for p in ("casadi", "numpy")}},
    }
    return Benchmark(rows, _ratios(rows, clock, compiler.lanes), facts, unavailable)


def _two_threads(seconds: float) -> Iterator[Row]:
    from ..kernels.compiled import Kernel
    from .own import _threads_row

    mechanism = load(REFERENCE)
    kernel = Kernel(mechanism, "virtual_power", "core", np.array([0.01, 0.02, 0.005]))
    samples = reachable_samples(Model(mechanism, backend="interpreted"), 4096)
    yield _threads_row(f"{REFERENCE} virtual_power", kernel, samples, seconds)


def _peer_rows(seconds: float, unavailable: dict[str, str]) -> Iterator[Row]:
    """Rows of the other engines, where the repository's `benchmarks` is at hand."""
    sys.path.insert(0, str(Path.cwd()))
    try:
        peers = importlib.import_module("benchmarks.peers")
    except ImportError:
        unavailable["peers"] = "run from the root of the repository"
        return
    finally:
        sys.path.pop(0)
    raw = tomllib.loads(bundled_text(REFERENCE))
    mechanism = load(REFERENCE)
    model = Model(mechanism, backend="interpreted")
    m = mechanism.degrees_of_freedom
    samples = reachable_samples(model, 64)
    q, q1, q2 = (np.ascontiguousarray(samples[:, i * m : (i + 1) * m]) for i in range(3))
    force = np.ascontiguousarray(samples[:, 3 * m :])
    point = np.tile(mechanism.platform.points["right_molar"], (64, 1))
    load_ = np.hstack([force, np.zeros((64, 3)), point])
    right = model.torques(q, q1, q2, load_)[0].torque
    for name, make in peers.PEERS.items():
        peer = make()
        able, why = peer.available()
        if not able:
            unavailable[name] = why
            continue
        try:
            peer.prepare(raw, Path(tempfile.mkdtemp(prefix="condyle-peer-")))
            error = float(np.abs(peer.solve(q, q1, q2, force) - right).max() / np.abs(right).max())
            times = peer.time_one(q, q1, q2, force, seconds)
        except (peers.PeerError, OSError) as problem:
            unavailable[name] = str(problem).splitlines()[0]
            continue
        note = f"ready in {peer.facts['prepare_seconds']:.1f} s"
        yield Row(f"peer {name}: one", *spread(times), error, None, note)


def _ratios(rows: list[Row], clock: float, lanes: int) -> dict[str, float]:
    """The bars, from rows of this run."""
    by_name = {row.name: row.seconds for row in rows}
    operations = {row.name: row.operations for row in rows}
    own = f"{REFERENCE} virtual_power"
    one, batch = by_name[f"{own}: one"], by_name[f"{own}: batch"]
    ratios: dict[str, float] = {}
    # The cut tree is the problem as it stands; the free couplers leave half of it to hand-written
    # code, and are the quickest way to use Pinocchio that we know.
    for tree, what in (("tree", "the cut tree"), ("free", "free couplers, the rest by hand")):
        cpp = [t for n, t in by_name.items() if n.startswith(f"peer pinocchio-{tree}")]
        if cpp:
            ratios[f"one evaluation, times faster than Pinocchio C++ ({what})"] = min(cpp) / one
            ratios[f"batch, times faster than Pinocchio C++ ({what})"] = min(cpp) / batch
    straight = by_name[f"{REFERENCE} CasADi straight-line C, gcc: one"]
    ratios["one evaluation, times faster than straight-line C"] = straight / one
    count = operations[f"{own}: batch"]
    assert count is not None
    floor = count / (2 * clock * lanes)
    ratios["floor of the batch [ns a sample]"] = floor * 1e9
    ratios["batch over its floor"] = batch / floor
    contact = by_name[f"{own} + contact forces: one"] / one
    ratios["one evaluation with contact forces over without"] = contact
    ratios["batch with contact forces over without"] = (
        by_name[f"{own} + contact forces: batch"] / batch
    )
    curved = "masticatory-curved virtual_power"
    ratios["curved over planar, one evaluation"] = by_name[f"{curved}: one"] / one
    ratios["curved over planar, batch"] = by_name[f"{curved}: batch"] / batch
    ready = f"{REFERENCE}: file to ready kernel"
    ratios["file to ready kernel, cold [s]"] = by_name[f"{ready}, cold"]
    ratios["file to ready kernel, cached [s]"] = by_name[f"{ready}, cached"]
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
