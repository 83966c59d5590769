"""A kind of study from outside the package: one file, this one, and one line that registers it."""

from __future__ import annotations

import json
import sys
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from pydantic import Field

import condyle
from condyle.analysis.new_study import study_lines, template
from condyle.analysis.studies import STUDIES, StudyKind, read_study, study_kind, tables_of
from condyle.cli.completion import listed
from condyle.errors import ProblemsError
from condyle.mechanism import bundled_text
from condyle.mechanism.files import from_data
from condyle.mechanism.study_file import File, MechanismFile, Positive, StudyFile
from condyle.results.study_answer import StudyAnswer, named_lines
from condyle.simulation.first_scenario import STARTER


class SpringStudy(StudyFile):
    """The spring that carries the platform."""

    mechanism: MechanismFile = "masticatory"
    stiffness: Positive = Field(description="of the spring [N/m]", examples=[200.0])
    log: File | None = None


@dataclass(frozen=True)
class CarryingSpring(StudyAnswer):
    kind = "spring"
    stretch: float

    def __str__(self) -> str:
        return "\n".join(named_lines({"stretch": f"{1e3 * self.stretch:.3g} mm"}))

    @property
    def data(self) -> dict[str, Any]:
        return {"stretch": self.stretch}

    @property
    def columns(self) -> dict[str, Any]:
        return {"stretch": [self.stretch]}


def carrying_spring(study: Any, gravity: float = 9.81) -> CarryingSpring:
    """The stretch of a spring that carries the platform.

    Args: gravity: at least 0 [m/s^2].
    """
    asked = SpringStudy.read(study)
    machine = condyle.load_mechanism(asked.mechanism)
    return CarryingSpring(gravity * machine.platform.mass / asked.stiffness)


@pytest.fixture(autouse=True)
def registered(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setitem(STUDIES, "spring", StudyKind(SpringStudy, carrying_spring))
    yield


def test_it_appears_where_kinds_appear(tmp_path: Path) -> None:
    assert {"mechanism", "stiffness", "log"} == {*condyle.schema("spring")["properties"]}
    assert "spring" in listed("study") and "spring" in listed("of")
    assert study_lines()["spring"] == "The spring that carries the platform"
    path = condyle.new_study(tmp_path / "mine", "spring")
    assert "# of the spring [N/m]\nstiffness = 200.0\n" in path.read_text()
    found = study_kind("spring").solve(path)
    assert found.data["stretch"] == pytest.approx(9.81 * 0.2 / 200.0, rel=0.5)
    found.save(tmp_path / "a.csv")
    assert (tmp_path / "a.csv").read_text().startswith("stretch\n")
    found.write_report(tmp_path / "a.html")
    assert str(found) in (tmp_path / "a.html").read_text()


def test_the_command_line_knows_it(condyle_command: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """In the help, with help, completed, checked, answered, to programs too; no command's twin."""
    page = condyle_command("--help").out
    assert "spring" in page.partition("Compute")[2] and page.count(" optimise ") == 1
    page = condyle_command("spring", "--help").out
    for said in (
        "that carries the platform",
        "new --study spring",
        "--report",
        "least",
        "--gravity",
    ):
        assert said in page, said
    assert condyle_command("new", "mine", "--study", "spring").status == 0
    outcome = condyle_command("check", "mine.toml", "--json")
    assert json.loads(outcome.out)["kind"] == "spring" and outcome.status == 0
    outcome = condyle_command("check", "mine.toml")
    assert outcome.out == "mine.toml: spring, no mistakes\nNext: condyle spring --help\n"
    outcome = condyle_command("spring", "mine.toml", "--gravity", "1.62", "--out", "a.csv")
    assert outcome.out.startswith("stretch  ") and "Next: " not in outcome.out
    assert Path("a.csv").is_file() and outcome.status == 0
    assert json.loads(condyle_command("spring", "mine.toml", "--json").out).keys() == {"stretch"}
    Path("mine.toml").write_text("stiffness = -1.0")
    for words in (("check", "mine.toml"), ("spring", "mine.toml")):
        outcome = condyle_command(*words)
        assert outcome.status == 2 and "stiffness: expected a value above 0" in outcome.err
    monkeypatch.setattr(sys.modules["__main__"], "__package__", None)  # click's name of the program
    monkeypatch.setenv("_CONDYLE_COMPLETE", "complete_bash")
    for line, offered in (
        ("spr", "spring"),
        ("spring --gra", "--gravity"),
        ("new --study sp", "spring"),
    ):
        monkeypatch.setenv("COMP_WORDS", f"condyle {line}")
        monkeypatch.setenv("COMP_CWORD", str(1 + line.count(" ")))
        assert condyle_command().out.split() == [offered]


@pytest.mark.parametrize("kind", ["scenario", *STUDIES])
def test_every_kind_is_checked(kind: str, condyle_command: Any) -> None:
    """Files as `new` writes them, and with a mistake."""
    made = ("simulate", "--new", "a.toml") if kind == "scenario" else ("new", "a", "--study", kind)
    assert condyle_command(*made).status == 0
    outcome = condyle_command("check", "a.toml", "--json")
    assert json.loads(outcome.out)["kind"] == kind and outcome.status == 0
    Path("a.toml").write_text("mistake = 1\n" + Path("a.toml").read_text())
    for words in ((), ("--of", kind)):
        outcome = condyle_command("check", "a.toml", *words)
        assert outcome.status == 2 and "mistake" in outcome.err and outcome.out == ""


def test_keys_of_several_kinds_are_of_the_smallest() -> None:
    """A fit's keys are an excitation's too."""
    kinds = {
        p.stem: read_study(p)[0] for p in (Path(__file__).parents[2] / "examples").glob("*.toml")
    }
    assert kinds["fit"] == "fit" and kinds["study"] == "study" and kinds["chew"] == "scenario"


def test_a_file_of_another_kind_says_which() -> None:
    """Whatever is expected; and one misspelt key is one problem."""
    texts = {kind: template(kind) for kind in STUDIES if kind != "spring"}
    texts |= {"mechanism": bundled_text("masticatory"), "scenario": STARTER}
    for expected in texts:
        for kind, text in texts.items():
            tables = tomllib.loads(text.replace("NAME", "x"))
            if kind != expected:
                read = from_data if expected == "mechanism" else tables_of(expected).checked
                with pytest.raises(ProblemsError) as caught:
                    read(tables, "x.toml")
                [said] = caught.value.problems
                assert said.startswith(f'is a file of kind "{kind}", expected "{expected}"')
                assert said.endswith("x.toml takes it") and "; condyle " in said
    with pytest.raises(ProblemsError, match=r'1 problem\n.*Did you mean "pose"'):
        tables_of("path").checked({"poses": []}, "x.toml")
    with pytest.raises(ProblemsError, match=r'1 problem\n.*Did you mean "chain"'):
        from_data(tomllib.loads(texts["mechanism"].replace("[[chain]]", "[[chains]]")))


def test_its_files_stand_beside_it_and_its_mistakes_are_said(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text('stiffness = 2.0\nmechanism = "my.toml"\nlog = "log.csv"\n')
    study = STUDIES["spring"].file.read(path)
    assert study.data()["log"] == str(tmp_path / "log.csv")
    assert study.data()["mechanism"] == str(tmp_path / "my.toml")
    path.write_text("stifness = 2.0\nstiffness = -1.0\n")
    with pytest.raises(ProblemsError, match='Did you mean "stiffness"') as caught:
        STUDIES["spring"].file.read(path)
    assert "stiffness: expected a value above 0" in caught.value.problems[0]
    with pytest.raises(condyle.InputError, match=r"no study is called .*spring"):
        condyle.new_study(tmp_path / "x", "sprint")
