"""Passive forces on the platform: ligaments, lines that pull beyond their slack length.

    force = max(0, elastic + damping L') where L > slack_length, else 0

elastic = sum_k bend_k max(0, L - knot_k): a line of one stiffness has its slack length for a knot,
and a table of strain and force one knot a row but the last.
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
    """

    length: ca.SX
    force: ca.SX
    generalized: ca.SX
    stored: ca.SX
    lost: ca.SX


def pulls(b: Builder, state: State) -> list[Pull]:
    """The ligaments."""
    found = []
    for i in range(len(b.structure.ligaments)):
        base, insertion, damping, knots, bends = (
            b.parameter(f"ligament_{name}_{i}")
            for name in ("base", "platform", "damping", "knots", "bends")
        )
        M = state.point(insertion)
        line = M.position - base
        length = ca.sqrt(ca.fmax(ca.dot(line, line), TINY))
        along = line / length
        rate = ca.dot(along, M.velocity)
        beyond = ca.fmax(length - knots, 0)
        elastic = ca.dot(bends, beyond)
        force = ca.fmax(elastic + (length > knots[0]) * damping * rate, 0)
        found.append(
            Pull(
                length,
                force,
                state.generalized_force(-force * along, M.lever),
                ca.dot(bends, beyond * beyond) / 2,
                (force - elastic) * rate,
            )
        )
    return found


def bearing(b: Builder, state: State) -> ca.SX:
    """The generalized force that balances ligaments, dual to the state's rates."""
    return -sum((one.generalized for one in pulls(b, state)), ca.SX.zeros(state.B.shape[1]))


def passive(structure: Structure) -> Program:
    """Lengths and forces of ligaments, (L,) each, at whole poses that meet the contacts."""
    b = Builder(structure)
    platform = given(b)
    motion = platform.motion
    found = pulls(b, pose_state(platform.pose, motion.rate, motion.acceleration))
    for name, unit in (("length", "m"), ("force", "N")):
        value = ca.vertcat(*(getattr(one, name) for one in found))
        b.output(f"ligament_{name}", value, unit, len(found))
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
