"""Registration: where the mechanism's frame {S} is in the laboratory when it is at home."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import permutations

import numpy as np

from ..errors import InputError, did_you_mean
from ..mechanism.mechanism import Mechanism
from .marker_file import ORIGIN, MarkerFile, Place
from .rigid import FLATTEST, breadth, fit

_ALONG = 0.999  # cosine between forward and up, above which they are one direction
_BETTER = 1 / 3  # of the misfit, with names exchanged, so that it is said
_MANY = 6  # maximum number of points whose orders are all tried


@dataclass(frozen=True, eq=False)
class Registration:
    """s = rotation x + position: from the laboratory at home, x, to {S}.

    Attributes: rotation: (3, 3);  position: (3,) [m].
                residual: distance of each point given from its place in the mechanism [m]; empty
                    where directions were given.
                warnings: implausible values.
                typed: points that were given as numbers.
    """

    rotation: np.ndarray
    position: np.ndarray
    residual: dict[str, float]
    warnings: tuple[str, ...] = ()
    typed: tuple[str, ...] = ()

    def to_base(self, points: np.ndarray) -> np.ndarray:
        """Points of the laboratory at home, (..., 3), in {S}."""
        return points @ self.rotation.T + self.position

    def pose(self, rotation: np.ndarray, position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """R of {M} in {S}, (F, 3, 3), and O_M, (F, 3) [m], of motions in the laboratory.

        A motion x -> R x + p is s -> (A R A^T) (s - b) + A p + b there; O_M is s = 0 at home.
        """
        A, b = self.rotation, self.position
        turned = A @ rotation @ A.T
        return turned, position @ A.T + b - turned @ b


def register(
    file: MarkerFile,
    mechanism: Mechanism,
    place: Callable[[Place, str], np.ndarray],
) -> Registration:
    """The registration that a marker file asks for.

    Args:   place: (3,) [m] in the laboratory at home, of what the file says, for the key named.
    Raises: InputError: for points that the mechanism does not have, or that are on a line.
    """
    if file.directed:
        return _by_directions(file.places, mechanism, place)
    here = np.array([_point(name, mechanism) for name in file.places])
    there = np.array([place(value, name) for name, value in file.places.items()])
    for what, some in (("in the laboratory", there), ("in the mechanism", here)):
        if breadth(some - some.mean(axis=0)) < FLATTEST:
            raise InputError(
                f"register: {', '.join(file.places)} are on one line {what}; a third point must "
                "be off it"
            )
    found = fit(there, here[None])
    residual = dict(zip(file.places, found.residual[0].tolist(), strict=True))
    typed = tuple(name for name, value in file.places.items() if not isinstance(value, str))
    said = _exchanged(there, here, [*file.places])
    return Registration(found.rotation[0], found.position[0], residual, said, typed)


def _exchanged(there: np.ndarray, here: np.ndarray, names: list[str]) -> tuple[str, ...]:
    """A warning, where the points would fit much better with their names exchanged."""
    if len(names) > _MANY:
        return ()
    orders = [list(order) for order in permutations(range(len(names)))]
    misfit = [float(np.linalg.norm(fit(there[order], here[None]).residual)) for order in orders]
    best = int(np.argmin(misfit))
    size = float(np.linalg.norm(here - here.mean(axis=0)))
    if misfit[best] > _BETTER * misfit[0] or misfit[0] < 0.02 * size:
        return ()
    moved = [f"{names[i]} at {names[k]}" for i, k in enumerate(orders[best]) if i != k]
    return (
        f"register: the points fit much better with their places exchanged ({', '.join(moved)}): "
        f"{misfit[best] * 1e3:.3g} in place of {misfit[0] * 1e3:.3g} mm",
    )


def _by_directions(
    places: Mapping[str, Place],
    mechanism: Mechanism,
    place: Callable[[Place, str], np.ndarray],
) -> Registration:
    """X of {S} along `forward` as far as it is square to `up`, Z along `up`."""
    forward, up = (np.array(places[name], dtype=float) for name in ("forward", "up"))
    forward, up = forward / np.linalg.norm(forward), up / np.linalg.norm(up)
    if abs(forward @ up) > _ALONG:
        raise InputError("register: forward and up are along one line; expected them square")
    x = forward - (forward @ up) * up
    x /= np.linalg.norm(x)
    rotation = np.array([x, np.cross(up, x), up])
    origin, name = np.zeros(3), places[ORIGIN]
    if isinstance(name, str):
        origin = _point(name, mechanism)
    where = places.get(name, name) if isinstance(name, str) else name
    return Registration(rotation, origin - rotation @ place(where, ORIGIN), {})


def _point(name: str, mechanism: Mechanism) -> np.ndarray:
    """A contact's ball centre or a landmark, (3,) [m] in {M}."""
    points = {c.name: c.point for c in mechanism.contacts} | mechanism.platform.points
    if name not in points:
        known = did_you_mean(name, points)
        raise InputError(f'register: "{mechanism.name}" has no point or contact "{name}".{known}')
    return np.array(points[name])
