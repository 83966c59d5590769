"""Loops that `check_gains` judges, against what simulation does: python -m benchmarks.loops.

    python -m benchmarks.loops [--laws bite_force,hybrid] [--observers none,kalman] [--seconds 600]

A path closes the jaw on food and stays there. 200 loops: laws x foods x delays x observers x
limits. A simulated loop is calm where in the last `LATE` of the run the force on the food is a
straight line within `CALM` of what it is, and nothing touches, leaves or breaks. Exit status 1 if
a loop that was called stable is not calm.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from collections.abc import Iterator
from itertools import product
from typing import Any

import numpy as np

import condyle

LATE, CALM, LEAST = 0.1, 0.05, 0.5  # s, share, N
FORCE = 30.0  # N
LAWS: dict[str, dict[str, Any]] = {
    "bite_force": {"stiffness": 900.0, "force": FORCE},
    "hybrid": {"stiffness": 900.0, "forces": FORCE, "directions": [[0, 0, 1]]},
    "computed_torque": {"stiffness": 2500.0},
    "joint_pd": {"stiffness": 3.0, "damping": 0.03},
    "impedance": {"stiffness": 5000.0, "damping": 60.0},
}
FOODS: dict[str, dict[str, Any]] = {
    "firm_bolus": {"stiffness": 13.75e3},
    "chow": {"stiffness": 52e3},
}
DELAYS = (0, 1, 2, 4, 6)
OBSERVERS: dict[str, dict[str, Any]] = {
    "none": {},
    "kalman": {"sensors": {"encoder_noise": 1e-4}, "observer": {"kind": "kalman"}},
}
LIMITS: dict[str, dict[str, Any]] = {"none": {}, "effort_rate": {"effort_rate": 5.0}}


def grid() -> Iterator[tuple[str, ...]]:
    """Names of law, observer, limits, food and delay, kernels that are alike one after another."""
    yield from product(LAWS, OBSERVERS, LIMITS, FOODS, map(str, DELAYS))


def path() -> condyle.Motion:
    """From 0.12 rad open to closed in 0.3 s, then at rest."""
    t = np.linspace(0.0, 0.8, 81)
    s = np.clip(t / 0.3, 0, 1)
    columns = dict.fromkeys(("X", "Y", "alpha"), 0 * t)
    shut = s**4 * (35 - 84 * s + 70 * s**2 - 20 * s**3)
    return condyle.Motion.from_arrays(t, columns | {"beta": 0.12 * (1 - shut)})


def scenario(law: str, observer: str, limits: str, food: str, delay: str) -> dict[str, Any]:
    """Of a loop by its names."""
    own = {"kind": law, "delay": int(delay), **LAWS[law], **LIMITS[limits]}
    load = {"kind": "food", "thickness": 3e-3, "break_thickness": 1e-4, **FOODS[food]}
    return {
        "duration": 0.8,
        "method": "rk4",
        "step": 2e-4,
        "start": {"on_motion": True},
        "controller": own,
        "load": [load],
        **OBSERVERS[observer],
    }


def outcome(
    model: condyle.Model, tables: dict[str, Any], motion: condyle.Motion
) -> tuple[str, float]:
    """What a simulation does: calm, broken, apart or restless; and its largest force [N]."""
    run = condyle.simulate(model, tables, motion=motion)
    force = np.linalg.norm(run["load_force"].values[:, 0], axis=1)
    events, t = run.condyle.events, run["time"].values
    peak = float(force.max())
    if events and events[-1]["ends"]:
        return "restless", peak
    if any(e["kind"] == "food_broken" for e in events):
        return "broken", peak
    late = t > tables["duration"] - LATE
    if any(e["kind"].startswith("food") and e["time"] > t[late][0] for e in events):
        return "restless", peak
    if not force[late].any():
        return "apart", peak
    line = np.polyval(np.polyfit(t[late], force[late], 1), t[late])
    off = np.abs(force[late] - line).max()
    return ("calm" if off <= max(LEAST, CALM * line.mean()) else "restless"), peak


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--laws", default=",".join(LAWS))
    parser.add_argument("--observers", default=",".join(OBSERVERS))
    parser.add_argument("--limits", default=",".join(LIMITS))
    parser.add_argument("--seconds", type=float, default=np.inf)
    given = parser.parse_args()
    wanted = [set(text.split(",")) for text in (given.laws, given.observers, given.limits)]
    model, motion, end = condyle.derive("masticatory"), path(), time.monotonic() + given.seconds
    counts: Counter[tuple[str, str]] = Counter()
    for names in grid():
        if any(name not in own for name, own in zip(names, wanted, strict=False)):
            continue
        if time.monotonic() > end:
            break
        tables = scenario(*names)
        report = condyle.check_gains(model, tables, motion=motion)
        said = {True: "stable", False: "unstable", None: "not judged"}[report.stable]
        was, peak = outcome(model, tables, motion)
        counts[said, was] += 1
        radius = max((p.radius for p in report.points), default=np.nan)
        print(
            f"{' '.join(names):44} {said:10} {was:9} |z| {radius:.4f} peak {peak:7.1f} N",
            flush=True,
        )
    for (said, was), count in sorted(counts.items()):
        print(f"{said:10} and {was:9}: {count}")
    return int(any(counts["stable", was] for was in ("restless", "broken")))


if __name__ == "__main__":
    sys.exit(main())
