"""How many threads work on a batch."""

from __future__ import annotations

import os

from ..errors import InputError


def workers(threads: int | None) -> int:
    """As many threads as asked for; by default the processors that this process may use.

    Raises: InputError: for a number below 1.
    """
    if threads is not None:
        if threads < 1:
            raise InputError(f"threads is {threads}; expected 1 or more, or None for all there are")
        return threads
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
