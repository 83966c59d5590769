"""Names and cells of strangers' files, as they may stand in a message."""

from __future__ import annotations

from collections.abc import Iterable

from ..errors import nearest

SHOWN = 10  # names in a message; of more, the count is told


def printable(text: str) -> str:
    """`text` with control characters written out (a terminal obeys them)."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)


def short(text: str) -> str:
    """The beginning of `text`, fit for a message."""
    return printable(text if len(text) <= 40 else text[:37] + "...")


def listed(names: Iterable[str], quote: str = '"') -> str:
    """'"a", "b"', or the first ten and how many more there are."""
    names = list(names)
    shown = ", ".join(f"{quote}{short(name)}{quote}" for name in names[:SHOWN])
    return shown if len(names) <= SHOWN else f"{shown} and {len(names) - SHOWN} more"


def columns_are(names: Iterable[str]) -> str:
    """'column "a" is', 'columns "a", "b" are'."""
    names = list(names)
    return f"column {listed(names)} is" if len(names) == 1 else f"columns {listed(names)} are"


def guess(name: str, available: Iterable[str]) -> str:
    """' Did you mean "x"? Available: ...', short however many there are."""
    choices = sorted(available)
    near = nearest(name[:100], choices) if len(choices) <= 1000 else []
    meant = f' Did you mean "{short(near[0])}"?' if near else ""
    return f"{meant} Available: {listed(choices, '')}." if choices else " None is available."
