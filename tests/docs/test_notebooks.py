"""Pages as notebooks: their code is that of the page."""

from __future__ import annotations

import importlib
from pathlib import Path
from types import ModuleType

import pytest

DOCS = Path(__file__).parents[2] / "docs"

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
def notebooks(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    pytest.importorskip("nbformat")
    monkeypatch.syspath_prepend(str(DOCS))
    return importlib.import_module("notebooks")


def test_code_and_commands_are_cells(notebooks: ModuleType) -> None:
    cells = notebooks.as_notebook(PAGE).cells
    assert [cell.cell_type[:4] for cell in cells] == ["mark", "code", "code", "mark", "mark"]
    assert cells[0].source == "# A page\nWords with a link and a picture:"
    assert cells[1].source == "x = 1"
    assert cells[2].source == "!condyle new my.toml\n!condyle check my.toml"
    assert "pip install" in cells[3].source and cells[4].source == "The end."


def test_what_was_overwritten_is_not_kept(notebooks: ModuleType) -> None:
    from nbformat import v4

    def said(text: str) -> object:
        return v4.new_output("stream", name="stdout", text=text)

    first, second = said("\x1b[?25l\r\x1b[2Kworking ━━"), said("\r\x1b[2K━ 50%\r\n20.7 N\r\n")
    (one,) = notebooks.plain([first, second])
    assert one.text == "20.7 N\n"
    assert notebooks.plain([said("working ━━")]) == []


def test_each_page_offers_its_notebook(notebooks: ModuleType) -> None:
    for page, name in zip(notebooks.PAGES, notebooks.FILES, strict=True):
        text = notebooks.with_download("# Title\nText\n", page)
        assert text.startswith("# Title\n") and f"generated/{name})" in text
    assert notebooks.with_download("# Title\n", "index.md") == "# Title\n"


@pytest.mark.ci
@pytest.mark.parametrize("last", ["", "\n!condyle --version"])
def test_a_command_that_fails_ends_the_build(notebooks: ModuleType, last: str) -> None:
    client = pytest.importorskip("nbclient.exceptions")
    pytest.importorskip("ipykernel")
    from nbformat import v4

    book = v4.new_notebook(cells=[v4.new_code_cell(f"!condyle check nosuch.toml{last}")])
    with pytest.raises(client.CellExecutionError, match="_exit_code"):
        notebooks.run(book)
