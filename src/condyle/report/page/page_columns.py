"""The numbers that the page carries: named columns of samples, packed for a browser."""

from __future__ import annotations

import base64
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..naming import short
from ..panel import Panel, Series
from ..scene import Style, styles


def packed(values: Any, kind: str) -> str:
    """An array in base64, of numpy's type `kind`."""
    return base64.b64encode(np.ascontiguousarray(values, dtype=kind).tobytes()).decode("ascii")


@dataclass
class Envelope:
    """Smallest and largest value of curves in spans of time, and when.

    edges: of the spans, (B + 1,) [s].   spans: (4, B) by name: low, high, and where each is in its
    span, from 0 to 1.
    """

    edges: np.ndarray
    spans: dict[str, np.ndarray] = field(default_factory=dict)

    def packed(self, lines: dict[str, int]) -> dict[str, Any]:
        """The curves `lines`, name -> number of its column."""
        low, high, low_at, high_at = np.array([self.spans[name] for name in lines]).swapaxes(0, 1)
        return {
            "columns": list(lines.values()),
            "edges": packed(self.edges, "<f8"),
            "low": packed(low, "<f4"),
            "high": packed(high, "<f4"),
            "lowAt": packed(np.round(65535 * low_at), "<u2"),
            "highAt": packed(np.round(65535 * high_at), "<u2"),
        }


class PageColumns:
    """Samples by name, (N,) each, in the order they were added.

    Times travel as float64, values as float32: seven digits, more than any readout shows.
    """

    def __init__(self, time: np.ndarray) -> None:
        self.time: np.ndarray = np.asarray(time, dtype=float)
        self.values: dict[str, np.ndarray] = {}
        self.lines: dict[str, int] = {}  # of curves, whose peaks the page keeps in any long run

    def add(self, name: str, values: np.ndarray, line: bool = False) -> int:
        """Number of the column `name`, which is added if it is new."""
        self.values.setdefault(name, np.asarray(values, dtype=float))
        number = list(self.values).index(name)
        if line:
            self.lines[name] = number
        return number

    def add_vector(self, name: str, values: np.ndarray) -> list[int]:
        """Numbers of the columns of (N, m) values."""
        return [self.add(f"{name}.{i}", column) for i, column in enumerate(values.T)]

    def packed(self, total: int, envelope: Envelope | None = None) -> dict[str, Any]:
        """What the page's script unpacks.

        Args: total: samples of the run;  envelope: of the lines, if the page has fewer.
        """
        return {
            "samples": len(self.time),
            "total": total,
            "time": packed(self.time, "<f8"),
            "names": list(self.values),
            "values": packed(list(self.values.values()), "<f4"),
            "envelope": None if envelope is None else envelope.packed(self.lines),
        }


# The third with gaps, through which one that it lies on can be seen, as gamma on alpha in chewing.
COMPONENTS = [Style(0, "solid"), Style(1, "dot"), Style(2, "dash")]
PAIR = [Style(0, "solid"), Style(1, "dot")]
MOST_LIMITS = 4  # lines in one plot; more would hide the curves
LIMITS_IN_VIEW = 0.25  # of a limit: peaks above this bring the limit into view
DIGITS = 4  # significant, of the largest value shown


def panel_data(
    section: str, panel: Panel, columns: PageColumns, chains: dict[str, Style]
) -> dict[str, Any]:
    """A panel for the page.

    Args: chains: looks of the chains, the same in all panels and in the picture in space.
    """
    (unit, scale), limits = panel.display, panel.limits
    values = np.concatenate([curve.values for curve in panel.curves])
    finite = np.abs(values[np.isfinite(values)])
    peak = float(finite.max(initial=0.0))
    nearest = min((abs(v) for pair in limits for v in (pair.low, pair.high) if v), default=np.inf)
    names = [curve.label for curve in panel.curves]
    drawn = len(limits) <= MOST_LIMITS
    return {
        "id": panel.id,
        "section": section,
        "kind": panel.kind,
        "title": panel.title,
        "unit": unit.removeprefix("1"),
        "decimals": decimals(panel.top) if panel.kind == "field" else decimals(peak * scale),
        "top": panel.top if panel.kind == "field" else None,
        "note": panel.note,
        "axes": [panel.across, panel.axis],
        "limitsDrawn": drawn,
        "limits": [
            {
                "low": _level(pair.low * scale),
                "high": _level(pair.high * scale),
                "label": pair.label(names),
                "of": pair.of,
            }
            for pair in limits
        ],
        "limitsInView": drawn and peak >= LIMITS_IN_VIEW * nearest,
        "fixed": [[_levels(np.multiply(v, scale)) for v in line] for line in panel.lines],
        "rangeWithLimits": _range_with_limits(panel, values * scale),
        "ranges": [_range(panel, 0), _range(panel, 1)],
        "shapes": _bounds(panel),
        "sets": [
            {"label": label, "lines": _lines(panel, curves, columns, chains)}
            for label, curves in panel.choices.items()
        ],
    }


def _lines(
    panel: Panel, curves: Sequence[Series], columns: PageColumns, chains: dict[str, Style]
) -> list[dict[str, Any]]:
    names = [curve.label for curve in curves]
    looks = [chains.get(n, look) for n, look in zip(names, styles(names), strict=True)]
    if panel.components:
        looks = COMPONENTS
    elif panel.kind == "plane":
        looks, names = PAIR, short(names)
    lines = []
    for name, curve, look in zip(names, curves, looks, strict=False):
        line: dict[str, Any] = {
            "label": name,
            "column": columns.add(curve.column, curve.values, line=True),
            "scale": panel.display.scale if curve.scale is None else curve.scale,
            "colour": look.colour,
            "dash": look.dash,
        }
        if curve.across is not None:
            line |= {"across": columns.add(*curve.across, line=True), "text": curve.text}
        lines.append(line)
    return lines


def _range_with_limits(panel: Panel, values: np.ndarray) -> list[float]:
    """The range of the axis that shows the limits too."""
    scale = panel.display.scale
    ends = [v * scale for one in panel.limits for v in (one.low, one.high) if np.isfinite(v)]
    low, high = 1.08 * min([0.0, *ends]), 1.08 * max([0.0, *ends])
    least, most = np.nanmin(values, initial=low), np.nanmax(values, initial=high)
    return [
        float(1.05 * least if least < low else low),
        float(1.05 * most if most > high else high),
    ]


def _range(panel: Panel, axis: int) -> list[float] | None:
    """The range of a track's axis, across or up: path, bounds and fixed lines with a margin."""
    seen = [np.asarray(panel.bounds[axis] or ()), *(line[axis] for line in panel.lines)]
    for curve in panel.curves:
        seen.append(curve.values if axis or curve.across is None else curve.across[1])
    values = panel.display.scale * np.concatenate(seen)
    values = values[np.isfinite(values)]
    if not values.size:
        return None
    spare = 0.07 * np.ptp(values) or 1.0
    return [float(values.min() - spare), float(values.max() + spare)]


def _bounds(panel: Panel) -> list[dict[str, Any]]:
    """A rectangle, or two lines where only one of the two axes is bounded, for plotly."""
    scale = panel.display.scale
    x, y = ([v * scale for v in one] if one is not None else None for one in panel.bounds)
    if x and y:
        return [{"type": "rect", "x0": x[0], "x1": x[1], "y0": y[0], "y1": y[1]}]
    across = [
        {"type": "line", "x0": v, "x1": v, "yref": "paper", "y0": 0, "y1": 1} for v in x or ()
    ]
    up = [{"type": "line", "y0": v, "y1": v, "xref": "paper", "x0": 0, "x1": 1} for v in y or ()]
    return [*across, *up]


def decimals(largest: float) -> int:
    """Decimal places that give a value four digits."""
    if largest == 0.0:
        return DIGITS - 1
    return min(max(DIGITS - 1 - math.floor(math.log10(largest)), 0), 9)


def _level(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _levels(values: np.ndarray) -> list[float | None]:
    return [_level(value) for value in values]
