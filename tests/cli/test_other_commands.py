"""The small commands: check, schema, new, reference, what help says; `--strict` of any."""

import json
import re
from pathlib import Path
from typing import Any

import pytest

import condyle
from condyle.analysis.studies import studies
from condyle.markers import SessionFile
from condyle.mechanism import bundled_text
from condyle.motion import bundled_reference

JAW = bundled_text("masticatory")


def test_check_describes_a_mechanism(run: Any) -> None:
    outcome = run("check", "masticatory")
    assert outcome.status == 0 and outcome.err == ""
    for text in (
        *("6 chains, 2 contacts, 4 degrees of freedom", "dependent coordinates:   Z, gamma"),
        *("X, Y, alpha, beta", "left_condyle", "on its surface at home", "9.81 m/s^2 along -Z"),
        *("platform:                0.2 kg, radii of gyration", "crank 20 mm"),
        *("limits 3 N m, 6 rad/s", "singularity at home", "rank 4 of 4"),
    ):
        assert text in outcome.out
    assert outcome.data["degrees_of_freedom"] == 4
    assert outcome.data["dependent"] == ["Z", "gamma"]


def test_check_lists_every_problem(refused: Any) -> None:
    text = JAW.replace("mass = 0.2 ", "mass = -1 ").replace("com = 0.5", "com = 5", 1)
    text = text.replace('"masseter_right"', '"masseter_left"')
    Path("jaw.toml").write_text("dependent = ['Z', 'Y']\nx = 1\n" + text)
    err = refused("check", "jaw.toml", said="condyle: jaw.toml: 5 problems\n  - ")
    for text in ("platform.mass", "masseter_left", "coupler.com", "x: is not", "determine Z, Y"):
        assert err.count(text) == 1


def test_check_warns_of_what_is_a_little_off_and_what_does_not_go_together(run: Any) -> None:
    Path("jaw.toml").write_text(JAW.replace("offset = 13.215", "offset = 13.216", 1))
    outcome = run("check", "jaw.toml")
    off = 'condyle: warning: contact "left_condyle": the point is -0.000673'
    assert outcome.status == 0 and outcome.err.startswith(off)
    text = JAW.replace("x = [-27.65,", "x = [-20,", 1).replace("mass = 0.2 ", "mass = 200 ")
    Path("jaw.toml").write_text(text.replace("-9.81", "9.81"))
    outcome = run("check", "jaw.toml")
    assert outcome.status == 0 and "9.81 m/s^2 along +Z" in outcome.out
    who = [line.split(": ")[2] for line in outcome.err.splitlines()]
    assert who == ["platform", "gravity", 'contact "left_condyle"']
    kinds = [warning["kind"] for warning in outcome.data["warnings"]]
    assert kinds == ["mass_large", "gravity_upwards", "home_outside_bounds"]


@pytest.mark.parametrize(
    ("words", "warning"),
    [
        ("check heavy.toml", "platform"),
        ("run own.toml --rate 4", "trial motion"),
        ("solve masticatory --states rest.csv --out out.csv", "the states are at rest"),
        ("compare own.toml --rate 4 --no-figures", "trial motion"),
    ],
)
def test_a_warning_is_an_error(
    run: Any, monkeypatch: pytest.MonkeyPatch, words: str, warning: str
) -> None:
    """With --strict, and nothing is written. Without a motion any mechanism gets one."""
    monkeypatch.setattr("condyle.analysis.comparison.FORMULATIONS", ["virtual_power"])
    Path("heavy.toml").write_text(JAW.replace("mass = 0.2 ", "mass = 200 "))
    Path("own.toml").write_text(JAW.replace("right_molar", "tip").replace("incisor", "nose"))
    Path("rest.csv").write_text("X,Y,alpha,beta\n0,0,0,0\n")
    before = sorted(Path().rglob("*"))
    outcome = run(*words.split(), "--strict", "--json")
    assert outcome.status == 2 and warning in outcome.err
    error = json.loads(outcome.out)["error"]
    assert error["kind"] == "warning" and any(warning in one for one in error["warnings"])
    assert sorted(Path().rglob("*")) == before
    if not words.startswith("compare"):
        outcome = run(*words.split())
        assert outcome.status == 0 and outcome.err.startswith("condyle: warning: ")
        assert warning in outcome.err


@pytest.mark.ci
def test_a_loop_that_is_not_stable_ends_with_a_status(run: Any) -> None:
    drive = 'kind = "joint_pd"\nstiffness = 5\ndamping = '
    bite = 'kind = "bite_force"\nstiffness = 900\nforce = 10'  # on nothing
    for law, status, stable in (
        (f"{drive}0.03", 0, True),
        (f"{drive}3.0", 1, False),
        (bite, 3, None),
    ):
        Path("law.toml").write_text(f"duration = 0.002\n[controller]\n{law}\n")
        outcome = run("simulate", "--scenario", "law.toml", "--check-gains")
        assert outcome.status == status and outcome.data["stable"] is stable
    outcome = run("simulate", "--scenario", "law.toml", "--check-gains", "--strict")
    assert outcome.status == 2 and "not judged" in outcome.err


def test_help_version_schema_and_reference(run: Any, refused: Any) -> None:
    assert json.loads(run("schema").out) == condyle.schema()
    study = json.loads(run("schema", "study").out)
    assert study["title"] == "condyle study" and "vary" in study["properties"]
    assert run("reference", "--out", "case").status == 0
    for path in bundled_reference():
        assert (Path("case") / path.name).read_bytes() == path.read_bytes()
    assert "synthetic" in run("reference", "--help").out.lower()
    assert run("--version").out.strip() == f"condyle {condyle.__version__}"
    listed, shown = run("--help").out, run("new", "--help").out
    assert all(name in listed for name in ("run", "solve", "compare", "check", "schema", "new"))
    assert all(kind in shown for kind in tuple(studies()))


def test_new_writes_a_file_that_checks(run: Any, refused: Any) -> None:
    outcome = run("new", "my-robot")
    assert outcome.status == 0 and "condyle check my-robot.toml" in outcome.out
    assert run("check", "my-robot.toml").status == 0
    assert condyle.load_mechanism("my-robot.toml").name == "my-robot"
    Path("my-robot.toml").write_text("mine")
    refused("new", "my-robot", said="my-robot.toml")
    assert Path("my-robot.toml").read_text() == "mine"
    assert run("new", "my-robot.toml", "--force").status == 0
    assert condyle.load_mechanism("my-robot.toml").name == "my-robot"


def test_a_bundled_machine_is_copied_with_its_comments(run: Any) -> None:
    for word, machine in (("hexaglide",) * 2, ("jaw", "human-jaw"), ("cable", "cable-robot")):
        assert run("new", "mine", "--from", word, "--force").status == 0
        made, source = Path("mine.toml").read_text(), bundled_text(machine)
        assert made == source.replace(f'\nname = "{machine}"\n', '\nname = "mine"\n') != source
        assert condyle.load_mechanism("mine.toml").chains == condyle.load_mechanism(machine).chains


def test_the_list_has_a_line_for_each(run: Any) -> None:
    outcome = run("new", "--list")
    found, kinds = outcome.data["mechanisms"], outcome.data["studies"]
    assert tuple(found) == condyle.bundled_mechanisms() and {*kinds} == {*studies()}
    for line in [*found.values(), *kinds.values()]:
        assert 10 < len(line) < 125 and "NAME" not in line
    assert outcome.out.count("\n") == 3 + len([*found, *kinds])


def test_a_session_file_to_start_from(run: Any, refused: Any) -> None:
    outcome = run("new", "my session", "--study", "session")
    assert outcome.status == 0 and "Wrote my session.toml" in outcome.out
    session = SessionFile.read("my session.toml")
    assert session.mechanism == "human-jaw" and len(session.trials) == 2
    every = re.sub(r"(?m)^# (?=\[|\w+ = )", "", Path("my session.toml").read_text())
    Path("all.toml").write_text(every.replace("[register]", '[register]\nchin = "Chin"\n#'))
    whole = SessionFile.read("all.toml")
    assert None not in (whole.scale, whole.static, whole.forces, whole.emg)
    refused("new", "my session", "--study", "session", said="my session.toml")


def test_a_mode_that_is_not_there_is_refused_before_any_is_computed(
    refused: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(condyle.Model, "modes", lambda *_, **__: pytest.fail("computed"))
    for mode in (0, 99):
        said = f"condyle: --mode: expected a number from 1 to 4, got {mode}"
        refused("modes", "human-jaw-muscles", "--mode", mode, said=said)
