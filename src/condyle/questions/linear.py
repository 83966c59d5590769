"""Derivatives of the equations of motion about a state, exact, by tangents of the graph.

With the balance in twists

    r(q, q', q'', lambda, tau) = Q - J^T tau - N lambda + T |lambda| = 0

the accelerations' derivatives are those of an implicit function, and so six equations a state:

    [r_q'' r_lambda] d(q'', lambda) = - (r_q dq + r_q' dq' - J^T dtau).
"""

from __future__ import annotations

import casadi as ca

from ..graph.program import Program
from ..kinematics.constraints import Placement
from ..kinematics.parasitic import whole_motion
from ..kinematics.rotation import Bryant
from .builder import Builder
from .equations import Wrench, equations
from .numbers import contact_symbols
from .platform import ANGLE_UNITS, Platform, contacts, independent_indices
from .structure import Structure


def linear(structure: Structure) -> Program:
    """At whole poses that meet the contacts; ports q1, q2 and contact_force along unit normals."""
    b, s = Builder(structure), structure
    m, k = s.m, len(s.contacts)
    pose = b.sample("pose", 6, ANGLE_UNITS)
    q1, q2, force = b.sample("q1", m), b.sample("q2", m), b.sample("contact_force", k, "N")
    effort = b.lane_sample("effort", unit="N m or N")
    placement = Placement(pose[:3], Bryant.of(pose[3:]), None)
    motion = whole_motion(contact_symbols(s, b.parameter), s.dependent, placement, q1, q2)
    q = pose[independent_indices(s.dependent)]
    platform = Platform(q, q1, q2, pose, placement, motion)
    eq = equations(b, platform, Wrench.of(b), "virtual_power", "core", lump=True)
    carried = b.total([c.row * t for c, t in zip(eq.chains, effort, strict=True)])
    touch = contacts(b, platform)
    r = b.cut(eq.Q - carried - touch.N @ force + touch.T @ ca.fabs(force))
    # The pose follows q along M_J.
    b.output("by_q", b.jacobian(r, pose) @ motion.M_J, "", 6, m)
    b.output("by_q1", b.jacobian(r, q1), "", 6, m)
    b.output("by_q2", b.jacobian(r, q2), "", 6, m)
    signs = ca.diag(ca.sign(force)) if k else ca.SX(0, 0)
    b.output("by_force", touch.T @ signs - touch.N, "", 6, k)
    b.output("J", [c.row for c in eq.chains], "", 6)
    return b.finish()
