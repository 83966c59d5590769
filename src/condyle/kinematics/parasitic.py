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
    independent_indices,
    indices,
    parasitic_jacobian,
    solve_small,
)
from .rotation import Bryant


@dataclass(frozen=True)
class PlatformRates:
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


def platform_rates(
    contacts: Sequence[ContactSymbols],
    dependent: Sequence[str],
    placement: Placement,
    q_rate: ca.SX,
    q_acceleration: ca.SX,
) -> PlatformRates:
    """Rates of the dependent coordinates by the implicit function theorem."""
    position, bryant = placement.position, placement.bryant
    frame = contact_frame(contacts, position, bryant.rotation())
    C = frame.N.T @ bryant.twist_jacobian()
    M_J = parasitic_jacobian(C, dependent)
    rate, acceleration = M_J @ q_rate, ca.SX(6, 1)
    dep, ind = indices(dependent), independent_indices(dependent)
    acceleration[ind] = q_acceleration
    if dep:
        bias = rate_bias(contacts, frame, position, bryant, rate)
        acceleration[dep] = -solve_small(C[:, dep], C[:, ind] @ q_acceleration + bias)
    return motion_at(frame, bryant, M_J, rate, acceleration)


def motion_at(
    frame: ContactFrame, bryant: Bryant, M_J: ca.SX, rate: ca.SX, acceleration: ca.SX
) -> PlatformRates:
    """The platform's rates from X_EE' and X_EE'' that are compatible with the contacts."""
    E = bryant.twist_jacobian()
    turning = E[3:, 3:] @ acceleration[3:] + angular_bias(bryant, rate[3:])
    twist_rate = ca.vertcat(acceleration[:3], turning)
    return PlatformRates(rate, acceleration, E @ rate, twist_rate, M_J, E, bryant.rotation(), frame)


def rate_bias(
    contacts: Sequence[ContactSymbols],
    frame: ContactFrame,
    position: ca.SX,
    bryant: Bryant,
    rate: ca.SX,
) -> ca.SX:
    """C' X', (k,): the part of phi'' due to the rates X_EE'."""
    bias = contact_bias(contacts, frame, position, bryant.twist_jacobian() @ rate)
    return bias + frame.N[3:, :].T @ angular_bias(bryant, rate[3:])


def angular_bias(bryant: Bryant, angle_rates: ca.SX) -> ca.SX:
    """R_omega' (alpha', beta', gamma'), (3,): the angular acceleration due to the rates."""
    c, s = bryant.cos, bryant.sin
    a1, b1, g1 = angle_rates[0], angle_rates[1], angle_rates[2]
    return ca.vertcat(
        c[1] * b1 * g1,
        -s[0] * a1 * b1 + (s[0] * s[1] * b1 - c[0] * c[1] * a1) * g1,
        c[0] * a1 * b1 - (s[0] * c[1] * a1 + c[0] * s[1] * b1) * g1,
    )
