"""The small commands: check, schema, new, reference, and what help says."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import condyle
from condyle.markers import read_session
from condyle.mechanism import bundled_text, json_schema
from condyle.motion import bundled_reference


def test_check_describes_a_mechanism(condyle_command: Callable[..., Any]) -> None:
    outcome = condyle_command("check", "masticatory")
    assert outcome.status == 0 and outcome.err == ""
    for text in (
        "6 chains, 2 contacts, 4 degrees of freedom",
        "dependent coordinates:   Z, gamma",
        "X, Y, alpha, beta",
        "left_condyle",
        "on its surface at home",
        "9.81 m/s^2 along -Z",
        "platform:                0.2 kg, radii of gyration",
        "crank 20 mm",
        "limits 3 N m, 6 rad/s",
        "singularity at home",
        "rank 4 of 4",
    ):
        assert text in outcome.out
    data = json.loads(condyle_command("check", "masticatory", "--json").out)
    assert data["degrees_of_freedom"] == 4 and data["dependent"] == ["Z", "gamma"]


def test_check_lists_every_problem(condyle_command: Callable[..., Any], tmp_path: Path) -> None:
    text = bundled_text("masticatory").replace("mass = 0.2 ", "mass = -1 ")
    text = text.replace('"masseter_right"', '"masseter_left"').replace("com = 0.5", "com = 5", 1)
    (tmp_path / "jaw.toml").write_text("dependent = ['Z', 'Y']\nx = 1\n" + text)
    outcome = condyle_command("check", "jaw.toml")
    assert outcome.status == 2 and outcome.out == ""
    assert outcome.err.startswith("condyle: jaw.toml: 5 problems\n  - ")
    for text in ("platform.mass", "masseter_left", "coupler.com", "x: is not", "determine Z, Y"):
        assert outcome.err.count(text) == 1


def test_check_warns_of_a_home_a_little_off(
    condyle_command: Callable[..., Any], tmp_path: Path
) -> None:
    text = bundled_text("masticatory").replace("offset = 13.215", "offset = 13.216", 1)
    (tmp_path / "jaw.toml").write_text(text)
    outcome = condyle_command("check", "jaw.toml")
    assert outcome.status == 0
    assert outcome.err.startswith(
        'condyle: warning: contact "left_condyle": the point is -0.000673'
    )


def test_check_warns_of_numbers_that_do_not_go_together(
    condyle_command: Callable[..., Any], tmp_path: Path
) -> None:
    text = bundled_text("masticatory").replace("x = [-27.65,", "x = [-20,", 1)
    text = text.replace("mass = 0.2 ", "mass = 200 ").replace("-9.81", "9.81")
    (tmp_path / "jaw.toml").write_text(text)
    outcome = condyle_command("check", "jaw.toml")
    assert outcome.status == 0 and "9.81 m/s^2 along +Z" in outcome.out
    assert [line.split(": ")[2] for line in outcome.err.splitlines()] == [
        "platform",
        "gravity",
        'contact "left_condyle"',
    ]
    data = json.loads(condyle_command("check", "jaw.toml", "--json").out)
    kinds = [warning["kind"] for warning in data["warnings"]]
    assert kinds == ["mass_large", "gravity_upwards", "home_outside_bounds"]


def test_schema_is_json(condyle_command: Callable[..., Any]) -> None:
    assert json.loads(condyle_command("schema").out) == json_schema()


def test_new_writes_a_file_that_checks(condyle_command: Callable[..., Any]) -> None:
    outcome = condyle_command("new", "my-robot")
    assert outcome.status == 0 and "condyle check my-robot.toml" in outcome.out
    assert condyle_command("check", "my-robot.toml").status == 0
    assert condyle.load_mechanism("my-robot.toml").name == "my-robot"
    Path("my-robot.toml").write_text("mine")
    assert condyle_command("new", "my-robot").status == 2
    assert Path("my-robot.toml").read_text() == "mine"
    assert condyle_command("new", "my-robot.toml", "--force").status == 0
    assert condyle.load_mechanism("my-robot.toml").name == "my-robot"


def test_reference_writes_the_bundled_files(condyle_command: Callable[..., Any]) -> None:
    outcome = condyle_command("reference", "--out", "case")
    assert outcome.status == 0 and "synthetic" in condyle_command("reference", "--help").out.lower()
    for path in bundled_reference():
        assert (Path("case") / path.name).read_bytes() == path.read_bytes()


def test_help_and_version(condyle_command: Callable[..., Any]) -> None:
    assert condyle_command("--version").out.strip() == f"condyle {condyle.__version__}"
    listed = condyle_command("--help").out
    for name in ("run", "solve", "compare", "check", "schema", "new"):
        assert name in listed
        assert condyle_command(name, "--help").status == 0


@pytest.mark.parametrize("arguments", [("runn",), ("run", "--nope"), ("solve", "masticatory")])
def test_misspelt_commands(condyle_command: Callable[..., Any], arguments: tuple[str, ...]) -> None:
    outcome = condyle_command(*arguments)
    assert outcome.status == 2 and "Traceback" not in outcome.err and outcome.out == ""


def test_a_session_file_to_start_from(condyle_command: Callable[..., Any]) -> None:
    outcome = condyle_command("new", "my session", "--study", "session")
    assert outcome.status == 0 and "Wrote my session.toml" in outcome.out
    session = read_session("my session.toml")
    assert session.mechanism == "human-jaw" and len(session.trials) == 2
    every = re.sub(r"(?m)^# (?=\[|\w+ = )", "", Path("my session.toml").read_text())
    Path("all.toml").write_text(every.replace("[register]", '[register]\nchin = "Chin"\n#'))
    whole = read_session("all.toml")
    assert (
        whole.scale is not None
        and whole.static is not None
        and whole.forces is not None
        and whole.emg is not None
    )
    assert condyle_command("new", "my session", "--study", "session").status == 2
    for words, text in (
        (("--study", "sessoin"), 'Did you mean "session"'),
        (("--study", "session", "--from-mjcf", "x"), "take one"),
    ):
        refused = condyle_command("new", "other", *words)
        assert refused.status == 2 and text in refused.err
