"""The configuration at a pose: joints, contacts, and how near the mechanism is to a singularity.

L_i = |S_i - M_i|^2 - |S_i M_i|^2 gives J_A theta' + J_W q' = 0 ([Cheng2023] eqs 25, 26). Divided by
twice crank times coupler, J_A becomes the sine of the transmission angle; divided by twice the
coupler, and with angles multiplied by the characteristic length, J_W becomes dimensionless too.
"""

from __future__ import annotations

import casadi as ca

from ..dynamics.singular_values import singular_values
from ..graph.program import Program
from ..kinematics.chain import FAMILIES, Loop
from ..kinematics.contact import contact_frame
from .builder import Builder, Lanes
from .numbers import single_contacts
from .platform import Platform, given, independent_indices
from .structure import Structure

CONVERGED = 0.0  # what the quality of singular values must be at least


def configuration(structure: Structure) -> Program:
    """The configuration at whole poses that meet the contacts."""
    b = Builder(structure)
    rows = add(b, given(b, still=True))
    b.output("J_W", rows, "1", structure.m)
    return b.finish()


def add(b: Builder, platform: Platform) -> Lanes:
    """The configuration among a question's outputs; returns the dimensionless rows of J_W."""
    loops, rows = _loops(b, platform)
    b.output("joint", [loop.q_r[0] for loop in loops], "rad or m")
    b.output("beta", [loop.q_r[1] for loop in loops], "rad")
    b.output("gamma", [loop.q_r[2] for loop in loops], "rad")
    b.output("cos_gamma", [loop.cos_gamma for loop in loops], "1")
    b.output("discriminant", [loop.discriminant for loop in loops], "1")
    b.output("J_A", [loop.J_A for loop in loops], "m^2 per rad or m")
    transmission = [loop.J_A / loop.J_A_scale for loop in loops]
    b.output("transmission", transmission, "1")
    sigma, quality = singular_values(b.total, rows)
    b.output("J_W_sigma", sigma, "1", b.structure.m)
    size = [ca.fabs(t) for t in transmission]
    b.output("J_A_extremes", ca.vertcat(b.least(size), -b.least([-s for s in size])), "1")
    b.check(quality, CONVERGED)

    position, R = platform.placement.position, platform.R
    contacts = single_contacts(b.structure, b.parameter)
    frame = contact_frame(contacts, position, R)
    k = len(contacts)
    points = [position + r for r in frame.levers]
    normals = [n / ca.norm_2(n) for n in frame.gradients]
    for name, vectors, unit in (("contact_point", points, "m"), ("contact_normal", normals, "1")):
        b.output(name, ca.horzcat(ca.SX(3, 0), *vectors).T, unit, k, 3)
    return rows


def _loops(b: Builder, platform: Platform) -> tuple[list[Loop], Lanes]:
    """The closed loops of the chains, and the dimensionless rows of J_W on q_EE'."""
    s, motion = b.structure, platform.motion
    ind = independent_indices(s.dependent)
    length = b.parameter("length")
    scale = ca.vertcat(*(1 / length if i >= 3 else ca.SX(1) for i in ind))
    B = motion.E @ motion.M_J
    loops, rows = [], []
    for group, kind in enumerate(s.families):
        family = FAMILIES[kind]
        r = platform.R @ b.lane(group, "joint")
        position = platform.placement.position + r
        loop = family.loop(family.named(b.lane(group, "constants")), position)
        e = loop.rod / loop.rod_length
        mask = b.lane(group, "mask")
        rows.append(mask * scale * (B.T @ ca.vertcat(e, ca.cross(r, e))))
        loops.append(loop)
    return loops, rows
