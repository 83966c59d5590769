"""Docstrings as tables: gives mkdocstrings the arguments, results and errors of this house's form.

The house writes sections in few lines; the tables of the site want one entry a name:

    Args:   q, q1: (N, m) each [m, rad]; flag: keep failed samples.
    Raises: InputError: if they do not fit.
"""

from __future__ import annotations

import re
from collections.abc import Collection
from typing import Any

from griffe import Extension

SECTION = re.compile(r"^(Args|Returns|Raises|Attributes):[ \t]*(.*)$")
ENTRY = re.compile(r"(?:^|\n|;)\s*(\w+(?:,\s+\w+)*):\s")
NAMES = re.compile(r"^(\w+(?:, \w+)*):\s+\S")


class HouseDocstrings(Extension):
    """Rewrites docstrings as they are read, into the form called google."""

    def on_function(self, *, func: Any, **_: Any) -> None:
        known = [p.name for p in func.parameters if p.name not in ("self", "cls")]
        if func.docstring:
            func.docstring.value = house_to_google(func.docstring.value, known, complete=True)

    def on_class(self, *, cls: Any, **_: Any) -> None:
        if cls.docstring:
            known = [name for name, member in cls.members.items() if member.is_attribute]
            cls.docstring.value = house_to_google(headed(cls.docstring.value, known), known)


def house_to_google(text: str, known: Collection[str], complete: bool = False) -> str:
    """A docstring whose sections have one entry a name; `complete` lists every known one."""
    parts = sections(text)
    if complete and known and all(title != "Args" for title, _ in parts):
        parts.insert(1, ("Args", ""))
    written = []
    for title, body in parts:
        if title == "":
            written.append(body)
        elif title == "Returns":
            written.append(f"Returns:\n    {' '.join(body.split())}")
        else:
            before, found = entries(body, None if title == "Raises" else known)
            if before:  # what holds for all of them
                written.append(f"{title}: {before}.")
            if title == "Args" and complete:
                found = {name: found.get(name, "") for name in known}
            lines = [f"    {name}: {what or '&nbsp;'}" for name, what in found.items()]
            written.append("\n".join([f"{title}:", *lines]))
    return "\n\n".join(piece for piece in written if piece)


def sections(text: str) -> list[tuple[str, str]]:
    """Title and body of each section; the first has no title."""
    found: list[tuple[str, list[str]]] = [("", [])]
    for line in text.splitlines():
        if head := SECTION.match(line):
            found.append((head[1], [head[2]]))
        elif found[-1][0] and line and not line[0].isspace():
            found.append(("", [line]))
        else:
            found[-1][1].append(line)
    return [(title, "\n".join(lines).strip("\n")) for title, lines in found]


def entries(body: str, known: Collection[str] | None) -> tuple[str, dict[str, str]]:
    """What stands before the first name, and name -> text, of `before; name, name: text`."""
    starts = [
        m
        for m in ENTRY.finditer(body)
        if known is None or all(name in known for name in re.split(r",\s+", m[1]))
    ]
    found: dict[str, str] = {}
    for i, start in enumerate(starts):
        end = starts[i + 1].start() if i + 1 < len(starts) else len(body)
        what = " ".join(body[start.end() : end].split()).rstrip(";")
        found |= dict.fromkeys(re.split(r",\s+", start[1]), what)
    before = body[: starts[0].start()] if starts else body
    return " ".join(before.split()).rstrip(".;"), found


def headed(text: str, known: Collection[str]) -> str:
    """A class's docstring with a title above the lines that name its attributes."""
    lines = text.splitlines()
    for i, line in enumerate(lines):
        found = NAMES.match(line)
        if found and all(name in known for name in found[1].split(", ")):
            body = [f"    {rest}" for rest in lines[i:]]
            return "\n".join([*lines[:i], "Attributes:", *body])
    return text
