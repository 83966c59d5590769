"""Names of a mechanism file in the texts of other languages: one function for each syntax.

A name may hold anything that prints, but commas, semicolons and double quotes. Here it says nothing
in the language that it stands in: it ends no comment and no string, and closes no element.
"""

from __future__ import annotations

import keyword
import re
from collections.abc import Callable, Iterable, Mapping
from importlib.resources import files
from xml.sax.saxutils import escape

import numpy as np

# Words of C and C++ that no variable can be called.
_C = """
auto break case char const continue default do double else enum extern float for goto if inline
int long register restrict return short signed sizeof static struct switch typedef union
unsigned void volatile while and asm bool catch class delete explicit export false friend
mutable namespace new not operator or private protected public template this throw true try
typename using virtual xor
"""
RESERVED = frozenset(_C.split()) | frozenset(word.lower() for word in keyword.kwlist)


def identifier(name: str) -> str:
    """A name with `_` in the place of what C does not take."""
    text = re.sub(r"[^A-Za-z0-9_]", "_", name).lstrip("_") or "x"
    if text[0].isdigit():
        text = f"n{text}"
    return f"{text}_" if text in RESERVED else text


def identifiers(names: Iterable[str], taken: Iterable[str] = ()) -> dict[str, str]:
    """Names to identifiers, no two alike, in any case of letters. Args: taken: by other things."""
    texts, used = dict[str, str](), {name.lower() for name in taken}
    for name in names:
        text, number = identifier(name), 2
        while text.lower() in used:
            text, number = f"{identifier(name)}_{number}", number + 1
        texts[name] = text
        used.add(text.lower())
    return texts


def line_comment(text: str) -> str:
    """A comment of YAML, MATLAB and Make, and of all that end with the line: one line."""
    return "".join(c if c.isprintable() else " " for c in text)


def c_comment(text: str) -> str:
    """A comment of C and C++."""
    return line_comment(text).replace("*/", "* /").replace("/*", "/ *")


def c_string(text: str) -> str:
    """Between double quotes in C and C++."""
    text = line_comment(text).replace("\\", "\\\\").replace('"', '\\"')
    return text.replace("?", "\\?")  # of which two begin a trigraph


def c_format(text: str) -> str:
    """Between double quotes, as part of a format of printf."""
    return c_string(text).replace("%", "%%")


def xml_text(text: str) -> str:
    """Between tags, or between quotes in one."""
    return escape(line_comment(text), {'"': "&quot;"})


def xml_comment(text: str) -> str:
    """A comment's text in XML, which holds no two dashes and ends with none."""
    return re.sub("-(?=-|$)", "- ", line_comment(text))


def python_string(text: str) -> str:
    """Between double quotes, one or three, in Python."""
    return line_comment(text).replace("\\", "\\\\").replace('"', '\\"')


def matlab_string(text: str) -> str:
    """Between single quotes in MATLAB, for a text that TeX's marks set."""
    return re.sub(r"([\\_^{}])", r"\\\1", line_comment(text)).replace("'", "''")


def markdown(text: str) -> str:
    """Text within a paragraph of Markdown."""
    return re.sub(r"([\\`*_\[\]<>|&!])", r"\\\1", line_comment(text))


def literal(x: float, precision: str) -> str:
    """A number in C."""
    if not np.isfinite(x):
        name = "NAN" if np.isnan(x) else "INFINITY" if x > 0 else "-INFINITY"
        return f"({precision}){name}"
    return repr(float(x)) if precision == "double" else f"{float(np.float32(x))!r}f"


def packaged(name: str) -> str:
    """The text of a file of this folder."""
    return (files(__package__) / name).read_text(encoding="utf-8")


# How files speak of a mechanism, by their endings: in comments, or as text.
PROSE: dict[str, Callable[[str], str]] = {
    **dict.fromkeys(("c", "h", "cpp", "hpp"), c_comment),
    **dict.fromkeys(("yaml", "txt"), line_comment),
    "xml": xml_text,
    "urdf": xml_comment,
    "py": python_string,
    "md": markdown,
}


def filled(text: str, words: Mapping[str, object]) -> str:
    """A text with words in the place of their names between two @, which are not filled again."""
    return re.sub(r"@(\w+)@", lambda found: str(words[found[1]]), text)


def file_text(
    file: str, template: str, words: Mapping[str, object], names: Mapping[str, str]
) -> str:
    """The text of a file, from its template in this folder.

    Args: names: further words, from a mechanism file: in the syntax of the file's prose.
    """
    prose = PROSE[file.rpartition(".")[2]]
    known = {**words, **{key: prose(name) for key, name in names.items()}}
    return filled(packaged(template), known)
