"""Long work in a notebook shows how far it is, and nothing remains; in a kernel of its own."""

from __future__ import annotations

import threading

import pytest

from condyle import progress

pytest.importorskip("nbclient")
pytest.importorskip("ipykernel")
WORK = """
import time
from condyle import progress
progress.DELAY, progress.PERIOD = {delay}, 0.01
with progress.step("drawing <figures>", total=4) as advance:
    advance(3)
    time.sleep({lasting})
    print("here")
    {wrong}
"""


def outputs(delay: float, lasting: float, wrong: str = "") -> list[str]:
    from nbclient import NotebookClient
    from nbformat.v4 import new_code_cell, new_notebook

    heard: list[str] = []

    class Client(NotebookClient):
        def process_message(self, msg, cell, cell_index):  # type: ignore[no-untyped-def]
            heard.append(str(msg["content"].get("data", {}).get("text/html", "")))
            return super().process_message(msg, cell, cell_index)

    book = new_notebook(
        cells=[new_code_cell(WORK.format(delay=delay, lasting=lasting, wrong=wrong))]
    )
    Client(book, timeout=120, allow_errors=True).execute()
    last = [str(out["data"]["text/html"]) for out in book.cells[0].outputs if "data" in out]
    assert last in ([], [""])  # the bar is gone
    return [one for one in heard if one]


@pytest.mark.ci
def test_a_bar_in_a_cell_comes_and_goes() -> None:
    for wrong in ("", "raise ValueError"):
        shown = outputs(0.0, 2.0, wrong)
        assert "drawing &lt;figures&gt;" in shown[-1] and "75%" in shown[-1]


@pytest.mark.ci
def test_quick_work_shows_nothing() -> None:
    assert outputs(1e6, 0.0) == []


def test_nothing_is_shown_outside_a_notebook() -> None:
    assert not progress.in_notebook()
    threads = threading.active_count()
    with progress.step("work", 2):
        assert threading.active_count() == threads
