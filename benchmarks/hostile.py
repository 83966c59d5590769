"""Hostile ticks for an exported controller: clocks, sensors, inputs and wishes at random.

    python -m benchmarks.hostile 1e7

compiles it with the sanitizers of addresses and of undefined behaviour, and counts what must not
be: efforts that are not finite, beyond limits, or beyond rates, and states that are none.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import condyle
from condyle.export.c_names import filled, literal
from condyle.export.controller import controller_source

SANITIZED = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all")
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
    ticks: int, folder: Path, seed: int = 0, cc: str = "gcc", level: str = "-O1"
) -> Counts:
    """Run them. Raises CalledProcessError where a sanitizer finds something."""
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
    strict = ("-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", level, *SANITIZED)
    subprocess.run([cc, *strict, *files, "-o", "hostile", "-lm"], cwd=folder, check=True)
    call = [str(folder / "hostile"), str(ticks), str(seed)]
    done = subprocess.run(call, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode not in (0, 1) or "rror" in done.stderr:
        raise subprocess.CalledProcessError(done.returncode, call, done.stdout, done.stderr)
    first, *rest = done.stdout.splitlines()
    edges = np.array([[int(x) for x in line.split()] for line in rest])
    return Counts(*(int(x) for x in first.split()), edges)


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as place:
        count = int(float(sys.argv[1])) if len(sys.argv) > 1 else 10**7
        print(hostile_ticks(count, Path(place)))
