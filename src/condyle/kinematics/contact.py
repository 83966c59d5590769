"""Contacts: parasitic motion and M_J ([Cheng2023] Section 3.1, for any number of contacts).

A contact is one equation phi(X_EE) = 0 of the ball centre. With C = d phi / d X_EE split into the
columns of the dependent and the independent coordinates,

    M_J:     identity rows for the independent ones, -C_dep^-1 C_ind for the dependent ones,
    X''_dep = -C_dep^-1 (C_ind q'' + C' X').
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca

from ..mechanism.mechanism import COORDINATES
from .rotation import Bryant, rotation

POSITIONS = COORDINATES[:3]


@dataclass(frozen=True)
class ContactSymbols:
    """A contact whose numbers are symbols: T in {M}, (3,), and the constants of its locus.

    surface: where the ball's centre stays, `Contact.locus` or another one of its form.
    """

    surface: Any
    point: ca.SX
    constants: ca.SX

    def phi(self, position: ca.SX) -> ca.SX:
        """How far a ball centre at `position`, (3,) in {S}, is off the surface [m]."""
        return self.surface.phi(position, self.constants)

    def gradient(self, position: ca.SX) -> ca.SX:
        """d phi / d position, (3,): along the unit normal."""
        return self.surface.gradient(position, self.constants)

    def bending(self, position: ca.SX, velocity: ca.SX) -> ca.SX:
        """v^T (d2 phi / d position2) v."""
        return self.surface.bending(position, velocity, self.constants)


def indices(names: Sequence[str]) -> list[int]:
    """Positions of pose coordinates in X_EE."""
    return [COORDINATES.index(name) for name in names]


def residuals(contacts: Sequence[ContactSymbols], pose: ca.SX) -> ca.SX:
    """phi(X_EE), (k,) [m]: how far each ball centre is off its surface."""
    R = rotation(pose[3:])
    return ca.vertcat(ca.SX(0, 1), *(c.phi(pose[:3] + R @ c.point) for c in contacts))


@dataclass(frozen=True)
class ContactFrame:
    """The contacts at one pose, in twist coordinates.

    N: (6, k), columns [grad phi; r x grad phi]: N^T [V; omega] = phi' = 0.
    n_length: (k,), |grad phi|, which turns multipliers of N into contact forces.
    """

    gradients: list[ca.SX]
    levers: list[ca.SX]

    @property
    def N(self) -> ca.SX:
        columns = [
            ca.vertcat(n, ca.cross(r, n)) for n, r in zip(self.gradients, self.levers, strict=True)
        ]
        return ca.horzcat(ca.SX(6, 0), *columns)

    @property
    def n_length(self) -> ca.SX:
        return ca.vertcat(ca.SX(0, 1), *(ca.norm_2(n) for n in self.gradients))


def contact_frame(contacts: Sequence[ContactSymbols], position: ca.SX, R: ca.SX) -> ContactFrame:
    """Gradients and levers of the contacts at O_M = `position` and rotation R."""
    levers = [R @ c.point for c in contacts]
    gradients = [c.gradient(position + r) for c, r in zip(contacts, levers, strict=True)]
    return ContactFrame(gradients, levers)


def contact_bias(
    contacts: Sequence[ContactSymbols], frame: ContactFrame, position: ca.SX, twist: ca.SX
) -> ca.SX:
    """The part of phi'' that velocities alone make, (k,): C' X' in twist coordinates.

    v^T H v + grad phi . (omega x (omega x r)), with H the second derivative of phi.
    """
    biases = [ca.SX(0, 1)]
    omega = twist[3:]
    for contact, n, r in zip(contacts, frame.gradients, frame.levers, strict=True):
        swing = ca.cross(omega, r)
        v = twist[:3] + swing
        curving = contact.bending(position + r, v)
        biases.append(curving + ca.dot(n, ca.cross(omega, swing)))
    return ca.vertcat(*biases)


def solve_small(A: ca.SX, b: ca.SX) -> ca.SX:
    """A^-1 b for a square A of a few rows, by minors: no pivots, no branches."""
    if A.shape[0] == 0:
        return ca.SX(b.shape[0], b.shape[1])
    return ca.inv_minor(A) @ b if A.shape[0] > 1 else b / A


def parasitic_jacobian(C: ca.SX, dependent: Sequence[str]) -> ca.SX:
    """M_J, (6, 6 - k), from C, (k, 6) ([Cheng2023] eq. 9, by the implicit function theorem)."""
    dep = indices(dependent)
    ind = [i for i in range(6) if i not in dep]
    M_J = ca.SX(6, len(ind))
    for column, row in enumerate(ind):
        M_J[row, column] = 1
    if dep:
        M_J[dep, :] = -solve_small(C[:, dep], C[:, ind])
    return M_J


def closed_form_available(kinds: Sequence[str], dependent: Sequence[str]) -> bool:
    """Whether the dependent coordinates follow from planes without iteration."""
    angles = [name for name in dependent if name not in POSITIONS]
    return len(kinds) <= 2 and all(kind == "plane" for kind in kinds) and len(angles) <= 1


@dataclass(frozen=True)
class Placement:
    """A pose that satisfies the contacts: O_M, the Bryant angles, and whether it is real.

    reach: dimensionless; the contacts can be met where it is not negative (None: always).
    """

    position: ca.SX
    bryant: Bryant
    reach: ca.SX | None

    def pose(self) -> ca.SX:
        """X_EE, (6,)."""
        angles = [ca.atan2(self.bryant.sin[i], self.bryant.cos[i]) for i in range(3)]
        return ca.vertcat(self.position, *angles)


def closed_form(
    contacts: Sequence[ContactSymbols], dependent: Sequence[str], q: ca.SX, branch: ca.SX
) -> Placement:
    """Dependent coordinates on planes, [Cheng2023] eq. (6) for any two planes.

    phi is linear in the position and in the cosine and sine of each single angle. Eliminating
    the dependent position coordinate leaves A cos + B sin = k in the dependent angle.

    Args: q: independent coordinates in the order of X_EE; branch: -sign(B) at home.
    """
    dep = indices(dependent)
    unknown = ca.SX.sym("unknown", 2)  # cosine and sine of the dependent angle
    values: list[Any] = [None] * 6
    independent = [i for i in range(6) if i not in dep]
    for k, i in enumerate(independent):
        values[i] = q[k]
    positions = [i for i in dep if i < 3]
    angles = [i for i in dep if i >= 3]
    cos = [unknown[0] if i in angles else ca.cos(values[i]) for i in (3, 4, 5)]
    sin = [unknown[1] if i in angles else ca.sin(values[i]) for i in (3, 4, 5)]
    bryant = Bryant(ca.vertcat(*cos), ca.vertcat(*sin))
    R = bryant.rotation()
    # Planes have a constant gradient, so the coefficient of a position is its entry.
    base = ca.vertcat(*(0 if i in positions else values[i] for i in range(3)))
    equations = [c.phi(base + R @ c.point) for c in contacts]
    slopes = [[c.gradient(ca.SX.zeros(3))[i] for i in positions] for c in contacts]

    reach = None
    if angles:
        rest = equations[0]
        if positions:
            rest = slopes[1][0] * equations[0] - slopes[0][0] * equations[1]
        A, B = ca.jacobian(rest, unknown[0]), ca.jacobian(rest, unknown[1])
        k = -ca.substitute(rest, unknown, ca.SX.zeros(2))
        h = A * A + B * B
        root = h - k * k
        s = branch * ca.sqrt(root)
        solution: ca.SX = ca.vertcat((A * k - B * s) / h, (B * k + A * s) / h)
        reach = root / h
        cosines = ca.substitute(bryant.cos, unknown, solution)
        bryant = Bryant(cosines, ca.substitute(bryant.sin, unknown, solution))
        equations = [ca.substitute(e, unknown, solution) for e in equations]
    if positions:
        S: ca.SX = ca.vertcat(*(ca.horzcat(*row) for row in slopes))
        e = ca.vertcat(*equations)
        if len(positions) == 1:
            # With an angle also solved, both equations give the same value; weigh them alike.
            found = [-ca.dot(S, e) / ca.dot(S, S)]
        else:
            solved = -solve_small(S, e)
            found = [solved[0], solved[1]]
        for i, value in zip(positions, found, strict=True):
            base[i] = value
    return Placement(base, bryant, reach)
