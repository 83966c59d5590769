"""Figures to files: PNG and SVG, and PDF for print."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
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
    plots: Mapping[str, Callable[[xr.Dataset], Figure]],
    solution: xr.Dataset,
    folder: str | os.PathLike[str],
    formats: Sequence[str] = FORMATS,
) -> list[Path]:
    """Draw and write figures by name."""
    paths = []
    with step("drawing figures", len(plots)) as advance:
        for name, draw in plots.items():
            paths += save(draw(solution), folder, name, formats)
            advance(1)
    return paths
