"""A solution as a film: the library's scene over time, GIF or MP4."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import InputError, brief
from ..extras import require
from ..files.atomic import ending_of, replacing
from ..mechanism.vocabulary import of_muscles
from ..progress import step
from ..results.solution import as_kind, open_solution
from .panel_list import activation_top, colour_values
from .scene import VIEWS, Camera, cloud, faces_of, force_scales, forces_of, parts_of, place
from .scene.floor import floor_below
from .scene.skull import skull_of

if TYPE_CHECKING:
    import xarray as xr

MOST = 3000  # frames
ROUND = 2  # sides of a film are multiples of it, as H.264 wants them
WIDE, INCH = 16 / 9, 12.8  # of a film: width over height, and the width that its letters are for


def video(
    solution: xr.Dataset | str | os.PathLike[str],
    out: str | os.PathLike[str],
    *,
    speed: float = 1.0,
    fps: float = 25.0,
    width: int = 640,
    view: str = "Oblique",
) -> Path:
    """Film a solution: chains, platform, contacts, forces, frames and floor, with the time.

    A frame has the shape of a slide, 16 to 9. In its corners stand the time, what colours mean, the
    step of the floor's grid, and an arrow of a round force for each scale.

    Args:   solution: or its NetCDF file.
            out: .gif, or .mp4 (extra `video`).
            speed: seconds of the solution in a second of the film.
            fps: frames a second, 1 to 60.  width: pixels, 160 to 1920 (1080p).
            view: Front, Side, Top or Oblique.
    Raises: InputError: for values that are not such, or more than 3000 frames;
            MissingExtraError: without matplotlib, or for .mp4 without imageio-ffmpeg.
    """
    require("matplotlib", "figures")
    if (ending := ending_of(out, (".gif", ".mp4"))) == ".mp4":
        require("imageio_ffmpeg", "video")
    _check_range("width", width, 160, 1920)
    if not isinstance(view, str) or view not in VIEWS:
        raise InputError(f"view: expected {', '.join(VIEWS)}, got {brief(view)}")
    given = open_solution(solution) if isinstance(solution, str | os.PathLike) else solution
    found = as_kind(given, "solution", "solution")
    times = frame_times(found, speed, fps)
    with replacing(out) as temporary, step("filming", len(times)) as advance:
        pictures = _pictures(found, times, int(width), view, speed, advance)
        (_write_gif if ending == ".gif" else _write_mp4)(temporary, pictures, float(fps))
    return Path(out)


def frame_times(solution: xr.Dataset, speed: float, fps: float) -> np.ndarray:
    """Times of the frames [s]; see `video`. Raises: InputError: for values that are not such."""
    _check_range("speed", speed, 1e-6, 1e6)
    _check_range("fps", fps, 1, 60)
    t = solution["time"].values
    count = math.floor((t[-1] - t[0]) * fps / speed) + 1
    if count > MOST:
        raise InputError(
            f"{count} frames, expected {MOST} or fewer: raise speed, or lower fps; the solution "
            f"lasts {t[-1] - t[0]:.4g} s"
        )
    times: np.ndarray = t[0] + speed / fps * np.arange(count)
    return times


def _check_range(name: str, value: Any, low: float, high: float) -> None:
    number = isinstance(value, int | float | np.number) and not isinstance(value, bool)
    if not number or not low <= value <= high:
        raise InputError(f"{name}: expected {low:g} to {high:g}, got {brief(value)}")


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
    solution: xr.Dataset, times: np.ndarray, width: int, view: str, speed: float, advance: Any
) -> Iterator[np.ndarray]:
    """Frames (height, width, 3) of bytes; a sample without a result shows the one before."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.collections import PolyCollection
    from matplotlib.figure import Figure

    from .film_frame import FilmFrame, draw_colours, draw_floor, draw_scale, draw_skull, triad

    film = _at(solution, times)
    scene = place(film.condyle.mechanism, film["pose"].values, film["joint"].values)
    parts = parts_of(film.condyle.mechanism, scene)
    forces = forces_of(film, scene, parts)
    scales = force_scales(forces, parts.size)
    arrows = [(force, scales[force.kind]) for force in forces]
    activations = colour_values(film)
    camera = Camera.of(*VIEWS[view])
    ends = [end for force, scale in arrows for end in force.ends(scene, scale)]
    everything = np.vstack([cloud(scene, parts.body.vertices), *ends])
    floor = floor_below(everything)
    frames = triad(scene.position, scene.rotation, parts.size)
    drawn = [everything, floor.lines.reshape(-1, 3), frames.reshape(-1, 3)]
    flat = camera.flat(np.vstack(drawn))
    low, high = np.nanmin(flat, axis=0), np.nanmax(flat, axis=0)
    half = 0.54 * (high - low)
    half = np.maximum(half, half[::-1] * [WIDE, 1 / WIDE])
    height = ROUND * round(width / WIDE / ROUND)
    width = width // ROUND * ROUND
    # A slide of `INCH`, whatever its pixels: letters and lines keep their part of it.
    figure = Figure(figsize=(INCH, INCH * height / width), dpi=width / INCH)
    canvas = FigureCanvasAgg(figure)
    axes = figure.add_axes((0, 0, 1, 1))
    axes.axis("off")
    corners = np.stack([(low + high) / 2 - half, (low + high) / 2 + half])
    axes.set(xlim=corners[:, 0], ylim=corners[:, 1])
    mechanism = film.condyle.mechanism
    draw_floor(axes, camera, floor)
    if (skull := skull_of(mechanism, parts.surfaces.values())) is not None:
        draw_skull(axes, camera, skull)
    draw_scale(axes, {force.kind: force.largest for force in forces}, scales)
    draw_colours(axes, mechanism, activation_top(film), of_muscles(mechanism))
    frame = FilmFrame(axes, camera, scene, parts.size)
    solids = PolyCollection([], lw=0.3, zorder=1)
    axes.add_collection(solids)
    pace = "" if speed == 1 else f"\n{speed:g} times as fast"
    for k in range(len(times)):
        activation = {name: float(values[k]) for name, values in activations.items()}
        seen, colours = faces_of(parts, scene, k, arrows, activation).seen(camera)
        solids.set_verts(seen)
        solids.set(facecolors=colours, edgecolors=colours)
        frame.show(k, f"{mechanism.name}\nt = {times[k]:.3f} s{pace}")
        canvas.draw()
        advance(1)
        yield np.asarray(canvas.buffer_rgba())[..., :3].copy()


def _at(solution: xr.Dataset, times: np.ndarray) -> xr.Dataset:
    """The solution at times, linear between samples that have a result."""
    t, good = solution["time"].values, solution["status"].values == 0
    if not good.any():
        raise InputError("video: this solution has no sample with a result")
    nearest = np.abs(t[good][:, None] - times).argmin(axis=0)
    film = solution.isel(time=np.flatnonzero(good)[nearest]).copy()
    for name in ("pose", "joint", "load", "contact_force", "effort"):
        for k, column in enumerate(solution[name].values[good].T):
            film[name].values[:, k] = np.interp(times, t[good], column)
    return film.assign_coords(time=("time", times, solution["time"].attrs))
