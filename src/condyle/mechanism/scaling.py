"""A mechanism scaled to another subject: its points moved as landmarks are, masses with them.

affine      x -> b + A x + d |y|: one affine map for each side of the plane Y = 0, continuous
            there, where landmarks determine both sides; else d = 0, one map for both
thin_plate  x -> b + A x + sum w_i |x - p_i|, sum w_i = 0, sum w_i p_i^T = 0: through every
            landmark, with the least bending (Bookstein, IEEE PAMI 11, 1989, in space)

Few landmarks hardly determine some factors: of the incisor, the chin and both condyles, those
square to a plane near all four. So the map is drawn towards a similarity: with A = s R + E it is

    min  sum |x'_i - b - A x_i - d |y_i||^2 / error^2 + (|E|^2 + |d|^2) / SHAPE^2

the most probable one where landmarks have the stated error and proportions of people differ by
SHAPE from those of a similar jaw (standard deviations). The bending of a thin plate is then what
its landmarks' error allows: a random field of slopes of that size, seen with that error.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import InputError, UnsupportedError, did_you_mean, join
from .bodies import Inertia, distance
from .contact import Contact
from .mechanism import Mechanism

KINDS = ("affine", "thin_plate")
FEWEST = 4  # landmarks, not in one plane
_FLAT = 0.02  # smallest over largest singular value of landmarks that determine a map
_ODD, _MOST = 1.25, 1.5  # factors on lengths that are warned of, and that are refused
ERROR = 3e-3  # m, standard deviation of a landmark's coordinate, if none is stated
SHAPE = 0.1  # standard deviation of proportions between people: an assumption, large on purpose
_AXES = "XYZ"


@dataclass(frozen=True, eq=False)
class ScaledMechanism:
    """A mechanism scaled to landmarks, and what was scaled.

    Attributes: mechanism: the scaled one.
                kind: of the map: "affine", "affine by side" or "thin_plate".
                stretch: factors on lengths along X, Y and Z at the mass centre, (3,).
                deviation: their standard deviations, (3,), of the stated error of the landmarks, or
                    of what their residuals show if that is more; of a thin plate, of its A.
                condition: condition number of the landmarks' places for the map.
                regularised: whether the map was drawn towards a similarity.
                volume: factor on volume and mass.
                residual: distance of each landmark from where the map puts it [m].
                scaled, kept: what was scaled, and what was not, in words.
                warnings: implausible factors.
    """

    mechanism: Mechanism
    kind: str
    stretch: tuple[float, ...]
    deviation: tuple[float, ...]
    condition: float
    regularised: bool
    volume: float
    residual: dict[str, float]
    scaled: tuple[str, ...]
    kept: tuple[str, ...]
    warnings: tuple[str, ...] = ()

    def __str__(self) -> str:
        factors = ", ".join(map(_factor, _AXES, self.stretch, self.deviation))
        off = max(self.residual.values())
        drawn = ", drawn towards a similarity by their error" if self.regularised else ""
        return "\n".join(
            [
                f"Scaled to {len(self.residual)} landmarks ({self.kind}{drawn}): lengths at the "
                f"mass centre by {factors}, mass by {self.volume:.4g}; landmarks off by "
                f"{off * 1e3:.3g} mm at most, condition number {self.condition:.3g}",
                f"  scaled: {'; '.join(self.scaled)}",
                f"  not scaled: {'; '.join(self.kept)}",
            ]
        )


def scaled_to(
    mechanism: Mechanism,
    landmarks: Mapping[str, Any],
    kind: str = "affine",
    *,
    error: float = ERROR,
    regularise: bool = True,
) -> ScaledMechanism:
    """A mechanism whose points are where a subject's are.

    All points of platform, contacts and chains go by one map, the mass by its factor on volume,
    the inertia by the second moments of the mapped body. Surfaces move with their contacts and
    keep their shape.

    Args:   landmarks: point or contact -> its place in {S} at home, (3,) [m]; four or more that are
                not in one plane.
            kind: "affine" (by side) or "thin_plate".
            error: standard deviation of a landmark's coordinate [m].
            regularise: draw the map towards a similarity, as far as the error asks for it.
    Raises: InputError: for landmarks that are not there, determine no map, or one beyond what
            people differ by.
            UnsupportedError: for chains with bodies, whose masses are no subject's.
            MechanismError: if the scaled numbers are no mechanism.
    """
    if kind not in KINDS:
        raise InputError(f'scale: kind: expected "affine" or "thin_plate", got "{kind}"')
    if solid := [chain.name for chain in mechanism.chains if chain.masses]:
        raise UnsupportedError(
            f"scale: {join(solid)} of {mechanism.name} has bodies of its own, which have no "
            "subject's size; only mechanisms of cables and muscles are scaled"
        )
    there = named_points(mechanism, landmarks)
    here = np.array([landmarks[name] for name in landmarks], dtype=float)
    if here.shape != (len(there), 3) or not np.isfinite(here).all():
        raise InputError("scale: expected three finite coordinates [m] for every landmark")
    warp, spread, condition = _determined(there, here, kind, list(landmarks), error, regularise)
    com = np.array(mechanism.platform.com)
    J, volume = warp.mean_slope(com), warp.volume(com)
    if volume <= 0:
        raise InputError(
            f"scale: the landmarks {join(landmarks)} turn the mechanism inside out; are left and "
            "right, or two of them, exchanged?"
        )
    off = np.linalg.norm(warp(there) - here, axis=1)
    stretch = tuple(float(s) for s in np.linalg.norm(J, axis=0))

    def beyond(limit: float) -> list[str]:
        factors = zip(_AXES, stretch, spread, strict=True)
        return [_factor(*one) for one in factors if not 1 / limit < one[1] < limit]

    if wild := beyond(_MOST):
        raise InputError(
            f"scale: lengths would go by {', '.join(wild)}, expected {1 / _MOST:.2g} to {_MOST:g} "
            f"(condition number of the landmarks {condition:.3g}).",
            "Check the landmarks' names, places and unit"
            + ("" if regularise else "; regularise = true draws the map towards a similarity"),
        )
    return ScaledMechanism(
        mechanism.set(_changes(mechanism, warp, J, volume), keep="home"),
        warp.kind,
        stretch,
        spread,
        condition,
        regularise,
        volume,
        dict(zip(landmarks, off.tolist(), strict=True)),
        *_listing(mechanism),
        tuple(
            f"scale: lengths go by {factor}; check the landmarks' places and their unit"
            for factor in beyond(_ODD)
        ),
    )


def _factor(axis: str, stretch: float, deviation: float) -> str:
    return f"{axis} {stretch:.4g} ± {deviation:.2g}"


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


def _determined(
    there: np.ndarray,
    here: np.ndarray,
    kind: str,
    names: list[str],
    error: float,
    regularise: bool,
) -> tuple[_Warp, tuple[float, ...], float]:
    """The map from landmarks to places, deviations of its factors, and the condition number.

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
            f"scale: the landmarks {join(names)} are in one plane, or nearly; add one off it"
        )
    sided = np.column_stack([flat, np.abs(there[:, 1]) / size])
    apart = kind == "affine" and count > FEWEST and not _narrow(sided)
    columns = sided if apart else flat
    w, method = np.zeros((count, 3)), "affine by side" if apart else kind
    if regularise:
        found, spread = _towards_similarity(columns * size, here, error)
        b, d = found[0] * size, found[4] if apart else np.zeros(3)
        A = found[1:4].T
        if kind == "thin_plate":
            c, w = _bending(there, here - (b + (there - middle) @ A.T), size, error)
            b = b + c
    else:
        (b, *a), *_ = np.linalg.lstsq(columns, here, rcond=None)
        off = here - columns @ np.array([b, *a])
        sigma = _at_least(error, off, 3.0 * (count - columns.shape[1]))
        inverse = np.linalg.inv(columns.T @ columns)
        spread = sigma / size * np.sqrt(np.diag(inverse)[1:4])
        d = a.pop() / size if apart else np.zeros(3)
        if kind == "thin_plate":
            K = np.linalg.norm(there[:, None] - there, axis=-1)
            system = np.block([[K / size, flat], [flat.T, np.zeros((4, 4))]])
            bent = np.linalg.solve(system, np.vstack([here, np.zeros((4, 3))]))
            w, (b, *a) = bent[:count] / size, bent[count:]
        A = np.array(a).T / size
    condition = float(np.linalg.cond(columns))
    return _Warp(method, b - A @ middle, A, d, there, w), (*spread.tolist(),), condition


def _towards_similarity(
    columns: np.ndarray, here: np.ndarray, error: float
) -> tuple[np.ndarray, np.ndarray]:
    """The most probable coefficients of columns, (p, 3), and deviations of factors, (3,).

    Args: columns: (n, p) [m]: a constant, places about their middle, and |y| if there is a fifth.
    """
    x, target = columns[:, 1:4], here - here.mean(axis=0)
    U, _, Vt = np.linalg.svd(x.T @ target)
    V = Vt.T * [1, 1, np.sign(np.linalg.det(Vt.T @ U.T))]
    R = V @ U.T
    n, p = columns.shape
    # Unknown are s, and of each component in turn the constant, its row of E, and of d.
    own = np.kron(np.eye(3), columns)
    turned = (x @ R.T).T.reshape(-1, 1)
    design = np.hstack([turned, own]) / error
    held = np.diag([0.0, *np.tile([0.0, *[1 / SHAPE] * (p - 1)], 3)])
    covariance = np.linalg.inv(design.T @ design + held @ held)
    s, *E = covariance @ design.T @ here.T.ravel() / error
    fit = np.array(E).reshape(3, p).T
    fit[1:4] += s * R.T
    off = (here - columns @ fit) / error
    scale = _at_least(1.0, off, 3 * n - np.trace(design @ covariance @ design.T))
    unit = fit[1:4] / np.linalg.norm(fit[1:4], axis=1, keepdims=True)
    spread = []
    for a, u in enumerate(unit):
        slope = np.concatenate([[u @ R[:, a]], np.kron(u, np.eye(p)[1 + a])])
        spread.append(scale * np.sqrt(slope @ covariance @ slope))
    return fit, np.array(spread)


def _bending(
    there: np.ndarray, off: np.ndarray, size: float, error: float
) -> tuple[np.ndarray, np.ndarray]:
    """Constant (3,) and weights (n, 3) of |x - p_i| for what an affine map leaves, (n, 3) [m].

    The field's variance between two points grows with their distance, to (SHAPE size)^2 at `size`.
    """
    rate, count = 0.5 * SHAPE**2 * size, len(there)
    K = -rate * np.linalg.norm(there[:, None] - there, axis=-1) + error**2 * np.eye(count)
    ones = np.ones((count, 1))
    system = np.block([[K / rate, ones], [ones.T, np.zeros((1, 1))]])
    found = np.linalg.solve(system, np.vstack([off, np.zeros((1, 3))]))
    return found[count], -found[:count]


def _at_least(error: float, off: np.ndarray, freedom: float) -> float:
    """The error, or what residuals with so many degrees of freedom show, if that is more."""
    return max(error, float(np.sqrt((off**2).sum() / freedom))) if freedom > 0.5 else error


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
    bounds = {}
    for axis, shift in zip("xyz", by, strict=True):
        if (bound := getattr(contact.bounds, axis)) is not None:
            bounds[f"contact[{i}].bounds.{axis}"] = [float(end + shift) for end in bound]
    return bounds


def _listing(m: Mechanism) -> tuple[tuple[str, ...], tuple[str, ...]]:
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
