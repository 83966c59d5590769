"""The live page in a browser: hands on the sliders move the mechanism and the numbers."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from support.browser import PATIENCE, Tab

import condyle
from condyle.view import View, open_view


@pytest.fixture(scope="module")
def solution(reference: condyle.Mechanism) -> xr.Dataset:
    """All 5001 samples of the reference case."""
    model = condyle.derive(reference, backend="interpreted")
    return model.solve(condyle.reference_motion(), condyle.reference_load())


@pytest.fixture
def view(browser: object) -> Iterator[View]:
    running = open_view("masticatory", port=0)
    yield running
    running.close()


@pytest.fixture
def tab(open_tab: Callable[..., Tab], view: View) -> Tab:
    return ready(open_tab(view.url))


def ready(tab: Tab) -> Tab:
    tab.page.wait_for_selector("[data-level]")
    # The scene's meshes arrive after the panel, and the blue arrow of the handle last.
    tab.picture_where("canvas", lambda pixels: near(pixels, HANDLE).sum() > 20, "the handle")
    return tab


HANDLE = (54, 142, 226)  # blue arrow of the drag control


def near(pixels: np.ndarray, colour: tuple[int, int, int]) -> np.ndarray:
    """Which pixels have nearly that colour."""
    return np.abs(pixels - colour).max(axis=-1) < 25


def fill(tab: Tab, label: str, value: float) -> None:
    """Type into the number of a slider."""
    field = tab.page.locator(
        f'xpath=//label[text()="{label}"]'
        '/ancestor::div[.//input[@inputmode="decimal"]][1]//input[@inputmode="decimal"]'
    )
    field.fill(str(value))
    field.press("Enter")


def is_red(pixels: np.ndarray) -> np.ndarray:
    return (pixels[..., 0] > 150) & (pixels[..., 1] < 110) & (pixels[..., 2] < 110)


def is_yellow(pixels: np.ndarray) -> np.ndarray:
    """As the drag control is where the mouse is over it."""
    return (pixels[..., :2] > 200).all(axis=-1) & (pixels[..., 2] < 190)


def row(tab: Tab, table: str, name: str) -> list[str]:
    cells = tab.page.locator(f'[data-table="{table}"] tr').filter(has_text=name).locator("td")
    return cells.all_inner_texts()


def wait_for_level(tab: Tab, level: str) -> str:
    status = tab.page.locator(f'[data-level="{level}"]')
    status.wait_for(timeout=PATIENCE)
    return status.inner_text()


@pytest.mark.parametrize(("width", "height"), [(1440, 900), (420, 844)])
def test_page_opens_without_a_network(
    open_tab: Callable[..., Tab], view: View, width: int, height: int
) -> None:
    tab = ready(open_tab(view.url, width, height))
    local = ("http://127.0.0.1", "ws://127.0.0.1", "data:", "blob:")
    assert [url for url in tab.requests if not url.startswith(local)] == []
    assert tab.page.locator('[data-level="ok"]').is_visible()
    pixels = tab.picture("canvas").reshape(-1, 3)
    assert pixels.std(axis=0).max() > 8, "the canvas is not blank"


def test_a_slider_moves_the_mechanism_and_the_numbers(tab: Tab, view: View) -> None:
    before, picture = row(tab, "chains", "masseter_left"), tab.picture("canvas")
    fill(tab, "beta [°]", 8)
    tab.page.locator('[data-table="pose"]').filter(has_text="8.00").wait_for()
    after = row(tab, "chains", "masseter_left")
    assert after[1] != before[1] and after[2] != before[2]
    at = view.snapshot
    assert at.pose[4] == pytest.approx(np.radians(8))
    assert after[1] == f"{np.degrees(at.joint[2]):.2f} °"
    assert after[2] == f"{at.effort[2]:.4f} N m"
    tab.changed_picture("canvas", picture)


def test_a_load_changes_efforts_and_contact_forces(tab: Tab, view: View) -> None:
    fill(tab, "Fz [N]", -60)
    tab.page.locator('[data-table="contacts"]').filter(has_not_text="0.370").wait_for()
    assert view.snapshot.load[2] == -60
    force = row(tab, "contacts", "right_condyle")[1]
    assert force == f"{view.snapshot.contact_force[1]:.3f} N"
    assert view.snapshot.contact_force[1] < -1


def test_poses_out_of_bounds_and_out_of_reach_say_so_and_the_page_lives(
    tab: Tab, view: View
) -> None:
    fill(tab, "X [mm]", -3)
    assert "left_condyle is 2 mm outside its bounds" in wait_for_level(tab, "warning")
    fill(tab, "X [mm]", 16)
    told = wait_for_level(tab, "unreachable")
    assert 'chain "temporalis_left" cannot reach M' in told
    assert row(tab, "chains", "temporalis_left")[2] == "–"
    tab.picture_where("canvas", lambda p: is_red(p).sum() > 2000, "the platform in red")
    tab.page.get_by_role("button", name="Go home").click()
    wait_for_level(tab, "ok")
    assert row(tab, "chains", "temporalis_left")[2] == "0.0145 N m"


def test_a_solution_is_played_and_scrubbed(
    tab: Tab, view: View, solution: xr.Dataset, tmp_path: Path
) -> None:
    path = tmp_path / "chewing.nc"
    solution.condyle.save(path)
    tab.page.get_by_role("tab", name="Play").click()
    tab.page.set_input_files("input[type=file]", str(path))
    tab.page.get_by_text("5001 samples").wait_for()
    fill(tab, "t [s]", 1.626)
    tab.page.locator("[data-level]").filter(has_text="t = 1.626 s").wait_for()
    at = solution.sel(time=1.626, method="nearest")
    for i, chain in enumerate(solution["chain"].values):
        assert row(tab, "chains", str(chain))[2] == f"{float(at['effort'].values[i]):.4f} N m"
    assert view.playback is not None
    view.playback.speed = 0.02  # slow, so that a slow machine is not at the end
    tab.page.get_by_role("button", name="Play", exact=True).click()
    tab.page.get_by_role("button", name="Pause", exact=True).wait_for()
    tab.wait(
        "() => Number(document.querySelector('[data-level]').textContent.match(/t = (.*) s/)[1])"
        " > 1.635"
    )
    assert 1.635 < view.playback.now < 4, "it began where it stood, however long it stood there"
    tab.page.get_by_role("tab", name="Move").click()
    fill(tab, "beta [°]", 3)
    tab.page.locator('[data-table="pose"]').filter(has_text="3.00").wait_for()
    assert view.playback is None, "a hand on the mechanism ends the playing"


def test_files_open_and_bad_ones_are_refused(tab: Tab, view: View, tmp_path: Path) -> None:
    bad = tmp_path / "bad.toml"
    bad.write_text('name = "<b>bad</b>"\nunknown = 1\n')
    tab.page.get_by_role("tab", name="Open").click()
    tab.page.set_input_files("input[type=file]", str(bad))
    told = tab.page.get_by_role("alert").filter(has_text="unknown")
    told.wait_for()
    assert view.session.mechanism.name == "masticatory"
    good = tmp_path / "good.toml"
    condyle.dump(condyle.load_mechanism("hexaglide"), good)
    tab.page.set_input_files("input[type=file]", str(good))
    tab.page.get_by_text("condyle - hexaglide").wait_for()
    wait_for_level(tab, "ok")
    assert view.session.mechanism.name == "hexaglide"
    assert len(row(tab, "chains", "left_front")) == 5


def test_dragging_the_platform_moves_it(tab: Tab, view: View) -> None:
    """Pulled down by the blue arrow, the jaw opens: Z is no independent coordinate here."""
    top, left = 420, 440  # the middle of the scene, without the blue rods
    blue = near(tab.picture("canvas")[top:620, left:560], HANDLE)
    y, x = (int(v) for v in np.argwhere(blue)[0] + [top, left])  # the tip of the arrow
    mouse = tab.page.mouse
    mouse.move(x, y + 10)
    tab.picture_where("canvas", lambda p: is_yellow(p).sum() > 20, "the arrow under the mouse")
    mouse.down()
    for step in range(1, 9):
        mouse.move(x, y + 10 + 5 * step)
        # A step of the hand is seen by the page before the next one.
        tab.page.evaluate("() => new Promise((done) => requestAnimationFrame(done))")
    tab.until(lambda: view.snapshot.pose[2] < -0.001, "the platform follows the hand")
    assert view.dragging
    mouse.up()
    tab.until(lambda: not view.dragging, "the hand lets go")
    tab.wait("() => Number(document.querySelectorAll('[data-table=pose] td')[3].textContent) < -1")


def test_the_page_is_for_this_machine_only(view: View) -> None:
    assert view.url.startswith("http://127.0.0.1:")
    listening = view._server.get_host()
    assert listening == "127.0.0.1"


def test_arrow_keys_on_a_slider_leave_the_camera_alone(tab: Tab, view: View) -> None:
    """They move the slider by a step; away from it they turn the camera."""
    client = next(iter(view._server.get_clients().values()))
    before = np.array(client.camera.position)
    slider = tab.page.get_by_role("slider").first
    slider.focus()
    for _ in range(3):
        tab.page.keyboard.down("ArrowRight")
        tab.page.wait_for_timeout(300)
        tab.page.keyboard.up("ArrowRight")
    tab.until(lambda: view.snapshot.pose.any(), "the slider moves the platform")
    assert np.allclose(client.camera.position, before, atol=1e-6)
    tab.page.evaluate("document.activeElement.blur()")
    tab.page.keyboard.down("ArrowRight")
    tab.until(lambda: not np.allclose(client.camera.position, before, atol=1e-3), "it turns")
    tab.page.keyboard.up("ArrowRight")


def test_internal_efforts_move_numbers_and_nothing_else(
    open_tab: Callable[..., Tab], tab: Tab, view: View
) -> None:
    before = view.snapshot
    tab.page.get_by_role("tab", name="Preload").click()
    tab.page.get_by_text("2 directions of internal efforts").wait_for()
    fill(tab, "direction 1 [N m]", 0.5)
    tab.until(lambda: bool(view.session.internal[0]), "the slider is heard")
    tab.until(lambda: view.snapshot is not before, "it is drawn")
    tab.page.locator('[data-table="internal"]').wait_for()
    now, directions = view.snapshot, view.session.directions()
    amount = view.session.internal[0]
    assert amount == pytest.approx(0.5, abs=0.01)
    added = now.effort - before.effort
    assert np.allclose(added, amount * directions.effort[:, 0], atol=1e-12)
    assert np.array_equal(now.pose, before.pose)
    tab.page.get_by_role("button", name="Reset internal efforts").click()
    tab.until(lambda: not view.session.internal.any(), "the efforts are taken off")
    tab.until(lambda: np.allclose(view.snapshot.effort, before.effort), "they are gone")
