"""Registration: where the mechanism's frame {S} is in the laboratory when it is at home."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from ..errors import InputError, did_you_mean
from ..mechanism.mechanism import Mechanism
from .marker_file import ORIGIN, MarkerFile, Place
from .rigid import FLATTEST, breadth, fit, orders

_ALONG = 0.999  # cosine between forward and up, above which they are one direction
_BETTER = 1 / 2  # of the misfit, with names exchanged, so that it is said
_SMALL = 0.02  # of the points' size: a misfit that names no exchange
_FAR = 5e-3  # m, residual of a point beyond which it is named
_ODD, _NOTABLE = 3.0, 2e-3  # and beyond this multiple of the median, if it is as large [m]


@dataclass(frozen=True, eq=False)
class Registration:
    """s = rotation x + position: from the laboratory at home, x, to {S}.

    Attributes: rotation: (3, 3);  position: (3,) [m].
                residual: distance of each point given from its place in the mechanism [m]; empty
                    where directions were given.
                sized: the same where the points may have another size;  size: that of the mechanism
                    over theirs.
                warnings: implausible values.
                typed: points that were given as numbers.
    """

    rotation: np.ndarray
    position: np.ndarray
    residual: dict[str, float]
    sized: dict[str, float] = field(default_factory=dict)
    size: float = 1.0
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
    *,
    any_size: bool = False,
) -> Registration:
    """The registration that a marker file asks for.

    Args:   place: (3,) [m] in the laboratory at home, of what the file says, for the key named.
            any_size: the mechanism will be scaled: warnings are of residuals in any size.
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
    rotation, position, size, off, sized = _nearest(there, here)
    residual, in_size = (dict(zip(file.places, v.tolist(), strict=True)) for v in (off, sized))
    typed = tuple(name for name, value in file.places.items() if not isinstance(value, str))
    said = _exchanged(there, here, [*file.places]) + _far(in_size if any_size else residual)
    return Registration(rotation, position, residual, in_size, size, said, typed)


class _Nearest(NamedTuple):
    """The rigid motion of points, (n, 3), nearest to others, and the residuals of each, (n,)."""

    rotation: np.ndarray
    position: np.ndarray
    size: float
    residual: np.ndarray
    sized: np.ndarray

    @property
    def misfit(self) -> float:
        """Root mean square of the residuals in the size that fits best [m]."""
        return float(np.sqrt(np.mean(self.sized**2)))


def _nearest(there: np.ndarray, here: np.ndarray) -> _Nearest:
    """Points in the laboratory onto those of the mechanism; the turn is the same in any size."""
    motion = fit(there, here[None])
    R = motion.rotation[0]
    turned, target = (there - there.mean(axis=0)) @ R.T, here - here.mean(axis=0)
    size = float((turned * target).sum() / (turned * turned).sum())
    sized = np.linalg.norm(size * turned - target, axis=1)
    return _Nearest(R, motion.position[0], size, motion.residual[0], sized)


def _exchanged(there: np.ndarray, here: np.ndarray, names: list[str]) -> tuple[str, ...]:
    """A warning, where the points would fit much better with their names exchanged.

    In any size, since a person's is another than the mechanism's.
    """
    tried = orders([len(names)])
    misfit = [_nearest(there[order], here).misfit for order in tried]
    best = int(np.argmin(misfit))
    size = float(np.sqrt(((here - here.mean(axis=0)) ** 2).sum(axis=1).mean()))
    if misfit[best] > _BETTER * misfit[0] or misfit[0] < _SMALL * size:
        return ()
    moved = [f"{names[i]} at {names[k]}" for i, k in enumerate(tried[best]) if i != k]
    return (
        f"register: the points fit much better with their places exchanged ({', '.join(moved)}): "
        f"{misfit[best] * 1e3:.3g} in place of {misfit[0] * 1e3:.3g} mm RMS in any size",
    )


def _far(residual: Mapping[str, float]) -> tuple[str, ...]:
    """A warning that names points far from their places in the mechanism."""
    median = float(np.median([*residual.values()]))
    off = {n: r for n, r in residual.items() if r > _FAR or r > max(_ODD * median, _NOTABLE)}
    if not off:
        return ()
    said = ", ".join(f"{n} {r * 1e3:.3g} mm" for n, r in off.items())
    return (
        f"register: far from their places in the mechanism: {said} (median of all points "
        f"{median * 1e3:.3g} mm); check their names and places, or scale the mechanism to the "
        "person ([scale] of a session)",
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
