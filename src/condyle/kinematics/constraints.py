"""Contacts: parasitic motion and M_J ([Cheng2023] Section 3.1, for any number of contacts).

A contact is one equation phi(X_EE) = 0 of the ball centre. With C = d phi / d X_EE split into the
columns of the dependent and the independent coordinates,

    M_J:     identity rows for the independent ones, -C_dep^-1 C_ind for the dependent ones,
    X''_dep = -C_dep^-1 (C_ind q'' + C' X').
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import casadi as ca

from ..mechanism.mechanism import COORDINATES, Mechanism
from ..mechanism.surface import is_flat
from .rotation import Bryant, rotation

POSITIONS = COORDINATES[:3]


@dataclass(frozen=True)
class ContactSymbols:
    """A contact whose numbers are symbols: T in {M}, (3,), and the constants of its locus.

    Two contacts on parallel planes can also be written as their mean and their difference; the
    latter does not depend on O_M: it is not `anchored`.

    surface: where the ball's centre stays, `Contact.offset_surface` or another one of its form.
    """

    surface: Any
    point: ca.SX
    constants: ca.SX
    anchored: bool = True

    def phi(self, position: ca.SX) -> ca.SX:
        """Distance of a ball centre at `position`, (3,) in {S}, from the surface [m]."""
        return self.surface.phi(position, self.constants)

    def gradient(self, position: ca.SX) -> ca.SX:
        """d phi / d position, (3,): along the unit normal."""
        return self.surface.gradient(position, self.constants)

    def bending(self, position: ca.SX, velocity: ca.SX) -> ca.SX:
        """v^T (d2 phi / d position2) v."""
        return self.surface.bending(position, velocity, self.constants)

    def rounded(self, position: ca.SX) -> ca.SX:
        """What rounding leaves of the surface's second derivative: see `Smooth.rounded`."""
        return self.surface.rounded(position, self.constants)

    def started_at(self, position: ca.SX) -> ContactSymbols:
        """Linked to the foot point of `position`: see `Smooth.started_at`."""
        return replace(self, surface=self.surface.started_at(position, self.constants))

    def along_path(self, part: float) -> ContactSymbols:
        """The contact at a fraction of the path from home: surfaces stay, guides move."""
        return self

    @property
    def square_lever(self) -> ca.SX:
        """|T|^2 [m^2]."""
        return ca.dot(self.point, self.point)

    def at(self, position: ca.SX, R: ca.SX) -> ca.SX:
        """The ball centre for O_M at `position`, (3,)."""
        lever = R @ self.point
        return position + lever if self.anchored else lever


def contacts_of(mechanism: Mechanism) -> list[ContactSymbols]:
    """A mechanism's contacts with their numbers in place."""
    return [
        ContactSymbols(
            c.offset_surface, ca.SX(ca.DM(c.point)), ca.SX(ca.DM(c.offset_surface.constants()))
        )
        for c in mechanism.contacts
    ]


def indices(names: Sequence[str]) -> list[int]:
    """Positions of pose coordinates in X_EE."""
    return [COORDINATES.index(name) for name in names]


def independent_indices(dependent: Sequence[str]) -> list[int]:
    """Positions of the other pose coordinates in X_EE."""
    return [i for i, name in enumerate(COORDINATES) if name not in dependent]


def residuals(contacts: Sequence[ContactSymbols], pose: ca.SX) -> ca.SX:
    """phi(X_EE), (k,) [m]: distances of the ball centres from their surfaces."""
    R = rotation(pose[3:])
    return ca.vertcat(ca.SX(0, 1), *(c.phi(c.at(pose[:3], R)) for c in contacts))


@dataclass(frozen=True)
class ContactFrame:
    """The contacts at one pose, in twist coordinates.

    N: (6, k), columns [grad phi; r x grad phi]: N^T [V; omega] = phi' = 0.
    n_length: (k,), |grad phi|, which turns multipliers of N into contact forces.
    """

    gradients: list[ca.SX]
    levers: list[ca.SX]
    anchored: list[bool]

    @property
    def N(self) -> ca.SX:
        columns = [
            ca.vertcat(n if anchored else ca.SX.zeros(3), ca.cross(r, n))
            for n, r, anchored in zip(self.gradients, self.levers, self.anchored, strict=True)
        ]
        return ca.horzcat(ca.SX(6, 0), *columns)

    @property
    def n_length(self) -> ca.SX:
        return ca.vertcat(ca.SX(0, 1), *(ca.norm_2(n) for n in self.gradients))


def contact_frame(contacts: Sequence[ContactSymbols], position: ca.SX, R: ca.SX) -> ContactFrame:
    """Gradients and levers of the contacts at O_M = `position` and rotation R."""
    levers = [R @ c.point for c in contacts]
    gradients = [c.gradient(c.at(position, R)) for c in contacts]
    return ContactFrame(gradients, levers, [c.anchored for c in contacts])


def contact_bias(
    contacts: Sequence[ContactSymbols], frame: ContactFrame, position: ca.SX, twist: ca.SX
) -> ca.SX:
    """The velocity-dependent part of phi'', (k,): C' X' in twist coordinates.

    v^T H v + grad phi . (omega x (omega x r)), with H the second derivative of phi.
    """
    biases = [ca.SX(0, 1)]
    omega = twist[3:]
    for contact, n, r in zip(contacts, frame.gradients, frame.levers, strict=True):
        swing = ca.cross(omega, r)
        v, at = (twist[:3] + swing, position + r) if contact.anchored else (swing, r)
        spinning = ca.dot(n, omega) * ca.dot(r, omega) - ca.dot(n, r) * ca.dot(omega, omega)
        biases.append(contact.bending(at, v) + spinning)
    return ca.vertcat(*biases)


def solve_small(A: ca.SX, b: ca.SX) -> ca.SX:
    """A^-1 b for a square A of a few rows, without pivots that depend on numbers.

    An entry that is 1 by structure, such as d phi / dZ on z = f(x, y), is eliminated first; the
    rest is solved by minors.
    """
    size = A.shape[0]
    if size == 0:
        return ca.SX(b.shape[0], b.shape[1])
    if size == 1:
        return b * (1 / A)
    if (one := _unit_entry(A)) is None:
        return ca.inv_minor(A) @ b
    i, j, rows, columns, below = one
    rest = solve_small(below, b[rows, :] - A[rows, j] @ b[i, :])
    x = ca.SX(size, b.shape[1])
    x[columns, :] = rest
    x[j, :] = b[i, :] - A[i, columns] @ rest
    return x


def all_of(conditions: Iterable[ca.SX]) -> ca.SX:
    """1 where all conditions hold, else 0; comparisons with NaN do not hold."""
    found = ca.SX(1)
    for condition in conditions:
        found = found * condition
    return found


def determinant(A: ca.SX) -> ca.SX:
    """The determinant of a square A of a few rows; entries that are 1 by structure go first."""
    if (one := _unit_entry(A)) is None:
        return ca.det(A)
    i, j, _, _, below = one
    return determinant(below) if (i + j) % 2 == 0 else -determinant(below)


def _unit_entry(A: ca.SX) -> tuple[int, int, list[int], list[int], ca.SX] | None:
    """An entry of A that is 1 by structure, the other rows and columns, and A without them."""
    others = range(A.shape[0])
    for j, i in product(others, others):
        if len(others) > 1 and A[i, j].is_one():
            rows, columns = [r for r in others if r != i], [c for c in others if c != j]
            return i, j, rows, columns, A[rows, columns] - A[rows, j] @ A[i, columns]
    return None


def parasitic_jacobian(C: ca.SX, dependent: Sequence[str]) -> ca.SX:
    """M_J, (6, 6 - k), from C, (k, 6) ([Cheng2023] eq. 9, by the implicit function theorem)."""
    dep, ind = indices(dependent), independent_indices(dependent)
    M_J = ca.SX(6, len(ind))
    for column, row in enumerate(ind):
        M_J[row, column] = 1
    if dep:
        M_J[dep, :] = -solve_small(C[:, dep], C[:, ind])
    return M_J


def closed_form_available(forms: Sequence[str], dependent: Sequence[str]) -> bool:
    """Whether the dependent coordinates follow from planes without iteration."""
    angles = [name for name in dependent if name not in POSITIONS]
    return len(forms) <= 2 and all(map(is_flat, forms)) and len(angles) <= 1


@dataclass(frozen=True)
class Placement:
    """A pose that satisfies the contacts: O_M, the Bryant angles, and whether it exists.

    discriminant: dimensionless; the contacts can be closed where it is >= 0 (None: always).
    iterated: by a fixed number of steps; `discriminant` is then 1 if they converged, else 0.
    left: square of the step that would follow, in lengths of the levers and radians.
    """

    position: ca.SX
    bryant: Bryant
    discriminant: ca.SX | None
    iterated: bool = False
    left: ca.SX | float = 0.0

    def pose(self) -> ca.SX:
        """X_EE, (6,)."""
        angles = [ca.atan2(self.bryant.sin[i], self.bryant.cos[i]) for i in range(3)]
        return ca.vertcat(self.position, *angles)


@dataclass(frozen=True)
class AngleEquation:
    """A cos + B sin = k for the one dependent angle, and the equations of the positions.

    base:      O_M with zeros for the dependent positions.
    equations: phi of the contacts there, in the unknown cosine and sine, `unknown` (2,).
    slopes:    d phi / d (dependent positions), one row a contact.
    """

    A: ca.SX
    B: ca.SX
    k: ca.SX
    unknown: ca.SX
    base: ca.SX
    bryant: Bryant
    equations: list[ca.SX]
    slopes: list[list[ca.SX]]


def angle_equation(
    contacts: Sequence[ContactSymbols], dependent: Sequence[str], q: ca.SX
) -> AngleEquation:
    """The contacts on planes as equations in the dependent coordinates.

    phi is linear in the position and in the cosine and sine of each single angle; the dependent
    position, if there is one, is eliminated between the two contacts.
    """
    dep = indices(dependent)
    unknown = ca.SX.sym("unknown", 2)
    values = dict(zip(independent_indices(dependent), ca.vertsplit(q), strict=False))
    positions = [i for i in dep if i < 3]
    angles = [i for i in dep if i >= 3]
    cos = [unknown[0] if i in angles else ca.cos(values[i]) for i in (3, 4, 5)]
    sin = [unknown[1] if i in angles else ca.sin(values[i]) for i in (3, 4, 5)]
    bryant = Bryant(ca.vertcat(*cos), ca.vertcat(*sin))
    R = bryant.rotation()
    base = ca.vertcat(*(0 if i in positions else values[i] for i in range(3)))
    equations = [c.phi(c.at(base, R)) for c in contacts]
    # Planes have a constant gradient, so the coefficient of a position is its entry.
    slopes = [
        [c.gradient(ca.SX.zeros(3))[i] if c.anchored else ca.SX(0) for i in positions]
        for c in contacts
    ]
    rest: ca.SX = equations[-1] if equations else ca.SX(0)
    if angles and positions and contacts[-1].anchored:
        rest = slopes[1][0] * equations[0] - slopes[0][0] * equations[1]
    A, B = ca.jacobian(rest, unknown[0]), ca.jacobian(rest, unknown[1])
    right = -ca.substitute(rest, unknown, ca.SX.zeros(2))
    return AngleEquation(A, B, right, unknown, base, bryant, equations, slopes)


def closed_form(
    contacts: Sequence[ContactSymbols], dependent: Sequence[str], q: ca.SX, branch: ca.SX
) -> Placement:
    """Dependent coordinates on planes, [Cheng2023] eq. (6) for any two planes.

    Args: q: independent coordinates in the order of X_EE; branch: -sign(B) at home.
    """
    dep = indices(dependent)
    positions = [i for i in dep if i < 3]
    s = angle_equation(contacts, dependent, q)
    base, bryant, equations, discriminant = s.base, s.bryant, s.equations, None
    if len(positions) < len(dep):
        A, B, k = s.A, s.B, s.k
        h = A * A + B * B
        root = h - k * k
        inverse_h = 1 / h
        k_h, s_h = k * inverse_h, branch * inverse_h * ca.sqrt(root)
        solution = ca.vertcat(A * k_h - B * s_h, B * k_h + A * s_h)
        discriminant = root * inverse_h
        bryant, equations = (
            Bryant(*(ca.substitute(v, s.unknown, solution) for v in (bryant.cos, bryant.sin))),
            [ca.substitute(e, s.unknown, solution) for e in equations],
        )
    if positions:
        S = ca.vertcat(*(ca.horzcat(*row) for row in s.slopes))
        e = ca.vertcat(*equations)
        if len(positions) == 1:
            # With an angle also solved, both equations give the same value; weigh them alike.
            roots = [-ca.dot(S, e) / ca.dot(S, S)]
        else:
            solved = -solve_small(S, e)
            roots = [solved[0], solved[1]]
        for i, value in zip(positions, roots, strict=True):
            base[i] = value
    return Placement(base, bryant, discriminant)


def mean_and_difference(
    surface: Any, slope: ca.SX, point: ca.SX, offset: ca.SX, difference: ca.SX, gap: ca.SX
) -> list[ContactSymbols]:
    """Two contacts on parallel planes, (phi_1 + phi_2) / 2 and phi_1 - phi_2.

    Args: point, offset: means of the two; difference, gap: first less second.
    """
    return [
        ContactSymbols(surface, point, ca.vertcat(slope, offset)),
        ContactSymbols(surface, difference, ca.vertcat(slope, gap), anchored=False),
    ]
