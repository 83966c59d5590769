"""Figures to files: PNG and SVG, and PDF for print."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path

import matplotlib as mpl
from matplotlib.figure import Figure

from ...files.atomic import replacing
from ...progress import step
from .style import STYLE, EmptyFigureError

FORMATS = ("png", "svg")
FOR_PRINT = (*FORMATS, "pdf")
# Without a date the same figure gives the same file.
METADATA: dict[str, dict[str, None]] = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}


def save(
    figure: Figure, folder: str | os.PathLike[str], name: str, formats: Sequence[str] = FORMATS
) -> list[Path]:
    """Write one figure in formats, each completely or not at all; returns the paths."""
    paths = [Path(folder) / f"{name}.{kind}" for kind in formats]
    engine = figure.get_layout_engine()
    try:
        with mpl.rc_context(STYLE):
            for path, kind in zip(paths, formats, strict=True):
                with replacing(path) as temporary:
                    figure.savefig(temporary, format=kind, metadata=METADATA.get(kind))
                figure.set_layout_engine("none")  # the first file laid it out
    finally:
        figure.set_layout_engine(engine)
    return paths


def save_drawn(
    plots: Mapping[str, Callable[[], Figure]],
    folder: str | os.PathLike[str],
    formats: Sequence[str] = FORMATS,
    every: bool = False,
) -> list[Path]:
    """Draw and write figures by name; those with nothing to show are left out.

    Args:   every: none may be left out, and all are drawn before one is written.
    Raises: EmptyFigureError: with `every`, if one has nothing to show.
    """
    paths = []
    with step("drawing figures", len(plots)) as advance:
        figures = ((name, draw() if every else _drawn(draw)) for name, draw in plots.items())
        for name, figure in list(figures) if every else figures:
            if figure is not None:
                paths += save(figure, folder, name, formats)
            advance(1)
    return paths


def _drawn(draw: Callable[[], Figure]) -> Figure | None:
    """A figure, or None if it has nothing to show."""
    with suppress(EmptyFigureError):
        return draw()
    return None
