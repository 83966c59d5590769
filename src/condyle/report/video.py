"""A solution as a film: the library's scene over time, GIF or MP4."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import InputError, as_path, shown
from ..extras import require
from ..files.atomic import replacing
from ..progress import step
from ..results.solution import as_kind, open_solution
from .scene import ROLES, VIEWS, cloud, parts_of, place

if TYPE_CHECKING:
    import xarray as xr

MOST = 3000  # frames
ARROW = 0.25  # the largest load over the picture's height
ROUND = 2  # sides of a film are multiples of it, as H.264 wants them


def video(
    solution: xr.Dataset | str | os.PathLike[str],
    out: str | os.PathLike[str],
    *,
    speed: float = 1.0,
    fps: float = 25.0,
    width: int = 640,
    view: str = "Oblique",
) -> Path:
    """Film a solution: chains, platform, contacts and the load, with the time.

    Args:   solution: or its NetCDF file.
            out: .gif, or .mp4 (extra `video`).
            speed: seconds of the solution in a second of the film.
            fps: frames a second, 1 to 60.  width: pixels, 160 to 1920.
            view: Front, Side, Top or Oblique.
    Raises: InputError: for values that are not such, or more than 3000 frames;
            MissingExtraError: without matplotlib, or for .mp4 without imageio-ffmpeg.
    """
    require("matplotlib", "figures")
    suffix = Path(as_path(out)).suffix.lower()
    if suffix not in (".gif", ".mp4"):
        raise InputError(f'{out}: expected a name that ends in .gif or .mp4, got "{suffix}"')
    if suffix == ".mp4":
        require("imageio_ffmpeg", "video")
    for name, value, low, high in (
        ("speed", speed, 1e-6, 1e6), ("fps", fps, 1, 60), ("width", width, 160, 1920),
    ):  # fmt: skip
        number = isinstance(value, int | float | np.number) and not isinstance(value, bool)
        if not number or not low <= value <= high:
            raise InputError(f"{name}: expected {low:g} to {high:g}, got {shown(value)}")
    if not isinstance(view, str) or view not in VIEWS:
        raise InputError(f"view: expected {', '.join(VIEWS)}, got {shown(view)}")
    given = open_solution(solution) if isinstance(solution, str | os.PathLike) else solution
    found = as_kind(given, "solution", "solution")
    t = found["time"].values
    count = math.floor((t[-1] - t[0]) * fps / speed) + 1
    if count > MOST:
        raise InputError(
            f"{count} frames, expected {MOST} or fewer: raise speed, or lower fps; the solution "
            f"lasts {t[-1] - t[0]:.4g} s"
        )
    times = t[0] + speed / fps * np.arange(count)
    with replacing(out) as temporary, step("filming", count) as advance:
        pictures = _pictures(found, times, int(width), VIEWS[view], advance)
        (_write_gif if suffix == ".gif" else _write_mp4)(temporary, pictures, float(fps))
    return Path(out)


def _write_gif(path: Path, pictures: Iterator[np.ndarray], fps: float) -> None:
    from PIL import Image

    frames = [Image.fromarray(one).quantize(64) for one in pictures]
    frames[0].save(
        path, format="GIF", save_all=True, append_images=frames[1:], duration=1000 / fps, loop=0
    )


def _write_mp4(path: Path, pictures: Iterator[np.ndarray], fps: float) -> None:
    import imageio_ffmpeg

    first = next(pictures)
    size = first.shape[1], first.shape[0]
    how = {"codec": "libx264", "macro_block_size": ROUND, "output_params": ["-f", "mp4"]}
    film = imageio_ffmpeg.write_frames(str(path), size, fps=fps, **how)
    try:
        film.send(None)
        film.send(np.ascontiguousarray(first))
        for one in pictures:
            film.send(np.ascontiguousarray(one))
    finally:
        film.close()


def _pictures(
    solution: xr.Dataset, times: np.ndarray, width: int, view: Any, advance: Any
) -> Iterator[np.ndarray]:
    """Frames (height, width, 3) of bytes; a sample without a result shows the one before."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.collections import LineCollection, PolyCollection
    from matplotlib.figure import Figure

    mechanism, t = solution.condyle.mechanism, solution["time"].values
    along = {name: _at(times, t, solution[name].values) for name in ("pose", "joint", "load")}
    scene = place(mechanism, along["pose"], along["joint"])
    parts = parts_of(mechanism, scene)
    away, up, _ = (np.asarray(x, dtype=float) if np.ndim(x) else x for x in view)
    away = away / np.linalg.norm(away)
    right = np.cross(up, away)
    right /= np.linalg.norm(right)
    look = np.stack([right, np.cross(away, right)], axis=1)
    everything = cloud(scene, parts.body.vertices) @ look
    low, size = everything.min(axis=0), np.ptp(everything, axis=0)
    middle, size = low + size / 2, size * 1.12
    size = np.maximum(size, 0.4 * size.max())
    height = ROUND * round(width / ROUND * size[1] / size[0])
    height = int(np.clip(height, width // 3, 2 * width)) // ROUND * ROUND
    width = width // ROUND * ROUND
    figure = Figure(figsize=(width / 100, height / 100), dpi=100)
    canvas = FigureCanvasAgg(figure)
    axes = figure.add_axes((0, 0, 1, 1))
    axes.axis("off")
    axes.set_aspect("equal", adjustable="datalim")
    ends = np.stack([middle - size / 2, middle + size / 2])
    axes.set(xlim=ends[:, 0], ylim=ends[:, 1])
    surfaces = [patch.vertices[patch.faces] @ look for patch in parts.surfaces.values()]
    for corners in surfaces:
        axes.add_collection(PolyCollection(corners, color=ROLES["surface"][0], alpha=0.35, lw=0))
    body = PolyCollection([], color=ROLES["platform"][0], alpha=0.8, lw=0)
    bars = LineCollection([], colors="#2b4a6f", linewidths=2.4, capstyle="round")
    for one in (body, bars):
        axes.add_collection(one)
    (balls,) = axes.plot([], [], "o", color=ROLES["ball"][0], ms=7)
    (load,) = axes.plot([], [], color="#c2185b", lw=2.5, marker="o", ms=6, markevery=[1])
    clock = axes.text(0.02, 0.96, "", transform=axes.transAxes, va="top", fontsize=11)
    rods = [
        (d.points[rod.start], d.points[rod.end]) for d in scene.chains.values() for rod in d.rods
    ]
    force, at = along["load"][:, :3], scene.position
    point = solution.condyle.options.get("load_point")
    if point in mechanism.platform.points:
        at = scene.on_platform(mechanism.platform.points[point])
    largest = np.nanmax(np.linalg.norm(force, axis=1), initial=0.0)
    arrow = force * (ARROW * size[1] / largest if largest else 0.0)

    def here(points: np.ndarray, k: int) -> np.ndarray:
        return points[k] if points.ndim == 2 else points

    for k in range(len(times)):
        vertices = scene.position[k] + parts.body.vertices @ scene.rotation[k].T
        body.set_verts(list(vertices[parts.body.faces] @ look))
        bars.set_segments([np.stack([here(a, k), here(b, k)]) @ look for a, b in rods])
        centres = np.array([one[k] for one in scene.contacts.values()]).reshape(-1, 3) @ look
        balls.set_data(*centres.T)
        load.set_data(*(np.stack([at[k] - arrow[k], at[k]]) @ look).T)
        clock.set_text(f"{times[k]:.3f} s")
        canvas.draw()
        advance(1)
        yield np.asarray(canvas.buffer_rgba())[..., :3].copy()


def _at(times: np.ndarray, t: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Columns at times, linear between samples that have a result."""
    good = np.isfinite(values).all(axis=1)
    if not good.any():
        raise InputError("video: this solution has no sample with a result")
    return np.column_stack([np.interp(times, t[good], column[good]) for column in values.T])
