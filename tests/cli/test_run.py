"""condyle run and compare: the reference case, its files and its output grids."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from oracles.random_mechanism import random_mechanism, toml_text

import condyle
from condyle.mechanism import bundled_text

REFERENCE = ("chewing-incisor.csv", "bite-force.csv")


def test_the_main_job(
    condyle_command: Callable[..., Any], read_csv: Callable[..., Any], tmp_path: Path
) -> None:
    """Without arguments: 5001 samples, a summary, and two files that say how they were made."""
    outcome = condyle_command("run")
    assert outcome.status == 0 and outcome.err == ""
    for text in ("5001 samples", "peak effort", "pterygoid_right", "closest to a singularity"):
        assert text in outcome.out
    assert "closest to the bounds: left_condyle" in outcome.out
    assert "results/masticatory.nc, results/masticatory.csv" in outcome.out
    solution = condyle.open_solution("results/masticatory.nc")
    assert solution.sizes["time"] == 5001 and solution.condyle.warnings == []
    assert solution["effort"].attrs["units"] == "N m"
    assert all("units" in variable.attrs for variable in solution.values())
    assert solution.attrs["condyle_version"] == condyle.__version__
    assert solution.condyle.mechanism == condyle.load_mechanism("masticatory")
    assert solution.condyle.options["load_point"] == "right_molar"
    assert (
        "synthetic" in solution.attrs["options"]
        or "chewing-incisor" in solution.condyle.options["motion"]
    )
    columns, rows = read_csv("results/masticatory.csv")
    table = dict(zip(columns, np.array(rows, dtype=float).T, strict=True))
    np.testing.assert_array_equal(table["t"], solution["time"])
    for name in solution["chain"].values:
        np.testing.assert_array_equal(table[f"tau_{name}"], solution["effort"].sel(chain=name))
    peak = np.abs(solution["effort"].sel(chain="masseter_left")).max().item()
    assert f"{peak:.5g} N m" in outcome.out
    assert {p.name for p in (tmp_path / "results").iterdir()} == {
        "masticatory.nc",
        "masticatory.csv",
    }


def test_summary_as_json_and_in_silence(condyle_command: Callable[..., Any]) -> None:
    data = json.loads(condyle_command("run", "--json", "--rate", 50).out)
    assert data["samples"] == 251 and data["failed_samples"] == 0
    assert set(data["peak_effort"]) == set(condyle.load_mechanism("masticatory").chain_names)
    assert data["samples_near_singularity"] == 0
    outcome = condyle_command("run", "--quiet", "--rate", 50, "--out", "there/below")
    assert (outcome.status, outcome.out, outcome.err) == (0, "", "")
    assert Path("there/below/masticatory.nc").exists()


def test_output_grids_do_not_change_the_motion(
    condyle_command: Callable[..., Any], tmp_path: Path
) -> None:
    """1 kHz and 200 Hz: the same accelerations and torques, to 1e-9, where they meet."""
    for rate in (1000, 200):
        assert condyle_command("run", "--rate", rate, "--out", f"at{rate}").status == 0
    fine, coarse = (condyle.open_solution(f"at{rate}/masticatory.nc") for rate in (1000, 200))
    assert (fine.sizes["time"], coarse.sizes["time"]) == (5001, 1001)
    np.testing.assert_allclose(fine["time"][::5], coarse["time"], rtol=0, atol=1e-15)
    for name in ("pose", "pose_rate", "pose_acceleration", "joint_acceleration", "effort"):
        got, wanted = fine[name].values[::5], coarse[name].values
        assert np.abs(got - wanted).max() < 1e-9 * max(1.0, np.abs(wanted).max())


def motion(kind: str, count: int = 41) -> tuple[list[str], np.ndarray]:
    """The same motion as coordinates, in other units, and as whole poses."""
    t = np.linspace(0, 1, count)
    q = np.column_stack([0.002 * np.sin(3 * t), 0.001 * t, 0.02 * np.cos(2 * t), -0.05 * t])
    if kind == "mm,deg":
        return ["t", "X", "Y", "alpha", "beta"], np.column_stack(
            [t, q * [1e3, 1e3, *[180 / np.pi] * 2]]
        )
    if kind == "other order":
        return ["beta", "t", "Y", "alpha", "X"], np.column_stack([q[:, 3], t, q[:, [1, 2, 0]]])
    if kind == "pose":
        model = condyle.derive(condyle.load_mechanism("masticatory"))
        pose = model.inverse_dynamics(q, 0 * q, 0 * q, outputs="all").pose
        return ["t", "X", "Y", "Z", "alpha", "beta", "gamma"], np.column_stack([t, pose])
    return ["t", "X", "Y", "alpha", "beta"], np.column_stack([t, q])


@pytest.mark.parametrize("kind", ["mm,deg", "other order", "pose"])
def test_a_motion_may_come_in_many_ways(
    condyle_command: Callable[..., Any], write_csv: Callable[..., Path], kind: str
) -> None:
    write_csv(*motion("plain"), "plain.csv")
    write_csv(*motion(kind), "other.csv")
    units = ("--units", "mm,deg") if kind == "mm,deg" else ()
    assert condyle_command("run", "--motion", "plain.csv", "--out", "plain").status == 0
    assert condyle_command("run", "--motion", "other.csv", "--out", "other", *units).status == 0
    plain, other = (condyle.open_solution(f"{n}/masticatory.nc") for n in ("plain", "other"))
    for name in ("pose", "pose_acceleration", "effort"):
        size = np.abs(plain[name]).max().item()
        np.testing.assert_allclose(other[name], plain[name], rtol=0, atol=1e-11 * size)


def test_poses_off_the_contacts_are_projected_and_told(
    condyle_command: Callable[..., Any], write_csv: Callable[..., Path]
) -> None:
    header, rows = motion("pose")
    rows[:, 3] += 2e-4  # Z depends, so it is recomputed
    write_csv(header, rows, "motion.csv")
    outcome = condyle_command("run", "--motion", "motion.csv")
    assert outcome.status == 0 and "up to 0.2 mm off the contact surfaces" in outcome.err
    solution = condyle.open_solution("results/masticatory.nc")
    np.testing.assert_allclose(solution["pose"].values[:, 2], rows[:, 3] - 2e-4, atol=1e-15)
    residual = solution.condyle.options["contact_residual_of_given_pose"]
    assert residual == pytest.approx(2e-4, rel=1e-9)


def test_a_run_that_leaves_its_bounds(
    condyle_command: Callable[..., Any], write_csv: Callable[..., Path]
) -> None:
    header, rows = motion("plain")
    rows[:, 2] = 0.004 * rows[:, 0]
    write_csv(header, rows, "motion.csv")
    outcome = condyle_command("run", "--motion", "motion.csv")
    assert outcome.status == 0 and 'contact "left_condyle" leaves its bounds at t = ' in outcome.err
    assert "OUTSIDE at t = 1 s" in outcome.out
    outcome = condyle_command("run", "--motion", "motion.csv", "--strict", "--out", "strict")
    assert outcome.status == 2 and "by up to" in outcome.err and not Path("strict").exists()


@pytest.mark.parametrize("reach", [0.02, 0.5])
def test_flagged_samples(
    condyle_command: Callable[..., Any],
    write_csv: Callable[..., Path],
    read_csv: Callable[..., Any],
    reach: float,
) -> None:
    """Some samples out of reach, or all: kept, empty, counted; without --flag an error."""
    header, rows = motion("plain")
    rows[:, 1] = reach * (1 + rows[:, 0]) / 2
    write_csv(header, rows, "motion.csv")
    outcome = condyle_command("run", "--motion", "motion.csv", "--out", "out")
    assert outcome.status == 2 and "cannot reach M" in outcome.err and not Path("out").exists()
    assert "more samples fail too" in outcome.err
    outcome = condyle_command("run", "--motion", "motion.csv", "--out", "out", "--flag")
    assert outcome.status == 0
    columns, cells = read_csv("out/masticatory.csv")
    failed = sum(row[-2] == "unreachable" for row in cells)
    assert columns[-2:] == ["status", "cause"] and (
        failed == 41 if reach == 0.5 else 0 < failed < 41
    )
    assert f"samples without a result: {failed}" in outcome.out
    assert all((row[1] == "") == (row[-2] != "ok") == (row[-1] != "") for row in cells)
    assert {row[-1] for row in cells} <= {"", "chain temporalis_left", "chain temporalis_right"}
    assert 'unreachable, chain "temporalis_' in outcome.out


@pytest.mark.slow
def test_contacts_of_any_number_have_a_run(
    condyle_command: Callable[..., Any],
    write_csv: Callable[..., Path],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
) -> None:
    monkeypatch.setenv("CONDYLE_BACKEND", "numpy")
    for contacts in (0, 1, 3, 5):
        raw = random_mechanism(np.random.default_rng(contacts), contacts=contacts)
        Path("jaw.toml").write_text(toml_text(raw))
        names = condyle.derive(condyle.load_mechanism("jaw.toml")).independent
        t = np.linspace(0, 1, 9)
        write_csv(["t", *names], np.column_stack([t] + [1e-4 * t] * len(names)), "motion.csv")
        assert condyle_command("check", "jaw.toml").status == 0
        arguments = ("jaw.toml", "--motion", "motion.csv", "--out", f"k{contacts}")
        assert condyle_command("run", *arguments).status == 0
        solution = condyle.open_solution(tmp_path / f"k{contacts}" / "random.nc")
        assert solution["contact_force"].shape == (9, contacts)


def test_samples_near_a_singularity_are_counted(
    condyle_command: Callable[..., Any], write_csv: Callable[..., Path]
) -> None:
    """A way along X to a nanometre before the temporal cranks are stretched."""
    model = condyle.derive(condyle.load_mechanism("masticatory"), backend="numpy")
    low, high = 0.0, 0.05
    while high - low > 1e-10:
        q = np.array([[(low + high) / 2, 0, 0, 0]])
        reached = model.inverse_dynamics(q, 0 * q, 0 * q).status[0] == 0
        low, high = (q[0, 0], high) if reached else (low, q[0, 0])
    header, rows = motion("plain")
    rows[:, 1:] = 0
    rows[:, 1] = (low - 1e-9) * np.sin(np.pi / 2 * rows[:, 0])
    write_csv(header, rows, "motion.csv")
    outcome = condyle_command("run", "--motion", "motion.csv")
    assert outcome.status == 0, outcome.err
    solution = condyle.open_solution("results/masticatory.nc")
    near = int((solution["singularity_ratio"] < 1e-3).sum())
    assert 0 < near < 10 and f"; {near} samples below 1e-3" in outcome.out
    assert re.search(f"{near} samples? (is|are) near a singularity", outcome.err)
    assert outcome.out.count("at t = 1 s; ") == 1


def test_results_are_written_all_or_none(
    condyle_command: Callable[..., Any], write_csv: Callable[..., Path]
) -> None:
    write_csv(*motion("plain"), "motion.csv")
    Path("results/masticatory.csv").mkdir(parents=True)
    outcome = condyle_command("run", "--motion", "motion.csv")
    assert outcome.status == 2 and "masticatory.csv: is a folder" in outcome.err
    assert [path.name for path in Path("results").iterdir()] == ["masticatory.csv"]


def test_names_never_leave_the_folder(
    condyle_command: Callable[..., Any], write_csv: Callable[..., Path], tmp_path: Path
) -> None:
    text = bundled_text("masticatory").replace('"masticatory"', '"../a b/é"')
    Path("jaw.toml").write_text(text, encoding="utf-8")
    write_csv(*motion("plain"), "motion.csv")
    assert condyle_command("run", "jaw.toml", "--motion", "motion.csv").status == 0
    assert all(".." not in path.parts for path in Path("results").iterdir())
    assert len(list(Path("results").iterdir())) == 2


def test_figures_for_a_journal_from_the_command(condyle_command: Callable[..., Any]) -> None:
    assert condyle_command("run", "--rate", 20, "--out", "o", "--quiet").status == 0
    what = ("plot", "o/masticatory.nc", "--figure", "load")
    outcome = condyle_command(*what, "--style", "journal", "--no-title", "--letters")
    assert outcome.status == 0, outcome.err
    svg = Path("figures/load.svg").read_text("utf-8")
    assert 'width="240.9' in svg, "85 mm"
    assert "stand-in" not in svg
    wrong = condyle_command(*what, "--style", "jurnal")
    assert wrong.status == 2 and "journal" in wrong.err


@pytest.mark.slow
def test_compare_in_short(condyle_command: Callable[..., Any]) -> None:
    options = ("--no-figures", "--report", "--rate", 20, "--out", "compared")
    outcome = condyle_command("compare", *options)
    assert outcome.status == 0 and outcome.err == ""
    for text in ("lagrange direct", "Table 1", "101 samples", "Table 2"):
        assert text in outcome.out
    assert {path.suffix for path in Path("compared").iterdir()} >= {".csv"}
    assert "Next: condyle view --solution compared/masticatory-compare.nc" in outcome.out
    assert Path("compared/masticatory.html").is_file()
    assert condyle_command("report", "compared/masticatory-compare.nc").status == 0
    page = Path("compared/masticatory-compare.html").read_text(encoding="utf-8")
    assert "Table 1. Computational time" in page and "Table 2. Mean norm" in page


def test_without_a_motion_any_mechanism_gets_one(condyle_command: Callable[..., Any]) -> None:
    outcome = condyle_command("run", "hexaglide", "--rate", "20")
    assert outcome.status == 0
    assert "no --motion" in outcome.err and "synthetic" in outcome.err
    assert Path("results/hexaglide.nc").is_file()
