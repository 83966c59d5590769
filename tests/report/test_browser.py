"""The report in a browser: it draws, it moves, and what it shows are the solution's numbers.

Most tests look at one page, which none of them opens anew: each goes to the sample that it needs.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from support.browser import Tab, tabs
from support.machines import model
from support.report_pages import payload

import condyle
from condyle.markers import MeasuredChannels
from condyle.motion import Motion, bundled_reference
from condyle.report.page import write_report
from condyle.report.scene import band_mesh, parts_of, place

STAGE = "document.getElementById('stage')"
INDEX = "Number(document.getElementById('scrub').value)"
LOOK = f"""() => {{
    const {{ eye, center, projection }} = {STAGE}._fullLayout.scene.camera;
    return [...['x', 'y', 'z'].map((k) => eye[k] - center[k]), projection.type];
}}"""


@pytest.fixture(scope="module")
def solution() -> xr.Dataset:
    """The reference case at 100 Hz."""
    motion = Motion.from_csv(bundled_reference()[0], rate=100)
    return model("masticatory").solve(motion, condyle.reference_load())


@pytest.fixture(scope="module")
def report(solution: xr.Dataset, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_report(solution, tmp_path_factory.mktemp("report") / "report.html")


@pytest.fixture(scope="module")
def tab(browser: Any, report: Path) -> Iterator[Tab]:
    with tabs(browser) as open_one:
        yield ready(open_one(report.as_uri(), color_scheme="light"))


def ready(tab: Tab) -> Tab:
    tab.page.wait_for_selector("html[data-ready=true]", state="attached")
    return tab


def shown(open_tab: Callable[..., Tab], solution: xr.Dataset, folder: Path, **how: Any) -> Tab:
    """The page of a solution of its own."""
    return ready(open_tab(write_report(solution, folder / "page.html", **how).as_uri()))


def scrub(tab: Tab, sample: int) -> None:
    """Move the time slider as a hand does, and wait for the mechanism to follow."""
    tab.page.evaluate(
        "(sample) => { const s = document.getElementById('scrub'); s.value = sample;"
        " s.dispatchEvent(new Event('input', { bubbles: true })); }",
        sample,
    )
    tab.wait(f"(n) => Number({STAGE}.dataset.sample) === n", sample)


def index(tab: Tab) -> int:
    return int(tab.page.evaluate(INDEX))


def plot(panel: str) -> str:
    return f"document.querySelector('#panel-{panel} .plot').firstChild"


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


@pytest.mark.parametrize(("scheme", "width", "height"), [("light", 1440, 900), ("dark", 390, 844)])
def test_page_opens_whole_and_without_a_network(
    tab: Tab, open_tab: Callable[..., Tab], report: Path, scheme: str, width: int, height: int
) -> None:
    if scheme == "dark":
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
    nameless = tab.page.evaluate(
        """() => [...document.querySelectorAll('button, input, select, [role=img], [role=group]')]
            .filter((e) => !(e.ariaLabel || e.textContent.trim() || e.labels?.length)).length"""
    )
    assert nameless == 0


def test_values_and_cursors_are_those_of_the_time(tab: Tab, solution: xr.Dataset) -> None:
    for sample in (400, 163):
        scrub(tab, sample)
        t, found = float(solution["time"].values[sample]), cursors(tab)
        assert len(found) >= 12 and {cursor["t"] for cursor in found} == {t}
        for cursor in found:
            assert cursor["left"] == pytest.approx(cursor["axis"], abs=0.6)
        assert tab.page.inner_text("#now").startswith(f"{t:.2f}")
    at = solution.isel(time=sample)
    panels = {"effort-Nm": "effort", "joint-rad": "joint", "joint_rate-rad": "joint_rate"}
    for panel, variable in {**panels, "transmission": "transmission"}.items():
        scale = 180 / np.pi if panel.endswith("-rad") else 1.0
        values = legend(tab, panel)
        assert list(values) == list(solution["chain"].values)
        digits = 6e-4 * scale * float(np.abs(solution[variable].values).max())  # as many are shown
        assert list(values.values()) == pytest.approx(at[variable].values * scale, abs=digits)
    for name in solution["contact"].values:
        force, margin = readout(tab, str(name))
        of = at.sel(contact=name)
        assert force == pytest.approx(float(of["contact_force"]), abs=0.0051)
        assert margin == pytest.approx(1e3 * float(of["bound_margin"]), abs=0.00051)
    for name in solution["chain"].values:
        joint, speed, torque = readout(tab, str(name))
        of = at.sel(chain=name)
        assert joint == pytest.approx(np.degrees(float(of["joint"])), abs=0.0051)
        assert speed == pytest.approx(np.degrees(float(of["joint_rate"])), abs=0.051)
        assert torque == pytest.approx(float(of["effort"]), abs=0.000051)
    # Contact balls and landmarks are drawn where the solution has them.
    drawn = tab.page.evaluate(
        f"""() => {{
            const t = {STAGE}.data.find((d) => d.name === 'landmarks');
            return Object.fromEntries(t.text.map((name, i) => [name, [t.x[i], t.y[i], t.z[i]]]));
        }}"""
    )
    for i, contact in enumerate(solution["contact"].values):
        expected = 1e3 * solution["contact_point"].values[sample, i]
        assert drawn[str(contact)] == pytest.approx(expected, abs=1e-3)
    assert {"incisor", "right_molar", "left_molar"} <= set(drawn)
    # At rest for a second, then up: no line from 0 s to the first bend, no kink at a peak.
    curve = f"{plot('pose-position')}.data[2].y"
    height = tab.page.evaluate(f"Array.from({curve})")
    np.testing.assert_allclose(height, 1e3 * solution["pose"].values[:, 2], atol=1e-5)
    simplify = f"{plot('pose-position')}._fullData.map((d) => d.line.simplify)"
    assert not any(tab.page.evaluate(simplify))


def test_play_and_keys(tab: Tab) -> None:
    """A button or the keyboard alone is enough."""
    page, key = tab.page, tab.page.keyboard.press
    scrub(tab, 120)
    before = tab.picture("#stage")
    page.select_option("#speed", "0.05")  # slow, so that a slow machine is not at the end
    page.click("#play")
    tab.wait(f"() => {INDEX} > 123")
    assert page.inner_text("#play") == "Pause"
    page.click("#play")
    stopped = index(tab)
    page.evaluate(
        """() => new Promise((done) => {
            let pictures = 20;
            const next = () => (pictures-- ? requestAnimationFrame(next) : done());
            next();
        })"""
    )
    assert index(tab) == stopped
    tab.wait(f"(n) => Number({STAGE}.dataset.sample) === n", stopped)
    assert np.abs(tab.picture("#stage") - before).max() > 50, "the mechanism moved"
    page.locator("#play").evaluate("button => button.blur()")
    for name, at in (("Home", 0), ("ArrowRight", 5), ("Shift+ArrowLeft", 4), ("End", 500)):
        key(name)
        assert index(tab) == at, name
    key("Home")
    key("Space")
    tab.wait(f"() => {INDEX} > 3")
    key("Space")
    assert page.inner_text("#play") == "Play"
    key("t")
    assert page.get_attribute("html", "data-theme") == "dark"
    key("2")
    pressed = page.locator("#cameras button[aria-pressed=true]")
    assert pressed.all_inner_texts() == ["Side"]
    key("Tab")
    outline = page.evaluate("getComputedStyle(document.activeElement).outlineStyle")
    assert outline != "none", "the focus can be seen"
    page.evaluate("document.activeElement.blur()")
    key("t")


def test_hovering_a_plot_moves_the_cursor(tab: Tab, solution: xr.Dataset) -> None:
    scrub(tab, 0)
    panel = tab.page.locator("#panel-pose-angles .plot")
    panel.scroll_into_view_if_needed()
    box = panel.bounding_box()
    assert box is not None
    tab.page.mouse.move(box["x"] + 0.6 * box["width"], box["y"] + 0.5 * box["height"])
    tab.wait(f"() => {INDEX} > 0")
    (time,) = {cursor["t"] for cursor in cursors(tab)}
    assert time == float(solution["time"].values[index(tab)]) and 2 < time < 4
    tab.page.mouse.move(0, 0)


def test_camera_presets_look_from_their_sides(tab: Tab) -> None:
    """They fill the view; names behind each other stand beside each other; a window that changes
    is fitted again.
    """
    scrub(tab, 0)
    texts = f"{STAGE}.data[5].text.filter((text) => text)"
    pictures = {}
    for name, direction in (("Side", (0, -1, 0)), ("Front", (1, 0, 0)), ("Top", (0, 0, 1))):
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
        fill = max(
            np.ptp(at) / size for at, size in zip(np.nonzero(drawn), drawn.shape, strict=True)
        )
        assert fill > 0.7, "the mechanism fills the view"
        for edge in (drawn[0], drawn[-1], drawn[:, 0], drawn[:, -1]):
            assert not edge.any(), "nothing is cut off"
        if name == "Side":
            tab.wait(f"() => {texts}.some((text) => text.includes(', '))")
            together = [set(text.split(", ")) for text in tab.page.evaluate(texts)]
            assert {"left_condyle", "right_condyle"} in together
            assert {"left_molar", "right_molar"} in together and {"incisor"} in together
        if name == "Front":
            tab.wait(f"() => {texts}.length === 5")
    assert np.abs(pictures["Front"] - pictures["Side"]).max() > 50
    ratio = f"{STAGE}._fullLayout.scene.aspectratio.x"
    wide = tab.page.evaluate(ratio)
    tab.page.set_viewport_size({"width": 390, "height": 844})
    tab.wait(f"(before) => Math.abs({ratio} - before) > 0.01", wide)
    assert tab.page.locator("#cameras button[aria-pressed=true]").all_inner_texts() == ["Top"]
    narrow = tab.page.evaluate(ratio)
    tab.page.set_viewport_size({"width": 1440, "height": 900})
    tab.wait(f"(before) => Math.abs({ratio} - before) > 0.01", narrow)


def test_zooming_one_plot_zooms_all(tab: Tab) -> None:
    zoom = f"(range) => Plotly.relayout({plot('pose-position')}, {{ 'xaxis.range': range }})"
    ranges = """[...document.querySelectorAll('.cursor')]
        .map((c) => c.parentElement.firstChild._fullLayout.xaxis.range.map(Number).join())"""
    tab.page.evaluate(zoom, [1, 2])
    tab.wait(f"() => {ranges}.every((range) => range === '1,2')")
    scrub(tab, 150)
    assert all(c["left"] == pytest.approx(c["axis"], abs=0.6) for c in cursors(tab))
    scrub(tab, 300)
    assert tab.page.locator(".cursor:visible").count() == 0, "3 s is out of the zoom"
    tab.page.evaluate(zoom, [0, 5])
    tab.wait(f"() => {ranges}.every((range) => range === '0,5')")


def test_legend_hides_a_line_and_shares_can_be_chosen(tab: Tab) -> None:
    button = tab.page.locator("#panel-effort-Nm .legend button").first
    button.click()
    assert button.get_attribute("aria-pressed") == "false"
    assert tab.page.evaluate(f"{plot('effort-Nm')}.data[0].visible") is False
    tab.page.select_option("#panel-share-Nm select", label="masseter_left")
    tab.wait("() => document.querySelectorAll('#panel-share-Nm .legend button').length === 4")
    assert list(legend(tab, "share-Nm")) == ["platform", "couplers", "cranks", "load"]


def test_paper_gets_light_colours_and_a_still(tab: Tab) -> None:
    """The picture begins below the facts, on the same page."""
    tab.page.keyboard.press("t")
    tab.wait("() => document.documentElement.dataset.theme === 'dark'")
    scrub(tab, 163)
    style = "getComputedStyle(document.querySelector('.stage')).breakInside"
    paper = tab.page.evaluate(
        f"""() => {{
            window.dispatchEvent(new Event('beforeprint'));
            const still = document.getElementById('still');
            const widths = [...document.querySelectorAll('.plot')].map(
                (p) => p.firstChild._fullLayout.width - p.clientWidth);
            const found = {{ theme: document.documentElement.dataset.theme, alt: still.alt,
                            size: still.src.length, spill: Math.max(...widths), breaks: {style} }};
            window.dispatchEvent(new Event('afterprint'));
            return found;
        }}"""
    )
    assert paper["theme"] == "light" and paper["size"] > 5000 and paper["breaks"] == "auto"
    assert "1.63" in paper["alt"] and paper["spill"] <= 0
    assert tab.page.get_attribute("html", "data-theme") == "dark"
    assert len(tab.page.pdf(format="A4")) > 50_000
    tab.page.emulate_media(media="print")
    assert tab.page.evaluate(style) == "auto"
    tab.page.emulate_media(media="screen")
    tab.page.keyboard.press("t")


def grey_share(tab: Tab) -> float:
    """Part of the solids' faces that are drawn grey."""
    return tab.page.evaluate(
        f"""() => {{
            const tints = ['platform', 'chains', 'joints', 'balls'].flatMap((name) =>
                [...{STAGE}.data.find((d) => d.name === name).facecolor]);
            return tints.filter((c) => c === tints[0]).length / tints.length;
        }}"""
    )


def arrow_size(tab: Tab) -> float:
    return np.ptp(
        tab.page.evaluate(f"[...{STAGE}.data.find((d) => d.name === 'forces').x.slice(0, 20)]")
    )


def test_samples_without_a_result_say_so_and_show_no_forces(
    open_tab: Callable[..., Tab], torn: xr.Dataset, tmp_path: Path
) -> None:
    first = int(np.flatnonzero(torn["status"].values)[0])
    tab = shown(open_tab, torn, tmp_path)
    scrub(tab, first - 2)
    assert grey_share(tab) < 0.8 and arrow_size(tab) > 1
    for sample in (first + 30, first + 10):  # from later, too, the last good one before
        scrub(tab, sample)
        told = tab.page.inner_text("#stage-message")
        when = f"{torn['time'].values[first - 1]:.3f} s"
        assert "no result, unreachable" in told and when in told and "without forces" in told
        assert tab.page.get_attribute("#stage", "data-drawn") == str(first - 1)
        tab.wait(f"() => {STAGE}.dataset.grey === 'true'")
        assert grey_share(tab) == 1.0 and arrow_size(tab) < 1e-6
    assert tab.page.locator("#panel-effort-Nm .value").first.inner_text() == "–"
    shades = tab.page.evaluate(
        f"{plot('effort-Nm')}.layout.shapes.filter((s) => s.type === 'rect')"
        ".map((s) => [s.x0, s.x1])"
    )
    assert shades[0] == [float(torn["time"].values[first]), pytest.approx(0.445)]
    assert len(shades) == 2
    assert "Without a result" in tab.page.inner_text(".lead")
    scrub(tab, 90)
    assert grey_share(tab) < 0.8 and arrow_size(tab) > 1


@pytest.mark.ci
def test_peaks_of_a_long_run_are_drawn(
    open_tab: Callable[..., Tab], solution: xr.Dataset, tmp_path: Path
) -> None:
    count = 30_000
    long = solution.isel(time=np.arange(count) % solution.sizes["time"])
    long = long.assign_coords(time=("time", np.arange(count) / 1000, {"units": "s"}))
    long["effort"].values[21_234, 2] = 9.75
    path = write_report(long, tmp_path / "long.html")
    columns = payload(path.read_text(encoding="utf-8"))["columns"]
    assert columns["samples"] < columns["total"] == count
    tab = ready(open_tab(path.as_uri()))
    line = f"{plot('effort-Nm')}.data[2]"
    x, y = tab.page.evaluate(f"[Array.from({line}.x), Array.from({line}.y)]")
    assert np.all(np.diff(x) >= -1e-9)
    assert x[int(np.argmax(y))] == pytest.approx(21.234, abs=1e-4) and max(y) == 9.75
    assert min(y) == pytest.approx(float(solution["effort"].values[:, 2].min()), rel=1e-6)


ODD_NAMES = ["constructor", "__proto__", "toString", "hasOwnProperty", "valueOf", "<b>x</b>"]


@pytest.mark.ci
def test_names_of_the_language_are_names(
    open_tab: Callable[..., Tab], solution: xr.Dataset, tmp_path: Path
) -> None:
    machine = solution.condyle.mechanism
    chains, contacts = (
        tuple(one.model_copy(update={"name": n}) for one, n in zip(those, ODD_NAMES, strict=False))
        for those in (machine.chains, machine.contacts)
    )
    odd = solution.isel(time=slice(0, 41)).assign_coords(chain=ODD_NAMES, contact=ODD_NAMES[:2])
    odd.attrs["mechanism"] = condyle.dumps(machine.replace(chains=chains, contacts=contacts))
    tab = shown(open_tab, odd, tmp_path)
    names = tab.page.locator("#panel-effort-Nm .legend .name").all_inner_texts()
    assert names == ODD_NAMES
    labels = tab.page.evaluate(f"{STAGE}.data[5].text.join(' ')")
    assert "constructor" in labels and "__proto__" in labels
    assert [len(readout(tab, name)) for name in ODD_NAMES[2:]] == [3] * 4


@pytest.mark.ci
def test_other_families_are_drawn(open_tab: Callable[..., Tab], tmp_path: Path) -> None:
    t = np.linspace(0, 1, 41)
    for name in ("gough-stewart", "hexaglide"):
        motion = {n: 0.02 * np.sin(6 * t) for n in model(name).independent}
        tab = shown(open_tab, model(name).solve(Motion.from_arrays(t, motion)), tmp_path)
        before = tab.picture("#stage")
        assert before.std() > 8
        scrub(tab, 12)
        assert np.abs(tab.picture("#stage") - before).max() > 50


def test_a_jaw_draws_activations_and_planes_of_all_its_muscles(
    open_tab: Callable[..., Tab], jaw: xr.Dataset, tmp_path: Path
) -> None:
    t, mechanism = jaw["time"].values, jaw.condyle.mechanism
    wave = np.column_stack([0.09 + 0 * t, 0 * t, -0.02 + 0.01 * np.sin(t)])
    wave[7] = np.nan  # not seen
    places = np.stack([np.full_like(wave, 0.08), wave], axis=1)
    emg = {"deep_masseter_left": np.abs(np.sin(t))}
    names, bodies = ("Upper", "Lower"), ("fixed", "platform")
    measured = MeasuredChannels(t, names, bodies, places, np.full((len(t), 2), 1e-4), emg)
    tab = shown(open_tab, jaw, tmp_path, measured=measured)
    evaluate = tab.page.evaluate
    markers = f"{STAGE}.data[6]"
    kinds = evaluate(f"[{markers}.name, ...{markers}.marker.symbol]")
    assert kinds == ["markers", "square", "diamond"]
    scrub(tab, 40)
    assert evaluate(f"{markers}.z") == pytest.approx([80, 1e3 * wave[40, 2]], rel=1e-6)
    scrub(tab, 7)
    assert evaluate(f"{markers}.z[1]") is None
    assert "on the platform" in tab.page.locator("#marker-legend").inner_text()
    tab.page.get_by_role("button", name="Markers").click()
    tab.wait(f"() => {markers}.visible === false")
    assert tab.page.locator("#panel-marker-residual select option").count() == 4
    scene = place(mechanism, jaw["pose"].values[7:8], jaw["joint"].values[7:8])
    lines = [np.vstack([one.points["B"], one.points["M"]]) for one in scene.chains.values()]
    widths = [band.width for band in parts_of(mechanism, scene).bands]
    # The page's size is that of the whole run.
    page = payload((tmp_path / "page.html").read_text(encoding="utf-8"))
    scale = page["machine"]["muscles"][0]["width"] / widths[0]
    bands = [
        band_mesh(line, scene.position[0], scale * width)[0]
        for line, width in zip(lines, widths, strict=True)
    ]
    x = evaluate(f"[...{STAGE}.data[1].x]")
    assert np.allclose(x, 1e3 * np.vstack(bands)[:, 0], atol=1e-3)
    quiet = evaluate(f"{STAGE}.data[1].facecolor")
    scrub(tab, 33)
    strong = evaluate(f"{STAGE}.data[1].facecolor")
    assert len({*quiet}) < 6 < len({*strong}) and len(quiet) == len(strong)
    z = evaluate(f"{plot('activation')}._fullData[0].z")
    assert np.shape(z) == (25, jaw.sizes["time"])
    under = 9  # the EMG, under the muscle it is of
    assert np.allclose(z.pop(under), np.abs(np.sin(t)), atol=1e-6) and 0.2 < np.max(z) < 1
    assert tab.page.locator(".plane .dot:visible").count() == 24
    sample = int(np.argmax(np.max(z, axis=0)))
    scrub(tab, sample)
    read = tab.page.locator("#panel-activation .value").all_inner_texts()
    assert float(read.pop(under)) == pytest.approx(abs(np.sin(t[sample])), abs=1e-3)
    assert float(max(read)) == pytest.approx(np.max(z), abs=1e-3)
    at = evaluate(
        """() => [...document.querySelectorAll('.plane')].map((card) => {
            const layout = card.querySelector('.plot').firstChild._fullLayout;
            const dot = card.querySelector('.dot');
            return layout.yaxis.p2d(parseFloat(dot.style.top) - layout.yaxis._offset);
        })"""
    )
    expected = jaw["effort"].values[sample, ::2]
    assert np.allclose(at, expected, atol=0.02 * np.nanmax(expected))
