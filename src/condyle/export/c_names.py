"""Names: of a mechanism file as C takes them, and what a C text defines and uses."""

from __future__ import annotations

import keyword
import re
from collections.abc import Iterable, Iterator, Mapping
from importlib.resources import files

import numpy as np

from ..backends.c.emit import text
from ..errors import InputError

# Words of C and C++ that no variable can be called.
_C = """
auto break case char const continue default do double else enum extern float for goto if inline
int long register restrict return short signed sizeof static struct switch typedef union
unsigned void volatile while and asm bool catch class delete explicit export false friend
mutable namespace new not operator or private protected public template this throw true try
typename using virtual xor
"""
RESERVED = frozenset(_C.split()) | frozenset(word.lower() for word in keyword.kwlist)
OTHERS = ("main", "check", "checker", "example")  # files of an exported folder besides
_WORD = re.compile(r"[A-Za-z_]\w*")
_DEFINED = re.compile(r"^\s*(?:#define\s+(\w+)|INLINE[^(]*?(\w+)\(|static[^(]*?(\w+)\()", re.M)
_MACHINE = re.compile(r"^(ONE_ARGUMENT|TWO_ARGUMENTS)\((\w+)", re.M)


def identifier(name: str) -> str:
    """A name with `_` in the place of what C does not take."""
    text = re.sub(r"[^A-Za-z0-9_]", "_", name).lstrip("_") or "x"
    if text[0].isdigit():
        text = f"n{text}"
    return f"{text}_" if text in RESERVED else text


def identifiers(names: Iterable[str]) -> dict[str, str]:
    """Names to identifiers, no two alike, in any case of letters."""
    found: dict[str, str] = {}
    for name in names:
        text, number = identifier(name), 2
        while text.lower() in {known.lower() for known in found.values()}:
            text, number = f"{identifier(name)}_{number}", number + 1
        found[name] = text
    return found


def in_comment(text: str) -> str:
    """Text of a file, such as a name, that ends no comment of C's."""
    return text.replace("*/", "* /").replace("/*", "/ *")


def in_format(text: str) -> str:
    """Text of a file as part of a format of printf, within quotes."""
    return text.replace("\\", "\\\\").replace('"', '\\"').replace("%", "%%").replace("?", "\\?")


def literal(x: float, precision: str) -> str:
    """A number in C."""
    if not np.isfinite(x):
        name = "NAN" if np.isnan(x) else "INFINITY" if x > 0 else "-INFINITY"
        return f"({precision}){name}"
    return repr(float(x)) if precision == "double" else f"{float(np.float32(x))!r}f"


def packaged(name: str) -> str:
    """The text of a file of this folder."""
    return (files(__package__) / name).read_text(encoding="utf-8")


def filled(text: str, words: Mapping[str, object]) -> str:
    """A text with words in the place of their names between two @."""
    for name, word in words.items():
        text = text.replace(f"@{name}@", str(word))
    return text


def scalar_functions() -> str:
    """The operations of graphs on `real`."""
    return text("functions.h") + packaged("c_scalar.h")


def require_prefix(prefix: str) -> str:
    """Raises InputError for a prefix that C does not allow."""
    fits = re.fullmatch("[A-Za-z][A-Za-z0-9_]{0,39}", str(prefix))
    if not fits or prefix in RESERVED or prefix.lower() in OTHERS:
        raise InputError(
            f'prefix "{prefix!s:.60}": expected a name that C takes, of at most 40 letters, digits '
            f"and _, a letter first, other than {', '.join(OTHERS)}"
        )
    return prefix


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
