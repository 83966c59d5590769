"""Long work in a notebook shows how far it is, and nothing remains; in a kernel of its own."""

from __future__ import annotations

import pytest

from condyle import notebook_bar, progress

pytest.importorskip("nbclient")
pytest.importorskip("ipykernel")
WORK = """
from condyle import notebook_bar
from condyle.progress import step
notebook_bar.DELAY = notebook_bar.PERIOD = {delay}
with step("drawing <figures>", total=4) as advance:
    for _ in range(3):
        advance(1)
    print("here")
    {wrong}
"""


def outputs(delay: float, wrong: str = "") -> list[str]:
    from nbclient import NotebookClient
    from nbformat.v4 import new_code_cell, new_notebook

    heard: list[str] = []

    class Client(NotebookClient):
        def process_message(self, msg, cell, cell_index):  # type: ignore[no-untyped-def]
            heard.append(str(msg["content"].get("data", {}).get("text/html", "")))
            return super().process_message(msg, cell, cell_index)

    book = new_notebook(cells=[new_code_cell(WORK.format(delay=delay, wrong=wrong))])
    Client(book, timeout=120, allow_errors=True).execute()
    last = [str(out["data"]["text/html"]) for out in book.cells[0].outputs if "data" in out]
    assert last in ([], [""])  # the bar is gone
    return [one for one in heard if one]


@pytest.mark.ci
def test_a_bar_in_a_cell_comes_and_goes() -> None:
    for wrong in ("", "raise ValueError"):
        shown = outputs(0.0, wrong)
        assert len(shown) == 3 and "&lt;figures&gt; 75 %" in shown[-1]


@pytest.mark.ci
def test_quick_work_shows_nothing() -> None:
    assert outputs(1e6) == []


def test_nothing_is_shown_outside_a_notebook() -> None:
    assert not notebook_bar.in_notebook()
    with progress.step("work", 2) as advance:
        assert advance is progress._unwatched


def test_a_bar_without_an_end_has_no_value() -> None:
    assert "value" not in notebook_bar.bar("searching", 3, None)
    assert 'value="1.000"' in notebook_bar.bar("done", 5, 4)
