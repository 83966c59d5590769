"""A session before cameras, with all that is to be found known: SYNTHETIC."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from .recorded_jaw import FIXED, PLATFORM, Jaw, record

CYCLES = {"by": "beta", "from": "minimum", "shortest": 0.4}


# Movements of a task: number, opening, closing and stop [s]; their X, Y [m] and beta [rad].
TASKS = {
    "chew": ((6, 0.35, 0.3, 0.15), (0.002, 0.002, 0.2)),
    "open": ((3, 0.7, 0.6, 0.9), (0.008, 0.0, 0.4)),
    "protrude": ((2, 0.5, 0.5, 0.8), (0.006, 0.0, 0.0)),
    "lateral": ((2, 0.5, 0.5, 0.8), (0.008, 0.006, 0.0)),
    "right": ((2, 0.5, 0.5, 0.8), (0.008, -0.006, 0.0)),
    "static": ((1, 0.3, 0.3, 0.3), (0.0, 0.0, 0.0)),
}


def movements(
    count: int, opening: float, closing: float, stop: float, rate: float = 100.0
) -> np.ndarray:
    """From 0 to 1 and back, with a stop after each; before the first one 0.7 s, or a stop."""
    up, down = ((1 - np.cos(np.pi * np.arange(0, 1, 1 / rate / s))) / 2 for s in (opening, closing))
    still = np.zeros(round(stop * rate))
    one = np.concatenate([up, 1 - down, still])
    return np.concatenate([np.zeros(round(max(stop, 0.7) * rate)), *[one] * count])


def write_tasks(
    folder: Path, jaw: dict[str, Any] | None = None, **tables: Any
) -> tuple[Path, dict[str, Jaw]]:
    """A session of the tasks of `TASKS` on the human jaw, a trial each, and what was recorded."""
    jaws = {}
    for name, (times, size) in TASKS.items():
        path = movements(*times)[:, None] * size
        jaws[name] = record(**{"mechanism": "human-jaw", "path": path, "head": 0.3} | (jaw or {}))
        jaws[name].write(folder / f"{name}1.c3d")
    given: dict[str, Any] = {
        "mechanism": "human-jaw",
        "markers": {"fixed": FIXED, "platform": PLATFORM},
        "home": [0.0, 0.5],
        "register": jaws["chew"].register,
        "vertical": {"up": jaws["chew"].A[:, 2].tolist()},
        "cycles": {"by": "gape", "least": 2.0},
        "solve": {"distribution": "minimum_norm"},  # which has an answer everywhere
        "trial": [{"file": f"{name}1.c3d", "task": name} for name in TASKS],
    }
    file = folder / "tasks.toml"
    file.write_text(tomli_w.dumps(given | tables))
    return file, jaws


def write_session(
    folder: Path,
    trials: int = 2,
    seconds: float = 4.0,
    jaw: dict[str, Any] | None = None,
    **tables: Any,
) -> tuple[Path, list[Jaw]]:
    """A session file with its recordings, and what was recorded.

    Args: jaw: options of `record`;  tables: of the file, beside those that it needs.
    """  # fmt: skip
    jaws = []
    for k in range(trials):
        one = record(seconds=seconds + 0.5 * k, seed=0, **(jaw or {}))
        one.write(folder / f"chewing{k + 1}.c3d")
        jaws.append(one)
    sides = ["right", "left"] * trials
    given: dict[str, Any] = {
        "mechanism": "masticatory",
        "markers": {"fixed": FIXED, "platform": PLATFORM},
        "home": [0.0, 0.5],
        "register": jaws[0].register,
        "filter": {"markers": 10.0},
        "cycles": CYCLES,
        "trial": [
            {"file": f"chewing{k + 1}.c3d", "task": "chew", "labels": {"side": sides[k]}}
            for k in range(trials)
        ],
    }
    path = folder / "session.toml"
    path.write_text(tomli_w.dumps(given | tables))
    return path, jaws
