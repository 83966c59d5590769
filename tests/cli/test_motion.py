"""condyle motion from-c3d: files in, files out, and what is said."""

import shlex
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.recorded_jaw import FIXED, PLATFORM, Jaw, record

from condyle.motion import read_table
from condyle.results.solution import open_solution

CALL = ("motion", "from-c3d", "a.c3d", "--markers", "m.toml", "--mechanism", "masticatory")
CALL += ("--out", "o.csv")


def jaw(gap: slice | None = None, **options: Any) -> Jaw:
    """One that was recorded, with two fixed markers lost for a while."""
    found = record(**options)
    for name in FIXED[:2] if gap else ():
        found.at(name)[gap] = np.nan
    return found


@pytest.fixture
def call(run: Any) -> Any:
    """Runs the command on a jaw, in the folder of its files."""

    def call(jaw: Jaw, *options: object, **written: Any) -> Any:
        jaw.write(Path("a.c3d"), **written)
        jaw.write_tables(Path("m.toml"))
        outcome = run(*CALL, *options)
        assert outcome.status == 0, outcome.err
        return outcome

    return call


def test_the_motion_is_written_and_its_quality_said(call: Any) -> None:
    one = jaw(slice(200, 205))
    one.at("Lower_FL")[50] = np.nan
    outcome = call(one, "--measured", "p.csv")
    assert outcome.err == ""
    for text in (
        "a.c3d: 400 frames at 100 Hz from 0 to 3.99 s, lengths in mm",
        "Motion: 400 poses from 0 to 3.99 s, 5 of them filled in",
        "Registration, distance of each point from its place in the mechanism: incisor",
        "Contacts, distance of the measured poses: left_condyle ",
        "Gaps: 1",
        "2 to 2.04 s (5 frames, filled): 2 of 4 fixed markers seen, not Upper_FL, Upper_BL",
        *("Results: o.csv", "Next: condyle run masticatory --motion o.csv --smooth auto"),
        *("seen 100 % of the time", "mm RMS", *(f"  {name}  " for name in (*FIXED, *PLATFORM))),
    ):
        assert text in outcome.out
    data = outcome.data
    assert data["frames"] == data["poses"] == 400 and data["unit"] == "mm"
    assert [r["name"] for r in data["residuals"]] == [*FIXED, *PLATFORM]
    assert {*data["residuals"][0]} == {"name", "body", "seen", "rms", "largest", "time"}
    assert {*data["gaps"][0]} == {"start", "end", "frames", "reason", "made"}
    assert data["off_contacts"]["left_condyle"]["largest"] < 1e-3
    assert data["files"] == ["o.csv", "p.csv"]

    table = read_table("o.csv", known=("t", "X", "Y", "Z", "alpha", "beta", "gamma"))
    pose = table.require(["X", "Y", "Z", "alpha", "beta", "gamma"])
    np.testing.assert_allclose(pose, one.pose, atol=1e-4)
    np.testing.assert_allclose(table.columns["t"], one.t, atol=1e-12)

    head, *rows = (line.split(",") for line in Path("p.csv").read_text().splitlines())
    parts = [(n, body) for body, names in (("fixed", FIXED), ("platform", PLATFORM)) for n in names]
    kinds = ("x", "y", "z", "residual_{}")
    assert head == ["t", *(f"{n}_{kind.format(body)}" for n, body in parts for kind in kinds)]
    place = dict(zip(head, rows[50], strict=True))
    assert place["Lower_FL_x"] == "" and len(rows) == 400
    assert float(place["Upper_FL_x"]) == pytest.approx(0.08, abs=1e-6)


def test_a_load_from_channels(call: Any) -> None:
    one = jaw(head=0.0)
    size = -80 * np.sin(one.t)
    options = {
        "channels": [(n, "N") for n in ("F1", "F2", "F3")],
        "analog": (size[:, None] * one.A[:, 2])[:, None],
    }
    outcome = call(one, "--force", "F1,F2, F3", "--load", "l.csv", **options)
    assert "--motion o.csv --load l.csv" in outcome.out
    force = read_table("l.csv", known=("t", "Fx", "Fy", "Fz")).require(["Fx", "Fy", "Fz"])
    np.testing.assert_allclose(force, np.outer(size, [0, 0, 1]), atol=1e-3)


@pytest.mark.slow
def test_measured_channels_reach_the_report(run: Any) -> None:
    one = jaw(head=0.0, seconds=2.0)
    emg = np.repeat(np.abs(np.sin(9 * one.t)), 5).reshape(-1, 5, 1)
    force = np.repeat((-20 * one.A[:, 2])[None], 5 * len(one.t), 0).reshape(-1, 5, 3)
    channels = [("F1", "N"), ("F2", "N"), ("F3", "N"), ("E", "V")]
    one.write(Path("a.c3d"), channels=channels, analog=np.concatenate([force, emg], axis=2))
    chain = "superficial_masseter_left"
    tables = {
        "forces": {"channels": ["F1", "F2", "F3"], "point": "incisor"},
        "emg": {"channels": {chain: "E"}, "high_pass": 0.0},
    }
    one.write_tables(Path("m.toml"), **tables)
    human = [word.replace("masticatory", "human-jaw") for word in CALL]
    forgotten = run(*human)
    assert forgotten.status == 0 and forgotten.err.count("warning") == 3
    assert "--load no file for it" in forgotten.err and "--measured no file" in forgotten.err
    outcome = run(*human, "--measured", "p.csv", "--load", "l.csv")
    assert outcome.status == 0 and outcome.err.count("warning") == 1
    assert "far from their places in the mechanism: left_condyle" in outcome.err
    assert "Load: force up to 20 N at incisor" in outcome.out
    assert f"EMG, largest of each: {chain} 1 at " in outcome.out
    told = "--load l.csv --load-point incisor --smooth auto --measured p.csv --report"
    assert f"Next: condyle run human-jaw --motion o.csv {told}" in outcome.out
    words = "run human-jaw --motion o.csv --load l.csv --load-point incisor --rate 20 --measured"
    assert run(*words.split(), "p.csv").status == 0
    solution = open_solution("results/human-jaw.nc")
    assert solution["marker_place"].shape == (len(solution["time"]), 8, 3)
    assert np.isfinite(solution["emg"].sel(chain=chain)).all()
    wrong = run(*words.split(), "l.csv")
    assert wrong.status == 2 and 'columns "Fx", "Fy", "Fz" are neither of a marker' in wrong.err
    assert run("report", "results/human-jaw.nc", "--measured", "p.csv").status == 0
    assert "marker-residual" in Path("results/human-jaw.html").read_text()


def test_what_was_assumed_is_a_warning_and_the_longest_stretch(call: Any) -> None:
    outcome = call(jaw(slice(150, 200)), "--longest", units=None)
    assert outcome.err.count("\n") == 1
    assert outcome.err.startswith("condyle: warning: a.c3d: does not say its unit of length")
    assert Path("o.csv").read_text().splitlines()[1].startswith("2,")
    assert call(record(), "--units", "mm", units=None).err == ""


def test_bad_input_writes_nothing(call: Any, refused: Any) -> None:
    one = jaw(slice(200, 210))
    one.write(Path("a.c3d"))
    one.write_tables(Path("m.toml"))
    for options, said in (
        ("--max-gap 0.05", "no pose for longer than 0.05 s: 2 to 2.09 s (2 of 4 fixed"),
        ("--units inch", "--units: expected m, cm, mm, um, got 'inch'"),
        ("--force F1,F2,F3", "--force requires --load"),
        ("--load l.csv", "load: no channels were named for it"),
        ("--force F1 --load l.csv", "got 1 channels, expected three"),
        ("--force F1,F1,F2 --load l.csv", "expected the labels of three channels"),
        ("--force F1,,F2 --load l.csv", "expected the labels of three channels"),
        ("--measured o.csv", "two files to write have one name"),
        ("--measured no/p.csv", "the folder"),
        ("--max-residual nan", "--max-residual"),
        ("--max-residual 0", "no pose for longer than 0.1 s: 0 to 3.99 s"),
        ("--max-gap -1", "--max-gap"),
        ("--mechanism mastcatory", "Did you mean"),
        ("--markers n.toml", "n.toml: no such file"),
    ):
        refused(*CALL, *shlex.split(options), said=said)
