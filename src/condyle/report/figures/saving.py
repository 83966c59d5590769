"""Figures to PNG and SVG files."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib as mpl
from matplotlib.figure import Figure

from ...files.atomic import replacing
from ...progress import step
from .style import STYLE

if TYPE_CHECKING:
    import xarray as xr

FORMATS = ("png", "svg")


def save(figure: Figure, folder: str | os.PathLike[str], name: str) -> list[Path]:
    """Write one figure as PNG and SVG, each completely or not at all; returns the paths."""
    paths = [Path(folder) / f"{name}.{kind}" for kind in FORMATS]
    engine = figure.get_layout_engine()
    try:
        with mpl.rc_context(STYLE):
            for path, kind in zip(paths, FORMATS, strict=True):
                # Without a date the same figure gives the same file.
                metadata = {"Date": None} if kind == "svg" else None
                with replacing(path) as temporary:
                    figure.savefig(temporary, format=kind, metadata=metadata)
                figure.set_layout_engine("none")  # the first file laid it out
    finally:
        figure.set_layout_engine(engine)
    return paths


def save_drawn(
    plots: Mapping[str, Callable[[xr.Dataset], Figure]],
    solution: xr.Dataset,
    folder: str | os.PathLike[str],
) -> list[Path]:
    """Draw and write figures by name."""
    paths = []
    with step("drawing figures", len(plots)) as advance:
        for name, draw in plots.items():
            paths += save(draw(solution), folder, name)
            advance(1)
    return paths
