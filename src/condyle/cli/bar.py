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


@contextmanager
def progress_bar(wanted: bool) -> Iterator[None]:
    """Show the steps of the block's work on stderr, if that is a terminal."""
    if not (wanted and sys.stderr.isatty()):
        yield
        return
    bar = _Bar()
    drawing = threading.Thread(target=bar.draw, name="condyle-progress", daemon=True)
    drawing.start()
    try:
        with watched_by(bar.step):
            yield
    finally:
        bar.over.set()
        drawing.join()


class _Bar:
    """The steps under way, innermost last, and a thread that draws the last one."""

    def __init__(self) -> None:
        self.over = threading.Event()
        self._steps = [_Step("working", None)]

    @contextmanager
    def step(self, what: str, total: float | None) -> Iterator[Advance]:
        one = _Step(what, total)

        def advance(amount: float) -> None:
            one.done += amount

        self._steps.append(one)
        try:
            yield advance
        finally:
            self._steps.remove(one)

    def draw(self) -> None:
        """Draw until it is over; a command that is quick never pays for rich."""
        if self.over.wait(DELAY):
            return
        from rich.console import Console
        from rich.progress import (
            BarColumn,
            Progress,
            ProgressColumn,
            Task,
            TaskProgressColumn,
            TextColumn,
            TimeRemainingColumn,
        )
        from rich.text import Text

        class Rate(ProgressColumn):
            """How many a second, of many."""

            def render(self, task: Task) -> Text:
                known = task.speed and (task.total or 0) >= MANY
                return Text(f"{task.speed:.0f}/s" if known else "")

        columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), Rate())
        with (
            suppress(OSError),  # a terminal that went away
            Progress(
                *columns,
                TimeRemainingColumn(compact=True),
                console=Console(stderr=True),
                transient=True,
                redirect_stdout=False,  # results never end up on stderr
                auto_refresh=False,
            ) as display,
        ):
            shown, task = None, None
            while not self.over.is_set():
                latest = self._steps[-1]
                if latest is not shown:
                    if task is not None:
                        display.remove_task(task)
                    shown, task = latest, display.add_task(latest.what, total=latest.total)
                assert task is not None
                display.update(task, completed=latest.done, refresh=True)
                self.over.wait(PERIOD)
