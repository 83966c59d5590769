"""Reactions: forces and moments of every joint, guide and contact at given efforts.

The free bodies of each chain (`free_body`) are solved for the efforts, so that Newton and Euler
hold for every body. All vectors are in {S}; each acts on the body it names, and its opposite on the
other. A crank's own weight is included as far as the mechanism file states its mass.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import casadi as ca

from ..dynamics.free_body import FreeBodies, free_bodies
from ..dynamics.joint_space import JointState, joint_motion
from ..graph.program import Program
from ..kinematics.chain import FAMILIES, Constants, Family, Joint
from ..kinematics.constraints import solve_small
from ..kinematics.moving_base import MovingBase
from ..kinematics.state import PointMotion, pose_state
from ..mechanism.mechanism import Mechanism
from .builder import Builder
from .platform import contacts, given
from .structure import Structure

POINT = "point of "  # prefix of the name of a quantity's point


@dataclass(frozen=True)
class ReactionPlace:
    """The identity of a reaction.

    quantity: "platform_joint", "crank_tip", "shaft_force", "shaft_moment", ..., "contact".
    owner:    name of the chain or contact.
    body, by: the body it acts on, and the one that exerts it.
    place:    point of action of the force, or reference point of the moment.
    effort:   whether it includes the actuator's effort.
    """

    quantity: str
    owner: str
    body: str
    by: str
    place: str
    unit: str = "N"
    effort: bool = False

    @property
    def name(self) -> str:
        """As in "crank_tip_masseter_left"."""
        return f"{self.quantity}_{self.owner}"

    @property
    def long_name(self) -> str:
        kind, at = ("force", "at") if self.unit == "N" else ("moment", "about")
        text = f"{kind} on the {self.body} from the {self.by}, {at} the {self.place}"
        return f"{text}, with the actuator's effort" if self.effort else text


def reactions(structure: Structure) -> Program:
    """Vectors, (3,) each, and their points, by quantity, for all chains that have it."""
    b = Builder(structure)
    platform = given(b)
    effort, force = b.lane_sample("effort"), b.sample("contact_force", len(structure.contacts), "N")
    g = b.gravity
    motion = platform.motion
    state = pose_state(platform.pose, motion.rate, motion.acceleration)
    by_quantity: dict[str, list[tuple[ca.SX, ca.SX] | None]] = {}
    units: dict[str, str] = {}
    for group, kind in enumerate(structure.families):
        family = FAMILIES[kind]
        M = state.point(b.lane(group, "joint"))
        constants = family.named(b.lane(group, "constants"))
        pairs = chain_reactions(family, constants, M, effort[group], g, b.base)
        for place, pair in zip(chain_places(family, ""), pairs, strict=True):
            by_quantity.setdefault(place.quantity, [None] * len(structure.chains))[group] = pair
            units[place.quantity] = place.unit
    for name, own in by_quantity.items():
        b.output(name, [None if pair is None else pair[0] for pair in own], units[name])
        b.output(POINT + name, [None if pair is None else pair[1] for pair in own], "m")
    touch, k = contacts(b, platform), len(structure.contacts)
    b.output("contact", (touch.normal @ ca.diag(force)).T, "N", k, 3)
    b.output(POINT + "contact", touch.point.T, "m", k, 3)
    return b.finish()


def reaction_places(mechanism: Mechanism) -> list[ReactionPlace]:
    """The reactions in the order of `reactions`."""
    return [
        *(place for c in mechanism.chains for place in chain_places(FAMILIES[c.kind], c.name)),
        *(
            ReactionPlace("contact", name, "platform", "surface", "centre of the ball")
            for name in mechanism.contact_names
        ),
    ]


def chain_reactions(
    family: Family,
    c: Constants,
    M: PointMotion,
    tau: ca.SX,
    g: ca.SX,
    base: MovingBase | None = None,
) -> list[tuple[ca.SX, ca.SX]]:
    """Reactions of one chain under the effort tau, and their points, (3,) each."""
    if not family.bodies:
        return [(family.loop(c, M.position).J * tau, M.position)]
    s = JointState.symbols()
    bodies = free_bodies(family, c, s, g, base)
    values, points = zip(*_quantities(bodies), strict=True)
    all_weights = ca.SX.ones(bodies.weight.numel())
    motion = joint_motion(family, c, M)
    carried = ca.substitute(ca.horzcat(*values), bodies.weight, all_weights)
    K, R, carried, where = motion.insert(s, [bodies.K, bodies.R, carried, ca.horzcat(*points)])
    solved = solve_small(K, bodies.E * tau - R @ all_weights)
    carried = ca.substitute(carried, bodies.unknown, solved)
    return list(zip(ca.horzsplit(carried), ca.horzsplit(where), strict=True))


def _quantities(bodies: FreeBodies) -> Iterator[tuple[ca.SX, ca.SX]]:
    """Vector and point of each reaction of a chain, in the order of `chain_places`."""
    yield bodies.unknown[:3], bodies.end_point
    for i, joint in enumerate(bodies.joints):
        yield bodies.carried.forces[i], joint.point
        if not is_ball(joint):
            yield bodies.carried.moments[i], joint.point
        if (guide := bodies.carried.guides[i]) is not None:
            yield guide, joint.point


def chain_places(family: Family, owner: str) -> Iterator[ReactionPlace]:
    """The reactions of one chain, in the order of `_quantities`; without bodies, its pull."""
    if not family.bodies:
        yield ReactionPlace("platform_joint", owner, "platform", family.kind, "platform joint M")
        return
    c = family.named(ca.SX.sym("c", family.size()))
    names = [name.removesuffix("s") for name in family.bodies]
    yield ReactionPlace("platform_joint", owner, "platform", names[-1], "platform joint M")
    for i, joint in enumerate(family.joints(c, ca.SX.sym("q_r", 3))):
        ends = (owner, names[i], names[i - 1] if i else "base", joint.place)
        turned = joint.driven and joint.turns.shape[1] > 0
        if is_ball(joint):
            yield ReactionPlace(joint.name, *ends)
        else:
            yield ReactionPlace(f"{joint.name}_force", *ends, effort=joint.driven and not turned)
            yield ReactionPlace(f"{joint.name}_moment", *ends, unit="N m", effort=turned)
        if joint.guide is not None:
            yield ReactionPlace("guide_moment", owner, names[i], "base", joint.place, unit="N m")


def is_ball(joint: Joint) -> bool:
    """Whether the joint carries no moment."""
    return joint.turns.shape[1] == 3
