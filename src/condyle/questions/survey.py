"""What a pose is like, for maps of many poses: only what is wanted is computed.

Each chain's discriminant always is, since it says who forbids a pose.
"""

from __future__ import annotations

from collections.abc import Collection

import casadi as ca

from ..dynamics.singular_values import singular_values
from ..graph.program import Program
from ..kinematics.constraints import contact_frame
from .builder import Builder
from .configuration import CONVERGED, loops_of, on_rates
from .numbers import single_contacts
from .platform import ANGLE_UNITS, closed, given
from .structure import Structure

# What can be asked for besides the discriminants.
SURVEYED = ("pose", "joint", "transmission", "rates", "rows", "ratio", "points")


def survey(structure: Structure, wanted: Collection[str] = (), at_pose: bool = False) -> Program:
    """Some of `SURVEYED` at poses on their contacts.

    `met` is at least 0.5, or 0 where it is not iterated, where the contacts can be met. What
    depends on a chain that cannot reach a pose is no number there.

    Args: at_pose: from whole poses that meet the contacts; else from q_EE, which closes them.
    """
    b = Builder(structure)
    platform = given(b, still=True) if at_pose else closed(b, rates=0)
    placement = platform.placement
    met = ca.SX(1) if placement.discriminant is None else placement.discriminant
    b.output("met", met, "1")
    loops = loops_of(b, platform)
    b.output("discriminant", [loop.discriminant for loop in loops], "1")
    if "pose" in wanted:
        b.output("pose", platform.pose, ANGLE_UNITS)
    if "joint" in wanted:
        b.output("joint", [loop.q_r[0] for loop in loops], "rad or m")
    if "rates" in wanted:
        b.output("rates", on_rates(b, platform, [c.J for c in loops]), "", structure.m)
    transmission = [loop.J_A / loop.J_A_scale for loop in loops]
    if "transmission" in wanted:
        b.output("transmission", transmission, "1")
    rows = on_rates(b, platform, [c.rod / c.rod_length for c in loops], scaled=True)
    if "rows" in wanted:
        b.output("rows", rows, "1", structure.m)
    if "ratio" in wanted:
        sigma, quality = singular_values(b.total, rows)
        size = [ca.fabs(t) for t in transmission]
        b.output("J_W_sigma", sigma, "1", structure.m)
        extremes = ca.vertcat(b.least(size), -b.least([-s for s in size]))
        b.output("J_A_extremes", extremes, "1")
        b.check(quality, CONVERGED)
    if "points" in wanted:
        contacts = single_contacts(structure, b.parameter)
        levers = contact_frame(contacts, placement.position, platform.R).levers
        points = [placement.position + lever for lever in levers]
        b.output("points", ca.horzcat(ca.SX(3, 0), *points).T, "m", len(contacts), 3)
    return b.finish()
