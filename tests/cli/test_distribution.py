"""How efforts are chosen, from the command line."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import condyle
from condyle.mechanism import bundled_text

Run = Callable[..., Any]
Read = Callable[[str], tuple[list[str], list[list[str]]]]
SHORT = ("--rate", 20)


def robot(name: str, limit: str = "3.0", contact: str = "") -> str:
    """A file of the chewing robot with another torque limit and other contacts."""
    text = bundled_text("masticatory").replace("torque_limit = 3.0", f"torque_limit = {limit}")
    Path(name).write_text(re.sub(r"(\[\[contact\]\]\n)", rf"\g<1>{contact}", text))
    return name


def states(name: str, rows: int = 3) -> str:
    names = ["X", "Y", "alpha", "beta"]
    header = [prefix + n for prefix in ("", "d", "dd") for n in names]
    values = np.zeros((rows, 12))
    values[:, 4] = 0.01
    lines = [",".join(header), *(",".join(map(str, row)) for row in values)]
    Path(name).write_text("\n".join(lines) + "\n")
    return name


@pytest.mark.slow
def test_run_chooses_as_it_is_told(condyle_command: Run) -> None:
    """W draws the contact forces down, and the efforts up."""
    loads, efforts = [], []
    for weight in (0, 10):
        options = ("--distribution", "weighted", "--contact-weight", weight)
        outcome = condyle_command("run", *SHORT, *options)
        assert outcome.status == 0, outcome.err
        solution = condyle.open_solution("results/masticatory.nc")
        assert solution.condyle.options["distribution"] == "weighted"
        assert solution.condyle.options["contact_weight"] == pytest.approx(weight)
        loads.append(float((solution["contact_force"] ** 2).sum()))
        efforts.append(float((solution["effort"] ** 2).sum()))
    assert loads[1] < 0.5 * loads[0] and efforts[1] > efforts[0]


def test_run_says_it_to_programs(condyle_command: Run) -> None:
    rubbing = robot("rub.toml", contact="friction = { coefficient = 0.1 }\n")
    said = json.loads(condyle_command("run", rubbing, *SHORT, "--json").out)
    assert said["distribution"] == "minimum_norm" and said["shortfall"] is None
    assert {*said["power"]["masseter_left"]} == {"peak", "work"}
    assert all(work < 0 for work in said["friction_work"].values())


def test_solve_with_limits_and_friction(condyle_command: Run, read_csv: Read) -> None:
    contact = 'friction = { coefficient = 0.1 }\none_sided = true\nside = "below"\n'
    file = robot("rub.toml", contact=contact)
    given = ("--states", states("s.csv"), "--out", "a.csv", "--distribution", "bounded")
    outcome = condyle_command("solve", file, *given, "--preload", 0.5)
    assert outcome.status == 0, outcome.err
    header, rows = read_csv("a.csv")
    row = dict(zip(header, map(float, rows[0]), strict=True))
    for name in ("left_condyle", "right_condyle"):
        assert row[f"contact_{name}"] < -0.5 + 1e-6
        speed, size = row[f"sliding_{name}"], row[f"friction_{name}"]
        assert speed == pytest.approx(0.01 * np.hypot(1, 1.1), rel=1e-6)  # along the slope
        expected = 0.1 * abs(row[f"contact_{name}"]) * speed / np.hypot(speed, 1e-3)
        assert size == pytest.approx(expected, rel=1e-9)


@pytest.mark.slow
def test_limits_that_no_effort_can_meet(condyle_command: Run, read_csv: Read) -> None:
    weak = robot("weak.toml", limit="1e-4")
    given = ("--states", states("s.csv"), "--out", "a.csv", "--distribution", "bounded")
    outcome = condyle_command("solve", weak, *given, "--json")
    error = json.loads(outcome.out)["error"]
    assert outcome.status == 2 and not Path("a.csv").exists()
    assert error["kind"] == "infeasible" and error["row"] == 1 and error["count"] == 3
    assert "times as large" in outcome.err and len(outcome.err.splitlines()) == 1
    outcome = condyle_command("solve", weak, *given, "--flag")
    assert outcome.status == 0 and "left empty" in outcome.err
    header, rows = read_csv("a.csv")
    assert header[-3:] == ["status", "cause", "shortfall"]
    assert rows[0][-3:-1] == ["infeasible", "sample"]
    assert float(rows[0][-1]) == pytest.approx(error["value"], rel=1e-9)
    assert condyle_command("run", weak, "--distribution", "bounded", *SHORT).status == 2
    assert not Path("results").exists()


def test_nothing_that_is_infinite_breaks_json(condyle_command: Run) -> None:
    text = bundled_text("masticatory").split("[[chain]]")
    four = "[[chain]]".join(text[:5])
    sided = re.sub(r"(\[\[contact\]\]\n)", '\\1one_sided = true\nside = "below"\n', four)
    Path("four.toml").write_text(sided)
    outcome = condyle_command("run", "four.toml", "--distribution", "bounded", *SHORT, "--json")
    error = json.loads(outcome.out)["error"]
    assert outcome.status == 2 and error["value"] is None
    assert "no limits would suffice" in error["message"]


@pytest.mark.parametrize("command", ["run", "solve", "compare"])
@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--distribution", "cubik"), 'there is no "cubik". Did you mean "cubic"'),
        (("--distribution", "cubic"), "efforts that only pull"),
        (("--preload", "1"), "minimum_norm knows none"),
        (("--distribution", "bounded", "--preload", "-1"), "at least 0, got -1"),
        (("--distribution", "bounded", "--preload", "nan"), "at least 0, got nan"),
        (("--contact-weight", "1"), "does not weigh contact forces"),
        (("--distribution", "weighted", "--contact-weight", "-1"), "at least 0, got -1"),
    ],
)
def test_choices_without_meaning(
    condyle_command: Run, command: str, options: tuple[str, ...], said: str
) -> None:
    more = ("--states", states("s.csv"), "--out", "a.csv") if command == "solve" else SHORT
    outcome = condyle_command(command, "masticatory", *more, *options)
    assert outcome.status == 2 and said in outcome.err
    assert outcome.err.splitlines()[-1].startswith("condyle: ") and "Traceback" not in outcome.err
    assert not Path("results").exists() and not Path("a.csv").exists()


def test_mixed_units_are_not_added(condyle_command: Run) -> None:
    slides = bundled_text("hexaglide").split("[[chain]]")[1]
    Path("mixed.toml").write_text(bundled_text("masticatory") + "\n[[chain]]" + slides)
    outcome = condyle_command("run", "mixed.toml", *SHORT, "--distribution", "bounded")
    assert outcome.status == 2 and "N and N m: take one of" in outcome.err


# -- the curve ----------------------------------------------------------------------------------


@pytest.mark.slow
def test_tradeoff(condyle_command: Run, read_csv: Read) -> None:
    outcome = condyle_command("compare", "--tradeoff", *SHORT)
    assert outcome.status == 0, outcome.err
    assert "Effort against load on the contacts" in outcome.out
    names = {path.name for path in Path("results").iterdir()}
    assert names == {
        "tradeoff.md", "tradeoff.csv", "tradeoff.png", "tradeoff.svg", "masticatory-tradeoff.nc",
    }  # fmt: skip
    header, rows = read_csv("results/tradeoff.csv")
    table = {
        name: np.array(column, float)
        for name, column in zip(header, np.transpose(rows), strict=True)
    }
    assert (np.diff(table["weight"]) > 0).all() and table["weight"][0] == 0
    assert (np.diff(table["effort"]) > -1e-12).all()
    assert (np.diff(table["contact_load"]) < 1e-12).all()
    said = json.loads(condyle_command("compare", "--tradeoff", *SHORT, "--json").out)
    assert [one["weight"] for one in said["tradeoff"]] == pytest.approx(table["weight"])


@pytest.mark.parametrize("options", [("--distribution", "bounded"), ("--contact-weight", "1")])
def test_tradeoff_chooses_itself(condyle_command: Run, options: tuple[str, ...]) -> None:
    outcome = condyle_command("compare", "--tradeoff", *SHORT, *options)
    assert outcome.status == 2 and "leave --distribution and --contact-weight out" in outcome.err
