"""Names of a mechanism file as C takes them."""

from __future__ import annotations

import keyword
import re
from collections.abc import Iterable

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
_WORD = re.compile(r"[A-Za-z][A-Za-z0-9_]*")


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


def require_prefix(prefix: str) -> str:
    """Raises InputError for what no name in C can begin with."""
    taken = prefix.lower() in OTHERS
    if not _WORD.fullmatch(prefix) or prefix in RESERVED or len(prefix) > 40 or taken:
        raise InputError(
            f'prefix "{prefix:.60}": expected a name that C takes, of at most 40 letters, digits '
            f"and _, a letter first, other than {', '.join(OTHERS)}"
        )
    return prefix
