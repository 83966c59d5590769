"""Whether deviations of `identify` hold: errors over stated deviations in logs of many kinds.

    python -m benchmarks.identifying --seeds 20

Sixteen numbers of the chewing robot from 4,000 samples (16 s) that another formulation made, with
noise of encoders (1e-4 rad) and of efforts (2 % of their root mean square), and in each kind
one thing more. z is the error over the stated deviation: its root mean square is 1 where deviations
are honest. Said: in how many logs a lack of fit is found.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

import condyle

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from identification.recorded import ENCODER, Recorded, recorded, rubbing, write_table
from scipy.signal import lfilter

Array = np.ndarray
SHARE = 0.02  # noise of efforts over their root mean square
DRAG = 0.02  # N m s, of the platform's turning
LATE = 8e-3  # s
NUMBERS = ("platform.mass", "platform.com", "chain.*.actuator.viscous", "chain.*.actuator.coulomb")
KINDS: dict[str, dict[str, Any]] = {  # with the options that hold what the log has
    "white": {},
    "noise not stated": {},
    "coloured": {},
    "outlying": {"robust": True},
    "late": {"delay": "channel"},
    "drifting": {},
    "gain fitted": {"gain": True},
    "gain": {},
    "drag": {},
    "one late": {},
    "all late": {},
}
MISMATCH = ("gain", "drag", "one late", "all late")


@dataclass
class Kind:
    """What a kind of logs gave.

    z: errors over deviations, one row a log;  said: logs with a lack of fit;  unsettled: refused.
    """

    z: list[Array] = field(default_factory=list)
    said: int = 0
    unsettled: int = 0
    words: list[str] = field(default_factory=list)

    @property
    def rms(self) -> float:
        """Root mean square of z."""
        return float(np.sqrt(np.mean(np.concatenate(self.z) ** 2))) if self.z else np.nan


def machines() -> tuple[condyle.Mechanism, condyle.Mechanism]:
    """The file that the fit starts from, and the machine."""
    before = rubbing(condyle.load_mechanism("masticatory"))
    changes: dict[str, Any] = {"platform.mass": 0.23, "platform.com": (4e-3, -2e-3, 3e-3)}
    for name in before.chain_names:
        for key in ("viscous", "coulomb"):
            path = f"chain.{name}.actuator.{key}"
            changes[path] = 1.3 * before.get(path)
    return before, before.set(changes)


def columns(machine: Recorded, kind: str, seed: int) -> dict[str, Array]:
    """A log of a kind. Drag is the machine's own: see `recorded`."""
    rng = np.random.default_rng(seed)
    joint = machine.joint + ENCODER * rng.normal(size=machine.joint.shape)
    effort, shape = machine.effort.copy(), machine.effort.shape
    size = noise(machine)
    if "late" in kind:
        late = range(shape[1]) if kind == "all late" else [1]
        for i in late:
            effort[:, i] = np.interp(machine.t - LATE, machine.t, effort[:, i])
    if "gain" in kind:
        effort[:, 0] *= 1.02
    white = rng.normal(size=shape)
    if kind == "coloured":  # a time constant of 78 ms
        white = np.sqrt(1 - 0.95**2) * lfilter([1.0], [1.0, -0.95], white, axis=0)
    effort += size * white
    if kind == "outlying":
        effort += 20 * size * rng.normal(size=shape) * (rng.random(shape) < 0.005)
    if kind == "drifting":  # as large as the noise at the end
        effort += size * np.cumsum(rng.normal(size=shape), axis=0) / np.sqrt(len(effort))
    found = {"t": machine.t}
    for head, rows in (("joint", joint), ("tau", effort)):
        names = machine.mechanism.chain_names
        found |= {f"{head}_{name}": rows[:, i] for i, name in enumerate(names)}
    return found


def noise(machine: Recorded) -> float:
    """Standard deviation of the efforts' noise [N m]."""
    return SHARE * float(np.sqrt((machine.effort**2).mean()))


def judged(kind: str, seeds: Sequence[int], seconds: float = 16.0) -> Kind:
    """Fits of logs of a kind."""
    before, truth = machines()
    machine = recorded(truth, seconds, drag=DRAG if kind == "drag" else 0.0)
    study: dict[str, Any] = {"numbers": list(NUMBERS), "options": KINDS[kind]}
    if kind != "noise not stated":
        study["noise"] = {"effort": noise(machine), "encoder": ENCODER}
    result = Kind()
    with tempfile.TemporaryDirectory() as folder:
        for seed in seeds:
            log = write_table(Path(folder) / "log.csv", columns(machine, kind, seed))
            try:
                found = condyle.identify(before, [log], study)
            except condyle.CondyleError:
                result.unsettled += 1
                continue
            z = [
                (one.value - truth.get(one.name)) / one.deviation
                for one in found.numbers
                if one.identified
                and "." in one.name
                and one.name.partition(".")[0] in ("platform", "chain")
            ]
            result.z.append(np.array(z))
            result.said += bool(found.lack_of_fit)
            result.words += [str(one) for one in found.lack_of_fit]
    return result


def main(arguments: Sequence[str] | None = None) -> int:
    """Run and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=6, help="logs of each kind")
    parser.add_argument("--kinds", nargs="+", choices=list(KINDS), default=list(KINDS))
    parser.add_argument("--words", action="store_true", help="print what is said")
    asked = parser.parse_args(arguments)
    print(f"{'log':18} {'rms z':>6} {'largest':>8} {'said':>9} {'not settled':>12}")
    for kind in asked.kinds:
        one = judged(kind, range(asked.seeds))
        largest = max((np.abs(z).max() for z in one.z), default=np.nan)
        said = f"{one.said} of {asked.seeds}"
        print(f"{kind:18} {one.rms:6.2f} {largest:8.1f} {said:>9} {one.unsettled:12}", flush=True)
        if asked.words:
            print(*(f"    {words}" for words in dict.fromkeys(one.words)), sep="\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
