"""The mechanisms that come with the package, and the starter of `condyle new`."""

from __future__ import annotations

import re
from importlib.resources import files

from ..errors import InputError, brief, did_you_mean

_BUNDLED = files(__package__) / "bundled"


def bundled_mechanisms() -> tuple[str, ...]:
    """Names of the mechanisms that come with the package."""
    return tuple(sorted(f.name[:-5] for f in _BUNDLED.iterdir() if f.name.endswith(".toml")))


def bundled_text(name: str) -> str:
    """The file of a bundled mechanism, with its comments and provenance marks.

    Raises: InputError: if no bundled mechanism has that name.
    """
    known = bundled_mechanisms()
    if name not in known:
        raise InputError(
            f"name: no bundled mechanism is called {brief(name)}.{did_you_mean(name, known)}"
        )
    return (_BUNDLED / f"{name}.toml").read_text(encoding="utf-8")


def bundled_machine(word: str) -> str:
    """A bundled mechanism by its name or a word of it: jaw is human-jaw, whose name others extend.

    Raises: InputError: if no bundled mechanism has that word in its name.
    """
    known = bundled_mechanisms()
    named = [name for name in known if word == name or word in name.split("-")]
    if not named:
        hint = did_you_mean(word, known)
        raise InputError(f"from_bundled: no bundled mechanism is called {brief(word)}.{hint}")
    return min(named, key=lambda name: (-sum(one.startswith(name) for one in known), len(name)))


def copied_text(machine: str, name: str) -> str:
    """The file of a bundled mechanism, with its comments, for a mechanism called `name`."""
    return re.sub(r'^name = ".*"$', f'name = "{name}"', bundled_text(machine), count=1, flags=re.M)


def first_sentence(text: str) -> str:
    """The first sentence of the comment a file begins with, without its end."""
    head = re.match(r"(?:# .*\n)+", text)
    words = " ".join(line[2:] for line in head[0].splitlines()) if head else ""
    return re.split(r"[.;](?:\s|$)", words, maxsplit=1)[0]


def starter_text(name: str) -> str:
    """A complete, commented mechanism file for a mechanism called `name`."""
    return (files(__package__) / "starter.toml").read_text(encoding="utf-8").replace("NAME", name)
