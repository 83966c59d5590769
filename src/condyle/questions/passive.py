"""Passive forces on the platform: ligaments, lines that pull beyond their slack length, and walls.

    force = elastic + damping L', the latter between -elastic and elastic

elastic = sum_k bend_k max(0, L - knot_k): a line of one stiffness has its slack length for a knot,
and a table of strain and force one knot a row but the last. A wall's force is no function of the
state, but an unknown of the distribution.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from ..graph.program import Program
from ..kinematics.state import State, pose_state
from .builder import Builder
from .platform import given
from .structure import Structure

PASSIVE = "passive"  # the part of the efforts that bears ligaments
TINY = 1e-30  # m^2, of a line of no length


@dataclass(frozen=True)
class Pull:
    """A ligament at one sample: length L [m], force [N], and its generalized force on the platform.

    stored: its elastic energy [J];  lost: power that its damping takes [W].
    row: dL by the state's coordinates;  stiffness: of its length [N/m];  damping: [N s/m], taut.
    """

    length: ca.SX
    force: ca.SX
    generalized: ca.SX
    stored: ca.SX
    lost: ca.SX
    row: ca.SX
    stiffness: ca.SX
    damping: ca.SX


def pulls(b: Builder, state: State) -> list[Pull]:
    """The ligaments."""
    tensions = []
    for i in range(len(b.structure.ligaments)):
        base, insertion, damping, knots, bends = (
            b.parameter(f"ligament_{name}_{i}")
            for name in ("base", "platform", "damping", "knots", "bends")
        )
        M = state.point(insertion)
        line = M.position - base
        length = ca.sqrt(ca.fmax(ca.dot(line, line), TINY))
        direction = line / length
        rate = ca.dot(direction, M.velocity)
        beyond = ca.fmax(length - knots, 0)
        elastic = ca.dot(bends, beyond)
        force = elastic + ca.fmin(ca.fmax(damping * rate, -elastic), elastic)
        row = state.generalized_force(direction, M.lever)
        tensions.append(
            Pull(
                length,
                force,
                -force * row,
                ca.dot(bends, beyond * beyond) / 2,
                (force - elastic) * rate,
                row,
                ca.dot(bends, length > knots),
                damping * (elastic > 0),
            )
        )
    return tensions


def bearing(b: Builder, state: State) -> ca.SX:
    """The generalized force that balances ligaments, dual to the state's rates."""
    return -sum((one.generalized for one in pulls(b, state)), ca.SX.zeros(state.B.shape[1]))


def sides(b: Builder, state: State) -> list[tuple[ca.SX, ca.SX]]:
    """Gaps of the walls [m], and generalized forces of their unit pushes."""
    gaps = []
    for i, push in enumerate(b.structure.walls):
        M, plane = state.point(b.parameter(f"wall_point_{i}")), b.parameter(f"wall_surface_{i}")
        upward = ca.vertcat(-plane[0], -plane[1], 1)
        normal = push * upward / ca.norm_2(upward)
        gap = ca.dot(normal, M.position) - normal[2] * plane[2]
        gaps.append((gap, state.generalized_force(normal, M.lever)))
    return gaps


def passive(structure: Structure) -> Program:
    """Passive parts at whole poses that meet the contacts: lengths and forces of ligaments,
    (L,) each, and gaps of walls, (W,).
    """
    b = Builder(structure)
    platform = given(b)
    motion = platform.motion
    state = pose_state(platform.pose, motion.rate, motion.acceleration)
    ligaments, walls = pulls(b, state), sides(b, state)
    if walls:
        b.output("wall_gap", ca.vertcat(*(gap for gap, _ in walls)), "m", len(walls))
    for name, unit in (("length", "m"), ("force", "N")) if ligaments else ():
        value = ca.vertcat(*(getattr(one, name) for one in ligaments))
        b.output(f"ligament_{name}", value, unit, len(ligaments))
    return b.finish()


def knots_and_bends(slack: ca.SX, stiffness: ca.SX, rows: int) -> tuple[ca.SX, ca.SX]:
    """Lengths [m] where the stiffness changes, and by how much [N/m].

    Args: stiffness: of a file: a number, or strain and force of `rows` rows, one after another.
    """
    if not rows:
        return slack, stiffness
    strains, forces = stiffness[0::2], stiffness[1::2]
    slopes = (forces[1:] - forces[:-1]) / (slack * (strains[1:] - strains[:-1]))
    return slack * (1 + strains[:-1]), slopes - ca.vertcat(0, slopes[:-1])
