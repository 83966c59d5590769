"""What the page says of single samples: no result, lift-off, out of bounds, above a limit."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from ...results.solution import BOUND_TOLERANCE
from ..actuators import drawn_limits
from .page_columns import Columns

if TYPE_CHECKING:
    from ...results.solution import Solution

NEAR_SINGULAR = "near a singularity"


def alerts(solution: Solution, columns: Columns) -> list[dict[str, Any]]:
    """Texts, each with the number of a column that is 1 where the text holds.

    `failed`: there is nothing to draw at such samples.
    """
    status = solution["status"]
    words = status.attrs["flag_meanings"].split()
    found = [
        (f"no result: {word}", status.values == code, True)
        for code, word in enumerate(words)
        if code
    ]
    found += [(text, where, False) for text, where in _warnings(solution)]
    return [
        {"text": text, "column": columns.add(f"alert.{text}", where), "failed": failed}
        for text, where, failed in found
        if where.any()
    ]


def _warnings(solution: Solution) -> Iterator[tuple[str, np.ndarray]]:
    with np.errstate(invalid="ignore"):
        for i, name in enumerate(solution["contact"].values):
            margin = solution["bound_margin"].values[:, i]
            yield f"{name} is outside its bounds", margin < -BOUND_TOLERANCE
            yield f"{name} lifts off", solution["lift_off"].values[:, i]
        for variable, word in (("torque", "effort"), ("joint_rate", "speed")):
            values, limits = solution[variable].values, drawn_limits(solution, variable)
            for i, name in enumerate(solution["chain"].values):
                yield f"{name} is beyond its {word} limit", limits[i].beyond(values[:, i])
    yield NEAR_SINGULAR, solution["singularity"].values != 0
