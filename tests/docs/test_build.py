"""What the build of the documentation makes: formulas, tables of arguments, the drawing."""

from __future__ import annotations

import importlib
import re
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

pytest.importorskip("latex2mathml")
pytest.importorskip("griffe")
DOCS = Path(__file__).parents[2] / "docs"


@pytest.fixture(autouse=True)
def on_path(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(DOCS))


def test_formulas_become_mathml() -> None:
    formulas = importlib.import_module("formulas")
    page = '<p><span class="arithmatex">\\(\\boldsymbol{M}_J &lt; 2\\)</span></p>'
    made = ET.fromstring(formulas.with_formulas(page))
    assert made[0].tag.endswith("math") and "".join(made.itertext()) == "𝑴J<2"
    assert formulas.mathml(r"\boldsymbol{\omega}").count("𝝎") == 1


@pytest.mark.parametrize("wrong", [r"\nosuch", r"\sqrt{1", "{a", r"\begin{aligned} a & b"])
def test_formula_that_cannot_be_set_ends_the_build(wrong: str) -> None:
    formulas = importlib.import_module("formulas")
    with pytest.raises(formulas.FormulaError):
        formulas.mathml(wrong)


def test_arguments_are_found_by_name() -> None:
    docstrings = importlib.import_module("docstrings")
    text = """One line.

A note: with a colon.

Args:   q, q1: (N, m) each [m; rad], in order; the rest: not a name.
        flag: keep
        them.
Returns: the sum; and: more.
Raises: InputError, SampleError: if not.
        KeyError:   never.
"""
    made = docstrings.house_to_google(text, ["q", "q1", "flag", "threads"], complete=True)
    assert made.startswith("One line.\n\nA note: with a colon.\n\nArgs:\n")
    rows = dict(re.findall(r"^    (\w+): (.*)$", made, re.MULTILINE))
    assert rows["q"] == rows["q1"] == "(N, m) each [m; rad], in order; the rest: not a name."
    assert rows["flag"] == "keep them." and rows["threads"] == "&nbsp;"
    assert rows["InputError"] == rows["SampleError"] == "if not."
    assert rows["KeyError"] == "never."
    assert "Returns:\n    the sum; and: more." in made


def test_every_equation_of_the_drawing_has_a_home() -> None:
    """Each model's steps name equations of its own section of the paper, and miss none of them."""
    drawing = importlib.import_module("structure")
    sections = {"momentum": set(range(29, 48)), "lagrange": set(range(48, 65))}
    named: dict[str, set[int]] = {name: set() for name in sections}
    for model, boxes in drawing.MODELS.items():
        method = model.partition(",")[0]
        for box in boxes[1:]:
            for first, last in re.findall(r"\((\d+)\)(?:-\((\d+)\))?", box.equations):
                named[method] |= set(range(int(first), int(last or first) + 1))
    assert named == sections
    svg = ET.fromstring(drawing.structure().replace("&nbsp;", " "))
    assert len(list(svg.iter("rect"))) == 2 + 3 * 4
