"""Check every peer against independent cases, time it, and print one table.

    python -m benchmarks.peers [PEER ...] [--mechanism TOML] [--cases JSON] [--seconds S] [--json]

Each is pinned to one core. A peer that cannot run says why; a wrong one is not timed.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tomllib
from pathlib import Path
from statistics import median, quantiles
from typing import Any

import numpy as np

from . import PEERS, Peer, PeerError

ROOT = Path(__file__).resolve().parents[2]
BUILD = Path(__file__).parent / "build"
TOLERANCE = 1e-9


def main(arguments: list[str] | None = None) -> int:
    """Exit status: 0 if every peer that could run is right, 1 if one is wrong, 2 for bad input."""
    options = _options(arguments)
    mechanism = tomllib.loads(options.mechanism.read_text())
    cases = json.loads(options.cases.read_text())["cases"]
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    rows = [_row(key, PEERS[key](), mechanism, cases, options) for key in options.peer or PEERS]
    if options.json:
        print(json.dumps(rows, indent=1))
    return 1 if any(row["status"] == "wrong" for row in rows) else 0


def _options(arguments: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.peers", description=__doc__)
    parser.add_argument("peer", nargs="*", help=f"which; all by default: {', '.join(PEERS)}")
    parser.add_argument("--mechanism", type=Path, default=_find("masticatory.toml"))
    parser.add_argument("--cases", type=Path, default=_find("oracle-cases.json"))
    parser.add_argument("--seconds", type=float, default=1.0, help="timing, a peer")
    parser.add_argument("--build", type=Path, default=BUILD, help="where compiled peers go")
    parser.add_argument("--json", action="store_true", help="JSON after the table")
    options = parser.parse_args(arguments)
    if unknown := [p for p in options.peer if p not in PEERS]:
        parser.error(f"no peer {', '.join(unknown)}; there are {', '.join(PEERS)}")
    for name in ("mechanism", "cases"):
        path = getattr(options, name)
        if path is None or not path.is_file():
            parser.error(f"no file for --{name}: {path or 'none found in the repository'}")
    return options


def _find(name: str) -> Path | None:
    """The file of that name that the repository ships, if it does."""
    return next((p for room in ("src", "tests") for p in sorted((ROOT / room).rglob(name))), None)


def _row(
    key: str, peer: Peer, mechanism: dict[str, Any], cases: list[Any], options: argparse.Namespace
) -> dict[str, Any]:
    """Result of one peer, printed as soon as it is there."""
    row: dict[str, Any] = {"peer": key, "name": peer.name}
    fine, reason = peer.available()
    if not fine:
        return _say(row | {"status": "unavailable", "reason": reason})
    try:
        peer.prepare(mechanism, options.build)
    except (PeerError, ValueError) as cause:
        return _say(row | {"status": "failed", "reason": str(cause)})
    q, qd, qdd, F, expected = (
        np.array([c[k] for c in cases]) for k in ("q", "qd", "qdd", "F", "tau")
    )
    tau = peer.solve(q, qd, qdd, F)
    error = float(np.max(np.abs(tau - expected).max(axis=1) / np.abs(expected).max(axis=1)))
    row |= {"error": error, "facts": peer.facts}
    if not error <= TOLERANCE:  # nan is wrong too
        return _say(row | {"status": "wrong", "reason": f"error {error:.1e} over {TOLERANCE:.0e}"})
    for kind, dependent in (("seconds", False), ("seconds_dependent", True)):
        times = peer.time_one(q, qd, qdd, F, options.seconds, dependent)
        low, _, high = quantiles(times, n=4)
        row[kind] = {"median": median(times), "quartiles": [low, high], "repeats": len(times)}
    return _say(row | {"status": "ok"})


def _say(row: dict[str, Any]) -> dict[str, Any]:
    if row["status"] != "ok":
        print(f"{row['name']:38s} {row['status']}: {row['reason']}", flush=True)
        return row
    one, after = row["seconds"], row["seconds_dependent"]["median"]
    low, high = one["quartiles"]
    print(
        f"{row['name']:38s} error {row['error']:.1e}  one {1e6 * one['median']:9.3f} us "
        f"({1e6 * low:.3f} to {1e6 * high:.3f})  dependent {1e6 * after:9.3f} us  "
        f"ready in {row['facts']['prepare_seconds']:.1f} s",
        flush=True,
    )
    return row


if __name__ == "__main__":
    sys.exit(main())
