"""condyle motion from-c3d: files in, files out, and what is said."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.recorded_jaw import FIXED, PLATFORM, Jaw, record

from condyle.motion import read_table
from condyle.results.solution import open_solution

CALL = ("motion", "from-c3d", "a.c3d", "--markers", "m.toml", "--mechanism", "masticatory")


@pytest.fixture
def call(condyle_command: Callable[..., Any]) -> Callable[..., Any]:
    """Runs the command on a jaw, in the folder of its files."""

    def run(jaw: Jaw, *options: object, **written: Any) -> Any:
        jaw.write(Path("a.c3d"), **written)
        jaw.write_tables(Path("m.toml"))
        return condyle_command(*CALL, *options)

    return run


def test_the_motion_is_written_and_its_quality_said(call: Callable[..., Any]) -> None:
    jaw = record()
    for name in FIXED[:2]:
        jaw.at(name)[200:205] = np.nan
    outcome = call(jaw, "--out", "o.csv")
    assert outcome.status == 0 and outcome.err == ""
    for text in (
        "a.c3d: 400 frames at 100 Hz from 0 to 3.99 s, lengths in mm",
        "Motion: 400 poses from 0 to 3.99 s, 5 of them filled in",
        "Registration, distance of each point from its place in the mechanism: incisor",
        "Contacts, distance of the measured poses: left_condyle ",
        "Gaps: 1",
        "2 to 2.04 s (5 frames, filled): 2 of 4 fixed markers seen, not Upper_FL, Upper_BL",
        "Results: o.csv",
        "Next: condyle run masticatory --motion o.csv --smooth auto",
    ):
        assert text in outcome.out
    for name in (*FIXED, *PLATFORM):
        assert f"  {name}  " in outcome.out
    assert "seen 100 % of the time" in outcome.out and "mm RMS" in outcome.out
    table = read_table("o.csv", known=("t", "X", "Y", "Z", "alpha", "beta", "gamma"))
    pose = table.require(["X", "Y", "Z", "alpha", "beta", "gamma"])
    np.testing.assert_allclose(pose, jaw.pose, atol=1e-4)
    np.testing.assert_allclose(table.columns["t"], jaw.t, atol=1e-12)


def test_markers_beside_the_mechanism(call: Callable[..., Any]) -> None:
    jaw = record()
    jaw.at("Lower_FL")[50] = np.nan
    assert call(jaw, "--out", "o.csv", "--measured", "p.csv").status == 0
    head, *rows = Path("p.csv").read_text().splitlines()
    bodies = {"fixed": FIXED, "platform": PLATFORM}
    names = [
        f"{name}_{column}"
        for body, markers in bodies.items()
        for name in markers
        for column in ("x", "y", "z", f"residual_{body}")
    ]
    assert head.split(",") == ["t", *names] and len(rows) == 400
    place = dict(zip(head.split(","), rows[50].split(","), strict=True))
    assert place["Lower_FL_x"] == "" and float(place["Upper_FL_x"]) == pytest.approx(0.08, abs=1e-6)


def test_a_load_from_channels(call: Callable[..., Any]) -> None:
    jaw = record(head=0.0)
    down = -80 * np.sin(jaw.t)[:, None] * jaw.A[:, 2]
    options = {"channels": [(n, "N") for n in ("F1", "F2", "F3")], "analog": down[:, None]}
    given = ("--out", "o.csv", "--force", "F1,F2, F3", "--load", "l.csv")
    outcome = call(jaw, *given, **options)
    assert outcome.status == 0 and "--motion o.csv --load l.csv" in outcome.out
    force = read_table("l.csv", known=("t", "Fx", "Fy", "Fz")).require(["Fx", "Fy", "Fz"])
    want = np.column_stack([0 * jaw.t, 0 * jaw.t, -80 * np.sin(jaw.t)])
    np.testing.assert_allclose(force, want, atol=1e-3)


def test_measured_channels_reach_the_report(
    call: Callable[..., Any], condyle_command: Callable[..., Any]
) -> None:
    jaw = record(head=0.0, seconds=2.0)
    emg = np.repeat(np.abs(np.sin(9 * jaw.t)), 5).reshape(-1, 5, 1)
    force = np.repeat((-20 * jaw.A[:, 2])[None], 5 * len(jaw.t), 0).reshape(-1, 5, 3)
    options = {
        "channels": [(n, u) for n, u in (("F1", "N"), ("F2", "N"), ("F3", "N"), ("E", "V"))],
        "analog": np.concatenate([force, emg], axis=2),
    }
    jaw.write(Path("a.c3d"), **options)
    chain = "superficial_masseter_left"
    tables = {
        "forces": {"channels": ["F1", "F2", "F3"], "point": "incisor"},
        "emg": {"channels": {chain: "E"}, "high_pass": 0.0},
    }
    jaw.write_tables(Path("m.toml"), **tables)
    human = [*CALL[:-1], "human-jaw", "--out", "o.csv"]
    forgotten = condyle_command(*human)
    assert forgotten.status == 0 and forgotten.err.count("warning") == 2
    assert "--load no file for it" in forgotten.err and "--measured no file" in forgotten.err
    outcome = condyle_command(*human, "--measured", "p.csv", "--load", "l.csv")
    assert outcome.status == 0 and outcome.err == ""
    assert "Load: force up to 20 N at incisor" in outcome.out
    assert f"EMG, largest of each: {chain} 1 at " in outcome.out
    told = "--load l.csv --load-point incisor --smooth auto --measured p.csv --report"
    assert f"Next: condyle run human-jaw --motion o.csv {told}" in outcome.out
    run = ("run", "human-jaw", "--motion", "o.csv", "--load", "l.csv", "--backend", "numpy")
    ran = condyle_command(*run, "--load-point", "incisor", "--rate", "20", "--measured", "p.csv")
    assert ran.status == 0
    solution = open_solution("results/human-jaw.nc")
    assert solution["marker_place"].shape == (len(solution["time"]), 8, 3)
    assert np.isfinite(solution["emg"].sel(chain=chain)).all()
    wrong = condyle_command(*run, "--measured", "l.csv")
    assert wrong.status == 2 and 'columns "Fx", "Fy", "Fz" are neither of a marker' in wrong.err
    page = condyle_command("report", "results/human-jaw.nc", "--measured", "p.csv")
    assert page.status == 0 and "marker-residual" in Path("results/human-jaw.html").read_text()


def test_as_data(call: Callable[..., Any]) -> None:
    jaw = record()
    jaw.at("Upper_FL")[100] += 0.02
    data = json.loads(call(jaw, "--out", "o.csv", "--json", first_frame=1).out)
    assert data["frames"] == data["poses"] == 400 and data["unit"] == "mm"
    assert [r["name"] for r in data["residuals"]] == [*FIXED, *PLATFORM]
    assert set(data["residuals"][0]) == {"name", "body", "seen", "rms", "largest", "time"}
    assert set(data["gaps"][0]) == {"start", "end", "frames", "reason", "made"}
    assert data["off_contacts"]["left_condyle"]["largest"] < 1e-3
    assert data["files"] == ["o.csv"]


def test_what_was_assumed_is_a_warning(call: Callable[..., Any]) -> None:
    outcome = call(record(), "--out", "o.csv", units=None)
    assert outcome.status == 0 and outcome.err.count("\n") == 1
    assert outcome.err.startswith("condyle: warning: a.c3d: does not say its unit of length")
    assert call(record(), "--out", "o.csv", "--units", "mm", units=None).err == ""


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--max-gap", "0.05"), "no pose for longer than 0.05 s: 2 to 2.09 s (2 of 4 fixed"),
        (("--units", "inch"), "unit: expected m, cm, mm, um, got 'inch'"),
        (("--force", "F1,F2,F3"), "--force requires --load"),
        (("--load", "l.csv"), "load: no channels were named for it"),
        (("--force", "F1", "--load", "l.csv"), "got 1 channels, expected three"),
        (("--force", "F1,F1,F2", "--load", "l.csv"), "expected the labels of three channels"),
        (("--force", "F1,,F2", "--load", "l.csv"), "expected the labels of three channels"),
        (("--measured", "o.csv"), "two files to write have one name"),
        (("--measured", "no/p.csv"), "the folder"),
        (("--max-residual", "nan"), "--max-residual"),
        (("--max-residual", "0"), "no pose for longer than 0.1 s: 0 to 3.99 s"),
        (("--max-gap", "-1"), "--max-gap"),
        (("--mechanism", "mastcatory"), "Did you mean"),
        (("--markers", "n.toml"), "n.toml: no such file"),
    ],
)
def test_bad_input_writes_nothing(
    call: Callable[..., Any], options: tuple[str, ...], said: str
) -> None:
    jaw = record()
    for name in FIXED[:2]:
        jaw.at(name)[200:210] = np.nan
    outcome = call(jaw, "--out", "o.csv", *options)
    assert outcome.status == 2 and said in outcome.err and outcome.out == ""
    assert sorted(path.name for path in Path().iterdir()) == ["a.c3d", "m.toml"]


def test_the_longest_stretch(call: Callable[..., Any]) -> None:
    jaw = record()
    for name in FIXED[:2]:
        jaw.at(name)[150:200] = np.nan
    assert call(jaw, "--out", "o.csv", "--longest").status == 0
    assert Path("o.csv").read_text().splitlines()[1].startswith("2,")


ODD = [
    "",
    "nan",
    "inf",
    "-1",
    "1e400",
    "9" * 400,
    "x" * 5000,
    ".",
    "\udcff",
    "--",
    "[]",
    "\n",
    "\0",
]


@pytest.mark.parametrize("word", ODD)
def test_odd_words_anywhere(
    call: Callable[..., Any], condyle_command: Callable[..., Any], word: str
) -> None:
    """A message and status 2, or a word that is fine: never a traceback."""
    good = call(record(seconds=0.8), "--out", "o.csv")
    assert good.status == 0
    names = ("--max-gap", "--max-residual", "--units", "--measured", "--markers", "--out")
    calls = [(*CALL, "--out", "o.csv", name, word) for name in (*names, "--mechanism")]
    calls.append((*CALL, "--out", "o.csv", "--force", word, "--load", "l.csv"))
    calls.append((*CALL, "--out", "o.csv", "--force", "a,b,c", "--load", word))
    calls += [("motion", word), ("motion", "from-c3d", word, *CALL[3:], "--out", "o.csv")]
    for arguments in calls:
        outcome = condyle_command(*arguments)
        assert outcome.status in (0, 2), (arguments, outcome)
        assert bool(outcome.status) == (outcome.err != "") and "Traceback" not in outcome.err
