"""The mechanisms that come with the package, and the starter of `condyle new`."""

from __future__ import annotations

from importlib.resources import files

from ..errors import InputError, did_you_mean, shown

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
            f"name: no bundled mechanism is called {shown(name)}.{did_you_mean(name, known)}"
        )
    return (_BUNDLED / f"{name}.toml").read_text(encoding="utf-8")


def starter_text(name: str) -> str:
    """A complete, commented mechanism file for a mechanism called `name`."""
    return (files(__package__) / "starter.toml").read_text(encoding="utf-8").replace("NAME", name)
