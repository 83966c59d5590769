"""A session from its file to its results: against the parts called by hand, and known truth."""

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
import xarray as xr
from scipy.spatial.distance import pdist
from support.recorded_jaw import record
from support.recorded_session import write_session

import condyle
from condyle.analysis import session as room
from condyle.analysis.session.cycle_measures import cycle_rows
from condyle.analysis.session.mean_cycle import mean_solution
from condyle.errors import InputError, ProblemsError, WarningError
from condyle.markers import SessionFile, motion_from_c3d
from condyle.mechanism.scaling import named_points, scaled_to
from condyle.report.measured_session import MeasuredSession

LANDMARKS = ["incisor", "left_condyle", "right_condyle", "chin"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("session")
    write_session(folder, seconds=2.8, jaw={"noise": 2e-5})
    return folder


@pytest.fixture(scope="module")
def session(folder: Path) -> tuple[MeasuredSession, Any]:
    """Two trials: what is measured of them, and how they were solved."""
    solved, real = [], room.solve_session
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(room, "solve_session", lambda file: solved.append(real(file)) or solved[0])
        return condyle.measure_session(folder / "session.toml"), solved[0]


@pytest.fixture
def found(session: Any) -> MeasuredSession:
    return session[0]


def measured(folder: Path, trials: int = 1, seconds: float = 1.5, **tables: Any) -> MeasuredSession:
    return condyle.measure_session(write_session(folder, trials, seconds, **tables)[0])


def test_a_trial_is_what_its_parts_give(folder: Path, found: MeasuredSession) -> None:
    session, path = SessionFile.read(folder / "session.toml"), folder / "chewing1.c3d"
    alone = condyle.run(
        "masticatory",
        motion_from_c3d(path, session, "masticatory", cutoff=10.0).motion,
        backend="numpy",  # as of so few samples
    )
    mine = found.solutions["chewing1"]
    alone = alone.isel(time=slice(10, -10))  # of the base's filter, 5 Hz, half a period
    assert np.array_equal(mine["time"], alone["time"])
    np.testing.assert_allclose(mine["effort"], alone["effort"], rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(mine["contact_force"], alone["contact_force"], atol=1e-11)
    assert "marker_place" in mine and not found.files


def test_cycles_are_those_of_the_jaw(found: MeasuredSession) -> None:
    """It opens 1.5 times a second from 0.6 s on; the last minimum may lie at the end."""
    columns = ("contact_force", 0, "contact_left_condyle"), ("effort", 3, "tau_masseter_right")
    for name, solution in found.solutions.items():
        rows = [row for row in found.cycles if row["trial"] == name]
        assert len(rows) >= 2 and [row["cycle"] for row in rows] == [*range(1, len(rows) + 1)]
        for row in rows:
            turns = (row["start"] - 0.6) * 1.5
            late = 0.2 if row["cycle"] == 1 else 0.04  # it sets out slowly
            assert 0 < turns - round(turns) < late
            assert row["duration"] == pytest.approx(1 / 1.5, abs=0.75 * late)
            parts = [row[phase] for phase in ("opening", "closing", "occlusal")]
            assert sum(parts) == pytest.approx(row["duration"])
            assert row["range_beta"] == pytest.approx(0.12, rel=0.05)
            assert row["side"] == ("right" if name == "chewing1" else "left")
            fine = np.linspace(row["start"], row["start"] + row["duration"], 20_001)
            for variable, of, column in columns:
                assert str(solution[solution[variable].dims[1]].values[of]) in column
                size = np.abs(solution[variable].values[:, of])
                size = np.interp(fine, solution["time"].values, size)
                mean = row[f"impulse_{column}"] / row["duration"]
                assert mean == pytest.approx(size.mean(), rel=1e-4)
                assert row[f"peak_{column}"] == pytest.approx(size.max(), rel=1e-4)
            assert row["peak_load"] == 0 and row["samples_without_result"] == 0


def test_means_are_over_cycles(session: Any) -> None:
    """Of a trial, of all; and the mean cycle is a solution."""
    found, solved = session
    every, phase = [], np.linspace(0, 1, found.mean.sizes["phase"])
    for k, (name, solution) in enumerate(found.solutions.items()):
        rows = [row for row in found.cycles if row["trial"] == name]
        t, effort = solution["time"].values, solution["effort"].values[:, 2]
        cycles = [np.interp(r["start"] + phase * r["duration"], t, effort) for r in rows]
        mean, sd = found.mean["effort_mean"][k, :, 2], found.mean["effort_sd"][k, :, 2]
        np.testing.assert_allclose(mean, np.mean(cycles, axis=0), atol=1e-12)
        np.testing.assert_allclose(sd, np.std(cycles, axis=0, ddof=1), atol=1e-12)
        assert int(found.mean["cycles"][k]) == len(cycles)
        every += cycles
    of_all = found.mean.sel(group="chew", chain=found.mean["chain"][2])
    for kind, wanted in (("mean", np.mean(every, axis=0)), ("sd", np.std(every, axis=0, ddof=1))):
        np.testing.assert_allclose(of_all[f"effort_group_{kind}"], wanted, atol=1e-12)

    mean = mean_solution(solved.trials, "s", ["a warning"])
    assert mean is not None and mean.sizes["time"] == 101
    assert f"mean of {len(found.cycles)} cycles" in mean.attrs["options"]
    expected = found.mean.sel(group="chew")["contact_force_group_mean"]
    np.testing.assert_allclose(mean["contact_force"], expected, atol=1e-12)
    assert mean.condyle.warnings == ["a warning"] and not mean["status"].values.any()
    assert (np.diff(mean["effort_quantile"].values, axis=0) >= 0).all()


def test_tables_for_a_paper(found: MeasuredSession) -> None:
    for words in ("Recordings", "Cycles of each trial", "left_condyle: peak [N]", "right", "±"):
        assert words in str(found)
    column, table = "peak_contact_left_condyle", found.report_tables[3]
    peaks = [r[column] for r in found.cycles]
    first = [r[column] for r in found.cycles if r["trial"] == "chewing1"]
    trial, every = table.records[0], table.records[-1]
    assert trial[f"{column}_mean"] == pytest.approx(np.mean(first))
    assert trial[f"{column}_sd"] == pytest.approx(np.std(first, ddof=1))
    assert every["trial"] == "all" and every["cycles"] == len(peaks)
    assert every[f"{column}_sd"] == pytest.approx(np.std(peaks, ddof=1))
    assert table.markdown().startswith("**Cycles of each trial")


def test_samples_without_a_result_do_not_count(session: Any) -> None:
    """Neither for means nor for peaks of their cycle."""
    one = session[1].trials[0]
    solution = one.solution.copy(deep=True)
    start = one.cycles.spans[1, 0]
    time = solution["time"].values
    bad = (time > start + 0.05) & (time < start + 0.1)
    solution["status"].values[bad] = 1
    solution["effort"].values[bad] = np.nan
    rows = cycle_rows(solution, one.cycles, "beta")
    assert rows[1]["samples_without_result"] == bad.sum()
    assert rows[1]["peak_tau_masseter_left"] is None and rows[0]["peak_tau_masseter_left"] > 0
    spoiled = replace(one, solution=solution)
    assert (
        len(spoiled.complete_cycles) == len(one.complete_cycles) - 1
        and not (spoiled.complete_cycles[:, 0] == start).any()
    )


@pytest.mark.slow
def test_a_static_trial_and_another_subject(tmp_path: Path) -> None:
    """Landmarks of a larger jaw: the session finds that jaw, and its motion on its own contacts."""
    jaw = condyle.load_mechanism("human-jaw")
    A = np.diag([1.06, 0.95, 1.03])
    places = dict(zip(LANDMARKS, named_points(jaw, LANDMARKS) @ A, strict=True))
    subject = scaled_to(jaw, places, regularise=False).mechanism
    condyle.dump(subject, tmp_path / "subject.toml")
    found = measured(
        tmp_path,
        seconds=1.0,
        jaw={"mechanism": str(tmp_path / "subject.toml"), "points": LANDMARKS},
        mechanism="human-jaw",
        scale={"landmarks": LANDMARKS, "regularise": False},
        static={"file": "chewing1.c3d", "home": [0.0, 0.5]},
    )
    # {S} is where the landmarks fit best, so that a size tells and no coordinate.
    sizes = [
        pdist([end for chain in one.chains for end in (chain.base, chain.platform)])
        for one in (found.mechanism, subject)
    ]
    np.testing.assert_allclose(*sizes, atol=2e-7)
    assert found.mechanism.platform.mass == pytest.approx(0.2 * np.linalg.det(A), rel=1e-5)
    assert "Scaled to 4 landmarks (affine)" in str(found) and "greatest forces" in str(found)


@pytest.mark.slow
def test_the_command_writes_all_or_nothing(
    condyle_command: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, _ = write_session(Path(), 1, 2.5)
    outcome = condyle_command("session", "session.toml", "--out", "out")
    assert outcome.status == 0, outcome.err
    for words in ("Recordings", "chewing1", "Results: out/chewing1.nc", "Next: condyle view"):
        assert words in outcome.out
    tables = ("recordings", "registration", "markers", "trials", "measures", "efforts", "surfaces")
    names = {"chewing1.nc", "cycles.csv", "cycles.parquet", "mean.nc", "report.html"}
    names |= {f"{table}.{ending}" for table in tables for ending in ("md", "csv")}
    assert {p.name for p in Path("out").iterdir()} == names
    assert condyle.open_solution("out/chewing1.nc")["marker_place"].shape[1] == 8
    with xr.open_dataset("out/mean.nc", engine="h5netcdf") as mean:
        assert mean["contact_force_mean"].dims == ("trial", "phase", "contact")
    table = pq.read_table("out/cycles.parquet").to_pylist()
    assert table[0]["trial"] == "chewing1" and table[0]["side"] == "right"
    page = Path("out/report.html").read_text()
    assert "Cycles of each trial" in page and "mean of" in page and "Bands over cycles" in page

    def full(*_: Any) -> None:
        raise OSError

    monkeypatch.setattr("condyle.report.page.report_page.report_html", lambda *_, **__: "page")
    monkeypatch.setattr("condyle.results.report_table.ReportTable.write_csv", full)
    with pytest.raises(InputError, match="cannot be written"):
        condyle.measure_session(path, "other")
    assert not [*Path("other").iterdir()]
    assert condyle_command("session", "nothing.toml").status == 2


@pytest.mark.slow
def test_points_against_markers_between_trials(tmp_path: Path) -> None:
    """Numbers that were typed from the first trial are applied where the head stood elsewhere."""
    path, (_, second) = write_session(tmp_path, 2, 1.0, cycles={"by": "beta"})
    moved = condyle.measure_session(path).report_tables[0].records[1]["fixed_markers_moved"]
    assert moved == pytest.approx(0.0, abs=1e-7)
    second.points += [0.02, 0.0, 0.01]
    second.write(tmp_path / "chewing2.c3d")
    found = condyle.measure_session(path)
    off = found.report_tables[0].records[1]["fixed_markers_moved"]
    assert off == pytest.approx(np.hypot(0.02, 0.01), rel=1e-3)
    assert any("points and markers disagree with chewing1.c3d" in said for said in found.warnings)
    markers = {(r["trial"], r["marker"]): r for r in found.report_tables[2].records}
    assert len(markers) == 16 and markers["chewing1", "Upper_FL"]["after_rms"] is None
    assert markers["chewing2", "Lower_FL"]["after_rms"] > 1e-5


def test_efforts_that_follow_emg(tmp_path: Path) -> None:
    """Without cycles a trial is one."""
    rows = [f"{t!r},{abs(math.sin(t))!r}" for t in np.arange(0.0, 5.0, 0.005).tolist()]
    (tmp_path / "emg.csv").write_text("\n".join(["t,E1", *rows]))
    (tmp_path / "mvc.csv").write_text("t,E1\n" + "".join(f"{k / 200},5\n" for k in range(200)))
    muscle = condyle.load_mechanism("masticatory").chain_names[0]
    path, _ = write_session(
        *(tmp_path, 1, 1.0),
        solve={"distribution": "emg_assisted", "emg_weight": 1e6},
        trial=[{"file": "chewing1.c3d", "channels": "emg.csv"}],
        emg={"channels": {muscle: "E1"}, "mvc": "mvc.csv", "high_pass": 0.0},
    )
    found = condyle.measure_session(SessionFile.read(path).model_copy(update={"cycles": None}))
    solution = found.solutions["chewing1"]
    got, wanted = (solution[x].sel(chain=muscle) for x in ("activation", "emg_activation"))
    np.testing.assert_allclose(got, wanted, atol=1e-3)
    assert wanted.max() > 0.15 and solution.condyle.options["emg_weight"] == 1e6
    (row,) = found.cycles
    assert row["start"] == pytest.approx(0.1) and row["duration"] == pytest.approx(0.99 - 0.2)
    assert not [name for name in row if name.startswith("range_")]
    assert row[f"emg_lag_{muscle}"] == 0 and row[f"emg_rmse_{muscle}"] < 1e-3
    (record,) = next(one for one in found.report_tables if one.name == "emg").records
    assert record["chain"] == muscle and record["emg_r2_mean"] == pytest.approx(1.0, abs=1e-4)


def test_maximal_contractions_by_subject(tmp_path: Path) -> None:
    """The same EMG counts half where the subject's contraction was twice as large."""
    t = np.arange(0.0, 5.0, 0.005).tolist()
    (tmp_path / "emg.csv").write_text(
        "t,E1\n" + "".join(f"{x!r},{abs(math.sin(x))!r}\n" for x in t)
    )
    for name, size in (("anna", 4), ("ben", 8)):
        rows = "".join(f"{k / 200},{size}\n" for k in range(200))
        (tmp_path / f"{name}.csv").write_text("t,E1\n" + rows)
    muscle = condyle.load_mechanism("masticatory").chain_names[0]
    trials = [
        {"file": "chewing1.c3d", "channels": "emg.csv", "name": name, "subject": name}
        for name in ("anna", "ben")
    ]
    emg = {"channels": {muscle: "E1"}, "high_pass": 0.0}
    mvc: dict[str, Any] = {"anna": "anna.csv", "ben": ["ben.csv"]}
    found = measured(tmp_path, seconds=1.0, trial=trials, emg=emg | {"mvc": mvc})
    anna, ben = (found.solutions[n]["emg"].sel(chain=muscle) for n in mvc)
    np.testing.assert_allclose(anna, 2 * ben, rtol=1e-12)
    assert ben.max() > 0.05
    for wrong, text in (
        ({"anna": "anna.csv"}, "ben has none"),
        (mvc | {"carl": "c.csv"}, "carl is no subject of the trials; they have anna, ben"),
    ):
        with pytest.raises(ProblemsError, match=text):
            measured(tmp_path, seconds=1.0, trial=trials, emg=emg | {"mvc": wrong})
    jaw = record(seconds=1.0)
    with pytest.raises(InputError, match=r"by subject \(anna, ben\)"):
        motion_from_c3d(
            tmp_path / "chewing1.c3d", jaw.tables(emg=emg | {"mvc": mvc}), "masticatory"
        )


@pytest.mark.slow
def test_bands_of_a_study(tmp_path: Path) -> None:
    """Of cycles, means and tables: against each variant solved alone, beside the cycles' spread."""
    masses = (0.1, 0.2, 0.3)
    study = '[[vary]]\nwhat = "platform.mass"\nvalues = [0.1, 0.2, 0.3]\n'
    (tmp_path / "bands.toml").write_text(study)
    path, _ = write_session(tmp_path, 1, 2.5, solve={"vary": "bands.toml"})
    found = condyle.measure_session(path, tmp_path / "out")
    assert found.solutions["chewing1"]["effort_quantile"].sizes["quantile"] == 5
    machine, variants = condyle.load_mechanism("masticatory"), []
    for mass in masses:
        condyle.dump(machine.set("platform.mass", mass), tmp_path / f"{mass}.toml")
        write_session(tmp_path, 1, 2.5, mechanism=f"{mass}.toml")
        variants.append(condyle.measure_session(path))
    column, share = "peak_contact_left_condyle", (0.05, 0.95)
    for k, row in enumerate(found.cycles):
        alone = np.quantile([one.cycles[k][column] for one in variants], share)
        np.testing.assert_allclose([row[f"{column}_low"], row[f"{column}_high"]], alone, rtol=1e-9)
        assert alone[0] < row[column] < alone[1]
    trial, tables = found.report_tables[3].records[0], str(found)
    means = [one.report_tables[3].records[0][f"{column}_mean"] for one in variants]
    bands = [trial[f"{column}_{end}"] for end in ("low", "high")]
    np.testing.assert_allclose(bands, np.quantile(means, share), rtol=1e-9)
    assert f"[{bands[0]:.3g}, {bands[1]:.3g}]" in tables and "3 variants" in tables
    for name in ("effort", "contact_force"):
        for over in ("mean", "group_mean"):
            alone = [one.mean[f"{name}_{over}"].values[0] for one in variants]
            wanted = np.quantile(alone, found.mean["quantile"], axis=0)
            got = found.mean[f"{name}_{over}_quantile"][0]
            np.testing.assert_allclose(got, wanted, rtol=1e-9, atol=1e-9)
    page = (tmp_path / "out" / "report.html").read_text()
    assert "Bands over cycles" in page and "Bands over variants" in page


@pytest.mark.slow
def test_bands_of_registrations_and_objectives(tmp_path: Path) -> None:
    """Of cycles, means, measures and tables: against sessions of each set of points alone."""
    draws, objectives, error = 2, ("cubic", "bounded"), 1e-3
    t = np.arange(0.0, 2.3, 0.01)  # a channel's cycles are the same for every registration
    jaw = record(seconds=2.3, mechanism="human-jaw")
    opening = np.interp(t, jaw.t, jaw.pose[:, 4])
    rows = [f"{a!r},{b!r}" for a, b in zip(t.tolist(), opening.tolist(), strict=True)]
    (tmp_path / "gape.csv").write_text("\n".join(["t,G", *rows]))
    given: dict[str, Any] = {
        "jaw": {"mechanism": "human-jaw"},
        "mechanism": "human-jaw",
        "cycles": {"by": "G", "least": 0.01},
        "trial": [{"file": "chewing1.c3d", "channels": "gape.csv"}],
    }
    path, _ = write_session(
        *(tmp_path, 1, 2.3),
        **given,
        bands={"registrations": draws, "error": error, "seed": 4, "distributions": objectives},
    )
    found = condyle.measure_session(path, tmp_path / "out")
    offsets = np.random.default_rng(4).normal(0.0, error, (draws, len(jaw.register), 3))
    alone: dict[str, list[MeasuredSession]] = {name: [] for name in objectives}
    for moved in offsets:
        places = {
            name: (np.array(place) + 1e3 * offset).tolist()
            for (name, place), offset in zip(jaw.register.items(), moved, strict=True)
        }
        for name in objectives:
            one = {"register": places, "solve": {"distribution": name}}
            path, _ = write_session(tmp_path, 1, 2.3, **given, **one)
            alone[name].append(condyle.measure_session(path))
    variants, share = [one for of in alone.values() for one in of], (0.05, 0.95)
    first = found.solutions["chewing1"]
    assert json.loads(first.attrs["bands"])["variants"] == len(variants) == 4
    for name in ("effort", "contact_force"):
        each = [one.solutions["chewing1"][name].values for one in variants]
        wanted = np.quantile(each, first["quantile"], axis=0)
        np.testing.assert_allclose(first[f"{name}_quantile"], wanted, rtol=1e-9, atol=1e-9)
        each = [one.mean[f"{name}_mean"].values[0] for one in variants]
        wanted = np.quantile(each, first["quantile"], axis=0)
        got = found.mean[f"{name}_mean_quantile"][0]
        np.testing.assert_allclose(got, wanted, rtol=1e-9, atol=1e-9)
    column = "peak_contact_left_condyle"
    for k, row in enumerate(found.cycles):
        for name, of in ((column, variants), ("gape", alone["cubic"])):
            wanted = np.quantile([one.cycles[k][name] for one in of], share)
            got = [row[f"{name}_low"], row[f"{name}_high"]]
            np.testing.assert_allclose(got, wanted, rtol=1e-9)
            assert wanted[0] < wanted[1]
    records = {r["measure"]: r for r in found.report_tables[4].records}
    means = [one.report_tables[4].records[0]["mean"] for one in alone["cubic"]]
    got = [records["gape"]["low"], records["gape"]["high"]]
    np.testing.assert_allclose(got, np.quantile(means, share), rtol=1e-9)
    assert "2 registrations" in str(found) and "4 variants" in str(found)


def test_what_does_not_fit_is_said(tmp_path: Path) -> None:
    twisted = {"incisor": "I", "nose": [0, 0, 0], "chin": [0, 1, 0]}
    for change, text in (
        ({"cycles": {"by": "Beta"}}, 'by: "Beta" is no coordinate.* Did you mean "beta"'),
        ({"register": twisted}, 'trial "chewing1": '),
        ({"scale": {"landmarks": ["incisor"]}}, "bodies of its own"),
        ({"mechanism": "human-jow"}, "human-jow"),
        ({"solve": {"distribution": "least"}}, "least"),
    ):
        path, _ = write_session(tmp_path, 1, 1.0, **change)
        with pytest.raises(condyle.CondyleError, match=text):
            condyle.measure_session(path, tmp_path / "out")
    path, _ = write_session(tmp_path, 1, 1.0, trial=[{"file": "a.c3d"}, {"file": "b.c3d"}])
    with pytest.raises(ProblemsError) as caught:
        condyle.measure_session(path)
    assert len(caught.value.problems) == 2
    path, _ = write_session(tmp_path, 1, 1.0)
    with pytest.raises(WarningError, match="no cycles"):
        condyle.measure_session(path, tmp_path / "out", strict=True)
    assert not (tmp_path / "out").exists()


def test_other_signals(tmp_path: Path) -> None:
    for by in ("incisor.z", "Z"):
        found = measured(tmp_path, seconds=3.1, cycles={"by": by})
        assert [r["duration"] for r in found.cycles] == pytest.approx([1 / 1.5] * 3, abs=0.08)
        assert f"range_{by}" in found.cycles[0]
