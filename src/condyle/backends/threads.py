"""Threads for batches: how many, and a pool that stays."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from itertools import count as counter

import numpy as np

from ..errors import InputError, brief

PIECES = 4  # that each thread takes, so that one that is held up does not hold up all
_pool: ThreadPoolExecutor | None = None


def workers(threads: int | None) -> int:
    """As many threads as asked for; by default the processors that this process may use.

    Raises: InputError: for a number below 1.
    """
    if threads is not None:
        if not isinstance(threads, int | np.integer) or threads < 1:
            raise InputError(
                f"threads: expected an integer of at least 1, or None for all there are; got "
                f"{brief(threads)}"
            )
        return int(threads)
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def shared_out(work: Callable[[int, int], None], count: int, n_threads: int, multiple: int) -> None:
    """Let threads do `work(start, end)` on pieces of `count` samples.

    Args: n_threads: threads, the caller's among them;  multiple: of which pieces start, so that
          results do not depend on how samples are cut.
    """
    if n_threads < 2:
        work(0, count)
        return
    size = -(-count // (PIECES * n_threads * multiple)) * multiple
    next_piece = counter(0, size)

    def take() -> None:
        for start in next_piece:  # one thread at a time is given each number
            if start >= count:
                return
            work(start, min(start + size, count))

    helpers = [_helpers().submit(take) for _ in range(n_threads - 1)]
    try:
        take()
    finally:
        for helper in helpers:
            helper.result()


def _helpers() -> ThreadPoolExecutor:
    global _pool
    if _pool is None:
        _pool = ThreadPoolExecutor(max(workers(None), 2), thread_name_prefix="condyle")
    return _pool


def _forget() -> None:
    """A forked process has none of its parent's threads."""
    global _pool
    _pool = None


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forget)
