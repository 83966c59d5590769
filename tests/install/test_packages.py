"""What packages and archives are told: the recipe, the citation and the paper say what is so."""

from __future__ import annotations

import json
import re
import tomllib
from pathlib import Path

import yaml

from condyle.version import __version__

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def text(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf-8")


def test_the_conda_recipe_is_that_of_the_project() -> None:
    recipe = yaml.safe_load(text("recipe/recipe.yaml"))
    assert recipe["context"]["version"] == __version__
    python, *run = recipe["requirements"]["run"]
    assert python == f"python {PROJECT['requires-python']}"
    assert {line.replace(" ", "") for line in run} == set(PROJECT["dependencies"])
    (entry,) = recipe["build"]["python"]["entry_points"]
    assert entry == f"condyle = {PROJECT['scripts']['condyle']}"
    assert recipe["about"]["license"] == PROJECT["license"]


def test_archive_and_citation_name_the_same() -> None:
    archive, citation = json.loads(text(".zenodo.json")), yaml.safe_load(text("CITATION.cff"))
    names = [person["name"] for person in PROJECT["authors"]]
    assert [person["name"] for person in archive["creators"]] == names
    assert [person["name"] for person in citation["authors"]] == names
    assert archive["license"] == citation["license"] == PROJECT["license"]
    assert archive["keywords"] == citation["keywords"] == PROJECT["keywords"]
    assert {"cff-version", "message", "title", "authors"} <= citation.keys()


def test_the_paper_has_what_the_journal_asks_for() -> None:
    _, head, body = text("paper/paper.md").split("---\n", 2)
    assert {"title", "tags", "authors", "affiliations", "date", "bibliography"} <= yaml.safe_load(
        head
    ).keys()
    assert 750 < len(body.split()) < 1750
    assert {"# Summary", "# Statement of need", "# References"} <= set(body.splitlines())
    cited = set(re.findall(r"@([A-Za-z]+\d{4})", body))
    assert cited == set(re.findall(r"@\w+\{(\w+),", text("paper/paper.bib")))


def test_systems_of_the_matrix_are_those_that_the_page_names() -> None:
    jobs = yaml.safe_load(text(".github/workflows/test.yml"))["jobs"]
    matrix = jobs["quick"]["strategy"]["matrix"]
    lowest = PROJECT["requires-python"].removeprefix(">=")
    assert matrix["python"][0] == lowest
    assert {name.partition("-")[0] for name in matrix["system"]} == {"ubuntu", "macos", "windows"}
