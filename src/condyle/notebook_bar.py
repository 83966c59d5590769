"""A progress bar for long work, in the cell of a notebook: after a second, gone at the end."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from html import escape
from typing import Any

DELAY = 1.0  # seconds before anything is shown
PERIOD = 0.2  # seconds between two pictures of the bar


def in_notebook() -> bool:
    """Whether this runs in a kernel, which shows HTML; a terminal's IPython does not."""
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    return hasattr(shell, "kernel")


@contextmanager
def notebook_step(what: str, total: float | None) -> Iterator[Callable[[float], None]]:
    """A step as a line of its own in the cell's output."""
    from IPython.display import HTML, display  # a kernel runs, so it is there

    done, shown, drawn = 0.0, None, time.monotonic() + DELAY - PERIOD

    def advance(amount: float) -> None:
        nonlocal done, shown, drawn
        done += amount
        if time.monotonic() < drawn + PERIOD:
            return
        drawn = time.monotonic()
        picture = HTML(bar(what, done, total))
        if shown is None:
            shown = display(picture, display_id=True)
        else:
            shown.update(picture)

    try:
        yield advance
    finally:
        if shown is not None:
            shown.update(HTML(""))


def bar(what: str, done: float, total: float | None) -> str:
    """HTML of a bar; one that does not know its end if `total` is None."""
    known: Any = f'value="{min(done / total, 1):.3f}"' if total else ""
    share = f" {100 * min(done / total, 1):.0f} %" if total else ""
    return f"<progress {known}></progress> {escape(what)}{share}"
