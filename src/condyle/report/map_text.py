"""The size of a workspace in words."""

from __future__ import annotations

from collections.abc import Iterator
from math import pi
from typing import TYPE_CHECKING

import numpy as np

from ..analysis.map.map_size import WorkspaceSize
from ..mechanism.mechanism import COORDINATES
from ..mechanism.mechanism_checks import length_text

if TYPE_CHECKING:
    import xarray as xr


def size_text(size: WorkspaceSize) -> str:
    """One line each for volume, ball and box."""
    return "\n".join(_lines(size))


def _lines(n: WorkspaceSize) -> Iterator[str]:
    v = n.volume
    yield (
        f"reachable:  {v.share:.4%} of the range, {v.value:.6g} {n.unit}, error about "
        f"{v.error:.1g}, at most {v.bound:.1g} ({v.poses} poses, finest cell {_sides(n, v.cell)})"
    )
    free = f"reachable, within bounds and limits, singularity ratio at least {n.margin:g}"
    if n.ball is None:
        yield "around home: nothing, home is outside the range"
        return
    yield (
        f"ball:       radius {length_text(n.ball.radius)} around home is {free} (angles times the "
        f"characteristic length); ends at {n.ball.stops}; certified at {n.ball.points} points, "
        f"{length_text(n.ball.spacing)} apart"
    )
    if n.box is None:
        yield f"box:        none, home is not {free}"
        return
    pairs = zip(n.axes, n.box.low, n.box.high, strict=True)
    sides = ", ".join(f"{name} {_ends(name, low, high)}" for name, low, high in pairs)
    ends = [("least", n.box.low), ("greatest", n.box.high)]
    faces = [f"{end} {n.axes[i]}" for end, at in ends for i, x in enumerate(at) if not x]
    on = f"; home is on its face at the {' and the '.join(faces)}" * bool(faces)
    yield f"box:        {sides}{on}; certified at points {_sides(n, n.box.spacing)} apart"


def map_table(dataset: xr.Dataset) -> str:
    """Which part of a map is reachable, and the range of each quantity there."""
    good = dataset["cause"].values == 0
    lines = [f"reachable: {good.mean():.4%} of {good.size} poses"]
    names = [str(name) for name in dataset.data_vars if dataset[name].dtype.kind == "f"]
    for name in names:
        values = dataset[name].values[good]
        values = values[np.isfinite(values)]
        ends = f"{values.min():.4g} to {values.max():.4g}" if values.size else "nowhere"
        about = dataset[name].attrs
        lines.append(f"{name}: {ends} [{about['units']}], {about['long_name']}")
    return "\n".join(lines)


def _sides(n: WorkspaceSize, values: tuple[float, ...]) -> str:
    return " x ".join(_size(name, value) for name, value in zip(n.axes, values, strict=True))


def _size(name: str, value: float) -> str:
    return f"{value * 1e3:.3g} mm" if name in COORDINATES[:3] else f"{value * 180 / pi:.3g} deg"


def _ends(name: str, low: float, high: float) -> str:
    scale, unit = (1e3, "mm") if name in COORDINATES[:3] else (180 / pi, "deg")
    return f"{low * scale:.4g} to {high * scale:.4g} {unit}"
