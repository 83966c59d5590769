"""Hostile ticks for an exported controller: clocks, sensors, inputs and wishes at random.

    python -m benchmarks.hostile 1e7

compiles it with the sanitizers of addresses and of undefined behaviour, and counts what must not
be: efforts that are not finite, beyond limits, or beyond rates, and states that are none. With 32
bits:

    python -m benchmarks.hostile 1e6 --cc "gcc -m32"
    python -m benchmarks.hostile 1e6 --cc arm-linux-gnueabihf-gcc --sanitize undefined \\
        --runner "qemu-arm -L /usr/arm-linux-gnueabihf"
"""

from __future__ import annotations

import argparse
import shlex
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import condyle
from condyle.export.controller import controller_source
from condyle.export.syntax import filled, literal

SCENARIO = {
    "duration": 0.1,
    "controller": {
        "kind": "bite_force", "stiffness": 900.0, "force": 60.0,
        "distribution": "bounded", "effort_rate": 40.0,
    },
    "sensors": {"encoder_noise": 1e-4},
    "observer": {"kind": "kalman"},
}  # fmt: skip


@dataclass(frozen=True)
class Counts:
    """What was seen. edges: (5, 5), ticks from a state to a state."""

    ticks: int
    not_finite: int
    beyond_limits: int
    beyond_rates: int
    no_state: int
    edges: np.ndarray

    @property
    def bad(self) -> int:
        return self.not_finite + self.beyond_limits + self.beyond_rates + self.no_state


def hostile_ticks(
    ticks: int,
    folder: Path,
    seed: int = 0,
    *,
    cc: str = "gcc",
    sanitize: str = "address,undefined",
    runner: str = "",
) -> Counts:
    """Run them. Raises CalledProcessError where a sanitizer finds something.

    Args: cc: compiler, with options of its own;  sanitize: of `-fsanitize`, or "";
          runner: command that runs a program of another processor.
    """
    machine = condyle.load_mechanism("masticatory")
    weak = {f"chain.{name}.actuator.torque_limit": 0.3 for name in machine.chain_names}
    source = controller_source(machine.set(weak), SCENARIO, None)
    prefix, plan, drive = source.exported.prefix, source.plan, source.drive
    assert drive.period is not None
    rows = {"low": plan.low, "high": plan.high}
    rows["step"] = np.ravel(drive.numbers["effort_rate"]) * drive.period
    words = {k: ", ".join(literal(float(x), "double") for x in row) for k, row in rows.items()}
    words |= {"prefix": prefix, "PREFIX": prefix.upper()}
    template = (Path(__file__).parent / "hostile.c").read_text(encoding="utf-8")
    for name, text in {**source.texts, "hostile.c": filled(template, words)}.items():
        (folder / name).write_text(text, encoding="utf-8")
    files = (f"{prefix}.c", f"{prefix}_controller.c", "hostile.c")
    strict = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-O1"]
    if sanitize:
        strict += [f"-fsanitize={sanitize}", "-fno-sanitize-recover=all"]
    build = [*shlex.split(cc), *strict, *files, "-o", "hostile", "-lm"]
    subprocess.run(build, cwd=folder, check=True)
    call = [*shlex.split(runner), str(folder / "hostile"), str(ticks), str(seed)]
    done = subprocess.run(call, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode not in (0, 1) or "rror" in done.stderr:
        raise subprocess.CalledProcessError(done.returncode, call, done.stdout, done.stderr)
    first, *rest = done.stdout.splitlines()
    edges = np.array([[int(x) for x in line.split()] for line in rest])
    return Counts(*(int(x) for x in first.split()), edges)


def main() -> int:
    parser = argparse.ArgumentParser(description="Hostile ticks for an exported controller.")
    parser.add_argument("ticks", nargs="?", type=float, default=1e7)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--cc", default="gcc", help="compiler, with options of its own")
    parser.add_argument("--sanitize", default="address,undefined", help='of -fsanitize, or ""')
    parser.add_argument("--runner", default="", help="runs a program of another processor")
    own = vars(parser.parse_args())
    ticks = int(own.pop("ticks"))
    with tempfile.TemporaryDirectory() as place:
        counts = hostile_ticks(ticks, Path(place), **own)
    print(counts)
    return int(counts.bad != 0)


if __name__ == "__main__":
    sys.exit(main())
