"""A mechanism scaled to another subject: its points moved as landmarks are, masses with them.

affine      x -> b + A x + d |y|: one affine map for each side of the plane Y = 0, continuous
            there, where landmarks determine both sides; else d = 0, one map for both
thin_plate  x -> b + A x + sum w_i |x - p_i|, sum w_i = 0, sum w_i p_i^T = 0: through every
            landmark, with the least bending (Bookstein, IEEE PAMI 11, 1989, in space)
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import InputError, UnsupportedError, did_you_mean, few
from .bodies import Inertia, distance
from .contact import Contact
from .mechanism import Mechanism

KINDS = ("affine", "thin_plate")
FEWEST = 4  # landmarks, not in one plane
_FLAT = 0.02  # smallest over largest singular value of landmarks that determine a map
_ODD = 1.5  # factor on a length beyond which landmarks look wrong
_AXES = "XYZ"


@dataclass(frozen=True, eq=False)
class ScaledMechanism:
    """A mechanism scaled to landmarks, and what was scaled.

    Attributes: mechanism: the scaled one.
                kind: of the map: "affine", "affine by side" or "thin_plate".
                stretch: factors on lengths along X, Y and Z at the mass centre, (3,).
                volume: factor on volume and mass.
                residual: distance of each landmark from where the map puts it [m].
                scaled, kept: what was scaled, and what was not, in words.
                warnings: implausible factors.
    """

    mechanism: Mechanism
    kind: str
    stretch: tuple[float, ...]
    volume: float
    residual: dict[str, float]
    scaled: tuple[str, ...]
    kept: tuple[str, ...]
    warnings: tuple[str, ...] = ()

    def __str__(self) -> str:
        factors = ", ".join(f"{a} {s:.4g}" for a, s in zip(_AXES, self.stretch, strict=True))
        off = max(self.residual.values())
        return "\n".join(
            [
                f"Scaled to {len(self.residual)} landmarks ({self.kind}): lengths at the mass "
                f"centre by {factors}, mass by {self.volume:.4g}; landmarks off by "
                f"{off * 1e3:.3g} mm at most",
                f"  scaled: {'; '.join(self.scaled)}",
                f"  not scaled: {'; '.join(self.kept)}",
            ]
        )


def scaled_to(
    mechanism: Mechanism, landmarks: Mapping[str, Any], kind: str = "affine"
) -> ScaledMechanism:
    """A mechanism whose points are where a subject's are.

    All points of platform, contacts and chains go by one map, the mass by its factor on volume,
    the inertia by the second moments of the mapped body. Surfaces move with their contacts and
    keep their shape.

    Args:   landmarks: point or contact -> its place in {S} at home, (3,) [m]; four or more that are
                not in one plane.
            kind: "affine" (by side) or "thin_plate".
    Raises: InputError: for landmarks that are not there, or determine no map.
            UnsupportedError: for chains with bodies, whose masses are no subject's.
            MechanismError: if the scaled numbers are no mechanism.
    """
    if kind not in KINDS:
        raise InputError(f'scale: kind: expected "affine" or "thin_plate", got "{kind}"')
    if solid := [chain.name for chain in mechanism.chains if chain.masses]:
        raise UnsupportedError(
            f"scale: {few(solid)} of {mechanism.name} has bodies of its own, which have no "
            "subject's size; only mechanisms of cables and muscles are scaled"
        )
    there = named_points(mechanism, landmarks)
    here = np.array([landmarks[name] for name in landmarks], dtype=float)
    if here.shape != (len(there), 3) or not np.isfinite(here).all():
        raise InputError("scale: expected three finite coordinates [m] for every landmark")
    warp = _determined(there, here, kind, list(landmarks))
    com = np.array(mechanism.platform.com)
    J, volume = warp.mean_slope(com), warp.volume(com)
    if volume <= 0:
        raise InputError(
            f"scale: the landmarks {few(landmarks)} turn the mechanism inside out; are left and "
            "right, or two of them, exchanged?"
        )
    off = np.linalg.norm(warp(there) - here, axis=1)
    stretch = tuple(float(s) for s in np.linalg.norm(J, axis=0))
    odd = [a for a, s in zip(_AXES, stretch, strict=True) if not 1 / _ODD < s < _ODD]
    return ScaledMechanism(
        mechanism.set(_changes(mechanism, warp, J, volume), keep="home"),
        warp.kind,
        stretch,
        volume,
        dict(zip(landmarks, off.tolist(), strict=True)),
        *_said(mechanism),
        tuple(
            f"scale: lengths along {a} go by {stretch[_AXES.index(a)]:.3g}; check the landmarks' "
            "places and their unit"
            for a in odd
        ),
    )


def named_points(mechanism: Mechanism, names: Mapping[str, Any] | Sequence[str]) -> np.ndarray:
    """Points of the platform and centres of contacts by name, at home, (n, 3) [m].

    Raises: InputError: for a name that is not there.
    """
    points = {c.name: c.point for c in mechanism.contacts} | dict(mechanism.platform.points)
    for name in names:
        if name not in points:
            raise InputError(
                f'scale: "{mechanism.name}" has no point or contact "{name}".'
                f"{did_you_mean(name, points)}"
            )
    return np.array([points[name] for name in names], dtype=float).reshape(len(names), 3)


@dataclass(frozen=True, eq=False)
class _Warp:
    """x -> b + A x + d |y| + sum w_i |x - p_i|, row vectors times matrices."""

    kind: str
    b: np.ndarray
    A: np.ndarray
    d: np.ndarray
    p: np.ndarray
    w: np.ndarray

    def __call__(self, x: Any) -> np.ndarray:
        x = np.asarray(x, dtype=float)
        bent = np.linalg.norm(x[..., None, :] - self.p, axis=-1) @ self.w
        return self.b + x @ self.A.T + np.abs(x[..., 1:2]) * self.d + bent

    def mean_slope(self, x: np.ndarray) -> np.ndarray:
        """dx'/dx at a point, (3, 3), the mean of both sides."""
        lever = x - self.p
        size = np.linalg.norm(lever, axis=1)
        unit = lever / np.where(size > 0, size, 1.0)[:, None]
        return self.A + self.w.T @ unit

    def volume(self, x: np.ndarray) -> float:
        """Factor on volume there; det(A + d e_y^T) is linear in d, so that of the mean slope is
        the mean of both sides."""
        return float(np.linalg.det(self.mean_slope(x)))


def _determined(there: np.ndarray, here: np.ndarray, kind: str, names: list[str]) -> _Warp:
    """The map from landmarks to places.

    Raises: InputError: for too few landmarks, or landmarks in one plane.
    """
    count = len(names)
    if count < FEWEST:
        raise InputError(
            f"scale: landmarks: got {count}, expected {FEWEST} or more that are not in one plane"
        )
    middle = there.mean(axis=0)
    size = float(np.sqrt(((there - middle) ** 2).sum(axis=1).mean()))
    # About the middle and by the size, so that the singular values are those of the shape.
    flat = np.column_stack([np.ones(count), (there - middle) / size])
    if _narrow(flat):
        raise InputError(
            f"scale: the landmarks {few(names)} are in one plane, or nearly; add one off it"
        )
    zeros = np.zeros((count, 3))
    if kind == "thin_plate":
        K = np.linalg.norm(there[:, None] - there, axis=-1)
        system = np.block([[K / size, flat], [flat.T, np.zeros((4, 4))]])
        found = np.linalg.solve(system, np.vstack([here, np.zeros((4, 3))]))
        w, (b, *a) = found[:count] / size, found[count:]
        d, said = np.zeros(3), kind
    else:
        sided = np.column_stack([flat, np.abs(there[:, 1]) / size])
        apart = count > FEWEST and not _narrow(sided)
        (b, *a), *_ = np.linalg.lstsq(sided if apart else flat, here, rcond=None)
        d = a.pop() / size if apart else np.zeros(3)
        w, said = zeros, "affine by side" if apart else kind
    A = np.array(a).T / size
    return _Warp(said, b - A @ middle, A, d, there, w)


def _narrow(columns: np.ndarray) -> bool:
    sigma = np.linalg.svd(columns, compute_uv=False)
    return bool(len(columns) < columns.shape[1] or sigma[-1] < _FLAT * sigma[0])


def _changes(m: Mechanism, warp: _Warp, J: np.ndarray, volume: float) -> dict[str, Any]:
    """Paths of the file with their new values, SI."""
    second = 0.5 * np.trace(I := m.platform.inertia.tensor()) * np.eye(3) - I
    second = volume * J @ second @ J.T
    tensor = np.trace(second) * np.eye(3) - second
    changes: dict[str, Any] = {
        "platform.mass": m.platform.mass * volume,
        "platform.com": warp(m.platform.com).tolist(),
        "platform.inertia": Inertia.entries_of(tensor),
        "platform.points": {name: warp(p).tolist() for name, p in m.platform.points.items()},
    }
    for i, contact in enumerate(m.contacts):
        moved = warp(contact.point)
        changes[f"contact[{i}].point"] = moved.tolist()
        changes |= _moved_bounds(i, contact, moved - contact.point)
    for i, chain in enumerate(m.chains):
        here = f"chain[{i}]"
        for key in ("base", "platform"):
            changes[f"{here}.{key}"] = warp(getattr(chain, key)).tolist()
        if via := getattr(chain, "via", None):
            changes[f"{here}.via"] = warp(via).tolist()
        if (muscle := getattr(chain, "muscle", None)) is not None:
            ratio = _line(warp, chain) / chain.lengths["line"]
            for key in ("optimal_length", "tendon_length"):
                changes[f"{here}.muscle.{key}"] = getattr(muscle, key) * ratio
    for i, ligament in enumerate(m.ligaments):
        ends = ligament.base, ligament.platform
        ratio = distance(*warp(ends)) / distance(*ends)
        changes |= {
            f"ligament[{i}].{key}": warp(end).tolist()
            for key, end in zip(("base", "platform"), ends, strict=True)
        }
        changes[f"ligament[{i}].slack_length"] = ligament.slack_length * ratio
    for i, wall in enumerate(m.walls):  # the gap stays
        moved = warp(wall.point)
        x, y, z = moved - wall.point
        rise = z - np.dot(wall.surface.slope, (x, y))
        changes[f"wall[{i}].point"] = moved.tolist()
        changes[f"wall[{i}].surface.offset"] = float(wall.surface.offset + rise)
    return changes


def _line(warp: Any, chain: Any) -> float:
    """Length of a chain's line at home, mapped, over its via points [m]."""
    points = warp(np.array([chain.base, *(getattr(chain, "via", None) or ()), chain.platform]))
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())


def _moved_bounds(i: int, contact: Contact, by: np.ndarray) -> dict[str, Any]:
    """The bounds of a contact, moved with it."""
    found = {}
    for axis, shift in zip("xyz", by, strict=True):
        if (bound := getattr(contact.bounds, axis)) is not None:
            found[f"contact[{i}].bounds.{axis}"] = [float(end + shift) for end in bound]
    return found


def _said(m: Mechanism) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """What is scaled and what is not, in words."""
    counts = (
        (len(m.platform.points), "landmarks"),
        (len(m.contacts), "contacts, their surfaces and bounds moved with them"),
        (len(m.chains), "chains' attachments"),
        (sum(hasattr(c, "muscle") for c in m.chains), "muscles' fibre and tendon lengths, with "
         "their lines"),
        (len(m.walls), "walls' points, their planes moved with them"),
        (len(m.ligaments), "ligaments, their slack lengths with their lines"),
    )  # fmt: skip
    scaled = [f"{count} {what}" for count, what in counts if count]
    return (
        (*scaled, "mass by volume", "mass centre, and inertia by the second moments"),
        ("greatest forces and other limits", "shapes of surfaces, radii of balls", "gravity"),
    )
