"""How quantities are written on axes, and where the data came from."""

from __future__ import annotations

import json
from math import pi
from pathlib import PurePath
from typing import TYPE_CHECKING

from ...analysis.paper import is_stand_in, is_synthetic
from ..failures import failures

if TYPE_CHECKING:
    from ...results.solution import Solution

TIME = "time [s]"
MOST_REASONS = 3  # why samples have no result, in a caption
COORDINATE = {"alpha": "α", "beta": "β", "gamma": "γ"}

# SI unit -> the unit on the axis, and what to multiply by.
_SHOWN = {"m": ("mm", 1e3), "rad": ("°", 180 / pi)}
_PER_SECOND = ("", "/s", "/s²")


def shown(unit: str, derivative: int = 0) -> tuple[str, float]:
    """Unit on the axis for a length or an angle or its derivatives, and the factor to it."""
    name, factor = _SHOWN.get(unit, (unit, 1.0))
    return name + _PER_SECOND[derivative], factor


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
    reasons = dict.fromkeys(str(one) for one in failures(solution))
    grey = [f" Grey: no result ({', '.join(list(reasons)[:MOST_REASONS])})."] if reasons else []
    return "; ".join(parts) + "." + "".join(grey)
