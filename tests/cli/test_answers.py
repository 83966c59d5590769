"""What every command says: the next step, JSON, and silence."""

from __future__ import annotations

import json
import re
import shlex
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from support.machine_log import CYCLE, DRIVES, HELD, LIGHTER, SHORT_PATH, write_log, write_poses
from support.machine_log import STUDY as LOG_STUDY
from support.recorded_jaw import record
from support.recorded_session import write_session
from support.speeds import few, slow

import condyle
from benchmarks import Benchmark
from condyle.cli import commands  # noqa: F401 - registers them
from condyle.cli.answer import Answer, command_line, files_line
from condyle.cli.command import registered
from condyle.mechanism import bundled_text
from condyle.motion import bundled_reference

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "cli.md"
QUICK = ("--rate", "20")
# Every command but view, which serves until it is stopped; with names that need quotes.
CALLS: dict[str, tuple[str, ...]] = {
    "new": ("new", "my robot"),
    "new --list": ("new", "--list"),
    "check": ("check", "my jaw.toml"),
    "check --project": ("check", "off.toml", "--project"),
    "check of another": ("check", "gough-stewart"),
    "reference": ("reference", "--out", "a case"),
    "run": ("run", "my jaw.toml", *QUICK, "--out", "the results"),
    "run --report": ("run", *QUICK, "--report"),
    "solve": ("solve", "my jaw.toml", "--states", "states.csv", "--out", "torques.csv"),
    "simulate": ("simulate", "my jaw.toml", "--scenario", "a fall.toml", "--out", "fallen"),
    "simulate --check-gains": ("simulate", "my jaw.toml", "--scenario", "pd.toml", "--check-gains"),
    "forward": ("forward", "my jaw.toml", "--states", "efforts.csv", "--out", "found.csv"),
    "derivatives": (
        *("derivatives", "my jaw.toml", "--states", "states.csv", "--of", "pose"),
        *("--out", "my slopes.csv"),
    ),
    "pose": ("pose", "masticatory", "--joints", "joints.csv", "--out", "poses.csv"),
    "pose --flag": ("pose", "masticatory", "--joints", "far.csv", "--out", "poses.csv", "--flag"),
    "pose --all": ("pose", "masticatory", "--joints", "joints.csv", "--out", "modes.csv", "--all"),
    "map": (
        *("map", "my jaw.toml", "--over", "X=-1:4:4 mm", "--no-figures"),
        *("--quantity", "joint", "--out", "my maps"),
    ),
    "compare": ("compare", *QUICK, "--motion", "my path.csv", "--no-figures", "--out", "x y"),
    "identify": (
        *("identify", "my jaw.toml", "--log", "a log.csv", "--study", "fit.toml"),
        *("--out", "a fit.toml"),
    ),
    "literature": ("literature",),
    "cite": ("cite",),
    "video": ("video", "a run.nc", "--out", "a film.gif", "--fps", "1"),
    "design": ("design", "lighter.toml", "--out", "a design"),
    "optimise": ("optimise", "held.toml", "--out", "a held.csv"),
    "bite": ("bite", "my jaw.toml", "--out", "bites.csv"),
    "calibrate": (
        *("calibrate", "my jaw.toml", "--poses", "poses.csv", "--study", "calib.toml"),
        *("--out", "my geometry.toml"),
    ),
    "path": ("path", "my jaw.toml", "--study", "cycle.toml", "--out", "a cycle.csv"),
    "excite": ("excite", "my jaw.toml", "--study", "excite.toml", "--out", "my path.csv"),
    "motion from-c3d": (
        *("motion", "from-c3d", "a trial.c3d", "--markers", "markers.toml"),
        *("--mechanism", "my jaw.toml", "--out", "a motion.csv"),
    ),
    "session": ("session", "session.toml", "--out", "a session"),
    "export c": ("export", "c", "my jaw.toml", "--question", "motion", "--out", "for c"),
    "export controller": (
        *("export", "controller", "my jaw.toml", "--scenario", "drives.toml"),
        *("--out", "my controller"),
    ),
    "export ros2": (
        *("export", "ros2", "my jaw.toml", "--scenario", "drives.toml"),
        *("--out", "my package"),
    ),
    "export fmu": ("export", "fmu", "my jaw.toml", "--out", "units", "--kind", "inverse"),
    "export acados": ("export", "acados", "my jaw.toml", "--out", "for acados"),
    "export matlab": ("export", "matlab", "my jaw.toml", "--out", "for matlab"),
    "export mjcf": ("export", "mjcf", "my jaw.toml", "--out", "for mujoco"),
    "sweep": ("sweep", "my study.toml", "--out", "my rows", "--workers", "1"),
    "plot": ("plot",),
    "plot SOLUTION": ("plot", "a run.nc", "--figure", "load", "--out", "my figures"),
    "report": ("report", "a run.nc"),
    "cache": ("cache",),
    "cache --clear": ("cache", "--clear"),
    "schema": ("schema",),
}
FEW = "new", "check", "run", "solve", "pose", "simulate"
RESULTS = {
    "new --list",
    "literature",
    "cite",
    "simulate --check-gains",
    "check",
    "check of another",
    "check --project",
    "plot",
    "cache",
    "cache --clear",
}
STUDY = """
motion = { file = "trial", rate = 4 }
load = "none"
[[vary]]
what = "platform.mass"
values = [0.2, 0.3]
"""


@pytest.fixture(scope="module")
def solution() -> xr.Dataset:
    motion = condyle.Motion.from_csv(bundled_reference()[0], rate=20)
    model = condyle.derive(condyle.load_mechanism("masticatory"), backend="numpy")
    return model.solve(motion, condyle.reference_load())


@pytest.fixture
def command(
    condyle_command: Callable[..., Any],
    solution: xr.Dataset,
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
) -> Callable[..., Any]:
    """Runs commands where the files of `CALLS` are."""
    monkeypatch.setenv("CONDYLE_BACKEND", "numpy")
    monkeypatch.setenv("CONDYLE_CACHE", str(tmp_path / "kernels"))
    monkeypatch.setattr("condyle.export.fmu._built", lambda sources: b"")  # it takes seconds
    text = bundled_text("masticatory")
    Path("my jaw.toml").write_text(text)
    Path("my study.toml").write_text(STUDY)
    Path("off.toml").write_text(text.replace("offset = 13.215", "offset = 13.5", 1))
    Path("a fall.toml").write_text("duration = 0.004")
    drives = 'duration = 0.002\n[controller]\nkind = "joint_pd"\nstiffness = 5\ndamping = 0.03\n'
    Path("pd.toml").write_text(drives)
    Path("my path.csv").write_bytes(bundled_reference()[0].read_bytes())
    states = [prefix + name for prefix in ("", "d", "dd") for name in ("X", "Y", "alpha", "beta")]
    joints = [f"joint_{name}" for name in condyle.load_mechanism("masticatory").chain_names]
    efforts = [*states[:8], *(name.replace("joint_", "tau_") for name in joints)]
    tables = {
        "states": (states, 0),
        "efforts": (efforts, 0),
        "joints": (joints, 0),
        "far": (joints, 3),
    }
    for name, (columns, value) in tables.items():
        row = ",".join([str(value)] * len(columns))
        Path(f"{name}.csv").write_text(f"{','.join(columns)}\n{row}\n")
    jaw = record(noise=5e-5)
    jaw.write(Path("a trial.c3d"))
    jaw.write_tables(Path("markers.toml"))
    write_session(Path.cwd(), 1, 2.5)
    solution.condyle.save("a run.nc")
    write_log(Path("a log.csv"))
    Path("fit.toml").write_text(LOG_STUDY)
    write_poses(Path("poses.csv"))
    Path("calib.toml").write_text('numbers = ["chain.*.actuator.zero"]')
    Path("excite.toml").write_text(SHORT_PATH)
    Path("cycle.toml").write_text(CYCLE)
    Path("held.toml").write_text(HELD)
    Path("drives.toml").write_text(DRIVES)
    Path("lighter.toml").write_text(LIGHTER)
    return condyle_command


@pytest.mark.parametrize("name", few(CALLS, *FEW, rest=slow))
def test_the_next_step_works(
    command: Callable[..., Any], monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    """The last line is a command that works in the folder as it is now."""
    outcome = command(*CALLS[name])
    assert outcome.status == 0, outcome.err
    stream = outcome.err if name == "schema" else outcome.out
    *_, last = stream.rstrip("\n").split("\n")
    assert (outcome.out + outcome.err).count("Next: ") == 1
    program, *words = shlex.split(last.removeprefix("Next: "))
    if program == "make":  # of a folder of C
        assert words[:1] == ["-C"] and Path(words[1], "Makefile").is_file()
        return
    assert last.startswith("Next: ") and program == "condyle"
    if words[0] == "view":  # its file must be one that it could show
        words = ["report", words[2]] if words[1:2] == ["--solution"] else ["check", *words[1:]]
    if words[0] == "run":
        words += QUICK if "--rate" not in words else ()
    if "--figures" in words:  # all of them take long
        monkeypatch.setattr("condyle.report.figures.saving.save", lambda *_: [])
    again = command(*words)
    assert again.status == 0, (last, again.err)


def documented_keys() -> dict[str, set[str]]:
    """Keys of `--json` by command, from the page."""
    found = {}
    for line in PAGE.read_text(encoding="utf-8").splitlines():
        if row := re.fullmatch(r"\| `condyle ([^`]+)` \| (`.+`) \|", line):
            found[row[1]] = set(re.findall(r"`(\w+)`", row[2]))
    return found


@pytest.mark.parametrize("name", few(CALLS, *FEW, rest=slow))
def test_json_is_one_object_with_the_documented_keys(
    command: Callable[..., Any], name: str
) -> None:
    outcome = command(*CALLS[name], "--json")
    assert outcome.status == 0 and "Next" not in outcome.err
    data = json.loads(outcome.out, parse_constant=pytest.fail)
    if name != "schema":
        known = documented_keys()
        assert set(data) == known.get(name, known.get(CALLS[name][0]))
    assert all(Path(file).is_file() for file in data.get("files", ()))


def test_the_keys_of_bench_are_documented() -> None:
    assert documented_keys()["bench"] == {*Benchmark([], {}, {}, {}).data(), "files"}


@pytest.mark.parametrize("name", few(CALLS, *FEW, rest=slow))
def test_quiet_says_only_what_was_asked_for(command: Callable[..., Any], name: str) -> None:
    outcome = command(*CALLS[name], "--quiet")
    assert outcome.status == 0 and outcome.err == ""
    assert "Next" not in outcome.out
    assert bool(outcome.out) == (name in RESULTS or name == "schema")


def test_errors_are_said_in_silence_too(command: Callable[..., Any]) -> None:
    for switch in ("--quiet", "--json"):
        outcome = command("report", "a rnu.nc", switch)
        assert outcome.status == 2 and (outcome.out == "") == (switch == "--quiet")
        assert "a rnu.nc: no such file" in outcome.err and "Did you mean a run.nc" in outcome.err


def test_every_command_has_the_switches(condyle_command: Callable[..., Any]) -> None:
    for name, _ in registered():
        words = name.split()
        listed = condyle_command(*words, "--help").out
        assert "--quiet" in listed
        assert ("--json" in listed) == (name != "view")
        called = any(list(call[: len(words)]) == words for call in CALLS.values())
        assert called or name in ("bench", "view")


def test_an_answer_for_programs_has_no_nan(capsys: pytest.CaptureFixture[str]) -> None:
    data = {"a": [float("nan"), np.float64(2.5)], "b": {"c": Path("d"), "e": float("-inf")}}
    Answer("text", data, "condyle run").give(quiet=False, as_json=True)
    wanted = {"a": [None, 2.5], "b": {"c": "d", "e": None}}
    assert json.loads(capsys.readouterr().out, parse_constant=pytest.fail) == wanted


def test_lines_to_copy() -> None:
    line = command_line("run", "a b.toml", load_point="tip", rate=None, report=True, flag=False)
    assert line == "condyle run 'a b.toml' --load-point tip --report"
    many = [Path(f"out/{i}.png") for i in range(9)]
    assert files_line(many[:4]) == "Results: out/0.png, out/1.png, out/2.png, out/3.png"
    assert files_line(many) == "Results: out/0.png, out/1.png, out/2.png and 6 more in out"
