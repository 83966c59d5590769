"""The platform point that a motion or load refers to: named, by its coordinates, or by default."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from ..errors import InputError, brief, did_you_mean, quoted
from ..mechanism.mechanism import Mechanism
from ..mechanism.quantities import LONGEST

DEFAULT_LANDMARK = "incisor"
DEFAULT_LOAD_POINT = "right_molar"
LOAD_POINT = "load_point"  # of coordinates


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


def load_place(given: Any, points: Mapping[str, Any]) -> np.ndarray:
    """Where a load acts, (3,) [m] in {M}: a point by its name, or coordinates "0.08,0.02,-0.03";
    of several, separated by ";", the middle, where equal parts of it have its resultant.

    Raises: InputError: as of `resolve_load_point`, and for coordinates that are none.
    """
    several = given.split(";") if isinstance(given, str) else [given]
    return np.mean([_place(one, points) for one in several], axis=0)


def _place(given: Any, points: Mapping[str, Any]) -> np.ndarray:
    name = given.strip() if isinstance(given, str) else given
    if not isinstance(name, str) or "," not in name or name in points:
        return np.array(points[resolve_load_point(name, points)], dtype=float)
    try:
        place = np.array([float(number) for number in name.split(",")])
    except ValueError:
        place = np.empty(0)
    if len(place) != 3 or not (np.abs(place) <= LONGEST).all():
        raise InputError(
            f"load point {brief(name)}: expected the name of a platform point, or three numbers in "
            f'{{M}} [m] of at most {LONGEST:g}, such as "0.08,0.02,-0.03"; several are separated '
            'by ";"'
        )
    return place


def with_load_point(mechanism: Mechanism, given: str | None) -> tuple[Mechanism, str | None]:
    """A mechanism that has the point where a load acts, and its name.

    That is the mechanism itself, unless coordinates or several points are given, as of
    `load_place`: then it has a point more, `load_point`, or the one of this kind that is there.

    Raises: InputError: as of `load_place`.
    """
    points = mechanism.platform.points
    if not isinstance(given, str) or given in points or not {*",;"} & {*given}:
        return mechanism, given
    place, name, k = load_place(given, points), LOAD_POINT, 1
    while name in points:
        if (np.array(points[name]) == place).all():
            return mechanism, name
        k += 1
        name = f"{LOAD_POINT}_{k}"
    return mechanism.set(f"platform.points.{name}", tuple(place.tolist())), name


def _resolve(name: str | None, points: Iterable[str], default: str, what: str, option: str) -> str:
    points = list(points)
    if name is not None and (not isinstance(name, str) or name not in points):
        got = f'"{name}"' if isinstance(name, str) else brief(name)
        raise InputError(f"the mechanism has no {what} {got}.{did_you_mean(name, points)}")
    if name is not None or default in points or len(points) == 1:
        return name or (default if default in points else points[0])
    there = f"choose one of {quoted(points)}" if points else "give it some in platform.points"
    has = f"{len(points)} points" if points else "no points"
    raise InputError(f"no {what} is named, and the platform has {has}; {there} with {option}")
