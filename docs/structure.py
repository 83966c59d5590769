"""The structure of the paper's four models, its Figure 4, as a drawing made when the site is built.

Corrected where the scan of the paper is: what the arrows carry is written out. Equation numbers are
those of [Cheng2023]; `test_structure` holds them against the table of equations.
"""

from __future__ import annotations

from dataclasses import dataclass
from html import escape

from formulas import mathml

WIDTH, COLUMN, GAP, BOX, STEP = 1000, 230, 20, 76, 106
EDGE = (WIDTH - 4 * COLUMN - 3 * GAP) / 2


@dataclass(frozen=True)
class Box:
    """A step of a model: two lines, formulas between dollars, and the equations it stands for."""

    first: str
    second: str
    equations: str


START = Box("motion", r"$q, \dot q, \ddot q$ of $X, Y, \alpha, \beta$", "(7)")
END = Box("torques of least norm", "from all four models the same, to 1e-10", "(65)-(66)")
# What both methods do with the motion, by model.
MODEL_1 = Box(
    r"$Z, \gamma, M_J$ as expressions in $q$", "every body's motion in $q$", "(6) (9) (16)-(24)"
)
MODEL_2 = Box(
    r"$X, \dot X, \ddot X$ as numbers", "from the contacts, once a sample", "(6) (9) (10)"
)
MODELS: dict[str, tuple[Box, Box, Box]] = {
    "momentum, Model 1": (
        MODEL_1,
        Box("forces of all bodies in $q$", r"$J^\top \frac{d}{dt}(M J \dot q)$", "(29)-(40)"),
        Box("power balance", "4 equations in 6 torques", "(41)-(43)"),
    ),
    "momentum, Model 2": (
        MODEL_2,
        Box("the 6RSS: forces in $X$", "the core, without contacts", "(44) (47)"),
        Box(r"times $M_J^\top$", "contact forces drop out", "(45)-(46)"),
    ),
    "lagrange, Model 1": (
        MODEL_1,
        Box("bodies cut apart, in $q$", r"$M \ddot q + C \dot q + G$ of each", "(48)-(54)"),
        Box("D'Alembert", "joined by virtual displacements", "(55)-(57)"),
    ),
    "lagrange, Model 2": (
        MODEL_2,
        Box("the 6RSS by D'Alembert, in $X$", "the core, without contacts", "(58)-(61) (64)"),
        Box(r"times $M_J^\top$", "contact forces drop out", "(62)-(63)"),
    ),
}


def structure() -> str:
    """The drawing, for a page: it takes the page's colours."""
    last = 2 * BOX + 2 * STEP + 100
    parts = [
        f'<div class="structure"><svg viewBox="0 0 {WIDTH} {last + BOX + 5}" role="img" '
        'aria-label="Structure of the four models">',
        '<defs><marker id="tip" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" '
        'markerHeight="7" orient="auto"><path d="M0 0L8 4L0 8z"/></marker></defs>',
        _box(START, EDGE, 5, WIDTH - 2 * EDGE),
    ]
    for column, (title, boxes) in enumerate(MODELS.items()):
        x = EDGE + column * (COLUMN + GAP)
        centre, begin = x + COLUMN / 2, BOX + 42
        parts.append(f'<text x="{centre}" y="{BOX + 32}">{escape(title)}</text>')
        for row, box in enumerate(boxes):
            y = BOX + 70 + row * STEP
            parts += [_arrow(centre, begin, y), _box(box, x, y, COLUMN)]
            begin = y + BOX
        parts.append(_arrow(centre, begin, last))
    parts.append(_box(END, EDGE, last, WIDTH - 2 * EDGE))
    return "\n".join([*parts, "</svg></div>"]) + "\n"


def _box(box: Box, x: float, y: float, width: float) -> str:
    lines = (_line(box.first), _line(box.second), f"eq. {box.equations}")
    first, second, equations = (f"<div>{line}</div>" for line in lines)
    place = f'x="{x}" y="{y}" width="{width}" height="{BOX}"'
    return (
        f'<rect {place} rx="6"/><foreignObject {place}>'
        f"<b>{first}</b>{second}<small>{equations}</small></foreignObject>"
    )


def _line(text: str) -> str:
    """Words and, between dollars, formulas."""
    pieces = text.split("$")
    return "".join(mathml(p) if i % 2 else escape(p) for i, p in enumerate(pieces))


def _arrow(x: float, start: float, end: float) -> str:
    return f'<path class="arrow" d="M{x} {start + 3}V{end - 3}" marker-end="url(#tip)"/>'
