"""Reactions: what every joint, guide and contact carries at given efforts.

The free bodies of each chain (`free_body`) are solved for the efforts of an evaluation, so that
Newton and Euler hold for every body. All vectors are in {S}; each acts on the body it names, and
its opposite on the other. A crank's own weight is not in them: a mechanism file states no mass
for a crank, which turns about its mass centre.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

import casadi as ca
import numpy as np

from ..kinematics.batch import evaluate
from ..kinematics.chain import FAMILIES, Constants, Family, Joint
from ..kinematics.closure import contact_symbols
from ..kinematics.contact import contact_frame, solve_small
from ..kinematics.state import PointMotion, pose_state
from ..mechanism.mechanism import Mechanism
from .equations import chain_symbols, platform_joints
from .free_body import FreeBodies, free_bodies
from .joint_space import JointState, joint_motion

if TYPE_CHECKING:
    from ..model import Evaluation, Model


@dataclass(frozen=True)
class Place:
    """Which reaction it is.

    quantity: "platform_joint", "crank_tip", "shaft_force", "shaft_moment", ..., "contact".
    owner:    name of the chain or contact.
    body, by: the body it acts on, and the one that exerts it.
    place:    where the force acts, or the point that the moment is about.
    effort:   whether the actuator's effort is part of it.
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


@dataclass(frozen=True)
class Reaction(Place):
    """A reaction at N samples: components in {S}, (N, 3), and its place in {S}, (N, 3) [m]."""

    frame: ClassVar[str] = "{S}"
    array: np.ndarray = field(kw_only=True)
    point: np.ndarray = field(kw_only=True)


def reactions(
    model: Model, evaluation: Evaluation, effort: np.ndarray | None = None
) -> dict[str, Reaction]:
    """Reactions at the samples of an evaluation; NaN where a sample failed.

    Args:    evaluation: of the model, with contact forces.
             effort: (N, n), the efforts to balance if not those of the evaluation. The contact
             forces are the evaluation's in any case.
    Returns: by name: <joint>_<chain>, <joint>_force_<chain>, <joint>_moment_<chain>,
             guide_moment_<chain>, contact_<contact>.
    """
    mechanism, poses, torques = model.mechanism, evaluation.poses, evaluation.torques
    effort = torques.torque if effort is None else effort
    assert torques.contact_force is not None
    inputs = (poses.pose, poses.rate, poses.acceleration, effort, torques.contact_force)
    with np.errstate(invalid="ignore"):
        values, points = evaluate(reaction_function(mechanism), *inputs)
    values[evaluation.status != 0] = np.nan
    shape = (len(effort), -1, 3)
    return {
        place.name: Reaction(**vars(place), array=array, point=point)
        for place, array, point in zip(
            reaction_places(mechanism),
            values.reshape(shape).transpose(1, 0, 2),
            points.reshape(shape).transpose(1, 0, 2),
            strict=True,
        )
    }


def reaction_places(mechanism: Mechanism) -> list[Place]:
    """What `reactions` computes, in its order."""
    return [
        *(place for c in mechanism.chains for place in _places(FAMILIES[c.kind], c.name)),
        *(
            Place("contact", name, "platform", "surface", "centre of the ball")
            for name in mechanism.contact_names
        ),
    ]


def reaction_function(mechanism: Mechanism) -> ca.Function:
    """(X_EE, X_EE', X_EE'', tau, lambda) -> reactions (3, r) and their points (3, r)."""
    n, k = len(mechanism.chains), len(mechanism.contacts)
    X, X1, X2 = (ca.SX.sym(name, 6) for name in ("X", "X1", "X2"))
    tau, contact = ca.SX.sym("tau", n), ca.SX.sym("contact", k)
    g = ca.SX(ca.DM(mechanism.gravity))
    state = pose_state(X, X1, X2)
    values, points = [], []
    pairs = zip(chain_symbols(mechanism), platform_joints(mechanism), strict=True)
    for i, ((family, constants), joint) in enumerate(pairs):
        value, point = chain_reactions(family, constants, state.point(joint), tau[i], g)
        values.append(value)
        points.append(point)
    frame = contact_frame(contact_symbols(mechanism), X[:3], state.R)
    for i, (gradient, lever) in enumerate(zip(frame.gradients, frame.levers, strict=True)):
        values.append(contact[i] * gradient / ca.norm_2(gradient))
        points.append(X[:3] + lever)
    outputs = ca.cse([ca.densify(ca.horzcat(*columns)) for columns in (values, points)])
    return ca.Function("reactions", [X, X1, X2, tau, contact], outputs)


def chain_reactions(
    family: Family, c: Constants, M: PointMotion, tau: ca.SX, g: ca.SX
) -> tuple[ca.SX, ca.SX]:
    """Reactions of one chain under the effort tau, and their points, (3, r) each."""
    s = JointState.symbols()
    bodies = free_bodies(family, c, s, g)
    values, points = zip(*_quantities(bodies), strict=True)
    links = bodies.weight.numel()
    all_weights = ca.SX.ones(links)
    motion = joint_motion(family, c, M)
    carried = ca.substitute(ca.horzcat(*values), bodies.weight, all_weights)
    K, R, carried, where = motion.insert(s, [bodies.K, bodies.R, carried, ca.horzcat(*points)])
    solved = solve_small(K, bodies.E * tau - R @ all_weights)
    return ca.substitute(carried, bodies.unknown, solved), where


def _quantities(bodies: FreeBodies) -> Iterator[tuple[ca.SX, ca.SX]]:
    """Vector and point of each reaction of a chain, in the order of `_places`."""
    yield bodies.unknown[:3], bodies.tip
    for i, joint in enumerate(bodies.joints):
        yield bodies.carried.forces[i], joint.point
        if not is_ball(joint):
            yield bodies.carried.moments[i], joint.point
        if (guide := bodies.carried.guides[i]) is not None:
            yield guide, joint.point


def _places(family: Family, owner: str) -> Iterator[Place]:
    """The reactions of one chain, in the order of `_quantities`."""
    c = family.named(ca.SX.sym("c", family.size()))
    names = [name.removesuffix("s") for name in family.bodies]
    yield Place("platform_joint", owner, "platform", names[-1], "platform joint M")
    for i, joint in enumerate(family.joints(c, ca.SX.sym("q_r", 3))):
        ends = (owner, names[i], names[i - 1] if i else "base", joint.place)
        turned = joint.driven and joint.turns.shape[1] > 0
        if is_ball(joint):
            yield Place(joint.name, *ends)
        else:
            yield Place(f"{joint.name}_force", *ends, effort=joint.driven and not turned)
            yield Place(f"{joint.name}_moment", *ends, unit="N m", effort=turned)
        if joint.guide is not None:
            yield Place("guide_moment", owner, names[i], "base", joint.place, unit="N m")


def is_ball(joint: Joint) -> bool:
    """Whether the joint carries no moment."""
    return joint.turns.shape[1] == 3


def reaction_variables(
    mechanism: Mechanism, found: dict[str, Reaction]
) -> tuple[dict[str, tuple[Any, ...]], dict[str, list[str]]]:
    """Variables and coordinates of a dataset, as xarray takes them.

    `reaction_<quantity>` has dimensions (time, chain, axis), or, where only chains of some
    families have it, (time, chain_<families>, axis) with those chains alone; contact forces are
    `contact_force_vector` (time, contact, axis).
    """
    variables: dict[str, tuple[Any, ...]] = {}
    coordinates: dict[str, list[str]] = {}
    groups: dict[str, list[Reaction]] = {}
    for reaction in found.values():
        groups.setdefault(reaction.quantity, []).append(reaction)
    for quantity, group in groups.items():
        owners = [reaction.owner for reaction in group]
        name, dimension = f"reaction_{quantity}", "chain"
        if quantity == "contact":
            name, dimension = "contact_force_vector", "contact"
        elif len(owners) < len(mechanism.chains):
            kinds = {c.kind: None for c in mechanism.chains if c.name in owners}
            dimension = "_".join(("chain", *kinds))
            coordinates[dimension] = owners
        values = np.stack([reaction.array for reaction in group], axis=1)
        variables[name] = (("time", dimension, "axis"), values, _attributes(group))
    return variables, coordinates


def _attributes(group: list[Reaction]) -> dict[str, str]:
    def joined(key: str) -> str:
        return ", ".join(dict.fromkeys(getattr(reaction, key) for reaction in group))

    keys = ("long_name", "body", "by", "place")
    return {"units": joined("unit"), **{key: joined(key) for key in keys}, "frame": Reaction.frame}
