"""How coordinates are written, and where the data came from."""

from __future__ import annotations

import json
from pathlib import PurePath
from typing import TYPE_CHECKING

from ...analysis.paper import is_stand_in, is_synthetic
from ..failed_spans import gaps

if TYPE_CHECKING:
    from ...results.solution import Solution

TIME = "time [s]"
MOST_REASONS = 3  # why samples have no result, in a caption
COORDINATE = {"alpha": "α", "beta": "β", "gamma": "γ"}


def written(coordinate: str) -> str:
    """A coordinate, or its rate, as formulas have it."""
    name = coordinate.rstrip("′")
    return COORDINATE.get(name, name) + coordinate[len(name) :]


def caption(solution: Solution) -> str:
    """Where the data come from, and what they must not be taken for."""
    options, name = solution.options, solution.attrs["mechanism_name"]
    stand_in = is_stand_in(solution.mechanism)
    invented = [what for what in ("motion", "load") if is_synthetic(options[what])]
    parts = [f"Mechanism {name}" + (": stand-in, not the authors' robot" if stand_in else "")]
    if invented:
        parts.append(f"synthetic {' and '.join(invented)}, not the paper's")
    parts += [
        f"{what}: {PurePath(options[what]).name}"
        for what in ("motion", "load")
        if what not in invented
    ]
    if "bands" in solution.attrs:
        count = json.loads(solution.attrs["bands"])["variants"]
        parts.append(f"bands: 5 to 95 and 25 to 75 % of {count} variants")
    reasons = dict.fromkeys(str(one) for one in gaps(solution))
    grey = [f" Grey: no result ({', '.join(list(reasons)[:MOST_REASONS])})."] if reasons else []
    return "; ".join(parts) + "." + "".join(grey)
