"""How far long work is, and how long it may last: the work says it, and rich draws it as a bar.

    with step("drawing figures", total=5) as advance:
        for figure in figures:
            ...
            advance(1)

A bar comes after a second and is gone at the end: where a command asks for one on its terminal, and
in the cell of a notebook. Elsewhere nobody watches, and a step costs next to nothing.
"""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from contextvars import ContextVar, copy_context
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeVar

if TYPE_CHECKING:
    from rich.progress import Progress

DELAY = 1.0  # seconds before anything is shown
PERIOD = 0.1  # seconds between two pictures of the bar
MANY = 1000  # steps from which a rate is shown

Item = TypeVar("Item")
Advance = Callable[[float], None]


@dataclass(eq=False)
class Step:
    """Attributes: what: is done;  total: how much of it there is, None if that is not known;
    done: how much of it so far.
    """

    what: str
    total: float | None = None
    done: float = 0.0

    def advance(self, amount: float) -> None:
        self.done += amount


_steps: ContextVar[list[Step] | None] = ContextVar("steps", default=None)
_deadline: ContextVar[float] = ContextVar("deadline", default=float("inf"))


@contextmanager
def budget(seconds: float) -> Iterator[None]:
    """Let searches inside the block end early, with less found, once `spent`."""
    token = _deadline.set(min(time.monotonic() + seconds, _deadline.get()))
    try:
        yield
    finally:
        _deadline.reset(token)


def spent() -> bool:
    """Whether the time of the innermost `budget` is over."""
    return time.monotonic() > _deadline.get()


@contextmanager
def step(what: str, total: float | None = None) -> Iterator[Advance]:
    """A piece of work that may last; yields a function to be told how much more is done."""
    own = Step(what, total)
    with ExitStack() as ends:
        if (steps := _steps.get()) is None and in_notebook():
            steps = ends.enter_context(progress_bar())
        if steps is not None:
            steps.append(own)
            ends.callback(steps.remove, own)
        yield own.advance


def stepping(what: str, items: Sequence[Item]) -> Iterator[Item]:
    """The items, each a part of a step."""
    with step(what, len(items)) as advance:
        for item in items:
            yield item
            advance(1)


@contextmanager
def watched_by(steps: list[Step]) -> Iterator[None]:
    """Let the steps of everything inside the block stand in a list, the innermost last."""
    token = _steps.set(steps)
    try:
        yield
    finally:
        with suppress(ValueError):  # of a generator that ends in another cell
            _steps.reset(token)


@contextmanager
def progress_bar() -> Iterator[list[Step]]:
    """Show the innermost step of the block's work, on stderr or in the notebook's cell."""
    steps, over = [Step("working")], threading.Event()
    drawing = threading.Thread(target=copy_context().run, args=(_draw, steps, over), daemon=True)
    drawing.start()
    try:
        with watched_by(steps):
            yield steps
    finally:
        over.set()
        drawing.join()


def in_notebook() -> bool:
    """Whether this runs in a kernel, which shows HTML; a terminal's IPython does not."""
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    return hasattr(shell, "kernel")


def _draw(steps: list[Step], over: threading.Event) -> None:
    """Draw the last step until it is over; work that is quick never pays for rich."""
    if over.wait(DELAY):
        return
    from rich import progress
    from rich.console import Console

    bar = progress.Progress(
        progress.TextColumn("{task.description}", markup=False),
        progress.BarColumn(),
        progress.TaskProgressColumn(),
        progress.TextColumn("{task.fields[rate]}"),
        progress.TimeRemainingColumn(compact=True),
        console=Console(stderr=True),
        transient=True,
        redirect_stdout=False,  # results never end up on stderr
        auto_refresh=False,
    )
    with suppress(OSError), _place(bar) as refresh:  # of a terminal that went away
        shown, task = None, bar.add_task("", rate="")
        while not over.is_set():
            if (latest := steps[-1]) is not shown:
                shown = latest
                bar.reset(task, description=latest.what, total=latest.total, rate="")
            bar.update(task, completed=latest.done)
            speed = bar.tasks[0].speed if (latest.total or 0) >= MANY else None
            bar.update(task, rate=f"{speed:.0f}/s" if speed else "")
            refresh()
            over.wait(PERIOD)


@contextmanager
def _place(bar: Progress) -> Iterator[Callable[[], Any]]:
    """The place of a bar, which is empty at the end; yields a function that draws it there."""
    if not in_notebook():
        with bar:
            yield bar.refresh
        return
    from IPython.display import HTML, display  # a kernel runs, so it is there

    cell = display(bar, display_id=True)
    try:
        yield lambda: cell.update(bar)
    finally:
        cell.update(HTML(""))
