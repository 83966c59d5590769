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

import condyle
from condyle.markers import MeasuredChannels
from condyle.motion import Motion, bundled_reference
from condyle.report.page.report_page import write_report
from condyle.report.scene import parts_of, place

from .conftest import renamed

STAGE = "document.getElementById('stage')"
INDEX = "Number(document.getElementById('scrub').value)"
LOOK = f"""() => {{
    const {{ eye, center, projection }} = {STAGE}._fullLayout.scene.camera;
    return [...['x', 'y', 'z'].map((k) => eye[k] - center[k]), projection.type];
}}"""
SIDES = {"Front": (1, 0, 0), "Side": (0, -1, 0), "Top": (0, 0, 1)}
# Table at the cursor: variables, their scale, and half of the last digit that is shown.
DEGREES = 180 / np.pi
READOUT = {
    "contact": [("contact_force", 1.0, 0.0051), ("bound_margin", 1e3, 0.00051)],
    "chain": [("joint", DEGREES, 0.0051), ("joint_rate", DEGREES, 0.051), ("effort", 1.0, 5.1e-5)],
}
ODD_NAMES = ["constructor", "__proto__", "toString", "hasOwnProperty", "valueOf", "<b>x</b>"]


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


def assert_fits(tab: Tab, width: int, dark: bool) -> None:
    """On a window of that width, in its scheme."""
    wide = tab.page.evaluate("document.documentElement.scrollWidth")
    assert wide <= width, "nothing sticks out sideways"
    ground = tab.page.evaluate("getComputedStyle(document.body).backgroundColor")
    assert (sum(int(v) for v in ground[4:-1].split(",")) < 3 * 128) == dark


def test_the_page_opens_whole_and_without_a_network(tab: Tab, report: Path) -> None:
    asked = [url for url in tab.requests if not url.startswith(("data:", "blob:"))]
    assert asked == [report.as_uri()]
    assert_fits(tab, 1440, dark=False)
    pixels = tab.picture("#stage").reshape(-1, 3)
    assert pixels.std(axis=0).max() > 8, "the canvas is not blank"
    assert len(np.unique(pixels // 16, axis=0)) > 30, "shaded solids of several colours"
    nameless = tab.page.evaluate(
        """() => [...document.querySelectorAll('button, input, select, [role=img], [role=group]')]
            .filter((e) => !(e.ariaLabel || e.textContent.trim() || e.labels?.length)).length"""
    )
    assert nameless == 0


def test_values_and_cursors_are_those_of_the_time(tab: Tab, solution: xr.Dataset) -> None:
    """To the digits that are shown."""
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
        scale = DEGREES if panel.endswith("-rad") else 1.0
        values = legend(tab, panel)
        assert list(values) == list(solution["chain"].values)
        digits = 6e-4 * scale * float(np.abs(solution[variable].values).max())
        assert list(values.values()) == pytest.approx(at[variable].values * scale, abs=digits)
    for kind, shown in READOUT.items():
        for name in solution[kind].values:
            of = at.sel({kind: name})
            for value, (variable, scale, digits) in zip(readout(tab, name), shown, strict=True):
                assert value == pytest.approx(scale * float(of[variable]), abs=digits), name
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
    height = tab.page.evaluate(f"Array.from({plot('pose-position')}.data[2].y)")
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
    tab.wait(f"(n) => Number({STAGE}.dataset.sample) === n", stopped)
    assert np.abs(tab.picture("#stage") - before).max() > 50, "the mechanism moved"
    page.locator("#play").evaluate("button => button.blur()")
    for name, at in (("Home", 0), ("ArrowRight", 5), ("Shift+ArrowLeft", 4), ("End", 500)):
        key(name)
        assert index(tab) == at, name
    key("Home")
    key("Space")
    tab.wait(f"() => {INDEX} > 1")
    key("Space")
    assert page.inner_text("#play") == "Play"
    key("End")
    press = f"() => {{ document.querySelector('#play').click(); return {INDEX}; }}"
    assert page.evaluate(press) == 0, "from the end it begins anew"
    key("Space")
    key("2")
    pressed = page.locator("#cameras button[aria-pressed=true]")
    assert pressed.all_inner_texts() == ["Side"]
    key("Tab")
    outline = page.evaluate("getComputedStyle(document.activeElement).outlineStyle")
    assert outline != "none", "the focus can be seen"
    page.evaluate("document.activeElement.blur()")


def test_a_hand_on_a_plot_moves_zooms_and_hides(tab: Tab, solution: xr.Dataset) -> None:
    """Over a plot the time follows the mouse; all plots have one zoom."""
    page = tab.page
    scrub(tab, 0)
    panel = page.locator("#panel-pose-angles .plot")
    panel.scroll_into_view_if_needed()
    box = panel.bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + 0.6 * box["width"], box["y"] + 0.5 * box["height"])
    tab.wait(f"() => {INDEX} > 0")
    (time,) = {cursor["t"] for cursor in cursors(tab)}
    assert time == float(solution["time"].values[index(tab)]) and 2 < time < 4
    page.mouse.move(0, 0)
    zoom = f"(range) => Plotly.relayout({plot('pose-position')}, {{ 'xaxis.range': range }})"
    ranges = """[...document.querySelectorAll('.cursor')]
        .map((c) => c.parentElement.firstChild._fullLayout.xaxis.range.map(Number).join())"""
    page.evaluate(zoom, [1, 2])
    tab.wait(f"() => {ranges}.every((range) => range === '1,2')")
    scrub(tab, 150)
    assert all(c["left"] == pytest.approx(c["axis"], abs=0.6) for c in cursors(tab))
    scrub(tab, 300)
    assert page.locator(".cursor:visible").count() == 0, "3 s is out of the zoom"
    page.evaluate(zoom, [0, 5])
    tab.wait(f"() => {ranges}.every((range) => range === '0,5')")
    button = page.locator("#panel-effort-Nm .legend button").first
    button.click()
    assert button.get_attribute("aria-pressed") == "false"
    assert page.evaluate(f"{plot('effort-Nm')}.data[0].visible") is False
    page.select_option("#panel-share-Nm select", label="masseter_left")
    tab.wait("() => document.querySelectorAll('#panel-share-Nm .legend button').length === 4")
    assert list(legend(tab, "share-Nm")) == ["platform", "couplers", "cranks", "load"]


def test_cameras_look_from_their_sides(tab: Tab) -> None:
    """They fill the view; names behind each other stand beside each other; a window that changes
    is fitted again.
    """
    scrub(tab, 0)
    texts = f"{STAGE}.data[5].text.filter((text) => text)"
    pictures = {}
    for name, direction in SIDES.items():
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
        spans = zip(np.nonzero(drawn), drawn.shape, strict=True)
        assert max(np.ptp(at) / size for at, size in spans) > 0.7, "it fills the view"
        for edge in (drawn[0], drawn[-1], drawn[:, 0], drawn[:, -1]):
            assert not edge.any(), "nothing is cut off"
        if name == "Side":
            tab.wait(f"() => {texts}.length === 3")  # of both sides what they share
            assert {*tab.page.evaluate(texts)} == {"condyle", "molar", "incisor"}
        if name == "Front":
            tab.wait(f"() => {texts}.length === 5")
    assert np.abs(pictures["Front"] - pictures["Side"]).max() > 50
    ratio = f"{STAGE}._fullLayout.scene.aspectratio.x"
    for size in ({"width": 390, "height": 844}, {"width": 1440, "height": 900}):
        before = tab.page.evaluate(ratio)
        tab.page.set_viewport_size(size)
        tab.wait(f"(before) => Math.abs({ratio} - before) > 0.01", before)
        pressed = tab.page.locator("#cameras button[aria-pressed=true]")
        assert pressed.all_inner_texts() == ["Top"]


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
    tab.page.keyboard.press("t")


def test_a_pdf_has_every_plot(solution: xr.Dataset, tmp_path: Path, browser: Any) -> None:
    """A page that is printed at once is empty."""
    write_report(solution, tmp_path / "page.html", pdf=tmp_path / "page.pdf")
    printed = (tmp_path / "page.pdf").read_bytes()
    assert printed.startswith(b"%PDF-") and len(printed) > 500_000
    assert printed.count(b"/Type /Page\n") > 5
    assert sorted(path.name for path in tmp_path.iterdir()) == ["page.html", "page.pdf"]


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
    """On a phone, in the dark, and with names that mean something to the language."""
    path = write_report(renamed(torn, ODD_NAMES, ODD_NAMES[:2]), tmp_path / "torn.html")
    tab = ready(open_tab(path.as_uri(), 390, 844, color_scheme="dark"))
    assert_fits(tab, 390, dark=True)
    names = tab.page.locator("#panel-effort-Nm .legend .name").all_inner_texts()
    assert names == ODD_NAMES
    labels = tab.page.evaluate(f"{STAGE}.data[5].text.join(' ')")
    assert "constructor" in labels and "__proto__" in labels
    first = int(np.flatnonzero(torn["status"].values)[0])
    scrub(tab, first - 2)
    assert [len(readout(tab, name)) for name in ODD_NAMES[2:]] == [3] * 4
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
def test_a_long_run_a_print_and_other_families(
    open_tab: Callable[..., Tab], solution: xr.Dataset, tmp_path: Path
) -> None:
    count, t = 30_000, np.linspace(0, 1, 41)
    long = solution.isel(time=np.arange(count) % solution.sizes["time"])
    long = long.assign_coords(time=("time", np.arange(count) / 1000, {"units": "s"}))
    long["effort"].values[21_234, 2] = 9.75
    tab = ready(open_tab(write_report(long, tmp_path / "long.html").as_uri()))
    line = f"{plot('effort-Nm')}.data[2]"
    x, y = tab.page.evaluate(f"[Array.from({line}.x), Array.from({line}.y)]")
    assert len(x) < count and np.all(np.diff(x) >= -1e-9)
    assert x[int(np.argmax(y))] == pytest.approx(21.234, abs=1e-4) and max(y) == 9.75
    assert min(y) == pytest.approx(float(solution["effort"].values[:, 2].min()), rel=1e-6)
    assert len(tab.page.pdf(format="A4")) > 50_000
    for name in ("gough-stewart", "hexaglide"):
        motion = Motion.from_arrays(t, {n: 0.02 * np.sin(6 * t) for n in model(name).independent})
        path = write_report(model(name).solve(motion), tmp_path / f"{name}.html")
        tab = ready(open_tab(path.as_uri()))
        before = tab.picture("#stage")
        assert before.std() > 8
        scrub(tab, 12)
        assert np.abs(tab.picture("#stage") - before).max() > 50


def test_a_jaw_draws_activations_and_planes_of_all_its_muscles(
    open_tab: Callable[..., Tab], jaw: xr.Dataset, tmp_path: Path
) -> None:
    """And markers, one not seen for a sample; the bands are those that Python draws."""
    t, mechanism = jaw["time"].values, jaw.condyle.mechanism
    wave = np.column_stack([0.09 + 0 * t, 0 * t, -0.02 + 0.01 * np.sin(t)])
    wave[7] = np.nan
    places = np.stack([np.full_like(wave, 0.08), wave], axis=1)
    emg = {"deep_masseter_left": np.abs(np.sin(t))}
    names, bodies = ("Upper", "Lower"), ("fixed", "platform")
    measured = MeasuredChannels(t, names, bodies, places, np.full((len(t), 2), 1e-4), emg)
    path = write_report(jaw, tmp_path / "jaw.html", measured=measured)
    tab = ready(open_tab(path.as_uri()))
    evaluate, markers = tab.page.evaluate, f"{STAGE}.data[6]"
    kinds = evaluate(f"[{markers}.name, ...{markers}.marker.symbol]")
    assert kinds == ["markers", "square", "diamond"]
    scrub(tab, 40)
    assert evaluate(f"{markers}.z") == pytest.approx([80, 1e3 * wave[40, 2]], rel=1e-6)
    scrub(tab, 7)
    assert evaluate(f"{markers}.z[1]") is None
    assert "on the platform" in tab.page.inner_text("#mechanism")
    tab.page.get_by_role("button", name="Markers").click()
    tab.wait(f"() => {markers}.visible === false")
    assert tab.page.locator("#panel-marker-residual select option").count() == 4
    scene = place(mechanism, jaw["pose"].values, jaw["joint"].values)
    parts = parts_of(mechanism, scene)
    for number, group in enumerate(("platform", "chains")):
        solids = np.vstack([solid.at(scene, 7) for solid in parts.of_group(group)])
        drawn = evaluate(f"['x', 'y', 'z'].map((axis) => [...{STAGE}.data[{number}][axis]])")
        assert np.allclose(drawn, 1e3 * solids.T, atol=1e-3)
    quiet = evaluate(f"{STAGE}.data[1].facecolor")
    scrub(tab, 33)
    strong = evaluate(f"{STAGE}.data[1].facecolor")
    assert len({*quiet}) < 6 < len({*strong}) and len(quiet) == len(strong)
    assert tab.page.locator(".plane .dot:visible").count() == 24
    z = evaluate(f"{plot('activation')}._fullData[0].z")
    emg, sample = z.pop(9), 33  # under the muscle it is of
    assert np.allclose(emg, np.abs(np.sin(t)), atol=1e-6)
    assert np.allclose(np.sort(z, axis=0), np.sort(jaw["activation"].values.T, axis=0), atol=1e-6)
    read = [float(v) for v in tab.page.locator("#panel-activation .value").all_inner_texts()]
    assert read.pop(9) == pytest.approx(emg[sample], abs=1e-3)
    assert read == pytest.approx([row[sample] for row in z], abs=1e-3)
    at = evaluate(
        """() => [...document.querySelectorAll('.plane')].map((card) => {
            const layout = card.querySelector('.plot').firstChild._fullLayout;
            const dot = card.querySelector('.dot');
            return layout.yaxis.p2d(parseFloat(dot.style.top) - layout.yaxis._offset);
        })"""
    )
    expected = jaw["effort"].values[sample, ::2]
    assert np.allclose(at, expected, atol=0.02 * np.nanmax(expected))
    # Names beside each other stand away from the middle; of both sides stands what they share.
    tab.page.get_by_role("button", name="Front").click()
    labels = f"{STAGE}.data[5]"
    tab.wait(f"() => {labels}.textposition.includes('top left')")
    written = dict(zip(*evaluate(f"[{labels}.text, {labels}.textposition]"), strict=True))
    assert written["incisor, canine"] == "top center"
    assert (written["left_molar"], written["right_molar"]) == ("top right", "top left")
    assert written["left_condyle"] == "bottom center"
