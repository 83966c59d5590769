"""The panel beside the scene: status, numbers, and the controls that move pose, load and time."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from functools import partial
from html import escape
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import viser
import xarray as xr

from ..errors import InputError, shortened
from ..kinematics.chain import FAMILIES
from ..mechanism import Mechanism, bundled_mechanisms, load_mechanism, parse
from ..mechanism.vocabulary import words_of
from ..results.solution import open_solution
from ..simulation.parameters import Parameter
from .live_player import LivePlayer
from .playback import Playback
from .readout import COLOURS, effects_html, internal_text, live_html, status_html, tables_html
from .session import MOST_INTERNAL, Session
from .snapshot import Snapshot
from .stage import VIEWS, Stage

WEIGHTS = 25  # the load's sliders go to this many weights of the platform,
LEAST_LOAD = 100.0  # and at least to this [N]
LONGEST_ERROR = 600  # characters of one that the page shows
SPEEDS = {"0.1×": 0.1, "0.25×": 0.25, "0.5×": 0.5, "1×": 1.0, "2×": 2.0}


class Page(Protocol):
    """What the controls need of the page that they stand on."""

    session: Session
    stage: Stage
    snapshot: Snapshot
    playback: Playback | LivePlayer | None
    live: LivePlayer | None
    dragging: bool
    dark: bool

    def request(self, kind: str, action: Callable[[], None]) -> None: ...
    def set_dark(self, dark: bool) -> None: ...
    def look_from(self, name: str) -> None: ...
    def open_mechanism(self, mechanism: Mechanism) -> None: ...
    def play_solution(self, solution: xr.Dataset) -> None: ...


class ControlPanel:
    """The controls of one mechanism. They note requests; the view's worker runs them."""

    def __init__(self, server: viser.ViserServer, view: Page) -> None:
        self._gui = server.gui
        self._view = view
        self._playback: Playback | None = None
        self._gui.set_panel_label(f"condyle - {view.session.mechanism.name}")
        self._status = self._gui.add_html("")
        tabs = self._gui.add_tab_group()
        self._live: LivePanel | None = None
        if view.live is not None:
            with tabs.add_tab("Live"):
                self._live = LivePanel(self._gui, self, view, view.live)
        with tabs.add_tab("Move"):
            self._add_pose()
            self._add_load()
        with tabs.add_tab("Preload"):
            self._add_internal()
        with tabs.add_tab("Play"):
            self._add_player()
        with tabs.add_tab("Open"):
            self._add_files()
        self._tables = self._gui.add_html("")
        views = self._gui.add_button_group("View", tuple(VIEWS))
        views.on_click(lambda _: view.request("camera", partial(view.look_from, views.value)))
        self._follow_drags()

    def on_change(self, kind: str, handle: Any, action: Callable[[Any], None]) -> None:
        """Request `action(value)` when a hand changes a handle, not when the panel itself does."""

        # On viser's own thread: a pool's thread might read the value after the worker's next one.
        async def heard(event: Any) -> None:
            if event.client_id is not None:
                self._view.request(kind, partial(action, handle.value))

        handle.on_update(heard)

    def add_button(self, label: str, action: Callable[[], None], **options: Any) -> Any:
        button = self._gui.add_button(label, **options)
        button.on_click(lambda _: self._view.request(label, action))
        return button

    def _add_pose(self) -> None:
        session = self._view.session
        self._coordinates = {c.name: c for c in session.coordinates()}
        self._sliders: dict[str, Any] = {}
        for c in self._coordinates.values():
            low, high = round_outwards(c.low * c.scale, c.high * c.scale)
            slider = self._gui.add_slider(f"{c.name} [{c.unit}]", low, high, 0.01, 0.0)
            self.on_change(c.name, slider, partial(self.move, c.name))
            self._sliders[c.name] = slider
        self._known = session.q.copy()
        self.add_button("Go home", self.go_home)
        control = self._view.stage.control
        control.visible = self._view.live is None  # the hand of a simulation has a grip of its own
        show = self._gui.add_checkbox("Drag handle", control.visible)
        self.on_change("control", show, lambda on: setattr(control, "visible", on))

    def _add_load(self) -> None:
        mechanism = self._view.session.mechanism
        weight = mechanism.platform.mass * float(np.linalg.norm(mechanism.gravity))
        most = round_outwards(0.0, max(WEIGHTS * weight, LEAST_LOAD))[1]
        session = self._view.session
        with self._gui.add_folder(words_of(session.mechanism)("Load on the platform")):
            for axis, name in enumerate(("Fx", "Fy", "Fz")):
                slider = self._gui.add_slider(f"{name} [N]", -most, most, most / 500, 0.0)
                self.on_change(name, slider, partial(self.push, axis))
            here, points = session.load_point, session.load_points
            at = self._gui.add_dropdown("at", points, initial_value=here)
            self.on_change("at", at, lambda point: session.set_load(session.load, point))

    def _add_internal(self) -> None:
        """One slider for each direction of internal efforts, as many as a panel can hold."""
        session = self._view.session
        count, most = len(session.internal), session.internal_reach()
        sliders = min(count, MOST_INTERNAL)
        say = words_of(session.mechanism)
        self._gui.add_markdown(say(internal_text(count, sliders)))
        self._internal: list[Any] = []
        for i in range(sliders):
            unit = FAMILIES[session.mechanism.chains[0].kind].effort_unit
            high = round_outwards(0.0, most)[1]
            slider = self._gui.add_slider(
                f"direction {i + 1} [{unit}]", -high, high, high / 500, 0.0
            )
            self.on_change(f"internal {i}", slider, partial(session.set_internal, i))
            self._internal.append(slider)
        if sliders:
            self.add_button(say("Reset internal efforts"), self.reset_internal)
        self._effects = self._gui.add_html("")

    def reset_internal(self) -> None:
        """Take all internal efforts off."""
        session = self._view.session
        session.internal[:] = 0.0
        for slider in self._internal:
            slider.value = 0.0

    def _add_player(self) -> None:
        self._player_note = self._gui.add_html(
            note_html("No solution is open. Open one (.nc) here:")
        )
        upload = self._gui.add_upload_button("Open a solution", mime_type=".nc")
        upload.on_upload(lambda _: self._view.request("open", partial(self.open_nc, upload.value)))
        self._time: Any = self._gui.add_slider("t [s]", 0.0, 1.0, 0.001, 0.0, disabled=True)
        self._play = self.add_button("Play", self.toggle, disabled=True)
        self._speed = self._gui.add_dropdown("Speed", tuple(SPEEDS), initial_value="1×")
        self.on_change("time", self._time, self.seek)
        self.on_change("speed", self._speed, self.set_speed)

    def _add_files(self) -> None:
        bundled = self._gui.add_dropdown("Bundled", ("-", *bundled_mechanisms()))
        self.on_change("open", bundled, self.open_bundled)
        upload = self._gui.add_upload_button("Open a mechanism (.toml)", mime_type=".toml")
        upload.on_upload(
            lambda _: self._view.request("open", partial(self.open_toml, upload.value))
        )
        dark = self._gui.add_checkbox("Dark page", self._view.dark)
        self.on_change("dark", dark, self._view.set_dark)

    def _follow_drags(self) -> None:
        stage = self._view.stage

        async def dragged(event: Any) -> None:
            action = partial(self.drag, stage.held_pose(), event.phase != "end")
            self._view.request("drag", action)

        stage.control.on_update(dragged)

    def show(self, snapshot: Snapshot) -> None:
        """Bring words, numbers and sliders to a snapshot."""
        self._status.content = status_html(snapshot)
        self._tables.content = tables_html(snapshot)
        session = self._view.session
        if self._internal:
            self._effects.content = effects_html(
                session.mechanism, session.directions(), session.internal, MOST_INTERNAL
            )
        for name, before, value in zip(
            session.model.independent, self._known, session.q, strict=True
        ):
            # A slider that a hand has just moved further must not be set back.
            if value != before:
                c, slider = self._coordinates[name], self._sliders[name]
                slider.value = float(np.clip(value * c.scale, slider.min, slider.max))
        self._known = session.q.copy()
        if self._live is not None:
            self._live.show(self._view.playback is self._view.live)
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
        playback.speed = SPEEDS[self._speed.value]
        options = playback.solution.condyle.options
        said = f"{len(playback.time)} samples, {options['formulation']}/{options['route']}"
        self._player_note.content = note_html(said)

    def show_error(self, message: str) -> None:
        """What went wrong, where the reader looks first."""
        colour, text = COLOURS["unreachable"], escape(shortened(message, LONGEST_ERROR))
        self._status.content = (
            f'<div role="alert" style="border-left:4px solid {colour};margin:4px 10px;'
            f'padding:4px 8px;font-size:13px;white-space:pre-wrap">{text}</div>'
        )

    def move(self, name: str, value: float) -> None:
        """Set a coordinate, in the unit of its slider."""
        self._take_over()
        session = self._view.session
        session.set_coordinate(name, value / self._coordinates[name].scale)
        i = session.model.independent.index(name)
        self._known[i] = session.q[i]

    def take(self, q: np.ndarray) -> None:
        """Go to independent coordinates, (m,) [m, rad]."""
        self._take_over()
        self._view.session.q = q.copy()

    def drag(self, pose: np.ndarray, holding: bool) -> None:
        """Follow the drag control, held at X_EE (6,) or let go there."""
        self._take_over()
        self._view.dragging = holding
        self._view.session.drag_to(pose)

    def go_home(self) -> None:
        self._take_over()
        self._view.session.go_home()

    def push(self, axis: int, value: float) -> None:
        """Set one component of the load [N]."""
        force = self._view.session.load.copy()
        force[axis] = value
        self._view.session.set_load(force)

    def _take_over(self) -> None:
        """A hand on the mechanism ends the playing; the pose goes on from where it was."""
        if self._view.playback is None:
            return
        self._view.playback.pause()
        self._view.playback = None
        self._view.session.take_pose(self._view.snapshot.pose)

    def _player(self) -> Playback:
        """The playback, on the page again if a hand had taken over."""
        assert self._playback is not None  # its controls are disabled before
        self._view.playback = self._playback
        return self._playback

    def toggle(self) -> None:
        player = self._player()
        (player.pause if player.playing else player.play)()

    def seek(self, time: float) -> None:
        self._player().seek(time)

    def set_speed(self, speed: str) -> None:
        if self._playback is not None:
            self._playback.speed = SPEEDS[speed]

    def open_bundled(self, name: str) -> None:
        if name != "-":
            self._view.open_mechanism(load_mechanism(name))

    def open_toml(self, file: Any) -> None:
        """Open an uploaded mechanism."""
        try:
            text = file.content.decode("utf-8-sig")
        except UnicodeDecodeError:
            raise InputError(f"{file.name} is not a text file (UTF-8 expected)") from None
        self._view.open_mechanism(parse(text, file.name))

    def open_nc(self, file: Any) -> None:
        """Open an uploaded solution."""
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "solution.nc"
            path.write_bytes(file.content)
            try:
                solution = open_solution(path)
            except InputError as error:
                raise InputError(str(error).replace(str(path), file.name)) from None
        self._view.play_solution(solution)


def note_html(text: str) -> str:
    """A line between controls; whatever it says, it formats nothing."""
    return f'<div style="margin:4px 10px;font-size:13px">{escape(text)}</div>'


def round_outwards(low: float, high: float) -> tuple[float, float]:
    """Ends of a slider, at most two digits longer than needed."""
    step = 10.0 ** np.floor(np.log10(high - low) - 1)
    return float(np.floor(low / step) * step), float(np.ceil(high / step) * step)


SLOWEST, FASTEST = 0.1, 10.0
STRONGEST = 20.0  # times the hand's first stiffness
STEPS = 400  # of a slider
MILLI = {"m": ("mm", 1e3)}


class LivePanel:
    """A tab's worth of controls."""

    def __init__(
        self, gui: viser.GuiApi, panel: ControlPanel, view: Page, player: LivePlayer
    ) -> None:
        self._gui, self._panel, self._view, self.player = gui, panel, view, player
        self._held = self._shown = False
        self._play = panel.add_button("Pause", self.toggle)
        panel.add_button("Restart", self.restart)
        speed = gui.add_slider("Speed [×]", SLOWEST, FASTEST, 0.1, 1.0)
        panel.on_change("live speed", speed, partial(setattr, player, "speed"))
        again = gui.add_checkbox("Loop", player.loop)
        panel.on_change("loop", again, partial(setattr, player, "loop"))
        self._add_hand()
        self._add_parameters()
        self._text = gui.add_html("")

    def _add_hand(self) -> None:
        player = self.player
        with self._gui.add_folder("Pull with the mouse"):
            at = self._gui.add_dropdown("at", player.pull_points, initial_value=player.pull_at)
            self._panel.on_change("pull at", at, self.pull_at)
            first, most = player.stiffness, STRONGEST * player.stiffness
            spring = self._gui.add_slider("spring [N/m]", 0.0, most, most / STEPS, first)
            self._panel.on_change("pull by", spring, partial(setattr, player, "stiffness"))
        self._grip = self._view.stage.add_grip()

        async def dragged(event: Any) -> None:
            position = np.asarray(self._grip.position) / self._view.stage.scale
            self._view.request("pull", partial(self.pull, position, event.phase != "end"))

        self._grip.on_update(dragged)

    def _add_parameters(self) -> None:
        """A slider for each number of the law and of the loads."""
        self._sliders: list[Any] = []
        owner, folder = "", None
        for i, parameter in enumerate(self.player.live.parameters):
            if parameter.owner != owner:
                owner, folder = parameter.owner, self._gui.add_folder(parameter.owner.capitalize())
            assert folder is not None
            with folder:
                self._sliders.append(self._slider(i, parameter))
        if self._sliders:
            self._panel.add_button("Reset to scenario", self.reset)

    def _slider(self, i: int, parameter: Parameter) -> Any:
        unit, scale = MILLI.get(parameter.unit, (parameter.unit, 1.0))
        low, high, value = (v * scale for v in (parameter.low, parameter.high, parameter.value))
        name = parameter.field.replace("_", " ")
        step = (high - low) / STEPS
        slider = self._gui.add_slider(f"{name} [{unit}]", low, high, step, value)
        self._panel.on_change(
            f"parameter {i}",
            slider,
            lambda value: self.player.live.set_parameter(i, float(value) / scale),
        )
        return slider

    def toggle(self) -> None:
        """Run or pause."""
        running = self.player.playing and self._shown
        self._view.playback = self._view.live  # again, if a hand or a solution had taken over
        (self.player.pause if running else self.player.play)()

    def restart(self) -> None:
        """Start again, running."""
        self._view.playback = self._view.live
        self.player.restart()
        self.player.playing = True

    def pull_at(self, point: str) -> None:
        """Move the grip to another point."""
        self.player.let_go()
        self.player.pull_at = point

    def pull(self, held: np.ndarray, holding: bool) -> None:
        """Hold the point by a spring at (3,) [m] in {S}, or let it go."""
        self._held = holding
        if holding:
            self.player.pull(held)
        else:
            self.player.let_go()

    def reset(self) -> None:
        """All parameters as the scenario has them."""
        self.player.live.reset()
        for slider, parameter in zip(self._sliders, self.player.live.parameters, strict=True):
            slider.value = parameter.value * MILLI.get(parameter.unit, ("", 1.0))[1]

    def show(self, visible: bool) -> None:
        """Bring words and grip up to date; `visible`: whether the page shows the simulation."""
        self._shown = visible
        self._grip.visible = visible
        self._play.label = "Pause" if visible and self.player.playing else "Run"
        if not visible:
            return
        if not self._held:
            self._grip.position = self._view.stage.scale * self.player.grip()
        self._text.content = live_html(self.player)
