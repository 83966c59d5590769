"""The platform's whole motion from its independent coordinates ([Cheng2023] eqs 8-11)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca

from .constraints import (
    ContactFrame,
    ContactSymbols,
    Placement,
    contact_bias,
    contact_frame,
    indices,
    parasitic_jacobian,
    solve_small,
)
from .rotation import Bryant


@dataclass(frozen=True)
class WholeMotion:
    """X_EE', X_EE'' (6,), the twist and its rate (6,), M_J (6, 6 - k), and the contacts' frame.

    E: (6, 6) with [V; omega] = E X_EE'.
    """

    rate: ca.SX
    acceleration: ca.SX
    twist: ca.SX
    twist_rate: ca.SX
    M_J: ca.SX
    E: ca.SX
    R: ca.SX
    frame: ContactFrame


def whole_motion(
    contacts: Sequence[ContactSymbols],
    dependent: Sequence[str],
    placement: Placement,
    q_rate: ca.SX,
    q_acceleration: ca.SX,
) -> WholeMotion:
    """Rates of the dependent coordinates by the implicit function theorem."""
    R, R_omega = placement.bryant.rotation(), placement.bryant.angular_velocity()
    frame = contact_frame(contacts, placement.position, R)
    E = ca.diagcat(ca.SX.eye(3), R_omega)
    C = frame.N.T @ E
    M_J = parasitic_jacobian(C, dependent)
    rate = M_J @ q_rate
    twist = E @ rate
    turning = angular_bias(placement.bryant, rate[3:])
    dep = indices(dependent)
    ind = [i for i in range(6) if i not in dep]
    acceleration = ca.SX(6, 1)
    acceleration[ind] = q_acceleration
    if dep:
        bias = contact_bias(contacts, frame, placement.position, twist)
        bias += frame.N[3:, :].T @ turning
        acceleration[dep] = -solve_small(C[:, dep], C[:, ind] @ q_acceleration + bias)
    twist_rate = ca.vertcat(acceleration[:3], R_omega @ acceleration[3:] + turning)
    return WholeMotion(rate, acceleration, twist, twist_rate, M_J, E, R, frame)


def angular_bias(bryant: Bryant, angle_rates: ca.SX) -> ca.SX:
    """R_omega' (alpha', beta', gamma'), (3,): the angular acceleration that rates alone make."""
    c, s = bryant.cos, bryant.sin
    a1, b1, g1 = angle_rates[0], angle_rates[1], angle_rates[2]
    return ca.vertcat(
        c[1] * b1 * g1,
        -s[0] * a1 * b1 + (s[0] * s[1] * b1 - c[0] * c[1] * a1) * g1,
        c[0] * a1 * b1 - (s[0] * c[1] * a1 + c[0] * s[1] * b1) * g1,
    )
