"""What the geometry at home decides: contact residuals, the dependent coordinates, and whether
the contacts hold at all."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import lru_cache
from itertools import combinations
from typing import Protocol

import numpy as np

from .bodies import cross
from .chain import Chain
from .contact import Contact
from .coordinates import COORDINATES
from .surface import Parallel
from .surface.overlap import Ends, nearest_wall, overlaps

DEPENDENT_ORDER = ("Z", "gamma", "alpha", "beta", "Y", "X")
MAX_CONDITION = 1e4
HOME_ERROR = 1e-5  # metres off the surface at home: an error beyond this,
HOME_WARNING = 1e-9  # a warning beyond that


class Parts(Protocol):
    """What the geometry at home is decided by: a mechanism, or what is valid of one."""

    @property
    def chains(self) -> tuple[Chain, ...]: ...
    @property
    def contacts(self) -> tuple[Contact, ...]: ...
    @property
    def dependent(self) -> tuple[str, ...] | None: ...


def characteristic_length(mechanism: Parts) -> float:
    """Mean distance of the platform joints and contact points from O_M [m].

    It multiplies angles wherever lengths and angles meet in one norm.
    """
    points = [chain.platform for chain in mechanism.chains]
    points += [contact.point for contact in mechanism.contacts]
    return float(np.mean(np.linalg.norm(points, axis=1))) or 1.0


def home_residuals(mechanism: Parts) -> np.ndarray:
    """Distance of each contact point from its surface at home, (k,) [m]."""
    return np.array([home_residual(contact) for contact in mechanism.contacts])


def home_residual(contact: Contact) -> float:
    value, gradient = contact.gradient()
    steepness = float(np.linalg.norm(gradient))
    return value / steepness if steepness else value


def constraint_jacobian(mechanism: Parts) -> np.ndarray:
    """C = d phi / d X_EE at home, (k, 6), angles multiplied by the characteristic length."""
    length = characteristic_length(mechanism)
    rows = []
    for contact in mechanism.contacts:
        _, gradient = contact.gradient()
        # At home R_omega is the identity, so angles act as rotations about the axes of {S}.
        rows.append(np.concatenate([gradient, cross(contact.point, gradient) / length]))
    return np.array(rows).reshape(-1, 6)


def condition_of(jacobian: np.ndarray, names: tuple[str, ...]) -> float:
    """Condition number of the columns of C that belong to `names`; 1 of none, inf of zeros."""
    if not names:
        return 1.0
    columns = jacobian[:, [COORDINATES.index(name) for name in names]]
    if not np.isfinite(jacobian).all():
        return float("inf")
    singular = np.linalg.svd(columns, compute_uv=False)
    scale = np.linalg.norm(jacobian, 2)
    # Rounding must not turn a coordinate the contacts ignore into one they determine.
    if singular[-1] <= 1e-13 * scale or not np.isfinite(singular).all():
        return float("inf")
    return float(singular[0] / singular[-1])


def usable_sets(mechanism: Parts) -> Iterator[tuple[str, ...]]:
    """Sets of dependent coordinates that the contacts determine at home, best known first."""
    jacobian = constraint_jacobian(mechanism)
    for names in combinations(DEPENDENT_ORDER, len(mechanism.contacts)):
        if condition_of(jacobian, names) < MAX_CONDITION:
            yield names


def dependent_coordinates(mechanism: Parts) -> tuple[str, ...]:
    """The coordinates that the contacts determine: (Z, gamma) for the paper's mechanism.

    Those of the file, else the first set in lexicographic order of Z, gamma, alpha, beta, Y, X
    whose columns of C have a condition number below 1e4. A checked mechanism has one.
    """
    known = getattr(mechanism, "first_usable", None)  # a mechanism looks for them once
    return mechanism.dependent or known or next(usable_sets(mechanism))


def independent_coordinates(mechanism: Parts) -> tuple[str, ...]:
    """The remaining coordinates, in the order of X_EE: q_EE of [Cheng2023] eq. (7)."""
    dependent = dependent_coordinates(mechanism)
    return tuple(name for name in COORDINATES if name not in dependent)


def home_problems(mechanism: Parts) -> list[str]:
    """Contacts that are off their surface at home, or cannot hold the platform.

    Those whose surface is only a note of one cannot be judged.
    """
    if not all(contact.surface.known for contact in mechanism.contacts):
        return list(off_surface(c for c in mechanism.contacts if c.surface.known))
    return list(off_surface(mechanism.contacts)) or list(holding_problems(mechanism))


def off_surface(contacts: Iterable[Contact]) -> Iterator[str]:
    """A line for each contact that cannot be at its point at home."""
    for contact in contacts:
        if (problem := home_problem(contact)) is not None:
            yield f'contact "{contact.name}": {problem}'


def home_problem(contact: Contact) -> str | None:
    """Why the contact cannot be at its point at home, or None."""
    with np.errstate(all="ignore"):
        off, locus = home_residual(contact), contact.offset_surface
    if not np.isfinite(off):
        if isinstance(locus, Parallel):
            return f"{_ball(contact)} finds no point of the surface to touch"
        return "the surface has no normal at the contact point at home"
    if abs(off) > HOME_ERROR:
        return (
            f"the point is {off * 1e3:+.6g} mm off the surface at home; at most 0.01 mm is "
            "accepted. Move the point or the surface; `condyle check --project` shows the "
            "nearest home"
        )
    if isinstance(locus, Parallel) and not locus.grip() > 0:
        return f"{_ball(contact)} cannot touch the surface there: it curves more tightly"
    form, numbers, ends = locus.form, locus.constants(), contact.ends
    if _overlaps(form, numbers, contact.point, ends):
        near = nearest_wall(form, numbers, contact.point, ends)
        where = f"is {near * 1e3:.4g} mm from its centre" if near else "goes over its centre"
        return (
            f"{_ball(contact)} overlaps the surface at home: beside where it touches, the surface "
            f"{where}. Take a smaller ball or a wider surface"
        )
    return None


@lru_cache(maxsize=256)
def _overlaps(form: str, numbers: tuple[float, ...], point: tuple[float, ...], ends: Ends) -> bool:
    return bool(overlaps(form, numbers, np.array([point]), ends)[0])


def _ball(contact: Contact) -> str:
    assert contact.ball_radius is not None
    return f'a ball of radius {contact.ball_radius * 1e3:g} mm on the side "{contact.side}"'


def holding_problems(mechanism: Parts) -> Iterator[str]:
    """Problems of contacts that do not determine the dependent coordinates."""
    if not mechanism.contacts:
        return
    usable = next(usable_sets(mechanism), None)
    count = len(mechanism.contacts)
    if usable is None:
        yield (
            f"contact: the {count} contacts cannot hold the platform at home: no {count} of its "
            "coordinates are determined by them (condition number above 1e4 for every choice). "
            "Two contacts may coincide or push along one line"
        )
    elif mechanism.dependent is not None:
        condition = condition_of(constraint_jacobian(mechanism), mechanism.dependent)
        if condition >= MAX_CONDITION:
            yield (
                f"dependent: the contacts do not determine {', '.join(mechanism.dependent)} at "
                f"home (condition number {condition:.3g}, must be below 1e4); "
                f"{', '.join(usable)} would do"
            )


def home_warnings(mechanism: Parts) -> list[str]:
    """Residuals at home that are small enough to accept and large enough to mention."""
    return [
        f'contact "{contact.name}": the point is {off * 1e3:+.3g} mm off its surface at home'
        for contact, off in zip(mechanism.contacts, home_residuals(mechanism), strict=True)
        if abs(off) > HOME_WARNING
    ]
