"""The gallery: twelve pages, each with its file, command, number, picture and viewer."""

from __future__ import annotations

import importlib
import re
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

DOCS = Path(__file__).parents[2] / "docs"
BUNDLED = Path(__file__).parents[2] / "src" / "condyle" / "mechanism" / "bundled"


@pytest.fixture
def gallery(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(str(DOCS))
    return importlib.import_module("gallery")


def test_each_page_has_all_that_a_page_needs(gallery: ModuleType) -> None:
    pages = {page.stem for page in (DOCS / "gallery").glob("*.md")} - {"index"}
    assert pages == {*gallery.SHOWN} and len(pages) == 12
    for name in pages:
        text = (DOCS / "gallery" / f"{name}.md").read_text(encoding="utf-8")
        for ground in ("light", "dark"):
            file = f"gallery-{name}-{ground}.png"
            (alt,) = re.findall(rf"!\[([^]]+)\]\(\.\./generated/{file}#only-{ground}\)", text)
            assert len(alt) > 40 and file in gallery.FILES
        assert f"](../generated/gallery-{name}.html)" in text
        assert f"gallery-{name}.html" in gallery.FILES
        assert re.search(r"^\$ condyle ", text, re.MULTILINE), f"{name}: no command"
        assert re.search(r"^assert .*\d", text, re.MULTILINE), f"{name}: no number"
        (file,) = re.findall(r'--8<-- "(.+\.toml)"', text)
        assert (BUNDLED / file).exists() or (gallery.EXAMPLES / file).exists()


def test_cards_lead_to_every_page_with_its_first_line(gallery: ModuleType) -> None:
    made = gallery.cards()
    for name in gallery.SHOWN:
        (card,) = re.findall(rf'<a href="{name}\.html">(.+)</a>', made)
        assert len(re.findall(r'<img src="[^"]+#only-(?:light|dark)" alt="[^"]{40,}">', card)) == 2
        title, line = re.findall(r"<b>(.+)</b><span>(.+)</span>", card)[0]
        assert title and 20 < len(line) < 100


def test_a_machine_is_drawn_whole(gallery: ModuleType) -> None:
    """Every joint of the file is on the sheet, at the end of a rod, in both grounds."""
    shown = gallery.SHOWN["eight-leg"]()
    mechanism = importlib.import_module("condyle").load_mechanism("eight-leg")
    for ground in ("light", "dark"):
        sheet = shown.draw(ground)
        sheet.axes.margins(*sheet.room)
        sheet.figure.draw_without_rendering()
        (x0, x1), (y0, y1) = sheet.axes.get_xlim(), sheet.axes.get_ylim()
        for chain in mechanism.chains:
            for x, y in sheet.flat([chain.base, chain.platform]):
                assert x0 < x < x1 and y0 < y < y1
        rods = [line.get_xydata() for line in sheet.axes.lines if len(line.get_xydata()) == 2]
        for chain in mechanism.chains:
            for end in sheet.flat([chain.base, chain.platform]):
                assert np.linalg.norm(np.vstack(rods) - end, axis=1).min() < 1e-6
