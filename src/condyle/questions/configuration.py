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
from .builder import Builder, Lanes
from .platform import Platform, contacts, given, independent_indices
from .structure import Structure

CONVERGED = 0.0  # what the quality of singular values must be at least


def configuration(structure: Structure) -> Program:
    """The configuration at whole poses that meet the contacts."""
    b = Builder(structure)
    rows = add_configuration(b, given(b, still=True))
    b.output("J_W", rows, "1", structure.m)
    return b.finish()


def add_configuration(b: Builder, platform: Platform) -> Lanes:
    """The configuration among a question's outputs; returns the dimensionless rows of J_W."""
    loops = loops_of(b, platform)
    rows = on_rates(b, platform, [loop.rod / loop.rod_length for loop in loops], scaled=True)
    b.output("joint", [loop.q_r[0] for loop in loops], "rad or m")
    b.output("beta", [loop.q_r[1] for loop in loops], "rad")
    b.output("gamma", [loop.q_r[2] for loop in loops], "rad")
    b.output("cos_gamma", [loop.cos_gamma for loop in loops], "1")
    b.output("discriminant", [loop.discriminant for loop in loops], "1")
    b.output("J_A", [loop.J_A for loop in loops], "m^2 per rad or m")
    b.output("transmission", [loop.transmission for loop in loops], "1")
    add_singularity(b, loops, rows)
    contacts(b, platform).add_places(b)
    return rows


def add_singularity(b: Builder, loops: list[Loop], rows: Lanes) -> None:
    """Singular values of J_W, from its dimensionless rows, and extremes of J_A."""
    sigma, quality = singular_values(b.total, rows)
    b.output("J_W_sigma", sigma, "1", b.structure.m)
    size = [ca.fabs(loop.transmission) for loop in loops]
    b.output("J_A_extremes", ca.vertcat(b.least(size), -b.least([-s for s in size])), "1")
    b.check(quality, CONVERGED)


def loops_of(b: Builder, platform: Platform) -> list[Loop]:
    """The closed loops of the chains, one a group."""
    loops = []
    for group, kind in enumerate(b.structure.families):
        family = FAMILIES[kind]
        position = platform.position + platform.R @ b.lane(group, "joint")
        loops.append(family.loop(family.named(b.lane(group, "constants")), position))
    return loops


def on_rates(b: Builder, platform: Platform, rows: Lanes, scaled: bool = False) -> Lanes:
    """Rows (3,) on the velocities of the platform joints as rows (m,) on q_EE'.

    Args: scaled: for rates whose angles are multiplied by the characteristic length.
    """
    motion = platform.motion
    B = motion.E @ motion.M_J
    scale = ca.SX.ones(b.structure.m)
    if scaled:
        length = b.parameter("length")
        ind = independent_indices(b.structure.dependent)
        scale = ca.vertcat(*(1 / length if i >= 3 else ca.SX(1) for i in ind))
    found = []
    for group, row in enumerate(rows):
        r, mask = platform.R @ b.lane(group, "joint"), b.lane(group, "mask")
        found.append(mask * scale * (B.T @ ca.vertcat(row, ca.cross(r, row))))
    return found
