"""A session from its file to its results: against the parts called by hand, and known truth."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
import xarray as xr
from scipy.spatial.distance import pdist
from support.recorded_session import CYCLES, write_session

import condyle
from condyle.analysis.session import solve_session
from condyle.analysis.session.cycle_measures import cycle_rows
from condyle.analysis.session.mean_cycle import mean_solution
from condyle.errors import InputError, ProblemsError, WarningError
from condyle.markers import motion_from_c3d, read_session
from condyle.mechanism.scaling import named_points, scaled_to
from condyle.report.measured_session import MeasuredSession

LANDMARKS = ["incisor", "left_condyle", "right_condyle", "chin"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("session")


@pytest.fixture(scope="module")
def found(folder: Path) -> MeasuredSession:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("CONDYLE_BACKEND", "numpy")
        return condyle.measure_session(write_session(folder, jaw={"noise": 2e-5})[0])


def test_a_trial_is_what_its_parts_give(folder: Path, found: MeasuredSession) -> None:
    session = read_session(folder / "session.toml")
    path = folder / "chewing1.c3d"
    motion = motion_from_c3d(path, session, "masticatory", cutoff=10.0)
    alone = condyle.run("masticatory", motion.motion)
    mine = found.solutions["chewing1"]
    np.testing.assert_allclose(mine["effort"], alone["effort"], rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(mine["contact_force"], alone["contact_force"], atol=1e-11)
    assert "marker_place" in mine and not found.files


def test_cycles_are_those_of_the_jaw(found: MeasuredSession) -> None:
    """It opens 1.5 times a second from 0.6 s on; the last minimum may lie at the end."""
    for name, solution in found.solutions.items():
        rows = [row for row in found.cycles if row["trial"] == name]
        assert len(rows) >= 3 and [row["cycle"] for row in rows] == [*range(1, len(rows) + 1)]
        for row in rows:
            turns = (row["start"] - 0.6) * 1.5
            assert abs(turns - round(turns)) < 0.02
            assert row["duration"] == pytest.approx(1 / 1.5, abs=0.015)
            assert row["range_beta"] == pytest.approx(0.12, rel=0.05)
            assert row["side"] == ("right" if name == "chewing1" else "left")
            fine = np.linspace(row["start"], row["start"] + row["duration"], 20_001)
            for variable, of, column in (
                ("contact_force", 0, "contact_left_condyle"),
                ("effort", 3, "tau_masseter_right"),
            ):
                assert str(solution[solution[variable].dims[1]].values[of]) in column
                size = np.abs(solution[variable].values[:, of])
                size = np.interp(fine, solution["time"].values, size)
                mean = row[f"impulse_{column}"] / row["duration"]
                assert mean == pytest.approx(size.mean(), rel=1e-4)
                assert row[f"peak_{column}"] == pytest.approx(size.max(), rel=1e-4)
            assert row["peak_load"] == 0 and row["samples_without_result"] == 0


def test_means_are_over_cycles(found: MeasuredSession) -> None:
    every = []
    for k, (name, solution) in enumerate(found.solutions.items()):
        rows = [row for row in found.cycles if row["trial"] == name]
        t, effort = solution["time"].values, solution["effort"].values[:, 2]
        phase = np.linspace(0, 1, found.mean.sizes["phase"])
        cycles = [np.interp(r["start"] + phase * r["duration"], t, effort) for r in rows]
        mean, sd = found.mean["effort_mean"][k, :, 2], found.mean["effort_sd"][k, :, 2]
        np.testing.assert_allclose(mean, np.mean(cycles, axis=0), atol=1e-12)
        np.testing.assert_allclose(sd, np.std(cycles, axis=0, ddof=1), atol=1e-12)
        assert int(found.mean["cycles"][k]) == len(cycles)
        every += cycles
    of_all = found.mean.sel(subject="all", chain=found.mean["chain"][2])
    np.testing.assert_allclose(of_all["effort_subject_mean"], np.mean(every, axis=0), atol=1e-12)
    np.testing.assert_allclose(
        of_all["effort_subject_sd"], np.std(every, axis=0, ddof=1), atol=1e-12
    )


def test_tables_for_a_paper(found: MeasuredSession) -> None:
    text = str(found)
    for words in ("Recordings", "Cycles of each trial", "left_condyle: peak [N]", "right", "±"):
        assert words in text
    trial = found.tables[2].records[0]
    peaks = [r["peak_contact_left_condyle"] for r in found.cycles if r["trial"] == "chewing1"]
    assert trial["peak_contact_left_condyle_mean"] == pytest.approx(np.mean(peaks))
    assert trial["peak_contact_left_condyle_sd"] == pytest.approx(np.std(peaks, ddof=1))
    every = found.tables[2].records[-1]
    peaks = [r["peak_contact_left_condyle"] for r in found.cycles]
    assert every["trial"] == "all" and every["cycles"] == len(peaks)
    assert every["peak_contact_left_condyle_sd"] == pytest.approx(np.std(peaks, ddof=1))
    assert found.tables[2].markdown().startswith("**Cycles of each trial")


def test_samples_without_a_result_do_not_count(tmp_path: Path) -> None:
    """Neither for means nor for peaks of their cycle."""
    path, _ = write_session(tmp_path, 1)
    solved = solve_session(read_session(path))
    one = solved.trials[0]
    solution = one.solution.copy(deep=True)
    start = one.found.spans[1, 0]
    bad = (solution["time"].values > start + 0.05) & (solution["time"].values < start + 0.1)
    solution["status"].values[bad] = 1
    solution["effort"].values[bad] = np.nan
    rows = cycle_rows(solution, one.found, "beta")
    assert (
        rows[1]["samples_without_result"] == bad.sum() and rows[1]["peak_tau_masseter_left"] is None
    )
    assert rows[0]["peak_tau_masseter_left"] > 0
    spoiled = replace(one, solution=solution)
    assert len(spoiled.whole) == len(one.whole) - 1
    assert not (spoiled.whole[:, 0] == start).any()


@pytest.mark.slow
def test_a_static_trial_and_another_subject(tmp_path: Path) -> None:
    """Landmarks of a larger jaw: the session finds that jaw, and its motion on its own contacts."""
    jaw = condyle.load_mechanism("human-jaw")
    A = np.diag([1.06, 0.95, 1.03])
    places = dict(zip(LANDMARKS, named_points(jaw, LANDMARKS) @ A, strict=True))
    subject = scaled_to(jaw, places).mechanism
    condyle.dump(subject, tmp_path / "subject.toml")
    path, _ = write_session(
        tmp_path,
        1,
        2.0,
        {"mechanism": str(tmp_path / "subject.toml"), "points": LANDMARKS},
        mechanism="human-jaw",
        scale={"landmarks": LANDMARKS},
        static={"file": "chewing1.c3d", "home": [0.0, 0.5]},
    )
    found = condyle.measure_session(path, tmp_path / "out")
    # {S} is where the landmarks fit best, so that a size tells and no coordinate.
    sizes = [
        pdist([end for chain in one.chains for end in (chain.base, chain.platform)])
        for one in (found.mechanism, subject)
    ]
    np.testing.assert_allclose(*sizes, atol=2e-7)
    assert found.mechanism.platform.mass == pytest.approx(0.2 * np.linalg.det(A), rel=1e-5)
    assert "Scaled to 4 landmarks (affine)" in str(found) and "greatest forces" in str(found)
    assert "human-jaw-scaled.toml" in {file.name for file in found.files}
    assert condyle.load_mechanism(tmp_path / "out/human-jaw-scaled.toml") == found.mechanism


@pytest.mark.slow
def test_results_are_written_whole_or_not_at_all(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, _ = write_session(tmp_path, 1, 2.5)
    found = condyle.measure_session(path, tmp_path / "out")
    names = {"chewing1.nc", "cycles.csv", "cycles.parquet", "mean.nc", "report.html"}
    names |= {
        f"{t}.{e}" for t in ("recordings", "markers", "trials", "efforts") for e in ("md", "csv")
    }
    assert {p.name for p in (tmp_path / "out").iterdir()} == names == {p.name for p in found.files}
    opened = condyle.open_solution(tmp_path / "out" / "chewing1.nc")
    assert opened["marker_place"].shape[1] == 8
    with xr.open_dataset(tmp_path / "out" / "mean.nc", engine="h5netcdf") as mean:
        assert mean["contact_force_mean"].dims == ("trial", "phase", "contact")
    table = pq.read_table(tmp_path / "out" / "cycles.parquet").to_pylist()
    assert [r["start"] for r in table] == [r["start"] for r in found.cycles]
    assert table[0]["trial"] == "chewing1" and table[0]["side"] == "right"
    page = (tmp_path / "out" / "report.html").read_text()
    assert "Cycles of each trial" in page and "mean of" in page and "Bands over cycles" in page
    monkeypatch.setattr(
        "condyle.report.tables.report_table.Table.write_csv",
        lambda *_: (_ for _ in ()).throw(OSError),
    )
    with pytest.raises(InputError, match="cannot be written"):
        condyle.measure_session(path, tmp_path / "other")
    assert not [*(tmp_path / "other").iterdir()]


def test_without_cycles_a_trial_is_one(tmp_path: Path) -> None:
    path, _ = write_session(tmp_path, 1, 2.0)
    session = read_session(path).model_copy(update={"cycles": None})
    found = condyle.measure_session(session)
    (row,) = found.cycles
    assert row["start"] == 0 and row["duration"] == pytest.approx(1.99)
    assert not [name for name in row if name.startswith("range_")]


def test_points_against_markers_between_trials(tmp_path: Path) -> None:
    """Numbers that were typed from the first trial are applied where the head stood elsewhere."""
    path, (_, second) = write_session(tmp_path, 2, 1.5, cycles={"by": "beta"})
    assert [one["fixed_markers_moved"] for one in condyle.measure_session(path).tables[0].records][
        1
    ] == pytest.approx(0.0, abs=1e-7)
    second.points += [0.02, 0.0, 0.01]
    second.write(tmp_path / "chewing2.c3d")
    found = condyle.measure_session(path)
    off = found.tables[0].records[1]["fixed_markers_moved"]
    assert off == pytest.approx(np.hypot(0.02, 0.01), rel=1e-3)
    assert any("points and markers disagree with chewing1.c3d" in said for said in found.warnings)
    markers = {(r["trial"], r["marker"]): r for r in found.tables[1].records}
    assert len(markers) == 16 and markers["chewing1", "Upper_FL"]["after_rms"] is None
    assert markers["chewing2", "Lower_FL"]["after_rms"] > 1e-5


def test_efforts_that_follow_emg(tmp_path: Path) -> None:
    t = np.arange(0.0, 5.0, 0.005)
    rows = [f"{at!r},{abs(math.sin(at))!r}" for at in t.tolist()]
    (tmp_path / "emg.csv").write_text("\n".join(["t,E1", *rows]))
    muscle = condyle.load_mechanism("masticatory").chain_names[0]
    path, _ = write_session(
        tmp_path, 1, 1.5,
        solve={"distribution": "emg_assisted", "emg_weight": 1e6},
        trial=[{"file": "chewing1.c3d", "channels": "emg.csv"}],
        emg={"channels": {muscle: "E1"}, "greatest": {muscle: 5.0}, "high_pass": 0.0},
    )  # fmt: skip
    solution = condyle.measure_session(path).solutions["chewing1"]
    found, wanted = (solution[x].sel(chain=muscle) for x in ("activation", "emg_activation"))
    np.testing.assert_allclose(found, wanted, atol=1e-3)
    assert wanted.max() > 0.15 and solution.condyle.options["emg_weight"] == 1e6


@pytest.mark.slow
def test_bands_of_a_study(tmp_path: Path) -> None:
    (tmp_path / "bands.toml").write_text(
        '[[vary]]\nwhat = "platform.mass"\nvalues = [0.1, 0.2, 0.3]\n'
    )
    path, _ = write_session(tmp_path, 1, 1.5, solve={"vary": "bands.toml"}, cycles=CYCLES)
    solution = condyle.measure_session(path).solutions["chewing1"]
    assert solution["effort_quantile"].sizes["quantile"] == 5


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"cycles": {"by": "Beta"}}, 'by: "Beta" is no coordinate.* Did you mean "beta"'),
        (
            {"register": {"incisor": "I", "nose": [0, 0, 0], "chin": [0, 1, 0]}},
            'trial "chewing1": ',
        ),
        ({"scale": {"landmarks": ["incisor"]}}, "bodies of its own"),
        ({"mechanism": "human-jow"}, "human-jow"),
        ({"solve": {"distribution": "least"}}, "least"),
    ],
)
def test_what_does_not_fit_is_said(tmp_path: Path, change: dict[str, Any], text: str) -> None:
    path, _ = write_session(tmp_path, 1, 1.0, **change)
    with pytest.raises(condyle.CondyleError, match=text):
        condyle.measure_session(path, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_missing_recordings_are_all_named(tmp_path: Path) -> None:
    path, _ = write_session(tmp_path, 1, 1.0, trial=[{"file": "a.c3d"}, {"file": "b.c3d"}])
    with pytest.raises(ProblemsError) as caught:
        condyle.measure_session(path)
    assert len(caught.value.problems) == 2


@pytest.mark.parametrize("by", ["incisor.z", "alpha", "Z"])
def test_other_signals(tmp_path: Path, by: str) -> None:
    path, _ = write_session(tmp_path, 1, 3.0, cycles={"by": by})
    found = condyle.measure_session(path)
    assert [r["duration"] for r in found.cycles] == pytest.approx([1 / 1.5] * 2, abs=0.03)
    assert f"range_{by}" in found.cycles[0]


def test_warnings_are_errors_where_strict(tmp_path: Path) -> None:
    path, _ = write_session(tmp_path, 1, 1.0)
    with pytest.raises(WarningError, match="no cycles"):
        condyle.measure_session(path, tmp_path / "out", strict=True)
    assert not (tmp_path / "out").exists()


def test_the_mean_cycle_is_a_solution(folder: Path, found: MeasuredSession) -> None:
    solved = solve_session(read_session(folder / "session.toml"))
    mean = mean_solution(solved.trials, "s", ["a warning"])
    assert mean is not None
    count = len(found.cycles)
    assert mean.sizes["time"] == 101 and f"mean of {count} cycles" in mean.attrs["options"]
    expected = found.mean.sel(subject="all")["contact_force_subject_mean"]
    np.testing.assert_allclose(mean["contact_force"], expected, atol=1e-12)
    assert mean.condyle.warnings == ["a warning"] and not mean["status"].values.any()
    assert (np.diff(mean["effort_quantile"].values, axis=0) >= 0).all()


@pytest.mark.slow
def test_the_command(condyle_command: Callable[..., Any]) -> None:
    write_session(Path("."), 1, 2.0)
    outcome = condyle_command("session", "session.toml", "--out", "results")
    assert outcome.status == 0, outcome.err
    for words in ("Recordings", "chewing1", "Results: results/chewing1.nc", "Next: condyle view"):
        assert words in outcome.out
    assert condyle_command("session", "nothing.toml").status == 2
