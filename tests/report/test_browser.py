"""The report in a browser: it draws, it moves, and what it shows are the solution's numbers."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from support.browser import Tab
from support.report_pages import payload

import condyle
from condyle.markers import MeasuredChannels
from condyle.motion import Motion
from condyle.report.page import write_report
from condyle.report.scene import band_mesh, parts_of, place

WINDOWS = {"wide": (1440, 900), "narrow": (390, 844)}
INDEX = "() => Number(document.getElementById('scrub').value)"


@pytest.fixture(scope="module")
def solution() -> xr.Dataset:
    """All 5001 samples of the reference case."""
    model = condyle.derive("masticatory", backend="interpreted")
    return model.solve(condyle.reference_motion(), condyle.reference_load())


@pytest.fixture(scope="module")
def report(solution: xr.Dataset, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_report(solution, tmp_path_factory.mktemp("report") / "report.html")


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


def test_scrubbing_moves_every_cursor_to_the_same_time(tab: Tab, solution: xr.Dataset) -> None:
    for sample in (1640, 4003):
        scrub(tab, sample)
        t = float(solution["time"].values[sample])
        found = cursors(tab)
        assert len(found) >= 12
        for cursor in found:
            assert cursor["t"] == t
            assert cursor["left"] == pytest.approx(cursor["axis"], abs=0.6)
        assert tab.page.inner_text("#now").startswith(f"{t:.3f}")


def test_hovering_a_plot_moves_the_cursor(tab: Tab, solution: xr.Dataset) -> None:
    plot = tab.page.locator("#panel-pose-angles .plot")
    plot.scroll_into_view_if_needed()
    box = plot.bounding_box()
    assert box is not None
    tab.page.mouse.move(box["x"] + 0.6 * box["width"], box["y"] + 0.5 * box["height"])
    tab.wait("() => Number(document.getElementById('scrub').value) > 0")
    times = {cursor["t"] for cursor in cursors(tab)}
    assert times == {float(solution["time"].values[index(tab)])}
    assert 2 < times.pop() < 4


def test_values_shown_equal_the_data(tab: Tab, solution: xr.Dataset) -> None:
    sample = 1626
    scrub(tab, sample)
    at = solution.isel(time=sample)
    for panel, variable, scale in (
        ("effort-Nm", "effort", 1.0),
        ("joint-rad", "joint", 180 / np.pi),
        ("joint_rate-rad", "joint_rate", 180 / np.pi),
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
        assert speed == pytest.approx(np.degrees(float(at["joint_rate"].values[i])), abs=0.051)
        assert torque == pytest.approx(float(at["effort"].values[i]), abs=0.000051)


def test_drawn_mechanism_is_where_the_data_say(tab: Tab, solution: xr.Dataset) -> None:
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
    button = tab.page.locator("#panel-effort-Nm .legend button").first
    button.click()
    assert button.get_attribute("aria-pressed") == "false"
    hidden = "() => document.querySelector('#panel-effort-Nm .plot').firstChild.data[0].visible"
    assert tab.page.evaluate(hidden) is False
    tab.page.select_option("#panel-share-Nm select", label="masseter_left")
    tab.wait("() => document.querySelectorAll('#panel-share-Nm .legend button').length === 4")
    shown = legend(tab, "share-Nm")
    assert list(shown) == ["platform", "couplers", "cranks", "load"]


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


def grey_share(tab: Tab) -> float:
    """Part of the solids' faces that are drawn grey."""
    return float(
        tab.page.evaluate(
            """() => {
            const tints = ['platform', 'chains', 'joints', 'balls'].flatMap((name) =>
                [...document.getElementById('stage').data.find((d) => d.name === name).facecolor]);
            return tints.filter((c) => c === tints[0]).length / tints.length;
        }"""
        )
    )


def arrow_size(tab: Tab) -> float:
    return float(
        tab.page.evaluate(
            """() => {
            const { x } = document.getElementById('stage').data.find((d) => d.name === 'forces');
            return Math.max(...x.slice(0, 20)) - Math.min(...x.slice(0, 20));
        }"""
        )
    )


def test_samples_without_a_result_say_so_and_show_no_forces(
    open_tab: Callable[..., Tab], torn: xr.Dataset, tmp_path: Path
) -> None:
    failed = np.flatnonzero(torn["status"].values)
    first = int(failed[0])
    tab = ready(open_tab(write_report(torn, tmp_path / "torn.html").as_uri()))
    scrub(tab, first - 2)
    assert grey_share(tab) < 0.8 and arrow_size(tab) > 1
    for sample in (first + 30, first + 10):  # from later, too, the last good one before
        scrub(tab, sample)
        told = tab.page.inner_text("#stage-message")
        when = f"{torn['time'].values[first - 1]:.3f} s"
        assert "no result, unreachable" in told and when in told and "without forces" in told
        assert tab.page.get_attribute("#stage", "data-drawn") == str(first - 1)
        tab.wait("() => document.getElementById('stage').dataset.grey === 'true'")
        assert grey_share(tab) == 1.0 and arrow_size(tab) < 1e-6
    assert tab.page.locator("#panel-effort-Nm .value").first.inner_text() == "–"
    shades = tab.page.evaluate(
        "() => document.querySelector('#panel-effort-Nm .plot').firstChild.layout.shapes"
        ".filter((s) => s.type === 'rect').map((s) => [s.x0, s.x1])"
    )
    assert shades[0] == [float(torn["time"].values[first]), pytest.approx(0.445)]
    assert len(shades) == 2
    assert "Without a result" in tab.page.inner_text(".lead")
    scrub(tab, 90)
    assert grey_share(tab) < 0.8 and arrow_size(tab) > 1


def test_curves_are_drawn_as_they_are(tab: Tab, solution: xr.Dataset) -> None:
    """At rest for a second, then up: no line from 0 s to the first bend, no kink at a peak."""
    drawn = tab.page.evaluate(
        """() => {
            const plot = document.querySelector('#panel-pose-position .plot').firstChild;
            const simplify = plot._fullData.map((d) => d.line.simplify);
            return { y: Array.from(plot.data[2].y), simplify };
        }"""
    )
    np.testing.assert_allclose(drawn["y"], 1e3 * solution["pose"].values[:, 2], atol=1e-5)
    assert not any(drawn["simplify"])


def test_peaks_of_a_long_run_are_drawn(
    open_tab: Callable[..., Tab], solution: xr.Dataset, tmp_path: Path
) -> None:
    count = 60_000
    long = solution.isel(time=np.arange(count) % solution.sizes["time"])
    long = long.assign_coords(time=("time", np.arange(count) / 1000, {"units": "s"}))
    long["effort"].values[31_234, 2] = 9.75
    tab = ready(open_tab(write_report(long, tmp_path / "long.html").as_uri()))
    x, y = tab.page.evaluate(
        """() => {
            const plot = document.querySelector('#panel-effort-Nm .plot').firstChild;
            return [Array.from(plot.data[2].x), Array.from(plot.data[2].y)];
        }"""
    )
    assert np.all(np.diff(x) >= -1e-9)
    assert x[int(np.argmax(y))] == pytest.approx(31.234, abs=1e-4) and max(y) == 9.75
    assert min(y) == pytest.approx(float(solution["effort"].values[:, 2].min()), rel=1e-6)


ODD_NAMES = ["constructor", "__proto__", "toString", "hasOwnProperty", "valueOf", "<b>x</b>"]


def test_names_of_the_language_are_names(
    open_tab: Callable[..., Tab], reference: condyle.Mechanism, tmp_path: Path
) -> None:
    chains, contacts = (
        tuple(one.model_copy(update={"name": n}) for one, n in zip(those, ODD_NAMES, strict=False))
        for those in (reference.chains, reference.contacts)
    )
    machine = reference.replace(chains=chains, contacts=contacts)
    t = np.linspace(0, 1, 41)
    motion = Motion.from_arrays(t, {n: 0 * t for n in ("X", "Y", "alpha", "beta")})
    solved = condyle.derive(machine, backend="interpreted").solve(motion)
    tab = ready(open_tab(write_report(solved, tmp_path / "odd.html").as_uri()))
    names = tab.page.locator("#panel-effort-Nm .legend .name").all_inner_texts()
    assert names == ODD_NAMES
    labels = tab.page.evaluate("document.getElementById('stage').data[5].text.join(' ')")
    assert "constructor" in labels and "__proto__" in labels
    assert [len(readout(tab, name)) for name in ODD_NAMES[2:]] == [3] * 4


def test_names_at_one_place_stand_beside_each_other(tab: Tab) -> None:
    """Seen from the side, left and right are one behind the other."""
    texts = "() => document.getElementById('stage').data[5].text"
    assert len([text for text in tab.page.evaluate(texts) if text]) == 5
    tab.page.click("#cameras button:text-is('Side')")
    tab.wait(f"() => ({texts})().some((text) => text.includes(', '))")
    together = [set(text.split(", ")) for text in tab.page.evaluate(texts) if text]
    assert {"left_condyle", "right_condyle"} in together
    assert {"left_molar", "right_molar"} in together and {"incisor"} in together
    tab.page.click("#cameras button:text-is('Front')")
    tab.wait(f"() => ({texts})().filter((text) => text).length === 5")


def test_first_printed_page_is_used(tab: Tab) -> None:
    """The picture begins below the facts, on the same page."""
    found = tab.page.evaluate(
        """() => {
            window.dispatchEvent(new Event('beforeprint'));
            const style = getComputedStyle(document.querySelector('.stage')).breakInside;
            window.dispatchEvent(new Event('afterprint'));
            return style;
        }"""
    )
    assert found == "auto"
    tab.page.emulate_media(media="print")
    assert (
        tab.page.evaluate("getComputedStyle(document.querySelector('.stage')).breakInside")
        == "auto"
    )


@pytest.mark.parametrize("name", ["gough-stewart", "hexaglide"])
def test_other_families_are_drawn(open_tab: Callable[..., Tab], name: str, tmp_path: Path) -> None:
    model = condyle.derive(condyle.load_mechanism(name), backend="interpreted")
    t = np.linspace(0, 1, 41)
    motion = Motion.from_arrays(t, {n: 0.02 * np.sin(6 * t) for n in model.independent})
    path = write_report(model.solve(motion), tmp_path / "report.html")
    tab = ready(open_tab(path.as_uri()))
    before = tab.picture("#stage")
    assert before.std() > 8
    tab.page.keyboard.press("ArrowRight")
    scrub(tab, 12)
    assert np.abs(tab.picture("#stage") - before).max() > 50


TINTS = "() => document.getElementById('stage').data[1].facecolor"


def drawn_widths(report: Path) -> list[float]:
    machine = payload(report.read_text(encoding="utf-8"))["machine"]
    return [muscle["width"] for muscle in machine["muscles"]]


def test_a_jaw_draws_activations_and_planes_of_all_its_muscles(
    open_tab: Callable[..., Tab], tmp_path: Path
) -> None:
    motion = Motion.from_csv(condyle.motion.bundled_reference()[0], rate=20)
    model = condyle.derive("human-jaw", backend="numpy")
    solution = model.solve(motion, condyle.reference_load())
    t = solution["time"].values
    wave = np.column_stack([0.09 + 0 * t, 0 * t, -0.02 + 0.01 * np.sin(t)])
    wave[7] = np.nan  # not seen
    measured = MeasuredChannels(
        t,
        ("Upper", "Lower"),
        ("fixed", "platform"),
        np.stack([np.full_like(wave, 0.08), wave], axis=1),
        np.full((len(t), 2), 1e-4),
        {"deep_masseter_left": np.abs(np.sin(t))},
    )
    report = write_report(solution, tmp_path / "jaw.html", measured=measured)
    tab = ready(open_tab(report.as_uri()))
    markers = "() => { const t = document.getElementById('stage').data[6]; return %s; }"
    assert tab.page.evaluate(markers % "[t.name, ...t.marker.symbol]") == [
        "markers",
        "square",
        "diamond",
    ]
    scrub(tab, 40)
    assert tab.page.evaluate(markers % "t.z") == pytest.approx([80, 1e3 * wave[40, 2]], rel=1e-6)
    scrub(tab, 7)
    assert tab.page.evaluate(markers % "t.z[1]") is None
    assert "on the platform" in tab.page.locator("#marker-legend").inner_text()
    tab.page.get_by_role("button", name="Markers").click()
    tab.wait("() => document.getElementById('stage').data[6].visible === false")
    assert tab.page.locator("#panel-marker-residual select option").count() == 4
    scene = place(model.mechanism, solution["pose"].values[7:8], solution["joint"].values[7:8])
    lines = [np.vstack([p["B"], p["M"]]) for d in scene.chains.values() for p in [d.points]]
    widths = [band.width for band in parts_of(model.mechanism, scene).bands]
    scale = drawn_widths(report)[0] / widths[0]  # the page's size is that of the whole run
    bands = [
        band_mesh(line, scene.position[0], scale * width)[0]
        for line, width in zip(lines, widths, strict=True)
    ]
    x = tab.page.evaluate("() => [...document.getElementById('stage').data[1].x]")
    assert np.allclose(x, 1e3 * np.vstack(bands)[:, 0], atol=1e-3)
    quiet = tab.page.evaluate(TINTS)
    scrub(tab, 33)
    strong = tab.page.evaluate(TINTS)
    assert len({*quiet}) < 6 < len({*strong}) and len(quiet) == len(strong)
    z = tab.page.evaluate(
        "() => document.querySelector('#panel-activation .plot').firstChild._fullData[0].z"
    )
    assert np.shape(z) == (25, solution.sizes["time"])
    emg = 9  # under the muscle it is of
    assert np.allclose(z.pop(emg), np.abs(np.sin(t)), atol=1e-6) and 0.2 < np.max(z) < 1
    assert tab.page.locator(".plane .dot:visible").count() == 24
    sample = int(np.argmax(np.max(z, axis=0)))
    scrub(tab, sample)
    read = tab.page.locator("#panel-activation .value").all_inner_texts()
    assert float(read.pop(emg)) == pytest.approx(abs(np.sin(t[sample])), abs=1e-3)
    assert float(max(read)) == pytest.approx(np.max(z), abs=1e-3)
    at = tab.page.evaluate(
        """() => [...document.querySelectorAll('.plane')].map((card) => {
            const layout = card.querySelector('.plot').firstChild._fullLayout;
            const dot = card.querySelector('.dot');
            return layout.yaxis.p2d(parseFloat(dot.style.top) - layout.yaxis._offset);
        })"""
    )
    expected = solution["effort"].values[sample, ::2]
    assert np.allclose(at, expected, atol=0.02 * np.nanmax(expected))
