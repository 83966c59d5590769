"""A live simulation: its clock and its messages without a page, then its page under hands."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from urllib.parse import urlsplit

import msgspec
import numpy as np
import pytest
import viser
from support.browser import Tab
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

import condyle
from condyle.errors import InputError
from condyle.simulation.simulating import planned
from condyle.view import View, live_player, open_view
from condyle.view.live_player import LivePlayer
from condyle.view.readout import live_html, status_html

from .page import drag, fill, grip, row

pytestmark = pytest.mark.usefixtures("compiler_command")  # by numpy a second takes minutes

PROTOCOL = f"viser-v{viser.__version__}"
TORQUE = {"kind": "computed_torque", "stiffness": 2500.0}
FOOD = {"kind": "food", "food": "bolus", "point": "right_molar"}
CHEW = {"duration": 3.0, "controller": TORQUE, "load": [FOOD]}
LONG = {**CHEW, "duration": 30.0}  # it loops


@pytest.fixture
def player(reference: condyle.Mechanism, monkeypatch: pytest.MonkeyPatch) -> LivePlayer:
    monkeypatch.setattr(live_player, "BUDGET", np.inf)  # however slow this machine is
    return LivePlayer(planned(reference, [CHEW])[0])


def test_it_keeps_the_time_of_the_clock(player: LivePlayer) -> None:
    assert player.advance(0.03) and player.now == pytest.approx(0.03, abs=1e-9)
    player.speed = 0.5
    player.advance(0.04)
    assert player.now == pytest.approx(0.05, abs=1e-9)
    player.advance(1e3)  # after a long sleep it does not run after the clock
    assert player.now == pytest.approx(0.1, abs=1e-9)
    player.pause()
    assert not player.advance(0.1) and player.now == pytest.approx(0.1, abs=1e-9)
    player.play()
    player.restart()
    assert player.now == 0


def test_its_numbers_are_those_of_a_simulation(
    reference: condyle.Mechanism, player: LivePlayer
) -> None:
    for _ in range(5):
        player.advance(0.1)
    found = player.snapshot()
    solved = condyle.simulate(condyle.derive(reference), {**CHEW, "duration": 0.5, "rate": 100.0})
    last = solved.isel(time=-1)
    for name, floor in (("pose", 1e-6), ("joint", 1e-6), ("effort", 1e-6), ("contact_force", 1e-4)):
        np.testing.assert_allclose(getattr(found, name), last[name], rtol=1e-3, atol=floor)
    assert found.time == pytest.approx(0.5) and found.rate is not None
    told = live_html(player)
    error = np.degrees(last["tracking_error"].values[3])
    near_zero = {"0.000", "-0.000"} if abs(error) < 1e-3 else set()
    assert any(f">{x}<" in told for x in {f"{error:.3f}", *near_zero}) and "food" in told


def test_an_end_is_said_and_it_begins_again(
    reference: condyle.Mechanism, monkeypatch: pytest.MonkeyPatch
) -> None:
    player = LivePlayer(planned(reference, [{"duration": 5.0, "start": {"dbeta": 0.1}}])[0])
    while player.playing:
        player.advance(0.1)
    found = player.snapshot()
    assert found.level == "unreachable" and "Simulation ended" in found.messages[0]
    assert np.isfinite(found.pose).all() and "Simulation ended" in status_html(found)
    player.play()
    assert player.now == 0 and player.advance(0.01) and player.live.ended is None
    monkeypatch.setattr(live_player, "BUDGET", np.inf)
    player = LivePlayer(planned(reference, [{"duration": 0.05, "controller": TORQUE}])[0])
    player.advance(0.1)
    assert player.now == 0 and player.playing
    player.loop = False
    player.advance(0.1)
    assert not player.playing and player.snapshot().messages[0] == "Simulation finished."


def test_what_goes_wrong_is_told_of_once(
    reference: condyle.Mechanism, player: LivePlayer, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A law that fails, and a pace that cannot be kept; a scenario stands alone."""

    def fail(t: float) -> None:
        raise np.linalg.LinAlgError("Singular matrix")

    with pytest.raises(InputError, match="no solution"):
        open_view(reference, "a.nc", scenario=CHEW)
    with monkeypatch.context() as patch:
        patch.setattr(live_player, "BUDGET", 0.0)
        for _ in range(20):
            player.advance(0.1)
        assert player.now == 0
        assert "Slower than requested" in player.snapshot().messages[0]
    monkeypatch.setattr(player.live, "go_to", fail)
    with pytest.raises(np.linalg.LinAlgError):
        player.advance(0.03)
    assert not player.advance(0.03)


@pytest.fixture
def view() -> Iterator[View]:
    running = open_view("masticatory", port=0, scenario=LONG)
    assert running.live is not None
    running.live.speed = 0.1  # leaves the processor to the page
    yield running
    running.close()


def test_hands_on_the_page(open_tab: Callable[..., Tab], view: View) -> None:
    tab = open_tab(view.url)
    player = view.live
    assert player is not None and view.playback is player
    tab.page.locator('[data-table="events"]').wait_for()
    tab.until(lambda: player.now > 0.01, "time passes")
    tab.page.get_by_role("button", name="Pause").click()
    tab.page.get_by_role("button", name="Run").wait_for()
    assert not player.playing
    fill(tab, "thickness [mm]", 15)
    thickness = [p.field for p in player.live.parameters].index("thickness")
    tab.until(lambda: player.live.values[thickness] == pytest.approx(0.015), "the food grows")
    x, y = grip(tab)
    tab.page.mouse.move(x, y)
    tab.page.wait_for_timeout(300)
    drag(tab, x, y, -12, 5)
    tab.until(lambda: player.live.pulling, "the hand pulls")
    tab.page.locator('[data-table="loads"] tr').filter(has_text="mouse").wait_for()
    tab.until(lambda: float(row(tab, "loads", "mouse")[1].split()[0]) > 0, "its force is told")
    tab.page.mouse.up()
    tab.until(lambda: not player.live.pulling, "the hand lets go")
    tab.page.get_by_role("button", name="Reset to scenario").click()
    tab.until(lambda: player.live.values[thickness] == pytest.approx(0.01), "as it was")
    tab.page.get_by_role("button", name="Restart").click()
    tab.until(lambda: player.playing, "it runs again")
    tab.page.get_by_role("tab", name="Move").click()
    fill(tab, "beta [°]", 3)
    tab.until(lambda: view.playback is None, "a hand on the mechanism ends it")
    assert not player.playing


VALUES = [None, "", "x" * 2000, True, [1.0], {"value": 1}, -1, 1e308, 10**18]
VALUES += [float("nan"), float("inf"), b"\xff"]


@pytest.mark.ci
def test_hostile_values_from_the_wire(view: View, capfd: pytest.CaptureFixture[str]) -> None:
    """To every control of a running simulation, past what the page's own sliders allow."""
    place = urlsplit(view.url)
    controls = list(view._server.gui._gui_input_handle_from_uuid)
    assert len(controls) > 10
    for update in [{"value": value} for value in VALUES] + [{"label": 3}, {}]:
        left = [*controls]
        while left:  # what cannot be read ends a connection
            with (
                suppress(ConnectionClosed),
                connect(f"ws://{place.netloc}{place.path}", subprotocols=[PROTOCOL]) as client,
            ):
                while left:
                    message = {"type": "GuiUpdateMessage", "uuid": left.pop(), "updates": update}
                    client.send(msgspec.msgpack.encode(message))
    time.sleep(0.5)
    assert view._worker.is_alive()
    assert np.isfinite(view.session.snapshot().pose).all()
    assert view.live is None or np.isfinite(view.live.snapshot().pose).all()
    view.close()
    told = capfd.readouterr()
    assert "Traceback" not in told.out + told.err
