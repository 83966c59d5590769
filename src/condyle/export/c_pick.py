"""The part of a C text that something needs: its functions, types and macros by name."""

from __future__ import annotations

import re
from collections.abc import Iterator

_WORD = re.compile(r"[A-Za-z_]\w*")
_DEFINED = re.compile(r"^\s*(?:#define\s+(\w+)|INLINE[^(]*?(\w+)\(|static[^(]*?(\w+)\()", re.M)
_MACHINE = re.compile(r"^(ONE_ARGUMENT|TWO_ARGUMENTS)\((\w+)", re.M)


def picked(text: str, wanted: str) -> str:
    """What the code `wanted` uses of `text`, directly or not; what defines nothing stays."""
    known = set(_WORD.findall(wanted))
    kept = []
    for item in reversed(list(_items(text))):
        names = _names(item)
        if names and not names & known:
            continue
        known |= set(_WORD.findall(item))
        kept.append(item)
    return "\n".join(reversed(kept)) + "\n"


def used(text: str, names: str) -> list[str]:
    """Those of some words that stand in a text."""
    words = set(_WORD.findall(text))
    return [name for name in names.split() if name in words]


def _names(item: str) -> set[str]:
    found = {name for match in _DEFINED.findall(item) for name in match if name}
    for _, name in _MACHINE.findall(item):
        found |= {f"{name}_s", f"{name}_v"}
    return found


def _items(text: str) -> Iterator[str]:
    """Definitions with the comments above them; a conditional part is one."""
    lines: list[str] = []
    conditionals = brackets = 0
    comment = False
    for line in text.splitlines():
        if not (line.strip() or conditionals or brackets):
            if lines:
                yield "\n".join(lines)
            lines = []
            continue
        lines.append(line)
        conditionals += line.startswith("#if") - line.startswith("#endif")
        code = re.sub(r"/\*.*?\*/", "", line)
        if comment:
            code = code.partition("*/")[2]
        comment = "/*" in code or (comment and "*/" not in line)
        code = code.partition("/*")[0]
        brackets += sum(code.count(b) for b in "({[") - sum(code.count(b) for b in ")}]")
        if code.strip() and not (conditionals or brackets or comment or code.endswith("\\")):
            yield "\n".join(lines)
            lines = []
    if lines:
        yield "\n".join(lines)
