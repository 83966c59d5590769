"""Exported C in a periodic loop: how late the machine is, and what a tick takes.

The loop that does nothing says what is the machine's; the difference is the controller's.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from condyle.backends.compiler import find_compiler
from condyle.errors import UnsupportedError
from condyle.export import export
from condyle.mechanism.mechanism import Mechanism
from condyle.progress import step

from .exported import call

RATES = (1_000, 5_000, 10_000, 20_000)  # Hz
FIRST_BIN = 256  # ns
HEAD = (
    *("rate", "work", "ticks", "half within", "99.9 % within", "latest"),
    *("mean tick", "longest", "missed"),
)


@dataclass(frozen=True)
class Loop:
    """One loop. Times in seconds.

    late:    the latest wake-up;  longest, mean: of a tick's work.
    missed:  ticks whose time had passed before the one before was done.
    histogram: ticks that woke up late by at most 256 ns, 512 ns, 1024 ns ...
    fifo:    whether the system let it run with SCHED_FIFO.
    """

    rate: int
    work: bool
    ticks: int
    late: float
    longest: float
    mean: float
    missed: int
    histogram: tuple[int, ...]
    fifo: bool

    def within(self, share: float) -> float:
        """What that share of the ticks woke up within, from the histogram [s]."""
        total = 0
        for i, count in enumerate(self.histogram):
            total += count
            if total >= share * sum(self.histogram):
                return min(FIRST_BIN * 2**i * 1e-9, self.late)
        return self.late


@dataclass(frozen=True)
class RealTime:
    """Loops at every rate, empty and with the efforts of one mechanism."""

    mechanism: str
    loops: list[Loop]

    def data(self) -> dict[str, Any]:
        """For JSON."""
        return {"mechanism": self.mechanism, "loops": [asdict(loop) for loop in self.loops]}

    def __str__(self) -> str:
        rows: list[tuple[str, ...]] = [HEAD]
        for loop in self.loops:
            work = f"{self.mechanism} inverse" if loop.work else "nothing"
            times = (loop.within(0.5), loop.within(0.999), loop.late, loop.mean, loop.longest)
            texts = [f"{1e6 * t:.1f} us" for t in times]
            rows.append((f"{loop.rate} Hz", work, str(loop.ticks), *texts, str(loop.missed)))
        widths = [max(len(row[i]) for row in rows) for i in range(len(HEAD))]
        lines = ["  ".join(f"{c:>{w}}" for c, w in zip(row, widths, strict=True)) for row in rows]
        how = (
            "SCHED_FIFO" if all(loop.fifo for loop in self.loops) else "no SCHED_FIFO: not allowed"
        )
        return "\n".join([*lines, f"{how}; times of waking up count from when a tick is due"])


def real_time(mechanism: Mechanism, seconds: float = 1.0) -> RealTime:
    """Run every loop for so long.

    Raises: UnsupportedError: on systems without clock_nanosleep.
    """
    if not sys.platform.startswith("linux"):
        raise UnsupportedError("real-time loops need Linux's clock_nanosleep")
    compiler = find_compiler()
    made = export(mechanism, ("inverse",), lanes=compiler.lanes)
    loops = []
    with tempfile.TemporaryDirectory(prefix="condyle-bench-") as place:
        folder = Path(place)
        (folder / f"{made.prefix}.c").write_text(made.source, encoding="utf-8")
        for name in (f"{made.prefix}.h", "exported.h"):
            (folder / name).write_text(made.header, encoding="utf-8")
        macros = {
            "CHAINS": len(mechanism.chains),
            "INPUTS": sum(a.size for a in made["inverse"].inputs),
            "CALL(in, out)": call(made),
            f"{made.prefix.upper()}_VECTOR": 1,
        }
        flags = [flag for flag in compiler.flags if flag not in ("-shared", "-fPIC")]
        sources = [str(Path(__file__).with_name("realtime.c")), f"{made.prefix}.c"]
        program = [*compiler.command, *flags, *(f"-D{k}={v}" for k, v in macros.items())]
        with step("building the loop"):
            _run([*program, f"-I{folder}", *sources, "-o", "loop", "-lm"], folder)
        with step("looping", 2 * len(RATES)) as advance:
            for rate in RATES:
                for work in (False, True):
                    told = _run(["./loop", str(rate), str(seconds), str(int(work))], folder)
                    loops.append(_loop(rate, work, told))
                    advance(1)
    return RealTime(mechanism.name, loops)


def _loop(rate: int, work: bool, told: str) -> Loop:
    numbers = {name: int(value) for name, value in (line.split() for line in told.splitlines())}
    bins = tuple(numbers[f"bin{i}"] for i in range(sum(n.startswith("bin") for n in numbers)))
    late, longest, mean = (1e-9 * numbers[name] for name in ("latest", "longest", "mean"))
    ticks, missed = sum(bins), numbers["missed"]
    return Loop(rate, work, ticks, late, longest, mean, missed, bins, bool(numbers["fifo"]))


def _run(command: list[str], folder: Path) -> str:
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    if done.returncode:
        raise UnsupportedError(f"the loop could not be run: {done.stderr.strip()[:500]}")
    return done.stdout
