"""The scene of a solution as a page of its own, or in a notebook's cell, played by viser."""

from __future__ import annotations

import contextlib
import io
import os
from dataclasses import dataclass
from html import escape
from pathlib import Path

import xarray as xr

from ..extras import require
from ..files.atomic import write_text
from ..progress import step
from ..report.scene import trails
from ..report.video import frame_times
from ..results.solution import as_kind, open_solution
from .playback import Playback

HEIGHT = 420  # pixels, of a cell


@dataclass(frozen=True)
class MovingScene:
    """A scene that plays itself; as the last line of a notebook's cell it stands in the cell.

    html: the whole page; it opens without a network.
    """

    html: str

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the page, whole or not at all. Raises: InputError: if it cannot be written."""
        write_text(path, self.html)
        return Path(path)

    def _repr_html_(self) -> str:
        page = escape(self.html, quote=True)
        look = f"width:100%;height:{HEIGHT}px;border:0"
        return f'<iframe title="moving mechanism" style="{look}" srcdoc="{page}"></iframe>'

    def __repr__(self) -> str:
        return f"MovingScene({len(self.html) / 1e6:.1f} MB of HTML)"


def moving_scene(
    solution: xr.Dataset | str | os.PathLike[str],
    *,
    speed: float = 1.0,
    fps: float = 25.0,
    dark: bool = False,
) -> MovingScene:
    """A solution as a moving scene to turn by hand: for a notebook's cell, or a page of its own.

    Chains, platform, contacts and forces as on the live page, with play, pause and a time slider.
    Muscles are coloured by activation; without a result the mechanism is grey.

    Args:   solution: or its NetCDF file.
            speed: seconds of the solution in a second of the scene.
            fps: frames a second, 1 to 60.
            dark: on a dark ground.
    Returns: the scene; its `save(path)` writes the page.
    Raises: InputError: for values that are not such, or more than 3000 frames;
            MissingExtraError: without viser.
    """
    require("viser", "view")
    from .serve import server_of
    from .stage import Stage

    given = open_solution(solution) if isinstance(solution, str | os.PathLike) else solution
    dataset = as_kind(given, "solution", "solution")
    times = frame_times(dataset, speed, fps)
    playback = Playback(dataset)
    # viser records what a server shows; this one listens to nobody, and ends here.
    server, _ = server_of("127.0.0.1", 0)
    try:
        server.scene.configure_environment_map(None)
        stage = Stage(server, playback.mechanism)
        stage.control.visible = False
        stage.show_paths([playback.path(point) for _, point in trails(dataset)])
        bodies = dataset["marker_body"].values if "marker_body" in dataset.coords else ()
        stage.show_markers([str(body) for body in bodies])
        stage.look_from(server.initial_camera)
        recorder = server.get_scene_serializer()
        with step("recording the scene", len(times)) as advance:
            for time in times:
                playback.seek(float(time))
                stage.show(playback.snapshot())
                recorder.insert_sleep(1.0 / fps)
                advance(1)
        return MovingScene(recorder.as_html(dark_mode=dark))
    finally:
        with contextlib.redirect_stdout(io.StringIO()):
            server.stop()
