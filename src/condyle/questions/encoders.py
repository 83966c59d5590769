"""What forward kinematics asks of a pose: joints, their Jacobian, how far off contacts it is."""

from __future__ import annotations

import casadi as ca

from ..graph.program import Program
from ..kinematics.chain import FAMILIES
from ..kinematics.constraints import contact_frame, indices, residuals, solve_small
from ..kinematics.state import pose_state
from .builder import Builder
from .numbers import single_contacts
from .platform import given
from .structure import Structure


def encoders(structure: Structure) -> Program:
    """At any pose, port pose: also at one that does not meet the contacts."""
    b = Builder(structure)
    platform = given(b, still=True)
    state = pose_state(platform.pose, ca.SX.zeros(6), ca.SX.zeros(6))
    joints, rows = [], []
    for group, kind in enumerate(structure.families):
        family = FAMILIES[kind]
        M = state.point(b.lane(group, "joint"))
        loop = family.loop(family.named(b.lane(group, "constants")), M.position)
        joints.append(loop.q_r[0])
        rows.append(state.generalized_force(loop.J, M.lever))
    b.output("joint", joints, "rad or m")
    b.output("J_theta", rows, "")
    b.output("M_J", platform.motion.M_J, "", 6, structure.m)
    # The dependent coordinates' step back onto the surfaces.
    contacts, dep = single_contacts(structure, b.parameter), indices(structure.dependent)
    phi = residuals(contacts, platform.pose)
    correction = ca.SX.zeros(6)
    if dep:
        C = contact_frame(contacts, platform.pose[:3], platform.R).N.T @ platform.motion.E
        correction[dep] = -solve_small(C[:, dep], phi)
    b.output("correction", correction, "m, rad", 6)
    b.output("phi", phi, "m", len(structure.contacts))
    return b.finish()
