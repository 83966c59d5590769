"""The report's file, without a browser: it is whole, closed to the network, and says the truth."""

from __future__ import annotations

import base64
import hashlib
import itertools
import json
import re
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from support.report_pages import Elements, column, payload, unpacked

import condyle
from condyle.errors import InputError
from condyle.motion import Motion, bundled_reference
from condyle.report.page import report_html, write_report
from condyle.report.page.html import fill, json_for_script, tag
from condyle.report.page.reduce import BUDGET, reduced
from condyle.report.page.report_page import opened
from condyle.report.panel_list import accuracy, magnitudes
from condyle.report.scene import DARK, LIGHT, styles
from condyle.report.tables import Table, kept_tables, with_tables
from condyle.results.failed_samples import at_sample

ATTACK = "</script><img src=x onerror=alert(1)>{{style}}"


@pytest.fixture(scope="module")
def solution(reference: condyle.Mechanism) -> xr.Dataset:
    """The reference case at 50 Hz."""
    motion = Motion.from_csv(bundled_reference()[0], rate=50)
    return condyle.derive(reference).solve(motion, condyle.reference_load())


@pytest.fixture(scope="module")
def page(solution: xr.Dataset) -> str:
    return report_html(solution)


def test_page_of_5001_samples_is_one_file_below_10_megabytes(
    reference: condyle.Mechanism, tmp_path: Path
) -> None:
    whole = condyle.derive(reference).solve(condyle.reference_motion(), condyle.reference_load())
    path = write_report(whole, tmp_path / "report.html")
    assert path.stat().st_size < 10e6
    data = payload(path.read_text(encoding="utf-8"))
    assert data["columns"]["samples"] == data["columns"]["total"] == 5001
    assert [p.name for p in tmp_path.iterdir()] == ["report.html"]


def test_nothing_on_the_page_points_elsewhere(page: str) -> None:
    for name, attributes in Elements(page).found:
        for key in ("src", "href", "action", "srcset", "data"):
            assert (attributes.get(key) or "#").startswith("#"), (name, attributes)
        assert not any(key.startswith("on") for key in attributes), "scripts only in scripts"


def test_policy_allows_just_the_scripts_of_the_page(page: str) -> None:
    elements = Elements(page)
    policy = next(a["content"] for n, a in elements.found if a.get("http-equiv")) or ""
    assert "default-src 'none'" in policy and "connect-src 'none'" in policy
    assert "http" not in policy and "unsafe-eval" not in policy
    _, *code = elements.scripts
    allowed = set(re.findall(r"sha256-([^']+)", policy))
    assert allowed == {
        base64.b64encode(hashlib.sha256(text.encode()).digest()).decode() for text in code
    }


def test_values_of_the_page_equal_the_solution(page: str, solution: xr.Dataset) -> None:
    data = payload(page)
    names = data["columns"]["names"]
    time = np.frombuffer(base64.b64decode(data["columns"]["time"]), dtype="<f8")
    assert np.array_equal(time, solution["time"].values)
    for variable in ("effort", "joint", "joint_rate", "transmission"):
        for i, chain in enumerate(solution["chain"].values):
            shown = column(data, names.index(f"{variable}.{chain}"))
            assert np.array_equal(shown, solution[variable].values[:, i].astype("f4"))


def test_every_kind_of_plot_is_there(page: str) -> None:
    data = payload(page)
    found = {panel["id"] for panel in data["panels"]}
    expected = {"pose-position", "pose-angles", "joint-rad", "joint_rate-rad", "effort-Nm"}
    expected |= {"share-Nm", "contact-force", "bound-margin", "load", "transmission", "sigma"}
    assert expected | {"ratio", "condition"} <= found
    torque = next(panel for panel in data["panels"] if panel["id"] == "effort-Nm")
    assert [(limit["low"], limit["high"]) for limit in torque["limits"]] == [(-3.0, 3.0)]
    tracks = [panel for panel in data["panels"] if panel["kind"] == "track"]
    assert [t["title"].split()[-1] for t in tracks] == ["above", "side"] * 2
    assert tracks[0]["bounds"] == [pytest.approx([-27.65, -14.65]), pytest.approx([69, 75])]


def test_names_are_text_and_never_markup(
    reference: condyle.Mechanism, solution: xr.Dataset
) -> None:
    chains = tuple(
        c.model_copy(update={"name": ATTACK.replace(",", "")}) if i == 0 else c
        for i, c in enumerate(reference.chains)
    )
    mechanism = reference.replace(name=ATTACK, chains=chains)
    motion = Motion.from_csv(bundled_reference()[0], rate=20)
    attacked = condyle.derive(mechanism).solve(motion)
    page = report_html(attacked)
    elements = Elements(page)
    assert "img" not in {name for name, _ in elements.found}
    assert len(elements.scripts) == 3, "the data, plotly and the page's own script"
    assert ATTACK in elements.text
    assert ATTACK in payload(page)["panels"][6]["sets"][0]["lines"][0]["label"]


def test_the_page_says_how_many_digits_there_are(solution: xr.Dataset) -> None:
    """The largest bound and when; an alarm, and a limit in its panel, where digits are few."""
    small = solution.isel(time=slice(0, 50)).copy(deep=True)
    small["bound"].values[:] = 3e-14
    small["bound"].values[7] = 2.5e-13
    fact = r'class="fact{}"><dt>Bound of the relative error</dt><dd>{}<small>largest, t = {:g} s'
    when = float(small["time"][7])
    assert re.search(fact.format("", "2.5e-13", when), report_html(small))
    assert not next(accuracy(small)).limits
    small["bound"].values[7] = 2e-6
    assert re.search(fact.format(" alarm", "2.0e-06", when), report_html(small))
    assert next(accuracy(small)).limits


def test_warnings_stand_at_the_top(reference: condyle.Mechanism) -> None:
    t = np.linspace(0, 1, 21)
    motion = Motion.from_arrays(
        t, {n: -0.003 * t * (n == "X") for n in ("X", "Y", "alpha", "beta")}
    )
    outside = condyle.derive(reference).solve(motion, flag=True)
    page = report_html(outside)
    assert outside.condyle.warnings
    text = Elements(page).text
    for warning in outside.condyle.warnings:
        assert text.index(warning) < text.index("Mechanism")
    told = {alert["text"] for alert in payload(page)["alerts"]}
    assert "left_condyle is outside its bounds" in told


def test_samples_without_a_result_are_holes_and_said_so(torn: xr.Dataset) -> None:
    data = payload(report_html(torn))
    failed = next(alert for alert in data["alerts"] if alert["failed"])
    assert failed["text"] == "no result: unreachable"
    assert np.array_equal(column(data, failed["column"]), torn["status"].values == 1)
    shown = column(data, data["columns"]["names"].index("effort.masseter_left"))
    assert np.array_equal(np.isnan(shown), torn["status"].values != 0)


def test_what_was_run_is_named_with_hashes(solution: xr.Dataset, tmp_path: Path) -> None:
    motion = tmp_path / "chewing <1>.csv"
    motion.write_text("t,X\n")
    text = Elements(report_html(solution, files=[motion])).text
    assert motion.name in text and str(tmp_path) not in text, "no folder of the sender"
    assert hashlib.sha256(b"t,X\n").hexdigest() in text
    assert hashlib.sha256(solution.attrs["mechanism"].encode()).hexdigest() in text
    assert f"condyle {condyle.__version__}" in text
    assert Path(solution.condyle.options["motion"]).name in text
    assert str(Path(solution.condyle.options["motion"]).parent) not in report_html(solution)
    assert solution.attrs["mechanism"] in text


def test_files_are_named_with_the_hashes_of_what_was_read(
    reference: condyle.Mechanism, tmp_path: Path
) -> None:
    """Without being named again; a copy that is stands there once."""
    motion, load = bundled_reference()
    contents = [Path(file).read_bytes() for file in (motion, load)]
    hashes = [hashlib.sha256(content).hexdigest() for content in contents]
    solution = condyle.derive(reference).solve(
        Motion.from_csv(motion, rate=10), condyle.Load.from_csv(load)
    )
    text = Elements(report_html(solution)).text
    assert all(text.count(found) == 1 for found in hashes)
    assert "sha256" not in text, "a hash is no option"
    copy = tmp_path / "copy.csv"
    copy.write_bytes(contents[0])
    text = Elements(report_html(solution, files=[copy])).text
    assert text.count(hashes[0]) == 1 and copy.name not in text


def test_heading_names_files_without_their_folders(page: str, solution: xr.Dataset) -> None:
    heading = Elements(page).text.split("Mechanism")[0]
    assert "motion: chewing-incisor.csv; load: " in heading
    assert str(Path(solution.condyle.options["motion"]).parent) not in heading


def test_a_missing_file_leaves_no_page(solution: xr.Dataset, tmp_path: Path) -> None:
    out = tmp_path / "report.html"
    out.write_text("before")
    with pytest.raises(InputError, match=r"gone\.csv"):
        write_report(solution, out, files=[tmp_path / "gone.csv"])
    assert out.read_text() == "before"


def test_tables_and_reactions_stand_on_the_page(solution: xr.Dataset) -> None:
    table = Table("table-1", "Table 1. Seconds", ("Model", "s"), [["GM1 <a>", "1.5"]], [], ["n=5"])
    force = np.ones((solution.sizes["time"], 6, 3)) * [2.0, 3.0, 6.0]
    attributes = {"units": "N", "long_name": "force at the ball joints"}
    added = xr.Dataset(
        {**solution.data_vars, "reaction_ball": (("time", "chain", "axis"), force, attributes)},
        solution.coords,
        solution.attrs,
    )
    page = report_html(added, tables=[table])
    text = Elements(page).text
    assert "Table 1. Seconds" in text and "GM1 <a>" in text and "n=5" in text
    assert "Largest force at the ball joints" in text and "7 N" in text
    panel = next(p for p in payload(page)["panels"] if p["id"] == "reaction_ball")
    assert len(panel["sets"][0]["lines"]) == 6
    assert np.allclose(magnitudes(added, "reaction_ball")["masseter_left"], 7.0)


def test_solution_keeps_its_tables_for_any_later_page(solution: xr.Dataset, tmp_path: Path) -> None:
    table = Table("table-1", "Table 1. Time", ("Model", "s"), [["GM1", "1.5"]], [{"s": 1}], ["n=5"])
    keeping = with_tables(solution, [table])
    assert "tables" not in solution.attrs, "a copy keeps them"
    keeping.condyle.save(tmp_path / "kept.nc")
    again = condyle.open_solution(tmp_path / "kept.nc")
    assert kept_tables(again)[0].markdown() == table.markdown()
    assert "Table 1. Time" in Elements(report_html(again)).text
    assert "Table 1. Time" not in Elements(report_html(again, tables=[])).text
    assert kept_tables(solution) == []


def test_small_contact_forces_have_arrows_of_a_scale_of_their_own(page: str) -> None:
    drawn = payload(page)["machine"]
    lengths = {k: s["largest"] * s["metresPerNewton"] for k, s in drawn["scales"].items()}
    assert lengths["contact"] == pytest.approx(lengths["load"])
    assert drawn["scales"]["contact"]["largest"] < 0.2 * drawn["scales"]["load"]["largest"]
    assert [arrow["into"] for arrow in drawn["arrows"]] == [True, True, False]


def test_forces_of_one_size_share_a_scale(reference: condyle.Mechanism) -> None:
    t = np.linspace(0, 1, 11)
    still = Motion.from_arrays(t, {n: 0 * t for n in ("X", "Y", "alpha", "beta")})
    push = condyle.Load.constant([0, 0, -20], point="incisor")
    solved = condyle.derive(reference).solve(still, push)
    scales = payload(report_html(solved))["machine"]["scales"]
    assert scales["contact"]["metresPerNewton"] == scales["load"]["metresPerNewton"]


def test_camera_sees_every_end_of_the_mechanism(page: str, solution: xr.Dataset) -> None:
    drawn = payload(page)["machine"]
    seen = np.array(drawn["extent"])
    low, high = np.array(drawn["range"]).T
    assert ((seen >= low - 1e-12) & (seen <= high + 1e-12)).all()
    balls = solution["contact_point"].values.reshape(-1, 3)
    for direction in itertools.product((-1, 0, 1), repeat=3):
        assert (balls @ direction).max() <= (seen @ direction).max() + 1e-12
    assert drawn["triad"]["arm"] == 0.02


def test_moment_of_the_load_is_plotted(reference: condyle.Mechanism) -> None:
    t = np.linspace(0, 1, 11)
    still = Motion.from_arrays(t, {n: 0 * t for n in ("X", "Y", "alpha", "beta")})
    twist = condyle.Load.constant([0, 0, 0], [0, 0.1, 0], point="incisor")
    data = payload(report_html(condyle.derive(reference).solve(still, twist)))
    assert "load" not in {panel["id"] for panel in data["panels"]}
    moment = next(panel for panel in data["panels"] if panel["id"] == "moment")
    assert moment["unit"] == "N m" and [n["label"] for n in moment["sets"][0]["lines"]][1] == "My"


def test_surface_that_cannot_be_drawn_is_named(
    solution: xr.Dataset, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("condyle.report.page.stage_data._surfaces", lambda *_: iter(()))
    assert payload(report_html(solution))["machine"]["undrawn"] == ["left_condyle", "right_condyle"]


@pytest.mark.parametrize("name", ["gough-stewart", "hexaglide"])
def test_other_families_have_a_page(name: str) -> None:
    mechanism = condyle.load_mechanism(name)
    model = condyle.derive(mechanism)
    t = np.linspace(0, 1, 21)
    motion = Motion.from_arrays(t, {n: 0.01 * np.sin(t) for n in model.independent})
    data = payload(report_html(model.solve(motion)))
    assert {rod["chain"] for rod in data["machine"]["rods"]} == set(mechanism.chain_names)
    assert len(data["machine"]["surfaces"]) == len(mechanism.contacts)


@pytest.fixture(scope="module")
def long_run(solution: xr.Dataset) -> xr.Dataset:
    """60 000 samples: the reference again and again, with one torque that peaks for a sample."""
    count = 60_000
    long = solution.isel(time=np.arange(count) % solution.sizes["time"])
    long = long.assign_coords(time=("time", np.arange(count) / 1000 - 3.0, {"units": "s"}))
    long["effort"].values[31_234, 2] = 9.75
    long["effort"].values[41_235, 2] = -8.5
    for name in ("effort", "joint", "pose", "contact_force"):
        long[name].values[20_000:20_040] = np.nan
    long["status"].values[20_000:20_040] = 1
    return long


def test_long_runs_are_thinned_and_keep_every_peak(long_run: xr.Dataset) -> None:
    """Of every curve, in every span of time; its time is right to a part of the span."""
    page = report_html(long_run)
    data = payload(page)
    packed = data["columns"]
    assert packed["total"] == 60_000 and packed["samples"] < 10_000
    assert len(packed["values"]) + len(packed["envelope"]["low"]) < 1.4 * BUDGET
    edges = unpacked(packed["envelope"]["edges"], "<f8")
    time = long_run["time"].values
    starts = np.searchsorted(time, edges[:-1] - 1e-9)
    line = packed["envelope"]["columns"].index(packed["names"].index("effort.masseter_left"))
    values = long_run["effort"].values[:, 2]
    for name, best in (("low", np.fmin), ("high", np.fmax)):
        rows = unpacked(packed["envelope"][name], "<f4").reshape(-1, len(edges) - 1)
        found = rows[line]
        expected = best.reduceat(values, starts)
        np.testing.assert_array_equal(found, expected.astype("f4"))
    at = unpacked(packed["envelope"]["highAt"], "<u2").reshape(rows.shape)[line] / 65535
    k = int(np.searchsorted(starts, 31_234, side="right")) - 1
    assert edges[k] + at[k] * (edges[k + 1] - edges[k]) == pytest.approx(28.234, abs=1e-5)
    text = Elements(page).text
    assert "9.75 N m" in text and "28.234 s" in text
    assert "60\u202f000" in text and "40 without a result" in text


def test_a_file_is_read_piece_by_piece(long_run: xr.Dataset, tmp_path: Path) -> None:
    long_run.condyle.save(tmp_path / "long.nc")
    write_report(tmp_path / "long.nc", tmp_path / "pieces.html")
    assert (tmp_path / "pieces.html").read_text("utf-8") == report_html(long_run)
    with pytest.raises(InputError, match=r"gone\.nc"):
        write_report(tmp_path / "gone.nc", tmp_path / "x.html")
    (tmp_path / "bad.nc").write_text("no NetCDF")
    with pytest.raises(InputError, match="not a NetCDF"):
        write_report(tmp_path / "bad.nc", tmp_path / "x.html")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["bad.nc", "long.nc", "pieces.html"]


@pytest.mark.ci
def test_memory_does_not_grow_with_the_run(solution: xr.Dataset, tmp_path: Path) -> None:
    """Twice the samples, as much memory: of Python's and numpy's objects, at its largest."""
    peaks = []
    for count in (200_000, 400_000):
        path = tmp_path / f"{count}.nc"
        long = solution.isel(time=np.arange(count) % solution.sizes["time"])
        long.assign_coords(time=("time", np.arange(count) / 1000, {"units": "s"})).condyle.save(
            path
        )
        del long
        tracemalloc.start()
        with opened(path) as lazy:
            reduced(lazy)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        path.unlink()
    assert peaks[1] < peaks[0] + 30e6, "time and status of every sample, and little more"
    assert peaks[1] < 150e6


def test_spans_without_a_result_are_listed_and_marked(long_run: xr.Dataset) -> None:
    page = report_html(long_run)
    [[start, end, words]] = payload(page)["failures"]
    assert (start, end) == pytest.approx((17.0, 17.039)) and words.startswith("unreachable: ")
    text = Elements(page).text
    assert "17 to 17.039 s" in text and "Without a result" in text


def test_the_interval_of_a_sample(long_run: xr.Dataset) -> None:
    [found] = long_run.condyle.failures
    assert (found.first, found.count) == (20_000, 40)
    assert at_sample([found], 20_010) is found and at_sample([found], 20_040) is None


def test_no_load_no_share_of_it(solution: xr.Dataset) -> None:
    """A machine without a load shows no share of zeros; with one it is called load."""
    idle = solution.copy(deep=True)
    idle["share"].values[list(solution["part"].values).index("load")] = 0.0
    for one, expected in ((solution, True), (idle, False)):
        panel = next(p for p in payload(report_html(one))["panels"] if p["id"] == "share-Nm")
        labels = [line["label"] for line in panel["sets"][0]["lines"]]
        assert ("load" in labels) == expected and "bite" not in labels


def test_json_cannot_leave_its_script_and_filling_is_one_pass() -> None:
    assert "<" not in json_for_script({"a": "</script><!--\u2028"})
    assert json.loads(json_for_script({"a": "</script>\u2028"})) == {"a": "</script>\u2028"}
    assert fill("{{a}} {{b}}", {"a": tag("i", "{{b}}"), "b": tag("b", "x")}) == (
        "<i>{{b}}</i> <b>x</b>"
    )
    assert tag("p", "<&", title='"') == '<p title="&quot;">&lt;&amp;</p>'


# Machado, Oliveira & Fernandes 2009, severity 1, on linear RGB.
VISION = {
    "full": np.eye(3),
    "protan": [[0.1523, 1.0526, -0.2049], [0.1145, 0.7863, 0.0992], [-0.0039, -0.0481, 1.0520]],
    "deutan": [[0.3673, 0.8606, -0.2280], [0.2801, 0.6725, 0.0474], [-0.0118, 0.0429, 0.9689]],
    "tritan": [[1.2555, -0.0767, -0.1788], [-0.0784, 0.9308, 0.1476], [0.0047, 0.6914, 0.3039]],
}


def linear(colour: str) -> np.ndarray:
    c = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) / 255
    return np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)


def lab(rgb: np.ndarray) -> np.ndarray:
    to_xyz = [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]
    x = to_xyz @ np.clip(rgb, 0, 1) / [0.9505, 1.0, 1.089]
    f = np.where(x > 0.008856, np.cbrt(x), 7.787 * x + 16 / 116)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


def contrast(a: str, b: str) -> float:
    bright = sorted(float(linear(c) @ [0.2126, 0.7152, 0.0722]) + 0.05 for c in (a, b))
    return bright[1] / bright[0]


@pytest.mark.parametrize(("palette", "ground"), [(LIGHT, "#ffffff"), (DARK, "#171c22")])
@pytest.mark.parametrize("vision", VISION)
def test_colours_can_be_told_apart(palette: tuple[str, ...], ground: str, vision: str) -> None:
    seen = [lab(np.array(VISION[vision]) @ linear(colour)) for colour in palette]
    nearest = min(float(np.linalg.norm(a - b)) for a, b in itertools.combinations(seen, 2))
    assert nearest > 20  # CIELAB distance; 2.3 is just noticeable
    assert min(contrast(colour, ground) for colour in palette) > 3


def test_styles_pair_left_and_right_and_never_repeat() -> None:
    pairs = styles(["jaw_left", "jaw_right", "lid_left", "lid_right"])
    assert [s.colour for s in pairs] == [0, 0, 1, 1]
    alone = styles(["left_condyle", "right_condyle"])
    assert [(s.colour, s.dash) for s in alone] == [(0, "solid"), (1, "dash")]
    assert pairs[0].dash == pairs[2].dash != pairs[1].dash
    many = styles([f"leg_{i}" for i in range(20)])
    assert len({(s.colour, s.dash) for s in many}) == 20
