"""Drawings of conventions: their words are the file's keys, and nothing of them is cut."""

from __future__ import annotations

import importlib
import re
from pathlib import Path
from types import ModuleType

import pytest
import yaml
from matplotlib.text import Text

from condyle.mechanism.chain import CHAINS
from condyle.mechanism.contact import Contact
from condyle.mechanism.surface import Cylinder, Ellipsoid, Plane, Profile, Quadratic, Sphere

SURFACES = {
    table.model_fields["kind"].default: table
    for table in (Cylinder, Ellipsoid, Plane, Profile, Quadratic, Sphere)
}
DOCS = Path(__file__).parents[2] / "docs"
KEYS = {
    "chain-rss": ("base", "axis", "crank_tip", "platform"),
    "chain-pss": ("base", "axis", "platform"),
    "chain-sps": ("base", "platform"),
    "chain-cable": ("base", "platform"),
    "surface-plane": ("offset", "side"),
    "surface-quadratic": ("offset", "side"),
    "surface-profile": ("direction", "points", "side"),
    "surface-sphere": ("centre", "radius", "side"),
    "surface-cylinder": ("point", "axis", "radius", "side"),
    "surface-ellipsoid": ("centre", "semi_axes", "side"),
    "contact": ("surface", "point", "side", "ball_radius", "one_sided"),
}


@pytest.fixture
def drawings(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(str(DOCS))
    return importlib.import_module("drawings")


@pytest.mark.parametrize("ground", ["light", "dark"])
def test_words_are_keys_and_are_whole(drawings: ModuleType, ground: str) -> None:
    for name, draw in drawings.DRAWINGS.items():
        sheet = draw(ground)
        sheet.axes.margins(*sheet.room)
        sheet.figure.draw_without_rendering()
        width, height = sheet.figure.get_size_inches() * sheet.figure.dpi
        words = [text for text in sheet.figure.findobj(Text) if text.get_text()]
        for text in words:
            box = text.get_window_extent()
            inside = box.x0 > 0 and box.y0 > 0 and box.x1 < width and box.y1 < height
            assert inside, f"{name}: {text.get_text()} is cut"
        said = " ".join(text.get_text() for text in words)
        for key in KEYS.get(name, ()):
            assert re.search(rf"\b{key}\b", said), f"{name} without {key}"


def test_keys_are_those_of_the_file() -> None:
    contact = {*Contact.model_fields}
    for name, keys in KEYS.items():
        what, _, kind = name.partition("-")
        if what == "chain":
            known = {*CHAINS[kind if kind == "cable" else kind.upper()].model_fields}
        else:
            known = contact | ({*SURFACES[kind].model_fields} if kind else set())
        assert {*keys} <= known


def test_every_drawing_stands_on_a_page_in_both_grounds_with_words(drawings: ModuleType) -> None:
    pages = "\n".join(path.read_text(encoding="utf-8") for path in sorted(DOCS.rglob("*.md")))
    for file in drawings.FILES:
        ground = file.removesuffix(".svg").rpartition("-")[2]
        alts = re.findall(rf"!\[([^]]+)\]\([./]*generated/{file}#only-{ground}\)", pages)
        assert alts and all(len(alt) > 40 for alt in alts), file
    families = {*CHAINS} - {"muscle"}  # drawn as the cable that it is
    assert {f"surface-{kind}" for kind in SURFACES} <= drawings.DRAWINGS.keys()
    assert {f"chain-{kind.lower()}" for kind in families} <= drawings.DRAWINGS.keys()


def nav_pages(entry: object) -> list[str]:
    if isinstance(entry, str):
        return [entry]
    parts = entry.values() if isinstance(entry, dict) else entry
    return [page for part in parts for page in nav_pages(part)]


def test_first_click_path_and_how_tos_have_pictures() -> None:
    """Every page of the ways in and the install page; of the how-tos all that show numbers."""
    config = (DOCS.parent / "mkdocs.yml").read_text(encoding="utf-8")
    nav = yaml.safe_load("nav:" + config.partition("\nnav:")[2])["nav"]
    ways = [entry for entry in nav for name in entry if name == "Install" or name.startswith("I ")]
    assert len(ways) == 5
    # Of ways to call, to extend and to export: code and tables of names.
    plain = {"errors", "extend", "frameworks", "kernels", "matlab", "mujoco", "ros2", "simulink"}
    shown = {f"how-to/{page.name}" for page in DOCS.glob("how-to/*.md") if page.stem not in plain}
    bare = [
        page
        for page in sorted({*nav_pages(ways)} | shown)
        if not re.search(r"!\[[^]]{10,}\]\(", (DOCS / page).read_text(encoding="utf-8"))
    ]
    assert bare == []
