"""Colours that colour-blind readers can tell apart, on light and on dark grounds.

Each list was spread out in CIELAB as seen with full, protan, deutan and tritan vision; the tests
measure it. A line's dash is the second sign, so nothing rests on colour alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ..naming import stem

LIGHT = ("#105DCA", "#D97A03", "#07A973", "#693804", "#745F8A", "#1E1B19")
DARK = ("#4491E5", "#D06A05", "#4CEE8D", "#F4EC46", "#A98AA0", "#DDF6FA")
# What is no chain, on light and on dark grounds.
ROLES = {
    "neutral": ("#7d8894", "#8d98a5"),
    "platform": ("#c9d3de", "#5b6877"),
    "bone": ("#e3d5b8", "#a89a7d"),
    "teeth": ("#fbf8ef", "#e4e0d3"),
    "surface": ("#e5b567", "#b98a3c"),
    "ball": ("#c2185b", "#ff6f9f"),
    "soft": ("#566170", "#a3aebb"),
    "ink": ("#46505c", "#e6ebf1"),
}
# Measured markers by the body that they are on: colour, plotly's symbol, a sign, and words.
MARKERS = {
    "fixed": (2, "square", "■", "markers measured on the base"),
    "platform": (0, "diamond", "◆", "on the platform"),
    "": (4, "circle", "●", "of no stated body"),
}
DASHES = ("solid", "dash", "dot", "dashdot")


@dataclass(frozen=True)
class Style:
    """colour: index into `LIGHT` and `DARK`;  dash: one of `DASHES`."""

    colour: int
    dash: str


def styles(names: Sequence[str]) -> list[Style]:
    """A style for each name: a left and a right one share their colour and differ in dash.

    Where there is one pair alone, they differ in colour too; names without pairs differ in both,
    and a dashed line over a solid one hides nothing.
    """
    stems = [stem(name) for name in names]
    paired = any(stems.count(stem) == 2 for stem in stems)
    if paired and len(names) == 2:
        return [Style(0, DASHES[0]), Style(1, DASHES[1])]
    groups = list(dict.fromkeys(stems)) if paired else list(names)
    seen: dict[str, int] = {}
    result = []
    for name, without_side in zip(names, stems, strict=True):
        group = without_side if paired else name
        number, twin = groups.index(group), seen.get(group, 0)
        seen[group] = twin + 1
        lap = number // len(LIGHT)
        step = twin + 2 * lap if paired else number + lap
        result.append(Style(number % len(LIGHT), DASHES[step % len(DASHES)]))
    return result
