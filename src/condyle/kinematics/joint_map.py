"""Joint coordinates as a function of the pose: all that forward kinematics asks of a mechanism."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca
import numpy as np

from ..mechanism.home import dependent_coordinates
from ..mechanism.mechanism import Mechanism
from .batch import evaluate
from .chain import FAMILIES
from .closure import contact_symbols
from .contact import contact_frame, indices, parasitic_jacobian, residuals, solve_small
from .state import pose_state


@dataclass(frozen=True)
class JointsAt:
    """What joints and contacts say of N poses.

    joint:   (N, n) [rad or m], zero at home.
    J_theta: (N, n, 6), on X_EE'.
    M_J:     (N, 6, m): X_EE' = M_J q'.
    fall:    (N, 6): moves the dependent coordinates back onto the surfaces.
    phi:     (N, k) [m], how far the contact points are off them.
    """

    joint: np.ndarray
    J_theta: np.ndarray
    M_J: np.ndarray
    fall: np.ndarray
    phi: np.ndarray


JointMap = Callable[[np.ndarray], JointsAt]  # of poses X_EE, (N, 6)


def joint_map(mechanism: Mechanism) -> JointMap:
    """The map of one mechanism; NaN where a chain cannot reach the pose."""
    function = _function(mechanism)
    n, m = len(mechanism.chains), mechanism.degrees_of_freedom

    def at(pose: np.ndarray) -> JointsAt:
        joint, J, M_J, fall, phi = evaluate(function, pose)
        J_theta = J.reshape(len(pose), 6, n).transpose(0, 2, 1)
        return JointsAt(joint, J_theta, M_J.reshape(len(pose), m, 6).transpose(0, 2, 1), fall, phi)

    return at


def _function(mechanism: Mechanism) -> ca.Function:
    """X_EE -> joints (n,), J_theta on X_EE' (n, 6), M_J (6, m), dX_phi (6,), phi (k,)."""
    X = ca.SX.sym("X", 6)
    state = pose_state(X, ca.SX.zeros(6), ca.SX.zeros(6))
    contacts = contact_symbols(mechanism)
    dependent = dependent_coordinates(mechanism)
    dep = indices(dependent)
    C = contact_frame(contacts, X[:3], state.R).N.T @ state.B
    joints, rows = [], []
    for chain in mechanism.chains:
        family = FAMILIES[chain.kind]
        constants = family.named(ca.SX(ca.DM(family.vector(family.constants(chain)))))
        M = state.point(ca.SX(ca.DM(chain.platform)))
        loop = family.loop(constants, M.position)
        joints.append(loop.q_r[0])
        rows.append(state.pull(loop.J, M.lever).T)
    phi = residuals(contacts, X)
    fall = ca.SX.zeros(6)
    if dep:
        fall[dep] = -solve_small(C[:, dep], phi)
    outputs = [ca.vertcat(*joints), ca.vertcat(*rows), parasitic_jacobian(C, dependent), fall, phi]
    return ca.Function("forward", [X], ca.cse([ca.densify(o) for o in outputs]))
