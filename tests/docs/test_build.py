"""What the build of the documentation makes: formulas, tables, drawings, notebooks, the gallery."""

from __future__ import annotations

import importlib
import re
import xml.etree.ElementTree as ET
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
import yaml
from matplotlib.text import Text

from condyle.mechanism import load_mechanism
from condyle.mechanism.chain import CHAINS
from condyle.mechanism.contact import Contact
from condyle.mechanism.surface import Cylinder, Ellipsoid, Plane, Profile, Quadratic, Sphere

DOCS = Path(__file__).parents[2] / "docs"
BUNDLED = DOCS.parent / "src" / "condyle" / "mechanism" / "bundled"
SURFACES = {
    table.model_fields["kind"].default: table
    for table in (Cylinder, Ellipsoid, Plane, Profile, Quadratic, Sphere)
}
# Drawing -> the keys of the file that it explains.
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


def read(*parts: str) -> str:
    return DOCS.joinpath(*parts).read_text(encoding="utf-8")


def test_formulas_become_mathml_or_end_the_build() -> None:
    pytest.importorskip("latex2mathml")
    formulas = importlib.import_module("formulas")
    page = '<p><span class="arithmatex">\\(\\boldsymbol{M}_J &lt; 2\\)</span></p>'
    made = ET.fromstring(formulas.with_formulas(page))
    assert made[0].tag.endswith("math") and "".join(made.itertext()) == "𝑴J<2"
    assert formulas.mathml(r"\boldsymbol{\omega}").count("𝝎") == 1
    for wrong in (r"\nosuch", r"\sqrt{1", "{a", r"\begin{aligned} a & b"):
        with pytest.raises(formulas.FormulaError):
            formulas.mathml(wrong)


def test_arguments_are_found_by_name() -> None:
    pytest.importorskip("griffe")
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
        for box in boxes[1:]:
            for first, last in re.findall(r"\((\d+)\)(?:-\((\d+)\))?", box.equations):
                numbers = range(int(first), int(last or first) + 1)
                named[model.partition(",")[0]] |= set(numbers)
    assert named == sections
    svg = ET.fromstring(drawing.structure().replace("&nbsp;", " "))
    assert len(list(svg.iter("rect"))) == 2 + 3 * 4


# -- drawings of conventions --------------------------------------------------------------------


def test_words_of_drawings_are_keys_of_the_file_and_are_whole() -> None:
    for name, draw in importlib.import_module("drawings").DRAWINGS.items():
        sheet = draw("light")
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
    for name, keys in KEYS.items():
        what, _, kind = name.partition("-")
        if what == "chain":
            known = {*CHAINS[kind if kind == "cable" else kind.upper()].model_fields}
        else:
            known = {*Contact.model_fields} | ({*SURFACES[kind].model_fields} if kind else set())
        assert {*keys} <= known


def nav_pages(entry: object) -> list[str]:
    if isinstance(entry, str):
        return [entry]
    parts = entry.values() if isinstance(entry, dict) else entry
    return [page for part in parts for page in nav_pages(part)]


def test_drawings_stand_on_pages_and_pages_have_pictures() -> None:
    """In both grounds, with words; all pages of the ways in and the install page have one, and of
    the how-tos all that show numbers. Every page is in the navigation.
    """
    drawings = importlib.import_module("drawings")
    names = {str(p.relative_to(DOCS)) for p in DOCS.rglob("*.md") if "generated" not in p.parts}
    pages = "\n".join(map(read, sorted(names)))
    for file in drawings.FILES:
        ground = file.removesuffix(".svg").rpartition("-")[2]
        alts = re.findall(rf"!\[([^]]+)\]\([./]*generated/{file}#only-{ground}\)", pages)
        assert alts and all(len(alt) > 40 for alt in alts), file
    families = {*CHAINS} - {"muscle"}  # drawn as the cable that it is
    assert {f"surface-{kind}" for kind in SURFACES} <= drawings.DRAWINGS.keys()
    assert {f"chain-{kind.lower()}" for kind in families} <= drawings.DRAWINGS.keys()
    config = read("..", "mkdocs.yml")
    nav = yaml.safe_load("nav:" + config.partition("\nnav:")[2])["nav"]
    assert {*nav_pages(nav)} == names
    ways = [entry for entry in nav for name in entry if name == "Install" or name.startswith("I ")]
    assert len(ways) == 5
    # Of ways to call, to extend and to export: code and tables of names.
    plain = {"errors", "extend", "frameworks", "kernels", "matlab", "mujoco", "ros2", "simulink"}
    shown = {f"how-to/{page.name}" for page in DOCS.glob("how-to/*.md") if page.stem not in plain}
    pictured = {*nav_pages(ways)} | shown
    assert not [page for page in pictured if not re.search(r"!\[[^]]{10,}\]\(", read(page))]


# -- the gallery --------------------------------------------------------------------------------


@pytest.mark.ci
def test_each_page_of_the_gallery_has_all_that_it_needs() -> None:
    """Its file, command, number, picture and viewer, and a card."""
    gallery = importlib.import_module("gallery")
    pages = {page.stem for page in (DOCS / "gallery").glob("*.md")} - {"index"}
    assert pages == {*gallery.SHOWN} and len(pages) == 14
    cards = gallery.cards()
    for name in pages:
        text = read("gallery", f"{name}.md")
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
        (card,) = re.findall(rf'<a href="{name}\.html">(.+)</a>', cards)
        assert len(re.findall(r'<img src="[^"]+#only-(?:light|dark)" alt="[^"]{40,}">', card)) == 2
        title, line = re.findall(r"<b>(.+)</b><span>(.+)</span>", card)[0]
        assert title and 20 < len(line) < 100


def test_a_machine_of_the_gallery_is_drawn_whole() -> None:
    """Every joint of the file is on the sheet, at the end of a rod."""
    sheet = importlib.import_module("gallery").SHOWN["eight-leg"]().draw("light")
    sheet.axes.margins(*sheet.room)
    sheet.figure.draw_without_rendering()
    (x0, x1), (y0, y1) = sheet.axes.get_xlim(), sheet.axes.get_ylim()
    rods = [line.get_xydata() for line in sheet.axes.lines if len(line.get_xydata()) == 2]
    for chain in load_mechanism("eight-leg").chains:
        for end in sheet.flat([chain.base, chain.platform]):
            assert x0 < end[0] < x1 and y0 < end[1] < y1
            assert np.linalg.norm(np.vstack(rods) - end, axis=1).min() < 1e-6


# -- pages as notebooks -------------------------------------------------------------------------

PAGE = """# A page
Words with [a link](other.md) and a picture:
![it](generated/it.png){ width="500" }

```python
x = 1
```

```console
$ condyle new my.toml
$ condyle check my.toml
```

```console
$ pip install .
```

The end.
"""


@pytest.fixture
def notebooks() -> ModuleType:
    pytest.importorskip("nbformat")
    return importlib.import_module("notebooks")


def test_code_and_commands_are_cells(notebooks: ModuleType) -> None:
    """Each page offers its notebook; what a cell's output overwrote is not kept."""
    from nbformat import v4

    cells = notebooks.as_notebook(PAGE).cells
    assert [cell.cell_type[:4] for cell in cells] == ["mark", "code", "code", "mark", "mark"]
    assert cells[0].source == "# A page\nWords with a link and a picture:"
    assert cells[1].source == "x = 1"
    assert cells[2].source == "!condyle new my.toml\n!condyle check my.toml"
    assert "pip install" in cells[3].source and cells[4].source == "The end."
    for page, name in zip(notebooks.PAGES, notebooks.FILES, strict=True):
        text = notebooks.with_download("# Title\nText\n", page)
        assert text.startswith("# Title\n") and f"generated/{name})" in text
    assert notebooks.with_download("# Title\n", "index.md") == "# Title\n"
    said = ["\x1b[?25l\r\x1b[2Kworking ━━", "\r\x1b[2K━ 50%\r\n20.7 N\r\n"]
    outputs = [v4.new_output("stream", name="stdout", text=text) for text in said]
    assert [one.text for one in notebooks.plain(outputs)] == ["20.7 N\n"]
    assert notebooks.plain([v4.new_output("stream", name="stdout", text="working ━━")]) == []


@pytest.mark.ci
def test_a_command_that_fails_ends_the_build(notebooks: ModuleType) -> None:
    """Also where another follows it in its cell."""
    client = pytest.importorskip("nbclient.exceptions")
    pytest.importorskip("ipykernel")
    from nbformat import v4

    code = "!condyle check nosuch.toml\n!condyle --version"
    with pytest.raises(client.CellExecutionError, match="_exit_code"):
        notebooks.run(v4.new_notebook(cells=[v4.new_code_cell(code)]))
