"""Poses followed from home, with every condition written as CasADi's expression.

Shares with the library how poses are followed (`kinematics.pose_finder`), rates by the chain rule,
and the contacts' equations; derivatives are CasADi's own, and run by its virtual machine.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

from condyle.kinematics.batch import evaluate
from condyle.kinematics.constraints import closed_form_available, contacts_of, indices, residuals
from condyle.kinematics.rotation import rotation
from condyle.mechanism import COORDINATES, Mechanism
from condyle.mechanism.home import characteristic_length
from condyle.motion.followed_closure import FollowedClosure


def closure(
    mechanism: Mechanism, x: ca.SX, prescribed: ca.SX, angles: Sequence[bool], two_branches: bool
) -> FollowedClosure:
    """Poses where functions `prescribed` (6 - k,) of the pose x, (6,), have given values."""
    rate = ca.SX.sym("rate", 6)
    values = ca.vertcat(residuals(contacts_of(mechanism), x), prescribed)
    K = ca.jacobian(values, x)
    functions = (
        ca.Function("K", [x], [values, K]),
        ca.Function("bias", [x, rate], [ca.jtimes(K @ rate, x, rate)]),
    )

    def conditions(pose: np.ndarray, rate: np.ndarray) -> tuple[np.ndarray, ...]:
        found, K = evaluate(functions[0], pose)
        bias = evaluate(functions[1], pose, rate)[0]
        return found, K.reshape(len(K), 6, 6).transpose(0, 2, 1), bias

    return FollowedClosure(
        conditions, np.array(angles), characteristic_length(mechanism), two_branches
    )


def coordinate_closure(mechanism: Mechanism, names: Sequence[str]) -> FollowedClosure:
    """Poses from 6 - k pose coordinates."""
    x = ca.SX.sym("x", 6)
    dependent = [name for name in COORDINATES if name not in names]
    forms = [contact.offset_surface.form for contact in mechanism.contacts]
    angles = [name in COORDINATES[3:] for name in names]
    closed = closed_form_available(forms, dependent)
    return closure(mechanism, x, x[indices(names)], angles, closed)


def landmark_closure(mechanism: Mechanism, landmark: str) -> FollowedClosure:
    """Poses from the displacement of a landmark from home, in {S}, and the middle's in Y."""
    x = ca.SX.sym("x", 6)
    R = rotation(x[3:])
    m = ca.DM(mechanism.platform.points[landmark])
    middle = (ca.DM(mechanism.contacts[0].point) + ca.DM(mechanism.contacts[1].point)) / 2
    sideways = x[1] + (R @ middle)[1] - middle[1]
    return closure(mechanism, x, ca.vertcat(x[:3] + R @ m - m, sideways), [False] * 4, False)
