"""The equations of motion of one mechanism as CasADi functions of samples.

    Pi^T (forces) = (J Pi)^T tau,     forces - J^T tau = G mu,

where `forces` (inertia less gravity less bite) and the rows of J are dual to the coordinates of
the state, Pi maps the independent rates to the state's rates, and the contacts act along G. The
route decides the state: `direct` works in q_EE itself (Model 1: Pi = E), `core` in the six
coordinates of the mechanism without contacts (Model 2: Pi = M_J).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca
import numpy as np

from ..errors import UnsupportedError
from ..kinematics.chain import FAMILIES, Constants, Family, Law
from ..kinematics.closure import contact_symbols
from ..kinematics.contact import (
    angle_equation,
    closed_form,
    closed_form_available,
    contact_frame,
    indices,
    parasitic_jacobian,
)
from ..kinematics.parasitic import whole_motion
from ..kinematics.state import (
    PointMotion,
    State,
    independent_state,
    pose_state,
    twist_state,
)
from ..mechanism.home import dependent_coordinates, independent_coordinates
from ..mechanism.mechanism import Mechanism
from .formulation import Body, Formulation


@dataclass(frozen=True)
class DynamicsOutputs:
    """Names and shapes of what `dynamics` functions return, by the order of the fields.

    forces: (s, parts)   J: (n, s)   Pi: (s, m)   rate, acceleration, reach: (n,)
    """

    forces: ca.SX
    J: ca.SX
    Pi: ca.SX
    rate: ca.SX
    acceleration: ca.SX
    reach: ca.SX


def part_names(mechanism: Mechanism) -> tuple[str, ...]:
    """Parts that share the torques: platform, the links of the chains, bite."""
    links: dict[str, None] = {}
    for chain in mechanism.chains:
        links.update(dict.fromkeys(reversed(FAMILIES[chain.kind].bodies)))
    return ("platform", *links, "bite")


def chain_symbols(mechanism: Mechanism) -> list[tuple[Family, Constants]]:
    """Each chain's family and its numbers."""
    pairs = []
    for chain in mechanism.chains:
        family = FAMILIES[chain.kind]
        pairs.append((family, family.named(ca.SX(ca.DM(family.vector(family.constants(chain)))))))
    return pairs


def platform_joints(mechanism: Mechanism) -> list[ca.SX]:
    return [ca.SX(ca.DM(chain.platform)) for chain in mechanism.chains]


def dynamics_outputs(
    mechanism: Mechanism,
    formulation: Formulation,
    state: State,
    Pi: ca.SX,
    load: ca.SX,
) -> DynamicsOutputs:
    """Forces by part, actuator Jacobian and joint motion, as expressions in a state."""
    g = ca.SX(ca.DM(mechanism.gravity))
    platform = mechanism.platform
    body = Body(ca.SX(platform.mass), ca.SX.zeros(3), ca.SX(ca.DM(platform.inertia.tensor())))
    size = state.B.shape[1]
    parts = {name: ca.SX(size, 1) for name in part_names(mechanism)}
    parts["platform"] = formulation.platform(state, body, g)
    r, force, moment = state.R @ load[6:], load[:3], load[3:6]
    bite = ca.vertcat(force, ca.cross(r, force) + moment)
    parts["bite"] = -(state.B.T @ bite)

    laws, cache = [], {}
    rows = []
    for (family, constants), joint in zip(
        chain_symbols(mechanism), platform_joints(mechanism), strict=True
    ):
        M = state.point(joint)
        if family.kind not in cache:
            cache[family.kind] = law_function(formulation, family)
        law = cache[family.kind](constants, M, g)
        laws.append(law)
        for name, force in law.forces.items():
            parts[name] += state.pull(force, M.lever)
        rows.append(state.pull(law.J, M.lever).T)
    return DynamicsOutputs(
        forces=ca.horzcat(*parts.values()),
        J=ca.vertcat(*rows),
        Pi=Pi,
        rate=ca.vertcat(*(law.rate for law in laws)),
        acceleration=ca.vertcat(*(law.acceleration for law in laws)),
        reach=ca.vertcat(*(law.reach for law in laws)),
    )


def core_function(mechanism: Mechanism, formulation: Formulation) -> ca.Function:
    """Model 2: (X_EE, X_EE', X_EE'', load) -> DynamicsOutputs, G (s, k) and |grad phi| (k,).

    load: force and moment in {S} and the point they act at in {M}, (9,).
    """
    X, X1, X2 = (ca.SX.sym(name, 6) for name in ("X", "X1", "X2"))
    load = ca.SX.sym("load", 9)
    state = pose_state(X, X1, X2)
    frame = contact_frame(contact_symbols(mechanism), X[:3], state.R)
    M_J = parasitic_jacobian(frame.N.T @ state.B, dependent_coordinates(mechanism))
    Pi, G = M_J, state.B.T @ frame.N
    if formulation.uses_twist:
        Pi, G = state.B @ M_J, frame.N
        state = twist_state(X, state.R, state.twist, state.twist_rate)
    outputs = dynamics_outputs(mechanism, formulation, state, Pi, load)
    return _function("core", [X, X1, X2, load], [*vars(outputs).values(), G, frame.n_length])


def direct_function(mechanism: Mechanism, formulation: Formulation) -> ca.Function:
    """Model 1: (q_EE, q_EE', q_EE'', load) -> DynamicsOutputs.

    Raises: UnsupportedError: where the parasitic motion has no closed form.
    """
    dependent = dependent_coordinates(mechanism)
    require_closed_form(mechanism)
    m = 6 - len(dependent)
    q, q1, q2 = (ca.SX.sym(name, m) for name in ("q", "q1", "q2"))
    load = ca.SX.sym("load", 9)
    placement = closed_form(
        contact_symbols(mechanism), dependent, q, ca.SX(closed_branch(mechanism))
    )
    state = independent_state(q, q1, q2, placement.pose())
    outputs = dynamics_outputs(mechanism, formulation, state, ca.SX.eye(m), load)
    return _function("direct", [q, q1, q2, load], list(vars(outputs).values()))


def closure_function(mechanism: Mechanism) -> ca.Function:
    """Closed-form parasitic motion: (q, q', q'') -> X_EE, X_EE', X_EE'', reach."""
    dependent = dependent_coordinates(mechanism)
    m = 6 - len(dependent)
    q, q1, q2 = (ca.SX.sym(name, m) for name in ("q", "q1", "q2"))
    contacts = contact_symbols(mechanism)
    placement = closed_form(contacts, dependent, q, ca.SX(closed_branch(mechanism)))
    motion = whole_motion(contacts, dependent, placement, q1, q2)
    pose = placement.pose()
    # The given angles as they are: arc functions would take them to their principal values.
    pose[indices(independent_coordinates(mechanism))] = q
    reach = placement.reach if placement.reach is not None else ca.SX(1.0)
    return _function("closure", [q, q1, q2], [pose, motion.rate, motion.acceleration, reach])


def posture_function(mechanism: Mechanism) -> ca.Function:
    """X_EE -> joint coordinates (n, 3), J_A, J_W, contact points and normals.

    Outputs: q_r (n, 3), cos_gamma (n,), J_A (n,), J_A_scale (n,), J_W (n, 6) dual to X_EE' and
    the rods' lengths (n,), M_J (6, m), reach (n,), contact points (3, k), unit normals (3, k).
    """
    X = ca.SX.sym("X", 6)
    state = pose_state(X, ca.SX.zeros(6), ca.SX.zeros(6))
    frame = contact_frame(contact_symbols(mechanism), X[:3], state.R)
    M_J = parasitic_jacobian(frame.N.T @ state.B, dependent_coordinates(mechanism))
    loops, J_W = [], []
    for (family, constants), joint in zip(
        chain_symbols(mechanism), platform_joints(mechanism), strict=True
    ):
        M = state.point(joint)
        loop = family.loop(constants, M.position)
        loops.append(loop)
        J_W.append(2 * state.pull(loop.rod, M.lever).T)
    points = ca.horzcat(ca.SX(3, 0), *(X[:3] + r for r in frame.levers))
    normals = ca.horzcat(ca.SX(3, 0), *(n / ca.norm_2(n) for n in frame.gradients))
    columns = [
        ca.vertcat(*(loop.q_r.T for loop in loops)),
        *(
            ca.vertcat(*(getattr(loop, name) for loop in loops))
            for name in ("cos_gamma", "J_A", "J_A_scale")
        ),
        ca.vertcat(*J_W),
        ca.vertcat(*(loop.rod_length for loop in loops)),
        M_J,
        ca.vertcat(*(loop.reach for loop in loops)),
        points,
        normals,
    ]
    return _function("posture", [X], columns)


def law_function(
    formulation: Formulation, family: Family
) -> Callable[[Constants, PointMotion, ca.SX], Law]:
    """A family's law, derived once and called for each chain with its numbers."""
    c = ca.SX.sym("c", family.size())
    P, V, A, r, g = (ca.SX.sym(name, 3) for name in "PVArg")
    law = formulation.chain(family, family.named(c), PointMotion(P, V, A, r), g)
    names = list(law.forces)
    outputs = [*law.forces.values(), law.J, law.reach, law.rate, law.acceleration]
    function = ca.Function("law", [c, P, V, A, g], outputs)

    def call(constants: Constants, M: PointMotion, gravity: ca.SX) -> Law:
        vector = ca.vertcat(*(_flat(getattr(constants, name)) for name in family.shapes))
        values = function.call([vector, M.position, M.velocity, M.acceleration, gravity])
        forces = dict(zip(names, values, strict=False))
        J, reach, rate, acceleration = values[len(names) :]
        return Law(forces, J, reach, rate, acceleration)

    return call


def _flat(value: ca.SX) -> ca.SX:
    return ca.vec(value.T) if value.shape == (3, 3) else value


def require_closed_form(mechanism: Mechanism) -> None:
    """Raises UnsupportedError where route `direct` has no closed-form parasitic motion."""
    kinds = [contact.surface.kind for contact in mechanism.contacts]
    dependent = dependent_coordinates(mechanism)
    if not closed_form_available(kinds, dependent):
        raise UnsupportedError(
            "route direct needs parasitic motion in closed form: at most two contacts, on planes, "
            f"with at most one dependent angle. This mechanism has {len(kinds)} "
            f"({', '.join(kinds)}) with dependent {', '.join(dependent)}. Use route core, which "
            "gives the same torques"
        )


def has_closed_form(mechanism: Mechanism) -> bool:
    """Whether the parasitic motion of the mechanism needs no iteration."""
    kinds = [contact.surface.kind for contact in mechanism.contacts]
    return closed_form_available(kinds, dependent_coordinates(mechanism))


def closed_branch(mechanism: Mechanism) -> float:
    """-sign(B) of the angle equation at home, which keeps the dependent angle on its branch."""
    dependent = dependent_coordinates(mechanism)
    equation = angle_equation(contact_symbols(mechanism), dependent, ca.SX.zeros(6))
    return -float(np.sign(float(ca.evalf(equation.B))))


def _function(name: str, inputs: list[ca.SX], outputs: list[ca.SX]) -> ca.Function:
    outputs = ca.cse([ca.densify(o) for o in outputs])
    return ca.Function(name, inputs, outputs)
