"""What a pose is like, for maps of many poses: only what is wanted is computed.

Each chain's discriminant always is, since it says who forbids a pose.
"""

from __future__ import annotations

from collections.abc import Collection

import casadi as ca

from ..graph.program import Program
from .builder import Builder
from .configuration import add_singularity, loops_of, on_rates
from .platform import ANGLE_UNITS, closed, contacts, given
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
    met = platform.placement.discriminant
    b.output("met", ca.SX(1) if met is None else met, "1")
    loops = loops_of(b, platform)
    b.output("discriminant", [loop.discriminant for loop in loops], "1")
    if "pose" in wanted:
        b.output("pose", platform.pose, ANGLE_UNITS)
    if "joint" in wanted:
        b.output("joint", [loop.q_r[0] for loop in loops], "rad or m")
    if "rates" in wanted:
        b.output("rates", on_rates(b, platform, [c.J for c in loops]), "", structure.m)
    if "transmission" in wanted:
        b.output("transmission", [loop.transmission for loop in loops], "1")
    rows = on_rates(b, platform, [c.rod / c.rod_length for c in loops], scaled=True)
    if "rows" in wanted:
        b.output("rows", rows, "1", structure.m)
    if "ratio" in wanted:
        add_singularity(b, loops, rows)
    if "points" in wanted:
        b.output("points", contacts(b, platform).point.T, "m", len(structure.contacts), 3)
    return b.finish()
