"""Closing the contacts from 6 - k prescribed coordinates, or from a landmark's path.

Six conditions fix a pose: the k contacts, phi = 0, and 6 - k prescribed functions g of the pose,
g = s(t). Rates come by the chain rule through the Jacobian K of (phi, g):

    K X' = (0, s'),     K X'' = (0, s'') - K' X'.

With two contacts a landmark's path leaves one freedom; the fourth condition, which [Cheng2023]
leaves open, is that the midpoint of the two contact points keeps its home Y.
"""

from __future__ import annotations

import casadi as ca

from ..errors import InputError
from ..graph.program import Program
from ..kinematics.constraints import (
    ContactSymbols,
    contact_frame,
    indices,
    residuals,
    solve_small,
)
from ..kinematics.guide import Guide
from ..kinematics.iteration import followed, newton
from ..kinematics.parasitic import platform_rates, rate_bias
from ..kinematics.rotation import Bryant
from ..mechanism.mechanism import COORDINATES
from .builder import Builder
from .numbers import contact_symbols, single_contacts
from .platform import ANGLE_UNITS, check_contacts
from .structure import Structure


def guides(b: Builder, s: ca.SX) -> list[ContactSymbols]:
    """A landmark's path as contacts, for displacements (4,): x, y, z and the middle's y.

    Raises: InputError: without two contacts.
    """
    if (k := len(b.structure.contacts)) != 2:
        raise InputError(f"names: expected {6 - k} coordinates; a landmark's path needs 2 contacts")
    landmark, middle = b.parameter("landmark"), b.parameter("middle")
    return [*(Guide.on_axis(i, landmark, s[i]) for i in range(3)), Guide.on_axis(1, middle, s[3])]


def closure(structure: Structure, names: tuple[str, ...] = ()) -> Program:
    """Poses and rates where g = s, g' = s1, g'' = s2, ports (6 - k,) each.

    Args: names: of 6 - k prescribed coordinates; without any, a landmark's displacement.
    """
    b = Builder(structure)
    m = structure.m
    s, s1, s2 = (b.sample(name, m) for name in ("s", "s1", "s2"))
    if not names:
        contacts = [*single_contacts(structure, b.parameter), *guides(b, s)]
        placement = followed(contacts, list(range(6)), ca.SX(0, 1), b.parameter("length"))
        here = [c.along_path(1.0) for c in contacts]
        rate, acceleration = _rates(here, placement.position, placement.bryant, s1, s2)
        pose = placement.pose()
    else:
        dependent = [name for name in COORDINATES if name not in names]
        contacts = contact_symbols(structure, b.parameter)
        placement = newton(contacts, dependent, s, b.parameter("length"))
        motion = platform_rates(contacts, dependent, placement, s1, s2)
        rate, acceleration = motion.rate, motion.acceleration
        pose = placement.pose()
        pose[indices(names)] = s
    b.output("pose", pose, ANGLE_UNITS)
    b.output("pose_rate", rate, "per s")
    b.output("pose_acceleration", acceleration, "per s^2")
    check_contacts(b, placement)
    return b.finish()


def _rates(
    contacts: list[ContactSymbols], position: ca.SX, bryant: Bryant, s1: ca.SX, s2: ca.SX
) -> tuple[ca.SX, ca.SX]:
    """X_EE' and X_EE'', (6,), where contacts and guides fix the whole pose."""
    frame = contact_frame(contacts, position, bryant.rotation())
    K = frame.N.T @ bryant.twist_jacobian()
    still = ca.SX.zeros(6 - s1.numel())
    rate = solve_small(K, ca.vertcat(still, s1))
    bias = rate_bias(contacts, frame, position, bryant, rate)
    return rate, solve_small(K, ca.vertcat(still, s2) - bias)


def conditions(structure: Structure, names: tuple[str, ...] = ()) -> Program:
    """phi and g, (6,), K, (6, 6), and K' X', (6,), at any pose, for Newton's method."""
    b = Builder(structure)
    pose, rate = b.sample("pose", 6, ANGLE_UNITS), b.sample("pose_rate", 6)
    contacts = single_contacts(structure, b.parameter)
    given = pose[indices(names)] if names else residuals(guides(b, ca.SX.zeros(4)), pose)
    values = ca.vertcat(residuals(contacts, pose), given)
    K = ca.jacobian(values, pose)
    b.output("values", values, "m, rad", 6)
    b.output("K", K, "", 6, 6)
    b.output("bias", ca.jtimes(K @ rate, pose, rate), "", 6)
    return b.finish()
