"""The report in a browser: it draws, it moves, and what it shows are the solution's numbers."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import condyle
from condyle.motion import Motion
from condyle.report.page import write_report
from condyle.results.solution import Solution

from .conftest import Tab

WINDOWS = {"wide": (1440, 900), "narrow": (390, 844)}
INDEX = "() => Number(document.getElementById('scrub').value)"


@pytest.fixture
def tab(open_tab: Callable[..., Tab], report: Path) -> Tab:
    return ready(open_tab(report.as_uri()))


def ready(tab: Tab) -> Tab:
    tab.page.wait_for_selector("html[data-ready=true]", state="attached")
    return tab


def index(tab: Tab) -> int:
    return int(tab.page.evaluate(INDEX))


def scrub(tab: Tab, sample: int) -> None:
    """Move the time slider as a hand does, and wait for the mechanism to follow."""
    tab.page.evaluate(
        "(sample) => { const s = document.getElementById('scrub'); s.value = sample;"
        " s.dispatchEvent(new Event('input', { bubbles: true })); }",
        sample,
    )
    tab.wait("(n) => Number(document.getElementById('stage').dataset.sample) === n", sample)


def cursors(tab: Tab) -> list[dict[str, Any]]:
    """Of every plot over time: where the cursor is, and where its axis puts that time [px]."""
    return tab.page.evaluate(
        """() => [...document.querySelectorAll('.cursor')].map((cursor) => {
            const axis = cursor.parentElement.firstChild._fullLayout.xaxis;
            const t = Number(cursor.dataset.time);
            return { t, left: parseFloat(cursor.style.left), axis: axis._offset + axis.d2p(t) };
        })"""
    )


def legend(tab: Tab, panel: str) -> dict[str, float]:
    """Values that a plot reads out, by name."""
    return tab.page.evaluate(
        """(id) => Object.fromEntries([...document.querySelectorAll(`#panel-${id} .legend button`)]
            .map((b) => [b.querySelector('.name').textContent,
                         Number(b.querySelector('.value').textContent)]))""",
        panel,
    )


def readout(tab: Tab, name: str) -> list[float]:
    """Values of a row of the table at the cursor."""
    row = tab.page.locator("#readout tr").filter(has_text=name).first
    return [float(v) for v in row.locator(".value").all_inner_texts()]


@pytest.mark.parametrize("window", WINDOWS)
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_page_opens_whole_and_without_a_network(
    open_tab: Callable[..., Tab], report: Path, window: str, scheme: str
) -> None:
    width, height = WINDOWS[window]
    tab = ready(open_tab(report.as_uri(), width, height, color_scheme=scheme))
    asked = [url for url in tab.requests if not url.startswith(("data:", "blob:"))]
    assert asked == [report.as_uri()]
    wide = tab.page.evaluate("document.documentElement.scrollWidth")
    assert wide <= width, "nothing sticks out sideways"
    ground = tab.page.evaluate("getComputedStyle(document.body).backgroundColor")
    brightness = sum(int(v) for v in ground[4:-1].split(",")) / 3
    assert (brightness > 128) == (scheme == "light")
    pixels = tab.picture("#stage").reshape(-1, 3)
    assert pixels.std(axis=0).max() > 8, "the canvas is not blank"
    assert len(np.unique(pixels // 16, axis=0)) > 30, "shaded solids of several colours"


def test_play_advances_time_and_pause_stops_it(tab: Tab) -> None:
    scrub(tab, 1200)
    before = tab.picture("#stage")
    tab.page.select_option("#speed", "0.05")  # slow, so that a slow machine is not at the end
    tab.page.click("#play")
    tab.wait("() => Number(document.getElementById('scrub').value) > 1230")
    assert tab.page.inner_text("#play") == "Pause"
    tab.page.click("#play")
    stopped = index(tab)
    tab.page.evaluate(
        """() => new Promise((done) => {
            let pictures = 20;
            const next = () => (pictures-- ? requestAnimationFrame(next) : done());
            next();
        })"""
    )
    assert index(tab) == stopped
    tab.wait("(n) => Number(document.getElementById('stage').dataset.sample) === n", stopped)
    assert np.abs(tab.picture("#stage") - before).max() > 50, "the mechanism moved"


def test_scrubbing_moves_every_cursor_to_the_same_time(tab: Tab, solution: Solution) -> None:
    for sample in (1640, 4003):
        scrub(tab, sample)
        t = float(solution["time"].values[sample])
        found = cursors(tab)
        assert len(found) >= 12
        for cursor in found:
            assert cursor["t"] == t
            assert cursor["left"] == pytest.approx(cursor["axis"], abs=0.6)
        assert tab.page.inner_text("#now").startswith(f"{t:.3f}")


def test_hovering_a_plot_moves_the_cursor(tab: Tab, solution: Solution) -> None:
    plot = tab.page.locator("#panel-pose-angles .plot")
    plot.scroll_into_view_if_needed()
    box = plot.bounding_box()
    assert box is not None
    tab.page.mouse.move(box["x"] + 0.6 * box["width"], box["y"] + 0.5 * box["height"])
    tab.wait("() => Number(document.getElementById('scrub').value) > 0")
    times = {cursor["t"] for cursor in cursors(tab)}
    assert times == {float(solution["time"].values[index(tab)])}
    assert 2 < times.pop() < 4


def test_values_shown_equal_the_data(tab: Tab, solution: Solution) -> None:
    sample = 1626
    scrub(tab, sample)
    at = solution.isel(time=sample)
    for panel, variable, scale in (
        ("torque-Nm", "torque", 1.0),
        ("joint-rad", "joint", 180 / np.pi),
        ("joint_rate-rad", "joint_rate", 1.0),
        ("transmission", "transmission", 1.0),
    ):
        shown = legend(tab, panel)
        assert list(shown) == list(solution["chain"].values)
        largest = float(np.abs(solution[variable].values).max()) * scale
        assert list(shown.values()) == pytest.approx(
            at[variable].values * scale, abs=6e-4 * largest
        )
    for i, contact in enumerate(solution["contact"].values):
        force, margin = readout(tab, str(contact))
        assert force == pytest.approx(float(at["contact_force"].values[i]), abs=0.0051)
        assert margin == pytest.approx(1e3 * float(at["bound_margin"].values[i]), abs=0.00051)
    for i, chain in enumerate(solution["chain"].values):
        joint, speed, torque = readout(tab, str(chain))
        assert joint == pytest.approx(np.degrees(float(at["joint"].values[i])), abs=0.0051)
        assert speed == pytest.approx(float(at["joint_rate"].values[i]), abs=0.00051)
        assert torque == pytest.approx(float(at["torque"].values[i]), abs=0.000051)


def test_drawn_mechanism_is_where_the_data_say(tab: Tab, solution: Solution) -> None:
    """Vertices of plotly's meshes against the contact balls and landmarks of the solution."""
    sample = 2040
    scrub(tab, sample)
    labels = tab.page.evaluate(
        """() => {
            const all = document.getElementById('stage').data;
            const t = all.find((d) => d.name === 'landmarks');
            return t.text.map((name, i) => [name, t.x[i], t.y[i], t.z[i]]);
        }"""
    )
    drawn = {name: position for name, *position in labels}
    for i, contact in enumerate(solution["contact"].values):
        expected = 1e3 * solution["contact_point"].values[sample, i]
        assert drawn[str(contact)] == pytest.approx(expected, abs=1e-3)
    assert {"incisor", "right_molar", "left_molar"} <= set(drawn)


def test_keyboard_alone_is_enough(tab: Tab) -> None:
    key = tab.page.keyboard.press
    key("ArrowRight")
    assert index(tab) == 50
    key("Shift+ArrowLeft")
    assert index(tab) == 49
    key("End")
    assert index(tab) == 5000
    key("Home")
    assert index(tab) == 0
    key("Space")
    tab.wait("() => Number(document.getElementById('scrub').value) > 30")
    key("Space")
    assert tab.page.inner_text("#play") == "Play"
    key("t")
    assert tab.page.get_attribute("html", "data-theme") == "dark"
    key("2")
    pressed = tab.page.locator("#cameras button[aria-pressed=true]")
    assert pressed.all_inner_texts() == ["Side"]
    key("Tab")
    outline = tab.page.evaluate("getComputedStyle(document.activeElement).outlineStyle")
    assert outline != "none", "the focus can be seen"


def test_controls_have_names(tab: Tab) -> None:
    nameless = tab.page.evaluate(
        """() => [...document.querySelectorAll('button, input, select, [role=img], [role=group]')]
            .filter((e) => !(e.ariaLabel || e.textContent.trim() || e.labels?.length)).length"""
    )
    assert nameless == 0


LOOK = """() => {
    const { eye, center, projection } = document.getElementById('stage')._fullLayout.scene.camera;
    return [...['x', 'y', 'z'].map((k) => eye[k] - center[k]), projection.type];
}"""


def test_camera_presets_look_from_their_sides(tab: Tab) -> None:
    pictures = {}
    for name, direction in (("Front", (1, 0, 0)), ("Side", (0, -1, 0)), ("Top", (0, 0, 1))):
        before = tab.picture("#stage")
        tab.page.click(f"#cameras button:text-is('{name}')")
        tab.wait(
            f"(wanted) => ({LOOK})().slice(0, 3).every((v, k) => "
            "Math.abs(v / 3 - wanted[k]) < 1e-6)",
            list(direction),
        )
        assert tab.page.evaluate(LOOK)[3] == "orthographic"
        pictures[name] = tab.changed_picture("#stage", before)
        inner = pictures[name][3:-3, 3:-3]  # neighbours may share a row of pixels
        drawn = np.abs(inner - inner[0, 0]).max(axis=-1) > 30
        rows, columns = np.nonzero(drawn)
        height, width = drawn.shape
        fill = max(np.ptp(rows) / height, np.ptp(columns) / width)
        assert fill > 0.7, "the mechanism fills the view"
        for edge in (drawn[0], drawn[-1], drawn[:, 0], drawn[:, -1]):
            assert not edge.any(), "nothing is cut off"
    assert np.abs(pictures["Front"] - pictures["Side"]).max() > 50


def test_preset_fits_again_when_the_window_changes(tab: Tab) -> None:
    tab.page.click("#cameras button:text-is('Top')")
    ratio = "() => document.getElementById('stage')._fullLayout.scene.aspectratio.x"
    tab.wait(f"() => ({LOOK})()[3] === 'orthographic'")
    wide = tab.page.evaluate(ratio)
    tab.page.set_viewport_size({"width": 390, "height": 844})
    tab.wait(f"(before) => Math.abs(({ratio})() - before) > 0.01", wide)
    assert tab.page.locator("#cameras button[aria-pressed=true]").all_inner_texts() == ["Top"]


def test_zooming_one_plot_zooms_all(tab: Tab) -> None:
    tab.page.evaluate(
        "() => Plotly.relayout(document.querySelector('#panel-pose-position .plot').firstChild,"
        " { 'xaxis.range': [1, 2] })"
    )
    ranges = """() => [...document.querySelectorAll('.cursor')]
        .map((c) => c.parentElement.firstChild._fullLayout.xaxis.range.map(Number).join())"""
    tab.wait(f"() => ({ranges})().every((range) => range === '1,2')")
    scrub(tab, 1500)
    assert all(c["left"] == pytest.approx(c["axis"], abs=0.6) for c in cursors(tab))
    scrub(tab, 3000)
    assert tab.page.locator(".cursor:visible").count() == 0, "3 s is out of the zoom"


def test_legend_hides_a_line_and_shares_can_be_chosen(tab: Tab) -> None:
    button = tab.page.locator("#panel-torque-Nm .legend button").first
    button.click()
    assert button.get_attribute("aria-pressed") == "false"
    hidden = "() => document.querySelector('#panel-torque-Nm .plot').firstChild.data[0].visible"
    assert tab.page.evaluate(hidden) is False
    tab.page.select_option("#panel-share-Nm select", label="masseter_left")
    tab.wait("() => document.querySelectorAll('#panel-share-Nm .legend button').length === 4")
    shown = legend(tab, "share-Nm")
    assert list(shown) == ["platform", "couplers", "cranks", "bite"]


def test_paper_gets_light_colours_and_a_still(tab: Tab) -> None:
    tab.page.keyboard.press("t")
    tab.wait("() => document.documentElement.dataset.theme === 'dark'")
    scrub(tab, 1626)
    paper = tab.page.evaluate(
        """() => {
            window.dispatchEvent(new Event('beforeprint'));
            const still = document.getElementById('still');
            const widths = [...document.querySelectorAll('.plot')].map(
                (p) => p.firstChild._fullLayout.width - p.clientWidth);
            const found = { theme: document.documentElement.dataset.theme, size: still.src.length,
                            alt: still.alt, spill: Math.max(...widths) };
            window.dispatchEvent(new Event('afterprint'));
            return found;
        }"""
    )
    assert paper["theme"] == "light" and paper["size"] > 5000
    assert "1.626" in paper["alt"] and paper["spill"] <= 0
    assert tab.page.get_attribute("html", "data-theme") == "dark"
    assert len(tab.page.pdf(format="A4")) > 50_000


def test_samples_without_a_result_say_so(
    open_tab: Callable[..., Tab], reference: condyle.Mechanism, tmp_path: Path
) -> None:
    t = np.linspace(0, 1, 41)
    names = ("X", "Y", "alpha", "beta")
    motion = Motion.from_arrays(t, {n: 0.2 * t * (n == "X") for n in names})
    torn = condyle.derive(reference, backend="interpreted").solve(motion, flag=True)
    tab = ready(open_tab(write_report(torn, tmp_path / "torn.html").as_uri()))
    assert "speed limit" in tab.page.inner_text("#stage-message")
    tab.page.keyboard.press("End")
    assert "unreachable" in tab.page.inner_text("#stage-message")
    assert tab.page.locator("#panel-torque-Nm .value").first.inner_text() == "–"
    assert "left empty" in tab.page.inner_text("#warnings")


@pytest.mark.parametrize("name", ["gough-stewart", "hexaglide"])
def test_other_families_are_drawn(open_tab: Callable[..., Tab], name: str, tmp_path: Path) -> None:
    model = condyle.derive(condyle.load(name), backend="interpreted")
    t = np.linspace(0, 1, 41)
    motion = Motion.from_arrays(t, {n: 0.02 * np.sin(6 * t) for n in model.independent})
    path = write_report(model.solve(motion), tmp_path / "report.html")
    tab = ready(open_tab(path.as_uri()))
    before = tab.picture("#stage")
    assert before.std() > 8
    tab.page.keyboard.press("ArrowRight")
    scrub(tab, 12)
    assert np.abs(tab.picture("#stage") - before).max() > 50
