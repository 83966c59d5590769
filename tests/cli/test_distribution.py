"""How efforts are chosen, from the command line; what is wrong is in test_wrong_input."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import condyle
from condyle.mechanism import bundled_text

from .conftest import read_csv, write_csv

SHORT = ("--rate", 4)
SIDED = 'one_sided = true\nside = "below"\n'
RUBBING = "friction = { coefficient = 0.1 }\n"
JAW = bundled_text("masticatory")


def robot(limit: str = "3.0", contact: str = "", text: str = JAW) -> str:
    """A file of the chewing robot with another torque limit and other contacts."""
    text = text.replace("torque_limit = 3.0", f"torque_limit = {limit}")
    Path("robot.toml").write_text(re.sub(r"(\[\[contact\]\]\n)", rf"\g<1>{contact}", text))
    return "robot.toml"


def solving(*words: object) -> tuple[object, ...]:
    """Of a file of three states at home, that slide along X."""
    names = [prefix + n for prefix in ("", "d", "dd") for n in ("X", "Y", "alpha", "beta")]
    write_csv("s.csv", names, np.tile([0, 0, 0, 0, 0.01, *[0] * 7], (3, 1)))
    return (*("solve", *words, "--states", "s.csv", "--out", "a.csv", "--distribution", "bounded"),)


@pytest.mark.slow
def test_run_chooses_as_it_is_told(run: Any) -> None:
    """W draws the contact forces down, and the efforts up."""
    loads, efforts = [], []
    for weight in (0, 10):
        options = ("--distribution", "weighted", "--contact-weight", weight)
        assert run("run", "--rate", 4, *options).status == 0
        solution = condyle.open_solution("results/masticatory.nc")
        assert solution.condyle.options["distribution"] == "weighted"
        assert solution.condyle.options["contact_weight"] == pytest.approx(weight)
        loads.append(float((solution["contact_force"] ** 2).sum()))
        efforts.append(float((solution["effort"] ** 2).sum()))
    assert loads[1] < 0.5 * loads[0] and efforts[1] > efforts[0]


@pytest.mark.slow
def test_limits_and_friction(run: Any) -> None:
    file = robot(contact=RUBBING + SIDED)
    assert run(*solving(file), "--preload", 0.5).status == 0
    header, rows = read_csv("a.csv")
    row = dict(zip(header, map(float, rows[0]), strict=True))
    for name in ("left_condyle", "right_condyle"):
        assert row[f"contact_{name}"] < -0.5 + 1e-6
        assert row[f"sliding_{name}"] == pytest.approx(0.01 * np.hypot(1, 1.1), rel=1e-6)
        assert 0 < row[f"friction_{name}"] < 0.1 * abs(row[f"contact_{name}"])
    data = run("run", robot(contact=RUBBING), *SHORT).data
    assert data["distribution"] == "minimum_norm" and data["shortfall"] is None
    assert {*data["power"]["masseter_left"]} == {"peak", "work"}
    assert all(work < 0 for work in data["friction_work"].values())


@pytest.mark.slow
def test_limits_that_no_effort_can_meet(run: Any) -> None:
    weak = robot(limit="1e-4")
    outcome = run(*solving(weak), "--json")
    error = json.loads(outcome.out)["error"]
    assert outcome.status == 2 and not Path("a.csv").exists()
    assert error["kind"] == "infeasible" and error["row"] == 1 and error["count"] == 3
    assert "times as large" in outcome.err and len(outcome.err.splitlines()) == 1
    outcome = run(*solving(weak), "--flag")
    assert outcome.status == 0 and "left without efforts" in outcome.err
    header, rows = read_csv("a.csv")
    assert header[-3:] == ["status", "cause", "shortfall"]
    assert rows[0][-3:-1] == ["infeasible", "sample"]
    assert float(rows[0][-1]) == pytest.approx(error["value"], rel=1e-9)
    assert run("run", weak, "--distribution", "bounded", *SHORT).status == 2
    assert not Path("results").exists()


@pytest.mark.slow
def test_nothing_that_is_infinite_breaks_json_and_units_do_not_mix(run: Any, refused: Any) -> None:
    four = robot(contact=SIDED, text="[[chain]]".join(JAW.split("[[chain]]")[:5]))
    outcome = run("run", four, "--distribution", "bounded", *SHORT, "--json")
    error = json.loads(outcome.out)["error"]
    assert outcome.status == 2 and error["value"] is None
    assert "no limits would suffice" in error["message"]
    mixed = robot(text=JAW + "\n[[chain]]" + bundled_text("hexaglide").split("[[chain]]")[1])
    refused("run", mixed, *SHORT, "--distribution", "bounded", said="N and N m: take one of")


@pytest.mark.slow
def test_tradeoff(run: Any) -> None:
    """The curve itself is in tests/analysis."""
    outcome = run("compare", "--tradeoff", "--rate", 4)
    assert outcome.status == 0, outcome.err
    assert "Effort against load on the contacts" in outcome.out
    names = {path.name for path in Path("results").iterdir()}
    tables = {f"tradeoff.{ending}" for ending in ("md", "csv", "png", "svg")}
    assert names == {*tables, "masticatory-tradeoff.nc"}
    header, rows = read_csv("results/tradeoff.csv")
    table = dict(zip(header, np.array(rows, dtype=float).T, strict=True))
    assert (np.diff(table["weight"]) > 0).all() and table["weight"][0] == 0
    assert (np.diff(table["effort"]) > -1e-12).all()
    assert (np.diff(table["contact_load"]) < 1e-12).all()
    assert [o["weight"] for o in outcome.data["tradeoff"]] == pytest.approx(table["weight"])
