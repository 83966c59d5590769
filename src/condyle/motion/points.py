"""The platform point that a motion or load refers to, named or by default."""

from __future__ import annotations

from collections.abc import Iterable

from ..errors import InputError, did_you_mean, quoted, shown

DEFAULT_LANDMARK = "incisor"
DEFAULT_LOAD_POINT = "right_molar"


def resolve_landmark(name: str | None, points: Iterable[str]) -> str:
    """The point whose path a motion gives: the one named, `incisor`, or the only one there is.

    Raises: InputError: if there is no such point, or none was named of several.
    """
    return _resolve(name, points, DEFAULT_LANDMARK, "landmark", "--landmark (landmark=...)")


def resolve_load_point(name: str | None, points: Iterable[str]) -> str:
    """The point a load acts at: the one named, `right_molar`, or the only one there is.

    Raises: InputError: as of `resolve_landmark`.
    """
    return _resolve(name, points, DEFAULT_LOAD_POINT, "load point", "--load-point (load_point=...)")


def _resolve(name: str | None, points: Iterable[str], default: str, what: str, option: str) -> str:
    points = list(points)
    if name is not None and (not isinstance(name, str) or name not in points):
        got = f'"{name}"' if isinstance(name, str) else shown(name)
        raise InputError(f"the mechanism has no {what} {got}.{did_you_mean(name, points)}")
    if name is not None or default in points or len(points) == 1:
        return name or (default if default in points else points[0])
    there = f"choose one of {quoted(points)}" if points else "give it some in platform.points"
    has = f"{len(points)} points" if points else "no points"
    raise InputError(f"no {what} is named, and the platform has {has}; {there} with {option}")
