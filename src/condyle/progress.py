"""How far long work is, and how long it may last: the work says it, and whoever watches shows it.

    with step("drawing figures", total=5) as advance:
        for figure in figures:
            ...
            advance(1)

Nobody watches unless asked to, or in a notebook; else a step costs next to nothing.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from contextvars import ContextVar
from typing import TypeVar

from .notebook_bar import in_notebook, notebook_step

Item = TypeVar("Item")
Advance = Callable[[float], None]
# What is done and how much of it there is, None if that is not known -> a step to be entered.
Watcher = Callable[[str, float | None], AbstractContextManager[Advance]]

_watcher: ContextVar[Watcher | None] = ContextVar("watcher", default=None)
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
def watched_by(watcher: Watcher) -> Iterator[None]:
    """Let `watcher` see the steps of everything inside the block."""
    token = _watcher.set(watcher)
    try:
        yield
    finally:
        _watcher.reset(token)


@contextmanager
def step(what: str, total: float | None = None) -> Iterator[Advance]:
    """A piece of work that may last; yields a function to be told how much more is done."""
    watcher = _watcher.get() or (notebook_step if in_notebook() else None)
    if watcher is None:
        yield _unwatched
    else:
        with watcher(what, total) as advance:
            yield advance


def stepping(what: str, items: Sequence[Item]) -> Iterator[Item]:
    """The items, each a part of a step."""
    with step(what, len(items)) as advance:
        for item in items:
            yield item
            advance(1)


def _unwatched(amount: float) -> None:
    pass
