"""Notices that the user gets once."""

from __future__ import annotations

import sys

_printed: set[str] = set()


def notice(text: str, about: str | None = None) -> None:
    """Say something on stderr, the first time only.

    Args: about: what it is about, where the same matter may come in different words.
    """
    if (about or text) not in _printed:
        _printed.add(about or text)
        print(f"condyle: {text}", file=sys.stderr)
