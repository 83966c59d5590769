"""The regressor: the equations of motion in the numbers of bodies and actuators, linear in them.

    Y pi + w = (J_theta M_J)^T effort,

dual to q_EE', with w of load and ligaments. pi are the standard numbers: of the platform its mass,
first moment and inertia about O_M; of a chain those of its family, `Family.standard`, and of its
actuator. A column is the derivative of virtual power by its number, exact at any value of it.
"""

from __future__ import annotations

import casadi as ca

from ..dynamics.formulation import PlatformBody
from ..dynamics.virtual_power import VirtualPower
from ..graph.program import Program
from ..kinematics.chain import FAMILIES
from ..kinematics.chain.family import Constants
from ..kinematics.constraints import indices, solve_small
from ..kinematics.state import PointMotion, State, twist_state
from ..mechanism.actuator import Actuator
from ..mechanism.quantities import Unit, number_fields
from ..status import Status
from .builder import Builder
from .equations import Wrench, symmetric
from .numbers import NO_LOSSES
from .passive import bearing
from .platform import contacts, given
from .structure import Structure

PLATFORM = {
    "platform.mass": "kg",
    **{f"platform.moment.{axis}": "kg m" for axis in "xyz"},
    **{f"platform.inertia.{entry}": "kg m^2" for entry in ("xx", "yy", "zz", "xy", "xz", "yz")},
}
ROTOR = "actuator.rotor"


def chain_numbers(kind: str) -> dict[str, str]:
    """Standard numbers of a chain of a family: a crank's inertia has its rotor's in it."""
    family, fields = FAMILIES[kind], number_fields(Actuator)
    own = {f"actuator.{key}": fields[key].unit for key in ("viscous", "coulomb")}
    if "crank.inertia" not in family.standard:
        own = {ROTOR: Unit("kg m^2", "kg"), **own}
    return family.standard | {name: str(unit.at(family.joint_unit)) for name, unit in own.items()}


def regressor(structure: Structure) -> Program:
    """Y, the load's w, and the actuators' rows, at whole poses that meet the contacts.

    Results: platform (m, 10), load (m,), and a chain's `chain_<group>` (m, p) and `row` (m,), dual
    to q_EE'; with contacts the same that gives their forces, `contact_platform` (k, 10) ..:

        contact_force = contact_Y pi + contact_load - contact_row effort.

    `friction` (m, k) and `contact_friction` (k, k), times |contact_force|, add to the load.
    """
    b = Builder(structure)
    platform, load = given(b), Wrench.of(b)
    motion = platform.motion
    state = twist_state(platform.position, motion.R, motion.twist, motion.twist_rate)
    admissible = motion.E @ motion.M_J
    rows = {"": admissible.T}
    if dep := indices(structure.dependent):
        # Across the contacts: the equations dual to the dependent coordinates.
        across, touch = motion.E[:, dep].T, contacts(b, platform)
        rows["contact_"] = solve_small(across @ touch.N, across)
        for prefix, projection in rows.items():
            b.output(f"{prefix}friction", projection @ touch.T, "", projection.shape[0], len(dep))
    own, known = _platform(b, state), bearing(b, state) - load.about_centre(state.R)
    for prefix, projection in rows.items():
        b.output(f"{prefix}platform", projection @ own, "", projection.shape[0], len(PLATFORM))
        b.output(f"{prefix}load", projection @ known, "N, N m", projection.shape[0])
    chains = [_chain(b, group, state) for group in range(len(structure.chains))]
    least = b.least([discriminant for *_, discriminant in chains])
    b.check(least, 0.0, Status.unreachable)
    for prefix, projection in rows.items():
        size = projection.shape[0]
        b.output(f"{prefix}row", [projection @ row for row, *_ in chains], "", size)
        for group, (_, Y, _) in enumerate(chains):
            alone: list[ca.SX | None] = [None] * len(chains)
            alone[group] = projection @ Y
            b.output(f"{prefix}chain_{group}", alone, "", size, Y.shape[1])
    return b.finish()


def _platform(b: Builder, state: State) -> ca.SX:
    """Wrench of inertia less gravity of the platform by its ten numbers, (6, 10)."""
    own = ca.SX.sym("platform", len(PLATFORM))
    body = PlatformBody(own[0], own[1:4], symmetric(ca.vertsplit(own[4:])))
    force = VirtualPower().platform(state, body, b.gravity)
    if b.base is not None:
        force += body.carried(state, b.base)
    return ca.jacobian(force, own)


def _chain(b: Builder, group: int, state: State) -> tuple[ca.SX, ca.SX, ca.SX]:
    """The actuator's row and the wrench by the chain's numbers, dual to the twist: (6,), (6, p).

    Also the chain's discriminant.
    """
    kind = b.structure.families[group]
    family = FAMILIES[kind]
    c = family.named(b.lane(group, "constants"))
    M = state.point(b.lane(group, "joint"))
    own = ca.SX.sym("chain", len(family.standard))
    names = [name.replace(".", "_") for name in family.standard]
    numbers = Constants(**dict(zip(names, ca.vertsplit(own), strict=True)))
    bodies = Constants(**vars(c) | family.of_standard(c, numbers))
    dynamics = VirtualPower().chain(family, bodies, M, b.gravity)
    mask = b.lane(group, "mask")
    forces = list(dynamics.forces.values())
    if b.base is not None:
        forces.append(VirtualPower().carried_chain(family, bodies, M, b.base))
    wrenches = [_moved(M, ca.jacobian(force, own)) for force in forces]
    # Linear, so that the slope is the same at all numbers: where each body has a mass.
    somewhere = ca.DM([float(name.endswith("mass")) for name in family.standard])
    Y = mask * sum((ca.substitute(w, own, somewhere) for w in wrenches), ca.SX(6, own.numel()))
    row = mask * _moved(M, dynamics.J)
    rate, acceleration = dynamics.rate, dynamics.acceleration
    square = b.lane(group, "actuator")[3] if b.structure.losses else NO_LOSSES[3]
    losses = [acceleration, rate, rate / ca.sqrt(rate * rate + square)]
    chosen = losses[-len(chain_numbers(kind)) + own.numel() :]
    return row, ca.horzcat(Y, *(row * value for value in chosen)), dynamics.discriminant


def _moved(M: PointMotion, forces: ca.SX) -> ca.SX:
    """Wrenches about O_M of forces on M, a column each."""
    return ca.vertcat(forces, ca.skew(M.lever) @ forces)
