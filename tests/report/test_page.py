"""The report's file, without a browser: it is whole, closed to the network, and says the truth."""

from __future__ import annotations

import base64
import hashlib
import itertools
import json
import re
import sys
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from support.machines import model
from support.report_pages import Elements, column, payload, unpacked

import condyle
from condyle import Load
from condyle.errors import InputError
from condyle.motion import Motion, bundled_reference
from condyle.report.actuators import duty
from condyle.report.page import report_html, write_report
from condyle.report.page.html import fill, json_for_script, tag
from condyle.report.page.reduce import BUDGET, reduced
from condyle.report.page.report_page import opened
from condyle.report.panel import panels_of
from condyle.report.panel_list import accuracy, magnitudes
from condyle.report.scene import DARK, LIGHT
from condyle.report.scene.patches import Patch
from condyle.report.tables import ReportTable, stored_tables, with_tables
from condyle.results.failed_samples import at_sample

from .conftest import panels, renamed

ATTACK = "</script><img src=x onerror=alert(1)>{{style}}"
GROUPS = ("chains", "surfaces")
T = np.linspace(0, 1, 21)


def sha256(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def at_rest(load: Load, x: float = 0.0) -> xr.Dataset:
    """The bundled robot at home, or moved along X up to a place."""
    motion = Motion.from_arrays(T, {n: x * T * (n == "X") for n in ("X", "Y", "alpha", "beta")})
    return model("masticatory").solve(motion, load, flag=True)


def repeated(solution: xr.Dataset, count: int) -> xr.Dataset:
    """Again and again, at 1 kHz."""
    long = solution.isel(time=np.arange(count) % solution.sizes["time"])
    return long.assign_coords(time=("time", np.arange(count) / 1000 - 3.0, {"units": "s"}))


def test_nothing_on_the_page_points_elsewhere(page: str) -> None:
    """And its policy allows just the scripts of the page."""
    elements = Elements(page)
    for name, attributes in elements.found:
        for key in ("src", "href", "action", "srcset", "data"):
            assert (attributes.get(key) or "#").startswith("#"), (name, attributes)
        assert not any(key.startswith("on") for key in attributes), "scripts only in scripts"
    policy = next(a["content"] for n, a in elements.found if a.get("http-equiv")) or ""
    assert "default-src 'none'" in policy and "connect-src 'none'" in policy
    assert "http" not in policy and "unsafe-eval" not in policy
    _, *code = elements.scripts
    digests = (base64.b64encode(hashlib.sha256(text.encode()).digest()).decode() for text in code)
    assert set(re.findall(r"sha256-([^']+)", policy)) == {*digests}


def test_names_are_text_and_never_markup(solution: xr.Dataset) -> None:
    attacked = renamed(solution, [ATTACK, *map(str, solution["chain"].values[1:])])
    machine = condyle.dumps(attacked.condyle.mechanism.replace(name=ATTACK))
    attacked.attrs |= {"mechanism": machine, "mechanism_name": ATTACK}
    page = report_html(attacked)
    elements = Elements(page)
    assert "img" not in {name for name, _ in elements.found}
    assert len(elements.scripts) == 3, "the data, plotly and the page's own script"
    assert ATTACK in elements.text
    assert ATTACK in payload(page)["panels"][6]["sets"][0]["lines"][0]["label"]
    assert "<" not in json_for_script({"a": "</script><!--\u2028"})
    assert json.loads(json_for_script({"a": "</script>\u2028"})) == {"a": "</script>\u2028"}
    filled = fill("{{a}} {{b}}", {"a": tag("i", "{{b}}"), "b": tag("b", "x")})
    assert filled == "<i>{{b}}</i> <b>x</b>", "in one pass"
    assert tag("p", "<&", title='"') == '<p title="&quot;">&lt;&amp;</p>'


def test_values_of_the_page_are_the_solutions(page: str, solution: xr.Dataset) -> None:
    """In every kind of plot."""
    data, found = payload(page), panels(page)
    columns, names = data["columns"], data["columns"]["names"]
    assert columns["samples"] == columns["total"] == solution.sizes["time"]
    assert np.array_equal(unpacked(columns["time"], "<f8"), solution["time"].values)
    for variable in ("effort", "joint", "joint_rate", "transmission"):
        for i, chain in enumerate(solution["chain"].values):
            shown = column(data, names.index(f"{variable}.{chain}"))
            assert np.array_equal(shown, solution[variable].values[:, i].astype("f4"))
    expected = {"pose-position", "pose-angles", "joint-rad", "joint_rate-rad", "effort-Nm"}
    expected |= {"share-Nm", "contact-force", "bound-margin", "load", "transmission", "sigma"}
    assert expected | {"ratio", "condition"} <= {*found}
    limits = [(limit["low"], limit["high"]) for limit in found["effort-Nm"]["limits"]]
    assert limits == [(-3.0, 3.0)]
    tracks = [panel for panel in found.values() if panel["kind"] == "track"]
    assert [t["title"].split()[-1] for t in tracks] == ["above", "side"] * 2
    (box,) = tracks[0]["shapes"]
    assert [box[k] for k in ("x0", "x1", "y0", "y1")] == pytest.approx([-27.65, -14.65, 69, 75])


def test_scales_and_extent_of_the_picture(
    page: str, solution: xr.Dataset, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Small contact forces have a scale of their own, and forces of one size share one."""
    machine = payload(page)["machine"]
    largest = {
        "contact": np.abs(solution["contact_force"].values).max(),
        "load": np.linalg.norm(solution["load"].values[:, :3], axis=1).max(),
    }
    scale = {force["kind"]: force["metresPerNewton"] for force in machine["forces"]}
    assert scale["contact"] * largest["contact"] == pytest.approx(scale["load"] * largest["load"])
    assert largest["contact"] < 0.2 * largest["load"]
    assert [force["into"] for force in machine["forces"]] == [True, True, False]
    pushed = at_rest(Load.constant([0, 0, -20], point="incisor"))
    forces = payload(report_html(pushed))["machine"]["forces"]
    assert len({force["metresPerNewton"] for force in forces}) == 1
    seen = np.array(machine["extent"])
    low, high = np.array(machine["range"]).T
    assert ((seen >= low - 1e-12) & (seen <= high + 1e-12)).all()
    balls = solution["contact_point"].values.reshape(-1, 3)
    for direction in itertools.product((-1, 0, 1), repeat=3):
        assert (balls @ direction).max() <= (seen @ direction).max() + 1e-12
    assert "Arms of the axes: 20 mm." in Elements(page).text and "Not drawn" not in page
    none = np.empty((0, 3)), np.empty((0, 3), int), np.empty((0, 2, 3)), False, np.empty((0, 2, 3))
    monkeypatch.setattr("condyle.report.scene.parts.contact_patch", lambda *_: Patch(*none))
    assert "not in the solution: left_condyle, right_condyle." in report_html(solution)


def test_the_page_says_how_many_digits_there_are(solution: xr.Dataset) -> None:
    """The largest bound and when; an alarm, and a limit in its panel, where digits are few."""
    small = solution.isel(time=slice(0, 50)).copy(deep=True)
    small["bound"].values[:] = 3e-14
    fact = r'class="fact{}"><dt>Bound of the relative error</dt><dd>{}<small>largest, t = {:g} s'
    for bound, alarm, said in ((2.5e-13, "", "2.5e-13"), (2e-6, " alarm", "2.0e-06")):
        small["bound"].values[7] = bound
        assert re.search(fact.format(alarm, said, float(small["time"][7])), report_html(small))
        assert bool(next(accuracy(small)).limits) == bool(alarm)


def test_warnings_stand_at_the_top_and_failures_are_holes(torn: xr.Dataset) -> None:
    outside = at_rest(Load.zero(), -0.003)
    page = report_html(outside)
    text = Elements(page).text
    assert outside.condyle.warnings
    for warning in outside.condyle.warnings:
        assert text.index(warning) < text.index("Mechanism")
    told = {alert["text"] for alert in payload(page)["alerts"]}
    assert "left_condyle is outside its bounds" in told
    data = payload(report_html(torn))
    failed = next(alert for alert in data["alerts"] if alert["failed"])
    assert failed["text"] == "no result: unreachable"
    assert np.array_equal(column(data, failed["column"]), torn["status"].values == 1)
    shown = column(data, data["columns"]["names"].index("effort.masseter_left"))
    assert np.array_equal(np.isnan(shown), torn["status"].values != 0)


def test_what_was_run_is_named_with_hashes(solution: xr.Dataset, tmp_path: Path) -> None:
    """Of what was read, without being named again; a copy stands there once; no folders."""
    motion = tmp_path / "chewing <1>.csv"
    motion.write_text("t,X\n")
    page = report_html(solution, files=[motion])
    text = Elements(page).text
    given = Path(solution.condyle.options["motion"])
    assert motion.name in text and str(tmp_path) not in text, "no folder of the sender"
    assert sha256(b"t,X\n") in text and sha256(solution.attrs["mechanism"].encode()) in text
    assert f"condyle {condyle.__version__}" in text and solution.attrs["mechanism"] in text
    assert given.name in text and str(given.parent) not in page
    assert "motion: chewing-incisor.csv; load: " in text.split("Mechanism")[0]
    read = [Path(file).read_bytes() for file in bundled_reference()]
    copy = tmp_path / "copy.csv"
    copy.write_bytes(read[0])
    solved = model("masticatory").solve(
        Motion.from_csv(bundled_reference()[0], rate=10), Load.from_csv(bundled_reference()[1])
    )
    text = Elements(report_html(solved, files=[copy])).text
    assert all(text.count(sha256(content)) == 1 for content in read)
    assert copy.name not in text and "sha256" not in text, "a hash is no option"
    out = tmp_path / "report.html"
    out.write_text("before")
    with pytest.raises(InputError, match=r"gone\.csv"):
        write_report(solution, out, files=[tmp_path / "gone.csv"])
    assert out.read_text() == "before"


def test_a_pdf_without_a_browser_is_refused_in_words(
    solution: xr.Dataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Before anything is written; so is a program that is none, or that does not answer."""
    out, pdf = tmp_path / "report.html", tmp_path / "report.pdf"
    for named, said in (("", "Chromium, Chrome or Edge"), ("/no/such", "CHROME_PATH: expected")):
        monkeypatch.setenv("CHROME_PATH", named)
        monkeypatch.setenv("PATH", str(tmp_path))
        monkeypatch.setattr("condyle.report.page.pdf.PLACES", ())
        with pytest.raises(InputError, match=said):
            write_report(solution, out, pdf=pdf)
    monkeypatch.setenv("CHROME_PATH", sys.executable)
    with pytest.raises(InputError, match="does not start"):
        write_report(solution, out, pdf=pdf)
    assert not pdf.exists()


def test_tables_and_reactions_stand_on_the_page(solution: xr.Dataset, tmp_path: Path) -> None:
    """A solution keeps its tables for any later page."""
    table = ReportTable(
        "table-1", "Table 1. Seconds", ("Model", "s"), [["GM1 <a>", "1.5"]], [{"s": 1}], ["n=5"]
    )
    keeping = with_tables(solution, [table])
    assert "tables" not in solution.attrs, "a copy keeps them"
    keeping.condyle.save(tmp_path / "kept.nc")
    again = condyle.open_solution(tmp_path / "kept.nc")
    assert stored_tables(again)[0].markdown() == table.markdown() and stored_tables(solution) == []
    force = np.ones((solution.sizes["time"], 6, 3)) * [2.0, 3.0, 6.0]
    attributes = {"units": "N", "long_name": "force at the ball joints"}
    added = again.assign(reaction_ball=(("time", "chain", "axis"), force, attributes))
    page = report_html(added)
    text = Elements(page).text
    assert "Table 1. Seconds" in text and "GM1 <a>" in text and "n=5" in text
    assert "Largest force at the ball joints" in text and "7 N" in text
    assert len(panels(page)["reaction_ball"]["sets"][0]["lines"]) == 6
    assert np.allclose(magnitudes(added, "reaction_ball")["masseter_left"], 7.0)
    assert "Table 1. Seconds" not in Elements(report_html(again, tables=[])).text
    assert "Table 1. Seconds" in Elements(report_html(solution, tables=[table])).text


def test_a_file_of_another_program_has_a_report_of_what_it_holds(
    solution: xr.Dataset, tmp_path: Path
) -> None:
    """Whatever it lacks of what the door does not need, alone or together; said once."""
    lacking = {
        "pose_rate": {"pose_rate-position", "pose_rate-angles"},
        "J_W_sigma": {"sigma"},
        "joint_unit": set[str](),
        "effort_unit": set[str](),
        "share": {"share-Nm"},
        "contact_point": {f"track-{k}-{view}" for k in (0, 1) for view in ("above", "side")},
        "joint_acceleration": {"joint_acceleration-rad"},
    }
    kept = {name: solution.attrs[name] for name in ("mechanism", "options")}
    small = solution.isel(time=slice(0, 9)).drop_attrs(deep=False).assign_attrs(kept)
    every = {panel.id for _, panel in panels_of(small)}
    for left_out in [*([name] for name in lacking), [*lacking, "part", "independent"]]:
        small.drop_vars(left_out).to_netcdf(tmp_path / "other.nc", engine="h5netcdf")
        other = condyle.open_solution(tmp_path / "other.nc")
        found = {panel.id for _, panel in panels_of(other)}
        assert every - found == set().union(*(lacking.get(name, ()) for name in left_out))
        other.close()
    text = Elements(report_html(other)).text
    said = re.findall(r"Not in this file: ([^;]+);", text)
    assert len(said) == 1 and {n for n in lacking if lacking[n]} == {*said[0].split(", ")}


def test_loads_and_families_have_their_panels(page: str, solution: xr.Dataset) -> None:
    """A moment is plotted; a machine without a load shows no share of zeros; legs are rods."""
    turned = panels(report_html(at_rest(Load.constant([0, 0, 0], [0, 0.1, 0], point="incisor"))))
    assert "load" not in turned and turned["moment"]["unit"] == "N m"
    assert [line["label"] for line in turned["moment"]["sets"][0]["lines"]][1] == "My"
    idle = solution.copy(deep=True)
    idle["share"].values[list(solution["part"].values).index("load")] = 0.0
    for one, expected in ((page, True), (report_html(idle), False)):
        labels = [line["label"] for line in panels(one)["share-Nm"]["sets"][0]["lines"]]
        assert ("load" in labels) == expected and "bite" not in labels
    for name in ("gough-stewart", "hexaglide"):
        motion = Motion.from_arrays(T, {n: 0.01 * np.sin(T) for n in model(name).independent})
        drawn = payload(report_html(model(name).solve(motion)))["machine"]
        mechanism = model(name).mechanism
        owners = {
            group: {s["owner"] for s in drawn["solids"] if s["group"] == group} for group in GROUPS
        }
        assert owners == {
            "chains": set(mechanism.chain_names),
            "surfaces": set(mechanism.contact_names),
        }


def test_long_runs_are_thinned_and_keep_every_peak(solution: xr.Dataset, tmp_path: Path) -> None:
    """Of every curve, in every span of time; its time is right to a part of the span. A file is
    read piece by piece, to the same page.
    """
    run = repeated(solution, 30_000)
    run["effort"].values[21_234, 2] = 9.75
    run["effort"].values[25_235, 2] = -8.5
    for name in ("effort", "joint", "pose", "contact_force"):
        run[name].values[10_000:10_040] = np.nan
    run["status"].values[10_000:10_040] = 1
    page = report_html(run)
    packed = payload(page)["columns"]
    assert packed["total"] == 30_000 and packed["samples"] < 10_000
    assert len(packed["values"]) + len(packed["envelope"]["low"]) < 1.4 * BUDGET
    assert len(page) < 10e6
    edges = unpacked(packed["envelope"]["edges"], "<f8")
    starts = np.searchsorted(run["time"].values, edges[:-1] - 1e-9)
    line = packed["envelope"]["columns"].index(packed["names"].index("effort.masseter_left"))
    values = run["effort"].values[:, 2]
    for name, best in (("low", np.fmin), ("high", np.fmax)):
        rows = unpacked(packed["envelope"][name], "<f4").reshape(-1, len(edges) - 1)
        np.testing.assert_array_equal(rows[line], best.reduceat(values, starts).astype("f4"))
    at = unpacked(packed["envelope"]["highAt"], "<u2").reshape(rows.shape)[line] / 65535
    k = int(np.searchsorted(starts, 21_234, side="right")) - 1
    assert edges[k] + at[k] * (edges[k + 1] - edges[k]) == pytest.approx(18.234, abs=1e-5)
    text = Elements(page).text
    for said in ("9.75 N m", "18.234 s", "30\u202f000", "40 without a result", "7 to 7.039 s"):
        assert said in text
    # Spans without a result are listed and marked.
    [[start, end, words]] = payload(page)["failures"]
    assert (start, end) == pytest.approx((7.0, 7.039)) and words.startswith("unreachable: ")
    [found] = run.condyle.failures
    assert (found.first, found.count) == (10_000, 40)
    assert at_sample([found], 10_010) is found and at_sample([found], 10_040) is None
    planes = [panel for panel in payload(page)["panels"] if panel["kind"] == "plane"]
    texts = [line["text"] for plane in planes for line in plane["sets"][0]["lines"]]
    assert texts == [one.text for one in duty(run)], "of every sample"
    run.condyle.save(tmp_path / "long.nc")
    write_report(tmp_path / "long.nc", tmp_path / "pieces.html")
    assert (tmp_path / "pieces.html").read_text("utf-8") == page
    (tmp_path / "bad.nc").write_text("no NetCDF")
    for name, said in (("gone.nc", r"gone\.nc"), ("bad.nc", "not a NetCDF")):
        with pytest.raises(InputError, match=said):
            write_report(tmp_path / name, tmp_path / "x.html")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["bad.nc", "long.nc", "pieces.html"]


@pytest.mark.ci
def test_memory_does_not_grow_with_the_run(solution: xr.Dataset, tmp_path: Path) -> None:
    """Twice the samples, as much memory: of Python's and numpy's objects, at its largest."""
    peaks = []
    for count in (100_000, 200_000):
        repeated(solution, count).condyle.save(tmp_path / "long.nc")
        tracemalloc.start()
        with opened(tmp_path / "long.nc") as lazy:
            reduced(lazy)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < peaks[0] + 15e6, "time and status of every sample, and little more"
    assert peaks[1] < 150e6


# Machado, Oliveira & Fernandes 2009, severity 1, on linear RGB.
VISION = (
    np.eye(3),
    [[0.1523, 1.0526, -0.2049], [0.1145, 0.7863, 0.0992], [-0.0039, -0.0481, 1.0520]],
    [[0.3673, 0.8606, -0.2280], [0.2801, 0.6725, 0.0474], [-0.0118, 0.0429, 0.9689]],
    [[1.2555, -0.0767, -0.1788], [-0.0784, 0.9308, 0.1476], [0.0047, 0.6914, 0.3039]],
)


def linear(colour: str) -> np.ndarray:
    c = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) / 255
    return np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)


def lab(rgb: np.ndarray) -> np.ndarray:
    to_xyz = [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]
    x = to_xyz @ np.clip(rgb, 0, 1) / [0.9505, 1.0, 1.089]
    f = np.where(x > 0.008856, np.cbrt(x), 7.787 * x + 16 / 116)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


def test_colours_can_be_told_apart() -> None:
    """By all eyes, and from their ground (WCAG 2)."""
    for palette, ground in ((LIGHT, "#ffffff"), (DARK, "#171c22")):
        for vision in VISION:
            seen = [lab(np.array(vision) @ linear(colour)) for colour in palette]
            nearest = min(float(np.linalg.norm(a - b)) for a, b in itertools.combinations(seen, 2))
            assert nearest > 20  # CIELAB distance; 2.3 is just noticeable
        for colour in palette:
            bright = sorted(linear(c) @ [0.2126, 0.7152, 0.0722] + 0.05 for c in (colour, ground))
            assert bright[1] / bright[0] > 3


def test_what_gives_stands_among_the_facts(page: str, solution: xr.Dataset) -> None:
    assert "Lowest frequency" not in page and "Softest at home" not in page
    machine = condyle.load_mechanism("masticatory")
    soft = machine.set({f"chain.{n}.actuator.stiffness": 400.0 for n in machine.chain_names})
    said = report_html(solution.assign_attrs(mechanism=condyle.dumps(soft)))
    home, made = np.zeros(4), condyle.derive(soft, backend="numpy")
    assert f"{made.modes(home).frequency[0]:.4g} Hz" in said
    assert f"{made.stiffness(home).translation[0]:.3g} m/N" in said
    assert said.count("Softest at home") == 2
