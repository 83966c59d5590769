"""What was measured beside the motion: markers in space, their residuals, EMG under activations."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from ..scene import styles
from .columns import Columns
from .panels import Line, Panel, panel
from .units import shown

if TYPE_CHECKING:
    from ...results.solution import Solution

SECTION = "markers"
WIDE = (1.0, 99.0)  # percent of its samples that the picture must hold of each marker
SETS = {
    "marker_residual": "from their places in the body",
    "marker_offset": "from where the computed motion has them",
}
WORDS = {"fixed": "base", "platform": "platform"}


def markers(solution: Solution, columns: Columns) -> list[dict[str, Any]]:
    """Markers for the 3D view: name, body, and the numbers of the columns of its place."""
    if "marker_place" not in solution:
        return []
    places = solution["marker_place"].values
    return [
        {
            "name": str(name),
            "body": str(body),
            "columns": columns.add_vector(f"marker.{name}", places[:, i]),
        }
        for i, (name, body) in enumerate(
            zip(solution["marker"].values, solution["marker_body"].values, strict=True)
        )
    ]


def reach(solution: Solution) -> np.ndarray:
    """Corners, (2 m, 3) [m], between which each marker mostly is."""
    if "marker_place" not in solution:
        return np.empty((0, 3))
    places = solution["marker_place"].values
    seen = [p[np.isfinite(p).all(axis=1)] for p in places.transpose(1, 0, 2)]
    return np.array([c for p in seen if len(p) for c in np.percentile(p, WIDE, axis=0)]).reshape(
        -1, 3
    )


def marker_panels(solution: Solution, columns: Columns) -> Iterator[Panel]:
    """Distances of the markers over time, if some were measured."""
    if "marker_place" not in solution:
        return
    names, bodies = ([str(v) for v in solution[n].values] for n in ("marker", "marker_body"))
    sets = {}
    for variable, label in SETS.items():
        values = solution[variable].values
        for body, word in WORDS.items():
            mine = [i for i, one in enumerate(bodies) if one == body]
            looks = styles([names[i] for i in mine])
            sets[f"{word}: {label}"] = [
                Line(names[i], f"{variable}.{names[i]}", values[:, i], look)
                for i, look in zip(mine, looks, strict=True)
            ]
    sets = {label: lines for label, lines in sets.items() if lines}
    if not sets:
        return
    yield panel(
        columns,
        SECTION,
        "marker-residual",
        "Distances of the markers",
        shown("m"),
        sets,
        note="From their places in the body: how rigid it is, and how well they were seen. From "
        "where the computed motion has them: what smoothing and the contacts took away too.",
    )
