"""Things the user is told once."""

from __future__ import annotations

import sys

_said: set[str] = set()


def notice(text: str) -> None:
    """Say something on stderr, the first time only."""
    if text not in _said:
        _said.add(text)
        print(f"condyle: {text}", file=sys.stderr)
