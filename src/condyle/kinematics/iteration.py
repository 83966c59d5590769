"""Dependent coordinates where they have no closed form: Newton's method as one expression.

A fixed number of steps from home's tangent, for kernels that cannot loop until it is enough. The
residual that is left says whether it was; where not, the sample needs `Closure`, which follows it
from home.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

from .contact import (
    ContactSymbols,
    Placement,
    contact_frame,
    indices,
    parasitic_jacobian,
    residuals,
    solve_small,
)
from .rotation import Bryant

STEPS = 5
RESIDUAL = 1e-13  # metres off a surface that count as on it


def newton(
    contacts: Sequence[ContactSymbols], dependent: Sequence[str], q: ca.SX, steps: int = STEPS
) -> Placement:
    """A pose with phi = 0, from q in the order of X_EE.

    Its `reach` is near 1 where the steps sufficed, and 0 where they did not.
    """
    dep = indices(dependent)
    ind = [i for i in range(6) if i not in dep]
    home = contact_frame(contacts, ca.SX.zeros(3), ca.SX.eye(3))
    # At home R_omega is the identity.
    start = parasitic_jacobian(home.N.T, dependent)[dep, :] @ q
    pose = ca.SX.zeros(6)
    pose[ind], pose[dep] = q, start
    for _ in range(steps):
        pose[dep] = pose[dep] - solve_small(*_linear(contacts, dep, pose))
    off = ca.SX(0.0)
    for phi in ca.vertsplit(residuals(contacts, pose)):
        off = ca.fmax(off, ca.fabs(phi))
    return Placement(pose[:3], Bryant.of(pose[3:]), ca.fmax(1 - off / RESIDUAL, 0))


def _linear(
    contacts: Sequence[ContactSymbols], dep: list[int], pose: ca.SX
) -> tuple[ca.SX, ca.SX]:
    """C_dep, (k, k), and phi, (k,), at a pose."""
    bryant = Bryant.of(pose[3:])
    R = bryant.rotation()
    frame = contact_frame(contacts, pose[:3], R)
    C = frame.N.T @ ca.diagcat(ca.SX.eye(3), bryant.angular_velocity())
    phi = ca.vertcat(*(c.phi(c.at(pose[:3], R)) for c in contacts))
    return C[:, dep], phi
