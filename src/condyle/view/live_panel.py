"""The controls of a live simulation: clock, knobs, the hand that pulls, and what it says."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, Protocol

import numpy as np
import viser

from ..simulation.knobs import Knob
from .live_player import LivePlayer
from .readout import live_html
from .stage import Stage

SLOWEST, FASTEST = 0.1, 10.0
STRONGEST = 20.0  # times the hand's first stiffness
STEPS = 400  # of a slider
MILLI = {"m": ("mm", 1e3)}


class Hearing(Protocol):
    """How a panel hears of hands; see `Panel`."""

    def hear(self, kind: str, handle: Any, action: Callable[[Any], None]) -> None: ...
    def press(self, label: str, action: Callable[[], None], **options: Any) -> Any: ...
    def wish(self, kind: str, action: Callable[[], None]) -> None: ...
    def watch_live(self) -> None: ...


class LivePanel:
    """A tab's worth of controls."""

    def __init__(self, gui: viser.GuiApi, panel: Hearing, player: LivePlayer, stage: Stage) -> None:
        self._gui, self._panel, self.player, self._stage = gui, panel, player, stage
        self._held = self._shown = False
        self._play = panel.press("Pause", self.toggle)
        panel.press("Restart", self.restart)
        speed = gui.add_slider("Speed [×]", SLOWEST, FASTEST, 0.1, 1.0)
        panel.hear("live speed", speed, partial(setattr, player, "speed"))
        again = gui.add_checkbox("Begin again at the end", player.again)
        panel.hear("again", again, partial(setattr, player, "again"))
        self._add_hand()
        self._add_knobs()
        self._told = gui.add_html("")

    def _add_hand(self) -> None:
        player = self.player
        with self._gui.add_folder("Pull with the mouse"):
            at = self._gui.add_dropdown("at", player.pull_points, initial_value=player.pull_at)
            self._panel.hear("pull at", at, self.pull_at)
            first, most = player.stiffness, STRONGEST * player.stiffness
            spring = self._gui.add_slider("spring [N/m]", 0.0, most, most / STEPS, first)
            self._panel.hear("pull by", spring, partial(setattr, player, "stiffness"))
        self._grip = self._stage.add_grip()

        async def dragged(event: Any) -> None:
            position = np.asarray(self._grip.position) / self._stage.scale
            self._panel.wish("pull", partial(self.pull, position, event.phase != "end"))

        self._grip.on_update(dragged)

    def _add_knobs(self) -> None:
        """A slider for each number of the law and of the loads."""
        self._sliders: list[Any] = []
        owner, folder = "", None
        for i, knob in enumerate(self.player.live.knobs):
            if knob.owner != owner:
                owner, folder = knob.owner, self._gui.add_folder(knob.owner.capitalize())
            assert folder is not None
            with folder:
                self._sliders.append(self._slider(i, knob))
        if self._sliders:
            self._panel.press("As in the scenario", self.reset)

    def _slider(self, i: int, knob: Knob) -> Any:
        unit, scale = MILLI.get(knob.unit, (knob.unit, 1.0))
        low, high, value = (v * scale for v in (knob.low, knob.high, knob.value))
        name = knob.field.replace("_", " ")
        step = (high - low) / STEPS
        slider = self._gui.add_slider(f"{name} [{unit}]", low, high, step, value)
        self._panel.hear(
            f"knob {i}", slider, lambda value: self.player.live.turn(i, float(value) / scale)
        )
        return slider

    # -- what a hand does -------------------------------------------------------------------------

    def toggle(self) -> None:
        """Run or pause."""
        running = self.player.playing and self._shown
        self._panel.watch_live()
        (self.player.pause if running else self.player.play)()

    def restart(self) -> None:
        """From the start, running."""
        self._panel.watch_live()
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
        """All knobs as the scenario has them."""
        self.player.live.reset()
        for slider, knob in zip(self._sliders, self.player.live.knobs, strict=True):
            slider.value = knob.value * MILLI.get(knob.unit, ("", 1.0))[1]

    # -- what it says -----------------------------------------------------------------------------

    def show(self, shown: bool) -> None:
        """Bring words and grip up to date; `shown`: whether the page shows the simulation."""
        self._shown = shown
        self._grip.visible = shown
        self._play.label = "Pause" if shown and self.player.playing else "Run"
        if not shown:
            return
        if not self._held:
            self._grip.position = self._stage.scale * self.player.grip()
        self._told.content = live_html(self.player)
