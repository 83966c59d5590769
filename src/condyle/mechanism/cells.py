"""Tables and curves of a notebook's cell, in the ink of its page."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape

import numpy as np

POINTS = 200  # of a curve
WIDE, HIGH = 320, 26  # pixels of a curve


def table(title: str, name: str, rows: Iterable[tuple[str, str]], picture: str = "") -> str:
    """Rows of title and text, escaped, under a caption; and a picture that is markup already."""
    body = "".join(
        f'<tr><th style="text-align:left">{escape(key)}</th>'
        f'<td style="text-align:left">{escape(text)}</td></tr>'
        for key, text in rows
    )
    caption = f"<caption>{escape(title)} <b>{escape(name)}</b></caption>"
    return f"{picture}<table>{caption}<tbody>{body}</tbody></table>"


def curves(values: np.ndarray, names: Sequence[str]) -> str:
    """Columns of (N, m), each over its own range, as an SVG."""
    values = np.asarray(values, dtype=float)
    rows = np.linspace(0, len(values) - 1, min(len(values), POINTS)).round().astype(int)
    shapes = []
    for i, name in enumerate(names):
        column = values[rows, i]
        good = np.isfinite(column)
        low, high = (column[good].min(), column[good].max()) if good.any() else (0.0, 0.0)
        y = (i + 0.85) * HIGH - 0.7 * HIGH * (column - low) / (high - low or 1.0)
        x = 70 + (WIDE - 70) * rows / max(rows[-1], 1)
        line = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x[good], y[good], strict=True))
        shapes.append(
            f'<text x="0" y="{(i + 0.7) * HIGH:.0f}" font-size="11" fill="currentColor">'
            f'{escape(name)}</text><polyline points="{line}" fill="none" stroke="currentColor"/>'
        )
    return (
        f'<svg role="img" aria-label="{escape(", ".join(names))} over time" width="{WIDE}" '
        f'height="{HIGH * len(names)}">{"".join(shapes)}</svg>'
    )
