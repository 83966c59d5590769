"""What names in C begin with, and what a text in C defines and uses."""

from __future__ import annotations

import re
from collections.abc import Iterator

from ..backends.c.emit import text
from ..errors import InputError
from .syntax import RESERVED, identifier, packaged

OTHERS = ("main", "check", "checker", "example")  # files of an exported folder besides
# Headers that sources include, and what is called so in an FMU.
_HEADERS = """assert complex ctype errno fenv inttypes limits locale math matrix mex setjmp signal
stdarg stdbool stddef stdint stdio stdlib string time fmu model"""
PREFIX_LENGTH = 40  # letters of a prefix
_WORD = re.compile(r"[A-Za-z_]\w*")
_DEFINED = re.compile(r"^\s*(?:#define\s+(\w+)|INLINE[^(]*?(\w+)\(|static[^(]*?(\w+)\()", re.M)
_MACHINE = re.compile(r"^(ONE_ARGUMENT|TWO_ARGUMENTS)\((\w+)", re.M)


def scalar_functions() -> str:
    """The operations of graphs on `real`."""
    return text("functions.h") + packaged("c_scalar.h")


def default_prefix(name: str, longest: int = PREFIX_LENGTH) -> str:
    """What names in C begin with where none is given. Args: name: of a mechanism."""
    own = identifier(name.lower())[:longest]
    return f"{own}_" if own in (*OTHERS, *_HEADERS.split(), *RESERVED) else own


def require_prefix(prefix: str) -> str:
    """Raises InputError for a prefix that C does not allow."""
    fits = re.fullmatch(f"[A-Za-z][A-Za-z0-9_]{{0,{PREFIX_LENGTH - 1}}}", str(prefix))
    if not fits or prefix in RESERVED or prefix.lower() in OTHERS:
        raise InputError(
            f'prefix "{prefix!s:.60}": expected a name that C takes, of at most 40 letters, digits '
            f"and _, a letter first, other than {', '.join(OTHERS)}"
        )
    return prefix


def picked(text: str, wanted: str) -> str:
    """What the code `wanted` uses of `text`, directly or not; what defines nothing stays."""
    known = set(_WORD.findall(wanted))
    needed = []
    for item in reversed(list(_items(text))):
        names = _names(item)
        if names and not names & known:
            continue
        known |= set(_WORD.findall(item))
        needed.append(item)
    return "\n".join(reversed(needed)) + "\n"


def used(text: str, names: str) -> list[str]:
    """The words of a list that stand in a text."""
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
