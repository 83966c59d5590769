"""The panel beside the scene: status, numbers, and the controls that move pose, load and time."""

from __future__ import annotations

import tempfile
from functools import partial
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import viser

from ..errors import CondyleError
from ..mechanism import bundled_mechanisms, load, parse
from ..solution import open_solution
from .readout import COLOURS, status_html, tables_html
from .snapshot import Snapshot
from .stage import VIEWS

if TYPE_CHECKING:
    from .playback import Playback
    from .serve import View

WEIGHTS = 25  # the load's sliders go to this many weights of the platform,
LEAST_LOAD = 100.0  # and at least to this [N]
SPEEDS = {"0.1×": 0.1, "0.25×": 0.25, "0.5×": 0.5, "1×": 1.0, "2×": 2.0}


class Panel:
    """The controls of one mechanism. They call the view and never compute."""

    def __init__(self, server: viser.ViserServer, view: View) -> None:
        self._gui = server.gui
        self._view = view
        self._playback: Playback | None = None
        self._gui.set_panel_label(f"condyle - {view.session.mechanism.name}")
        self._status = self._gui.add_html("")
        tabs = self._gui.add_tab_group()
        with tabs.add_tab("Move"):
            self._add_pose()
            self._add_load()
        with tabs.add_tab("Play"):
            self._add_player()
        with tabs.add_tab("Open"):
            self._add_files()
        self._tables = self._gui.add_html("")
        views = self._gui.add_button_group("View", tuple(VIEWS))
        views.on_click(lambda event: view.look_from(event.target.value))
        view.stage.control.on_update(self._dragged)

    def _add_pose(self) -> None:
        session = self._view.session
        self._coordinates = {c.name: c for c in session.coordinates()}
        self._sliders: dict[str, Any] = {}
        for c in self._coordinates.values():
            low, high = round_outwards(c.low * c.scale, c.high * c.scale)
            slider: Any = self._gui.add_slider(
                f"{c.name} [{c.unit}]",
                min=low,
                max=high,
                step=0.01,
                initial_value=0.0,
            )
            slider.on_update(partial(self._moved, c.name))
            self._sliders[c.name] = slider
        self._gui.add_button("Go home").on_click(lambda _: self._go_home())
        show = self._gui.add_checkbox("Drag the platform in the scene", True)
        control = self._view.stage.control
        show.on_update(lambda _: setattr(control, "visible", show.value))

    def _add_load(self) -> None:
        mechanism = self._view.session.mechanism
        weight = mechanism.platform.mass * float(np.linalg.norm(mechanism.gravity))
        most = float(np.ceil(max(WEIGHTS * weight, LEAST_LOAD)))
        with self._gui.add_folder("Load on the platform"):
            self._load = [
                self._gui.add_slider(f"{name} [N]", -most, most, most / 500, 0.0)
                for name in ("Fx", "Fy", "Fz")
            ]
            points = self._view.session.load_points
            here = self._view.session.load_point
            self._load_point = self._gui.add_dropdown("at", points, initial_value=here)
        for slider in self._load:
            slider.on_update(self._loaded)
        self._load_point.on_update(self._loaded)

    def _add_player(self) -> None:
        self._player_note = self._gui.add_markdown("No solution is open. Open one (.nc) here:")
        upload = self._gui.add_upload_button("Open a solution", mime_type=".nc")
        upload.on_upload(lambda _: self._open_solution(upload.value.name, upload.value.content))
        self._time: Any = self._gui.add_slider("t [s]", 0.0, 1.0, 0.001, 0.0, disabled=True)
        self._play = self._gui.add_button("Play", disabled=True)
        self._speed = self._gui.add_dropdown("Speed", tuple(SPEEDS), initial_value="1×")
        self._time.on_update(self._scrubbed)
        self._play.on_click(lambda _: self._toggle())
        self._speed.on_update(lambda _: self._set_speed())

    def _add_files(self) -> None:
        bundled = self._gui.add_dropdown("Bundled", ("-", *bundled_mechanisms()))
        bundled.on_update(lambda event: self._open_bundled(event, bundled.value))
        upload = self._gui.add_upload_button("Open a mechanism (.toml)", mime_type=".toml")
        upload.on_upload(lambda _: self._open_mechanism(upload.value.name, upload.value.content))
        dark = self._gui.add_checkbox("Dark page", self._view.dark)
        dark.on_update(lambda _: self._view.set_dark(dark.value))

    def show(self, snapshot: Snapshot) -> None:
        """Bring words, numbers and sliders to a snapshot."""
        self._status.content = status_html(snapshot)
        self._tables.content = tables_html(snapshot)
        for name, slider in self._sliders.items():
            c = self._coordinates[name]
            value = self._view.session.q[self._view.session.model.independent.index(name)]
            shown = float(np.clip(value * c.scale, slider.min, slider.max))
            if abs(slider.value - shown) > 0.005:
                slider.value = shown
        if self._playback is not None:
            self._time.value = self._playback.now
            self._play.label = "Pause" if self._playback.playing else "Play"

    def show_playback(self, playback: Playback) -> None:
        """Let the player control a solution."""
        self._playback = playback
        first, last = float(playback.time[0]), float(playback.time[-1])
        self._time.min, self._time.max = first, last
        self._time.step = max((last - first) / max(len(playback.time) - 1, 1), 1e-6)
        self._time.disabled = self._play.disabled = False
        options = playback.solution.options
        self._player_note.content = (
            f"{len(playback.time)} samples, {options['formulation']}/{options['route']}"
        )

    def say_error(self, message: str) -> None:
        """What went wrong, where the reader looks first."""
        colour = COLOURS["unreachable"]
        self._status.content = (
            f'<div role="alert" style="border-left:4px solid {colour};margin:4px 10px;'
            f'padding:4px 8px;font-size:13px;white-space:pre-wrap">{escape(message)}</div>'
        )

    def _moved(self, name: str, event: Any) -> None:
        if event.client_id is None:
            return  # the panel itself set the slider
        with self._view.lock:
            self._leave_playback()
            c = self._coordinates[name]
            self._view.session.set_coordinate(name, self._sliders[name].value / c.scale)
        self._view.refresh()

    def _dragged(self, event: Any) -> None:
        with self._view.lock:
            self._leave_playback()
            self._view.dragging = event.phase != "end"
            self._view.session.drag_to(self._view.stage.held_pose())
        self._view.refresh()

    def _go_home(self) -> None:
        with self._view.lock:
            self._leave_playback()
            self._view.session.go_home()
        self._view.refresh()

    def _loaded(self, event: Any) -> None:
        if event.client_id is None:
            return
        with self._view.lock:
            force = np.array([handle.value for handle in self._load])
            self._view.session.set_load(force, self._load_point.value)
        self._view.refresh()

    def _leave_playback(self) -> None:
        """A hand on the mechanism ends the playing; the pose goes on from where it was."""
        if self._view.playback is None:
            return
        pose = self._view.snapshot.pose
        self._view.playback.pause()
        self._view.playback = None
        self._view.session.take_pose(pose)

    def _resume_playback(self) -> Playback | None:
        if self._playback is not None:
            self._view.playback = self._playback
        return self._playback

    def _toggle(self) -> None:
        with self._view.lock:
            playback = self._resume_playback()
            if playback is not None:
                (playback.pause if playback.playing else playback.play)()
        self._view.refresh()

    def _scrubbed(self, event: Any) -> None:
        if event.client_id is None:
            return
        with self._view.lock:
            playback = self._resume_playback()
            if playback is not None:
                playback.seek(self._time.value)
        self._view.refresh()

    def _set_speed(self) -> None:
        if self._playback is not None:
            self._playback.speed = SPEEDS[self._speed.value]

    def _open_bundled(self, event: Any, name: str) -> None:
        if event.client_id is not None and name != "-":
            self._try(lambda: self._view.open_mechanism(load(name)))

    def _open_mechanism(self, name: str, content: bytes) -> None:
        self._try(lambda: self._view.open_mechanism(parse(decoded(name, content), name)))

    def _open_solution(self, name: str, content: bytes) -> None:
        def read() -> None:
            with tempfile.TemporaryDirectory() as folder:
                path = Path(folder) / "solution.nc"
                path.write_bytes(content)
                try:
                    solution = open_solution(path)
                except CondyleError as error:
                    raise CondyleError(str(error).replace(str(path), name)) from None
            self._view.play_solution(solution)

        self._try(read)

    def _try(self, action: Any) -> None:
        try:
            action()
        except CondyleError as error:
            self.say_error(str(error))


def round_outwards(low: float, high: float) -> tuple[float, float]:
    """Ends of a slider, at most two digits longer than needed."""
    step = 10.0 ** np.floor(np.log10(high - low) - 1)
    return float(np.floor(low / step) * step), float(np.ceil(high / step) * step)


def decoded(name: str, content: bytes) -> str:
    """The text of an uploaded file."""
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise CondyleError(f"{name} is not a text file (UTF-8 expected)") from None
