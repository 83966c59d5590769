"""A session before cameras, with all that is to be found known: SYNTHETIC."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import tomli_w

from .recorded_jaw import FIXED, PLATFORM, Jaw, record

CYCLES = {"by": "beta", "from": "minimum", "shortest": 0.4}


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
        "trial": [{"file": f"chewing{k + 1}.c3d", "side": sides[k]} for k in range(trials)],
    }
    path = folder / "session.toml"
    path.write_text(tomli_w.dumps(given | tables))
    return path, jaws
