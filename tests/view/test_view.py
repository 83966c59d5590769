"""The live page in a browser: hands on the sliders move the mechanism and the numbers."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from support.browser import Tab, tabs
from support.machines import model

import condyle
from condyle.motion import Motion, bundled_reference
from condyle.view import View, open_view

from .page import drag, fill, grip, ready, row, upload, wait_for_level


@pytest.fixture(scope="module")
def solution() -> xr.Dataset:
    motion = Motion.from_csv(bundled_reference()[0], rate=100)
    return model("masticatory").solve(motion, condyle.reference_load())


@pytest.fixture(scope="module")
def view(browser: object) -> Iterator[View]:
    running = open_view("masticatory", port=0)
    yield running
    running.close()


@pytest.fixture(scope="module")
def page(browser: object, view: View) -> Iterator[Tab]:
    """First on a phone, where it opens without a network."""
    with tabs(browser) as open_one:
        tab = open_one(view.url, 420, 844)
        tab.page.wait_for_selector("[data-level]")
        local = ("http://127.0.0.1", "ws://127.0.0.1", "data:", "blob:")
        assert [url for url in tab.requests if not url.startswith(local)] == []
        assert tab.page.locator('[data-level="ok"]').is_visible()
        tab.picture_where(
            "canvas", lambda p: p.reshape(-1, 3).std(axis=0).max() > 8, "a canvas that is not blank"
        )
        tab.page.set_viewport_size({"width": 1440, "height": 900})
        yield ready(tab)


@pytest.fixture
def tab(page: Tab, view: View) -> Tab:
    """The one page of all tests, at home and without loads."""
    page.page.get_by_role("tab", name="Move").click()
    fill(page, "Fz [N]", 0)
    page.page.get_by_role("button", name="Go home").click()
    page.until(lambda: bool(np.allclose(view.snapshot.pose, 0, atol=1e-9)), "it is at home")
    wait_for_level(page, "ok")
    return page


def is_red(pixels: np.ndarray) -> np.ndarray:
    return (pixels[..., 0] > 150) & (pixels[..., 1] < 110) & (pixels[..., 2] < 110)


def is_yellow(pixels: np.ndarray) -> np.ndarray:
    """As the drag control is where the mouse is over it."""
    return (pixels[..., :2] > 200).all(axis=-1) & (pixels[..., 2] < 190)


def test_sliders_move_the_mechanism_and_the_numbers(tab: Tab, view: View) -> None:
    assert view.url.startswith("http://127.0.0.1:"), "for this machine only"
    assert view._server.get_host() == "127.0.0.1"
    before, picture = row(tab, "chains", "masseter_left"), tab.picture("canvas")
    fill(tab, "beta [°]", 8)
    tab.page.locator('[data-table="pose"]').filter(has_text="8.00").wait_for()
    after, at = row(tab, "chains", "masseter_left"), view.snapshot
    assert after[1] != before[1] and after[2] != before[2]
    assert at.pose[4] == pytest.approx(np.radians(8))
    assert after[1] == f"{np.degrees(at.joint[2]):.2f} °"
    assert after[2] == f"{at.effort[2]:.4f} N m"
    tab.changed_picture("canvas", picture)
    fill(tab, "Fz [N]", -60)
    tab.until(lambda: view.snapshot.load[2] == -60, "the load is heard")
    force = f"{view.snapshot.contact_force[1]:.3f} N"
    assert view.snapshot.contact_force[1] < -1
    tab.page.locator('[data-table="contacts"]').filter(has_text=force).wait_for()
    assert row(tab, "contacts", "right_condyle")[1] == force


def test_poses_out_of_bounds_and_out_of_reach_say_so_and_the_page_lives(tab: Tab) -> None:
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
    upload(tab, "Open a solution", path)
    tab.page.get_by_text("501 samples").wait_for()
    fill(tab, "t [s]", 1.63)
    tab.page.locator("[data-level]").filter(has_text="t = 1.63").wait_for()
    at = solution.sel(time=1.63, method="nearest")
    for i, chain in enumerate(solution["chain"].values):
        assert row(tab, "chains", str(chain))[2] == f"{float(at['effort'].values[i]):.4f} N m"
    assert view.playback is not None
    view.playback.speed = 0.02  # slow, so that a slow machine is not at the end
    tab.page.get_by_role("button", name="Play", exact=True).click()
    tab.page.get_by_role("button", name="Pause", exact=True).wait_for()
    tab.wait(
        "() => Number(document.querySelector('[data-level]').textContent.match(/t = (.*) s/)[1])"
        " > 1.64"
    )
    assert 1.64 < view.playback.now < 4, "it began where it stood, however long it stood there"
    tab.page.get_by_role("tab", name="Move").click()
    fill(tab, "beta [°]", 3)
    tab.page.locator('[data-table="pose"]').filter(has_text="3.00").wait_for()
    assert view.playback is None, "a hand on the mechanism ends the playing"


def test_dragging_the_platform_moves_it(tab: Tab, view: View) -> None:
    """Pulled down by the blue arrow, the jaw opens: Z is no independent coordinate here."""
    x, y = grip(tab)
    tab.page.mouse.move(x, y)
    tab.picture_where("canvas", lambda p: is_yellow(p).sum() > 20, "the arrow under the mouse")
    drag(tab, x, y, 5, 8)
    tab.until(lambda: view.snapshot.pose[2] < -0.001, "the platform follows the hand")
    assert view.dragging
    tab.page.mouse.up()
    tab.until(lambda: not view.dragging, "the hand lets go")
    height = "document.querySelectorAll('[data-table=pose] td')[5].textContent"
    tab.wait(f"() => parseFloat({height}) < -1")


def test_arrow_keys_on_a_slider_leave_the_camera_alone(tab: Tab, view: View) -> None:
    """They move the slider by a step; away from it they turn the camera."""
    client = next(iter(view._server.get_clients().values()))
    before = np.array(client.camera.position)
    tab.page.get_by_role("slider").first.focus()
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


def test_internal_efforts_move_numbers_and_nothing_else(tab: Tab, view: View) -> None:
    before = view.snapshot
    tab.page.get_by_role("tab", name="Preload").click()
    tab.page.get_by_text("2 directions of internal efforts").wait_for()
    fill(tab, "direction 1 [N m]", 0.5)
    tab.until(lambda: bool(view.session.internal[0]), "the slider is heard")
    tab.until(lambda: view.snapshot is not before, "it is drawn")
    tab.page.locator('[data-table="internal"]').wait_for()
    assert np.array_equal(view.snapshot.pose, before.pose)
    tab.page.get_by_role("button", name="Reset internal efforts").click()
    tab.until(lambda: not view.session.internal.any(), "the efforts are taken off")
    tab.until(lambda: np.allclose(view.snapshot.effort, before.effort), "they are gone")


def test_files_open_and_bad_ones_are_refused(
    open_tab: Callable[..., Tab], view: View, tmp_path: Path
) -> None:
    tab = open_tab(view.url)  # the last of the file: the view has another mechanism afterwards
    tab.page.wait_for_selector("[data-level]")
    bad = tmp_path / "bad.toml"
    bad.write_text('name = "<b>bad</b>"\nunknown = 1\n')
    tab.page.get_by_role("tab", name="Open").click()
    upload(tab, "Open a mechanism", bad)
    tab.page.get_by_role("alert").filter(has_text="unknown").wait_for()
    assert view.session.mechanism.name == "masticatory"
    good = tmp_path / "good.toml"
    condyle.dump(condyle.load_mechanism("hexaglide"), good)
    upload(tab, "Open a mechanism", good)
    tab.page.get_by_text("condyle - hexaglide").wait_for()
    wait_for_level(tab, "ok")
    assert view.session.mechanism.name == "hexaglide"
    assert len(row(tab, "chains", "left_front")) == 5
