"""What every command says: the next step, JSON, and silence."""

import json
import re
import shlex
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.machine_log import CYCLE, DRIVES, HELD, LIGHTER, SHORT_PATH, write_log, write_poses
from support.machine_log import STUDY as LOG_STUDY
from support.machines import model
from support.recorded_jaw import record
from support.recorded_session import write_session
from support.speeds import few, slow

import condyle
from benchmarks import Benchmark
from condyle.analysis import literature
from condyle.cli import commands  # noqa: F401 - registers them
from condyle.cli.answer import Answer, command_line, files_line
from condyle.cli.command import registered
from condyle.mechanism import bundled_text
from condyle.motion import bundled_reference

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "cli.md"
# Every command but view, which serves until it is stopped; JAW is a name that needs quotes.
CALLS = {
    name: shlex.split((words or name).replace("JAW", "'my jaw.toml'"))
    for name, _, words in (line.partition(" | ") for line in """\
new | new 'my robot'
new --list
check | check JAW
check --project | check off.toml --project
check --picture | check JAW --picture 'at home.svg'
check of another | check gough-stewart
check STUDY | check 'my study.toml'
reference | reference --out 'a case'
run | run JAW --rate 20 --out 'the results'
run --report | run --rate 20 --report
solve | solve JAW --states states.csv --out torques.csv
simulate | simulate JAW --scenario 'a fall.toml' --out fallen
simulate --check-gains | simulate JAW --scenario pd.toml --check-gains
forward | forward JAW --states efforts.csv --out found.csv
derivatives | derivatives JAW --states states.csv --of pose --out 'my slopes.csv'
modes | modes 'a soft jaw.toml' --at right_molar --mode 2 --motion 'a b.csv' --picture 'a b.png'
modes --states | modes 'a soft jaw.toml' --states still.csv --out 'my modes.csv'
pose | pose masticatory --joints joints.csv --out poses.csv
pose --flag | pose masticatory --joints far.csv --out poses.csv --flag
pose --all | pose masticatory --joints joints.csv --out modes.csv --all
map | map JAW --over 'X=-1:4:4 mm' --no-figures --quantity joint --out 'my maps'
compare | compare --rate 20 --motion 'my path.csv' --no-figures --report --out 'x y'
identify | identify JAW --log 'a log.csv' --study fit.toml --out 'a fit.toml'
literature
cite
video | video 'a run.nc' --out 'a film.gif' --fps 1
design | design lighter.toml --out 'a design'
optimise | optimise held.toml --out 'a held.csv'
bite | bite JAW --out bites.csv
calibrate | calibrate JAW --poses poses.csv --study calib.toml --out 'my geometry.toml'
path | path JAW --study cycle.toml --out 'a cycle.csv'
excite | excite JAW --study excite.toml --out 'my path.csv'
motion from-c3d | motion from-c3d 'a trial.c3d' --markers markers.toml --mechanism JAW --out m.csv
session | session session.toml --out 'a session'
export c | export c JAW --question motion --out 'for c'
export controller | export controller JAW --scenario drives.toml --out 'my controller'
export ros2 | export ros2 JAW --scenario drives.toml --out 'my package'
export fmu | export fmu JAW --out units --kind inverse
export acados | export acados JAW --out 'for acados'
export matlab | export matlab JAW --out 'for matlab'
export mjcf | export mjcf JAW --out 'for mujoco'
sweep | sweep 'my study.toml' --out 'my rows' --workers 1
plot
plot SOLUTION | plot 'a run.nc' --figure load --out 'my figures'
report | report 'a run.nc'
cache
cache --clear
schema""".splitlines())
}  # fmt: skip
FEW = "check", "solve"
# Dear ones, whose rooms test them too.
DEAR = {
    *("session", "check of another", "simulate --check-gains", "literature", "plot", "design"),
    *("plot SOLUTION", "optimise"),
    *(f"export {kind}" for kind in ("matlab", "acados", "ros2", "controller", "fmu")),
}
# --quiet leaves their answer, which was asked for itself.
RESULTS = {
    *("new --list", "literature", "cite", "simulate --check-gains", "plot", "cache"),
    *(
        "modes",
        "cache --clear",
        "check",
        "check of another",
        "check --project",
        "check STUDY",
        "schema",
    ),
}
# They leave no next step.
LAST = {
    *("literature", "cite", "bite", "schema", "cache", "cache --clear", "map"),
    *(f"export {kind}" for kind in ("fmu", "acados", "matlab", "mjcf")),
}
STUDY = """
motion = { file = "trial", rate = 4 }
load = "none"
vary = [{ what = "platform.mass", values = [0.2, 0.3] }]
"""
PD = 'duration = 0.002\n[controller]\nkind = "joint_pd"\nstiffness = 5\ndamping = 0.03\n'


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the files of `CALLS`."""
    folder, jaw = tmp_path_factory.mktemp("files"), bundled_text("masticatory")
    texts = {
        "my jaw": jaw,
        "off": jaw.replace("offset = 13.215", "offset = 13.5", 1),
        "my study": STUDY,
        "a fall": "duration = 0.004",
        "a soft jaw": jaw.replace("actuator = {", "actuator = { stiffness = 400.0,"),
    } | dict(
        fit=LOG_STUDY, calib='numbers = ["chain.*.actuator.zero"]', excite=SHORT_PATH, cycle=CYCLE,
        held=HELD, drives=DRIVES, lighter=LIGHTER, pd=PD,
    )  # fmt: skip
    for name, text in texts.items():
        (folder / f"{name}.toml").write_text(text)
    shutil.copy(bundled_reference()[0], folder / "my path.csv")
    states = [prefix + name for prefix in ("", "d", "dd") for name in ("X", "Y", "alpha", "beta")]
    joints = [f"joint_{name}" for name in condyle.load_mechanism("masticatory").chain_names]
    efforts = [*states[:8], *(name.replace("joint_", "tau_") for name in joints)]
    tables = {"states": states, "efforts": efforts, "joints": joints, "far": joints}
    tables |= {"still": states[:4]}
    for name, columns in tables.items():
        row = ",".join([str(3 * (name == "far"))] * len(columns))
        (folder / f"{name}.csv").write_text(f"{','.join(columns)}\n{row}\n")
    recorded = record(noise=5e-5)
    recorded.write(folder / "a trial.c3d")
    recorded.write_tables(folder / "markers.toml")
    write_session(folder, 1, 2.5)
    write_log(folder / "a log.csv")
    write_poses(folder / "poses.csv")
    motion = condyle.Motion.from_csv(bundled_reference()[0], rate=20)
    model("masticatory").solve(motion, condyle.reference_load()).condyle.save(folder / "a run.nc")
    return folder


@pytest.fixture
def command(run: Any, files: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Any:
    """Runs commands where the files of `CALLS` are."""
    monkeypatch.setenv("CONDYLE_CACHE", str(tmp_path / "kernels"))
    monkeypatch.setattr("condyle.export.fmu._built", lambda sources: b"")  # it takes seconds
    # All models, and all published numbers, are in tests/analysis.
    monkeypatch.setattr("condyle.analysis.comparison.FORMULATIONS", ["momentum"])
    monkeypatch.setattr(literature, "ROWS", [r for r in literature.ROWS if "nclin" in r.what])
    shutil.copytree(files, Path.cwd(), dirs_exist_ok=True)
    return run


def documented_keys() -> dict[str, set[str]]:
    """Keys of `--json` by command, from the page."""
    rows = re.findall(r"^\| `condyle ([^`]+)` \| (`.+`) \|$", PAGE.read_text("utf-8"), re.MULTILINE)
    return {name: set(re.findall(r"`(\w+)`", keys)) for name, keys in rows}


@pytest.mark.parametrize(
    "name", [*few([c for c in CALLS if c not in DEAR], *FEW, rest=slow), *few(sorted(DEAR))]
)
def test_an_answer(
    command: Any, name: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """To people, to programs, and hardly anything: of one run.

    The last line is a command that works in the folder as it is now, or none; JSON has the
    documented keys.
    """
    outcome = command(*CALLS[name])
    assert outcome.status == 0, outcome.err
    *_, last = outcome.out.rstrip("\n").split("\n")
    assert (outcome.out + outcome.err).count("Next: ") == (name not in LAST)
    assert last.startswith("Next: ") == (name not in LAST)
    outcome.answer.give(quiet=True, as_json=False)
    quiet = capsys.readouterr()
    assert bool(quiet.out) == (name in RESULTS) and "Next" not in quiet.out + quiet.err
    outcome.answer.give(quiet=False, as_json=True)
    said = capsys.readouterr()
    data = json.loads(said.out, parse_constant=pytest.fail)
    if name != "schema":
        known = documented_keys()
        assert set(data) == known.get(name, known.get(CALLS[name][0])) and not said.err
    assert all(Path(file).is_file() for file in data.get("files", ()))
    for text in ("momentum direct", "Table 1", "101 samples", "Table 2"):
        assert name != "compare" or (text in outcome.out and Path("x y/masticatory.html").is_file())

    if name in LAST:
        return
    program, *words = shlex.split(last.removeprefix("Next: "))
    if program == "make":  # of a folder of C
        assert words[:1] == ["-C"] and Path(words[1], "Makefile").is_file()
        return
    assert program == "condyle"
    if words[0] == "view":  # its file must be one that it could show
        solved = words[1:2] == ["--solution"]
        words = ["report" if solved else "check", *words[1 + solved :]]
    words += ["--rate", "20"] * (words[0] == "run" and "--rate" not in words)
    if name != "compare":  # figures and pages take long
        page = lambda _, path, **files: path.write_text("") or path  # noqa: E731
        monkeypatch.setattr("condyle.report.page.write_report", page)
        monkeypatch.setattr("condyle.report.figures.saving.save", lambda *_: [])
    if name not in FEW and words == ["check", "my jaw.toml"]:  # as after others
        return
    again = command(*words)
    assert again.status == 0, (last, again.err)
    page = Path("x y/masticatory-compare.html")
    assert name != "compare" or "Table 1. Computational time" in page.read_text("utf-8")


def test_switches(command: Any) -> None:
    """They reach the answer; neither leaves anything on stderr."""
    for name in ("new --list", "check", "solve", "reference"):
        as_json, quiet = (command(*CALLS[name], switch) for switch in ("--json", "--quiet"))
        assert (as_json.status, as_json.err, quiet.status, quiet.err) == (0, "", 0, "")
        assert json.loads(as_json.out) == as_json.data and "Next" not in quiet.out
        assert bool(quiet.out) == (name in RESULTS)


def test_errors_are_said_in_silence_too(command: Any) -> None:
    for switch in ("--quiet", "--json"):
        outcome = command("report", "a rnu.nc", switch)
        assert outcome.status == 2 and (outcome.out == "") == (switch == "--quiet")
        assert "a rnu.nc: no such file" in outcome.err and "Did you mean a run.nc" in outcome.err


def test_every_command_has_the_switches() -> None:
    for name, made in registered():
        words = name.split()
        options = {option for one in made.params for option in one.opts}
        assert {"--quiet", "--strict"} <= options and ("--json" in options) == (name != "view")
        called = any(call[: len(words)] == words for call in CALLS.values())
        assert called or name in ("bench", "view")
    assert documented_keys()["bench"] == {*Benchmark([], {}, {}, {}).data(), "files"}


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
