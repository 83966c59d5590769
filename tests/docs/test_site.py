"""The documentation as a folder on disk: no formula is cut, search works, nothing is fetched."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

pytestmark = pytest.mark.ci  # the site takes a minute; what its pages run, test_docs runs too

ROOT = Path(__file__).parents[2]
# What sticks out of its box, in a page of the site.
CUT = """() => [...document.querySelectorAll(".md-content .formula, .md-content math, .structure")]
    .filter(e => e.scrollWidth > e.clientWidth + 1).map(e => e.textContent.trim().slice(0, 60))"""
AUDIT = (ROOT / "tests/docs/audit.js").read_text(encoding="utf-8")
WORDS = {"notebook": "notebooks.html", "video": "look.html", "install": "install.html"}
SIDEWAYS = "() => document.documentElement.scrollWidth > document.documentElement.clientWidth"


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip("mkdocs")
    folder = tmp_path_factory.mktemp("site")
    call = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "-d", str(folder)]
    environment = {**os.environ, "NO_MKDOCS_2_WARNING": "1"}
    environment.pop("CONDYLE_BACKEND", None)  # examples simulate: by numpy they take an hour
    done = subprocess.run(call, cwd=ROOT, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr + done.stdout
    return folder


NUMBERS = {"tutorial": "0.358897", "tutorial-simulate": "20.7 N on the food", "notebooks": "0.006"}


def test_notebooks_have_been_run(site: Path) -> None:
    """A download has what its cells print and draw; their assertions held, or the build fails."""
    for name, number in NUMBERS.items():
        book = json.loads((site / "generated" / f"{name}.ipynb").read_text(encoding="utf-8"))
        code = [cell for cell in book["cells"] if cell["cell_type"] == "code"]
        outputs = [output for cell in code for output in cell["outputs"]]
        assert all(cell["execution_count"] for cell in code)
        assert number in "".join("".join(output.get("text", [])) for output in outputs)
        kinds = {kind for output in outputs for kind in output.get("data", {})}
        assert name == "tutorial" or "image/png" in kinds
    # The page about a word is in the index of the search, with the word in a title.
    index = json.loads((site / "search" / "search_index.json").read_text(encoding="utf-8"))
    for word, page in WORDS.items():
        titled = [one["location"] for one in index["docs"] if word in one["title"].lower()]
        assert any(page in place for place in titled), titled


def test_the_gallery_shows_the_pictures_of_the_scheme(site: Path, open_tab: Callable) -> None:
    shown = """() => [...document.querySelectorAll(".md-content img")]
        .filter(e => e.offsetParent && e.naturalWidth).map(e => e.src.split("#only-")[1])"""
    for scheme in ("light", "dark"):
        tab = open_tab((site / "index.html").as_uri(), width=390, color_scheme=scheme)
        for page in sorted((site / "gallery").glob("*.html")):
            tab.page.goto(page.as_uri())
            assert tab.page.evaluate(shown) == [scheme] * (14 if page.stem == "index" else 1)


def _stumbles(tab: Any, width: int) -> list[str]:
    stumbles: list[str] = tab.page.evaluate(AUDIT)
    stumbles += ["scrolls sideways"] * tab.page.evaluate(SIDEWAYS)
    return stumbles + (tab.page.evaluate(CUT) if width > 1000 else [])


def test_every_page_is_read_on_a_phone_and_a_desk(site: Path, open_tab: Callable) -> None:
    """Nothing scrolls sideways; words, headings, pictures and contrast, in light and in dark."""
    tab = open_tab((site / "index.html").as_uri(), width=390)
    wrong, schemes = [], ["default", "slate"]
    for page in sorted(site.rglob("*.html")):
        if "generated" in page.parts or page.name == "404.html":
            continue
        tab.page.goto(page.as_uri())
        tab.page.add_style_tag(content="* { transition: none !important; }")
        schemes.reverse()  # each page in both, and what frames the pages in both at both widths
        for width, scheme in zip((390, 1300), schemes, strict=True):
            tab.page.set_viewport_size({"width": width, "height": 900})
            tab.page.evaluate(f"document.body.dataset.mdColorScheme = {scheme!r}")
            stumbles = _stumbles(tab, width)
            for _ in range(20):  # what follows the page's width by script has time to follow
                if stumbles:
                    tab.page.wait_for_timeout(250)
                    stumbles = _stumbles(tab, width)
            wrong += [f"{page.relative_to(site)} {width} {scheme}: {what}" for what in stumbles]
    assert wrong == []
    assert [u for u in tab.requests if not u.startswith(("file:", "data:", "blob:"))] == []


def test_formulas_are_set(site: Path, open_tab: Callable) -> None:
    tab = open_tab((site / "theory" / "virtual-power.html").as_uri())
    assert tab.page.locator("math[display=block]").count() > 12
    assert "$" not in tab.page.locator(".md-content").inner_text()
    # The browser lays them out: a fraction is taller than its numerator.
    tall = "() => document.querySelector('mfrac').getBoundingClientRect().height"
    assert tab.page.evaluate(tall) > 20


def test_search_answers_from_a_folder(site: Path, open_tab: Callable) -> None:
    tab = open_tab((site / "theory" / "kernels.html").as_uri())
    found = tab.page.locator(".md-search-result__item a")
    box = tab.page.locator("input[name=query]")

    def answered() -> bool:
        # The page listens to keys, and may not yet: ask again, and leave each question its time.
        box.fill("")
        box.press_sequentially("transmission")
        tab.page.wait_for_timeout(5000)
        return found.count() > 0

    tab.until(answered, "the search answers")
    links = found.evaluate_all("e => e.map(a => a.href)")
    assert any("symbols.html" in link for link in links)
    assert all(link.startswith("file:") for link in links)


def test_arguments_stand_in_tables(site: Path, open_tab: Callable) -> None:
    tab = open_tab((site / "reference" / "api.html").as_uri())
    row = tab.page.locator("tr.doc-section-item", has_text="keep samples").first.inner_text()
    assert row.split()[:2] == ["flag", "bool"] and row.split()[-1] == "False"
