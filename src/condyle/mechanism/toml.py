"""The tables of a TOML file, whatever the file is."""

from __future__ import annotations

import os
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..errors import InputError, as_path, brief, did_you_mean, shortened
from ..files.limits import KEY_PARTS, NESTING, TOML
from ..files.reading import text_of
from .library import bundled_mechanisms, bundled_text

_EXPECTED = "the path of a mechanism file or the name of a bundled mechanism"
_PART = r"""(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+"""
_DOTTED = re.compile(rf"(?<![\w-])(?:{_PART}\.[ \t]*+){{{KEY_PARTS.most}}}")


def read_text(source: str | os.PathLike[str]) -> str:
    """The text of a mechanism file or of a bundled mechanism.

    Raises: InputError: if there is no such file, or it is no text of a sensible length.
    """
    source = as_path(source, "mechanism", _EXPECTED)
    if source in bundled_mechanisms() and not os.path.isfile(source):
        return bundled_text(source)
    if not os.path.exists(source):
        near = {path.name for path in Path(source).parent.glob("*.toml")}
        raise InputError(
            f"mechanism file {shortened(source, 200)} does not exist, and no bundled mechanism has "
            "that name." + did_you_mean(Path(source).name, {*bundled_mechanisms(), *near})
        )
    return text_of(source, TOML)


def read_tables(text: str, source: str) -> dict[str, Any]:
    """The tables of a file as TOML gives them; `source` names it in messages.

    Raises: InputError: if the text is not TOML, or nests deeper than Python can follow.
    """
    if not isinstance(text, str):
        raise InputError(f"{source}: expected the text of a mechanism file, got {brief(text)}")
    TOML.check(len(text), source)
    if _DOTTED.search(text):
        raise too_deep(source)
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{source} is not TOML: {shortened(str(error), 300)}") from None
    except ValueError:  # more digits than Python reads
        raise InputError(f"{source}: an integer has thousands of digits") from None
    except RecursionError:
        raise too_deep(source) from None


def too_deep(source: str) -> InputError:
    return InputError(
        f"{source}: tables or lists are nested more than {NESTING.most} deep (limit NESTING); a "
        "mechanism needs six"
    )


def nests_too_deep(data: Any) -> bool:
    """Whether tables and lists are nested deeper than any mechanism needs."""
    waiting = [(1, data)]
    while waiting:
        depth, node = waiting.pop()
        if depth > NESTING.most:
            return True
        inner = node.values() if isinstance(node, Mapping) else node
        waiting += [(depth + 1, n) for n in inner if isinstance(n, Mapping | list | tuple)]
    return False
