"""A progress bar for work that lasts: on a terminal, after a second, gone at the end."""

from __future__ import annotations

import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass

from ..progress import Advance, watched_by

DELAY = 1.0  # seconds before anything is shown
PERIOD = 0.1  # seconds between two pictures of the bar
MANY = 1000  # steps from which a rate is shown


@dataclass(eq=False)
class _Step:
    what: str
    total: float | None
    done: float = 0.0

    def advance(self, amount: float) -> None:
        self.done += amount


@contextmanager
def progress_bar(wanted: bool) -> Iterator[None]:
    """Show the innermost step of the block's work on stderr, if that is a terminal."""
    if not (wanted and sys.stderr.isatty()):
        yield
        return
    steps, over = [_Step("working", None)], threading.Event()

    @contextmanager
    def step(what: str, total: float | None) -> Iterator[Advance]:
        steps.append(_Step(what, total))
        own = steps[-1]
        try:
            yield own.advance
        finally:
            steps.remove(own)

    drawing = threading.Thread(target=_draw, args=(steps, over), daemon=True)
    drawing.start()
    try:
        with watched_by(step):
            yield
    finally:
        over.set()
        drawing.join()


def _draw(steps: list[_Step], over: threading.Event) -> None:
    """Draw the last step until it is over; a command that is quick never pays for rich."""
    if over.wait(DELAY):
        return
    from rich import progress
    from rich.console import Console

    bar = progress.Progress(
        progress.TextColumn("{task.description}"),
        progress.BarColumn(),
        progress.TaskProgressColumn(),
        progress.TextColumn("{task.fields[rate]}"),
        progress.TimeRemainingColumn(compact=True),
        console=Console(stderr=True),
        transient=True,
        redirect_stdout=False,  # results never end up on stderr
        auto_refresh=False,
    )
    with suppress(OSError), bar:  # of a terminal that went away
        shown, task = None, bar.add_task("", rate="")
        while not over.is_set():
            if (latest := steps[-1]) is not shown:
                shown = latest
                bar.reset(task, description=latest.what, total=latest.total, rate="")
            bar.update(task, completed=latest.done)
            speed = bar.tasks[0].speed if (latest.total or 0) >= MANY else None
            bar.update(task, rate=f"{speed:.0f}/s" if speed else "", refresh=True)
            over.wait(PERIOD)
