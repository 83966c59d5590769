"""condyle run: the reference case, its files, its output grids, and motions of many kinds."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.machines import model
from support.speeds import first

import condyle
from condyle.mechanism import bundled_text

from .conftest import read_csv, write_csv

RUN = ("run", "--motion", "motion.csv")
NAMES = ["X", "Y", "alpha", "beta"]
T = np.linspace(0, 1, 41)
Q = np.column_stack([0.002 * np.sin(3 * T), 0.001 * T, 0.02 * np.cos(2 * T), -0.05 * T])


def motion(q: Any = Q, names: Any = NAMES) -> None:
    write_csv("motion.csv", ["t", *names], np.column_stack([T[: len(q)], q]))


def opened(folder: str = "results") -> Any:
    return condyle.open_solution(f"{folder}/masticatory.nc")


@pytest.mark.slow
def test_the_main_job(run: Any, tmp_path: Path) -> None:
    """Without arguments: 5001 samples, a summary, and two files that say how they were made.

    At 200 Hz: the same accelerations and torques, to 1e-9, where the grids meet.
    """
    outcome = run("run")
    assert outcome.status == 0 and outcome.err == ""
    for text in (
        *("5001 samples", "peak effort", "pterygoid_right", "closest to a singularity"),
        "closest to the bounds: left_condyle",
        "results/masticatory.nc, results/masticatory.csv",
    ):
        assert text in outcome.out
    solution, machine = opened(), condyle.load_mechanism("masticatory")
    assert solution.sizes["time"] == 5001 and solution.condyle.warnings == []
    assert solution["effort"].attrs["units"] == "N m"
    assert all("units" in variable.attrs for variable in solution.values())
    assert solution.attrs["condyle_version"] == condyle.__version__
    assert solution.condyle.mechanism == machine
    assert solution.condyle.options["load_point"] == "right_molar"
    assert "chewing-incisor" in solution.condyle.options["motion"]
    columns, rows = read_csv("results/masticatory.csv")
    table = dict(zip(columns, np.array(rows, dtype=float).T, strict=True))
    np.testing.assert_array_equal(table["t"], solution["time"])
    for name in machine.chain_names:
        np.testing.assert_array_equal(table[f"tau_{name}"], solution["effort"].sel(chain=name))
    peak = np.abs(solution["effort"].sel(chain="masseter_left")).max().item()
    assert f"{peak:.5g} N m" in outcome.out
    assert {*outcome.data["peak_effort"]} == {*machine.chain_names}
    assert outcome.data["samples_near_singularity"] == 0
    files = {p.name for p in (tmp_path / "results").iterdir()}
    assert files == {"masticatory.nc", "masticatory.csv"}

    assert run("run", "--rate", 200, "--out", "there/below").status == 0
    coarse = opened("there/below")
    np.testing.assert_allclose(solution["time"][::5], coarse["time"], rtol=0, atol=1e-15)
    for name in ("pose", "pose_rate", "pose_acceleration", "joint_acceleration", "effort"):
        got, wanted = solution[name].values[::5], coarse[name].values
        assert np.abs(got - wanted).max() < 1e-9 * max(1.0, np.abs(wanted).max())


def test_a_motion_may_come_in_other_units_and_as_whole_poses(run: Any) -> None:
    """The same numbers to rounding; what lies off the contacts is projected, and said."""
    motion()
    assert run(*RUN, "--out", "plain").status == 0
    plain, whole = opened("plain"), ["X", "Y", "Z", "alpha", "beta", "gamma"]
    pose = model("masticatory").inverse_kinematics(Q).pose + 2e-4 * np.eye(6)[2]  # Z depends
    motion(pose * [*[1e3] * 3, *[180 / np.pi] * 3], whole)
    outcome = run(*RUN, "--units", "mm,deg")
    assert outcome.status == 0 and "up to 0.2 mm off the contact surfaces" in outcome.err
    other = opened()
    for name in ("pose", "pose_acceleration", "effort"):
        size = np.abs(plain[name]).max().item()
        np.testing.assert_allclose(other[name], plain[name], rtol=0, atol=1e-11 * size)
    residual = other.condyle.options["contact_residual_of_given_pose"]
    assert residual == pytest.approx(2e-4, rel=1e-9)


def test_a_run_that_leaves_its_bounds(run: Any, refused: Any) -> None:
    motion(Q * [1, 0, 1, 1] + np.outer(0.004 * T, [0, 1, 0, 0]))
    refused(*RUN, "--strict", said="by up to")
    outcome = run(*RUN)
    assert outcome.status == 0 and 'contact "left_condyle" leaves its bounds at t = ' in outcome.err
    assert "OUTSIDE at t = 1 s" in outcome.out


@pytest.mark.parametrize("reach", first([0.02, 0.5]))
def test_flagged_samples(run: Any, refused: Any, reach: float) -> None:
    """Some samples out of reach, or all: kept, empty, counted; without --flag an error."""
    motion(Q * [0, 1, 1, 1] + np.outer(reach * (1 + T) / 2, [1, 0, 0, 0]))
    assert "more samples fail too" in refused(*RUN, said="cannot reach M")
    outcome = run(*RUN, "--flag")
    assert outcome.status == 0
    columns, cells = read_csv("results/masticatory.csv")
    failed = sum(row[-2] == "unreachable" for row in cells)
    assert columns[-2:] == ["status", "cause"]
    assert failed == 41 if reach == 0.5 else 0 < failed < 41
    assert f"samples without a result: {failed}" in outcome.out
    assert all((row[1] == "") == (row[-2] != "ok") == (row[-1] != "") for row in cells)
    assert {row[-1] for row in cells} <= {"", "chain temporalis_left", "chain temporalis_right"}
    assert 'unreachable, chain "temporalis_' in outcome.out


def test_samples_near_a_singularity_are_counted(run: Any) -> None:
    """A way along X to a nanometre before the temporal cranks are stretched."""
    low, high = 0.0, 0.05
    while high - low > 1e-10:
        q = np.array([[(low + high) / 2, 0, 0, 0]])
        reached = model("masticatory").inverse_dynamics(q, 0 * q, 0 * q).status[0] == 0
        low, high = (q[0, 0], high) if reached else (low, q[0, 0])
    motion(np.outer((low - 1e-9) * np.sin(np.pi / 2 * T), [1, 0, 0, 0]))
    outcome = run(*RUN)
    assert outcome.status == 0, outcome.err
    near = int((opened()["singularity_ratio"] < 1e-3).sum())
    assert 0 < near < 10 and f"; {near} samples below 1e-3" in outcome.out
    assert re.search(f"{near} samples? (is|are) near a singularity", outcome.err)
    assert outcome.out.count("at t = 1 s; ") == 1


def test_results_are_written_all_or_none_and_in_their_folder(run: Any, refused: Any) -> None:
    motion()
    Path("results/masticatory.csv").mkdir(parents=True)
    refused(*RUN, said="masticatory.csv: is a folder")
    text = bundled_text("masticatory").replace('"masticatory"', '"../a b/é"')
    Path("jaw.toml").write_text(text, encoding="utf-8")
    assert run(*RUN, "jaw.toml", "--out", "b/c").status == 0
    assert len([*Path("b/c").iterdir()]) == 2 and [p.name for p in Path("b").iterdir()] == ["c"]


@pytest.mark.ci
def test_figures_for_a_journal_from_the_command(run: Any, refused: Any) -> None:
    motion()
    assert run(*RUN).status == 0
    what = ("plot", "results/masticatory.nc", "--figure", "effort")
    outcome = run(*what, "--style", "journal", "--no-title", "--letters")
    assert outcome.status == 0, outcome.err
    svg = Path("figures/effort.svg").read_text("utf-8")
    assert 'width="240.9' in svg and "stand-in" not in svg, "85 mm"
    assert b"/MediaBox [ 0 0 240.9" in Path("figures/effort.pdf").read_bytes()
    refused(*what, "--style", "jurnal", said="journal")
    refused(*what, "--figure", "marker", said="no figure marker: no markers were measured")
