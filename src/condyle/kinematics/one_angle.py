"""Two contacts on surfaces z = f(x, y), with Z and one angle dependent: one equation.

The difference E of their phi is free of Z. It is solved by sinusoids that agree with it to second
order, the first where the angle is that of home, and at last by Halley's method. The angle's
cosine and sine are rotated along, without trigonometry. On surfaces of second order E has five
coefficients, and a step is cheap.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import casadi as ca

from .constraints import ContactSymbols, Placement, contact_frame
from .rotation import Bryant, turned, turned_slightly

CLOSED = 1e-13  # maximum residual [rad]
WITHIN = 0.55  # minimum product of the angles' cosines: beyond, branches cannot be told apart
SHORT = 2e-4  # maximum last step [rad]
CURVED = 0.45  # maximum E E'' / E'^2: from one half on there may be no root

Derivatives = tuple[ca.SX, ca.SX, ca.SX]  # E and its first two in the angle


def one_angle(contacts: Sequence[ContactSymbols], angle: int, q: ca.SX) -> Placement:
    """A pose with phi = 0, from q in the order of X_EE without Z and the angle."""
    unknown, bryant = _rotation(angle, q)
    base = ca.vertcat(q[:2], 0)
    equation = _equation(contacts, base, bryant.rotation(), unknown)
    home = _home_slope(contacts, angle)
    side = home / ca.fabs(home)
    E, slope, curvature = equation(ca.SX([1, 0]))
    # The branch of home ends at a fold, where the slope changes sign: there must be none.
    margin = slope * side
    turn = _osculating(E, slope, curvature, side)
    c = ca.substitute(bryant.cos, unknown, turn)
    away = ca.dot(base, base) / (contacts[0].square_lever + contacts[1].square_lever)
    margin = ca.fmin(margin, c[0] * c[1] * c[2] - away - WITHIN)
    margin = ca.fmin(margin, ca.fmin(c[0], c[1]))  # then all three are positive
    E, slope, curvature = equation(turn)
    margin = ca.fmin(margin, ca.fmin(slope * side, CURVED * slope * slope - ca.fabs(E * curvature)))
    turn = turned(turn, _osculating(E, slope, curvature, side))
    E, slope, curvature = equation(turn)
    inverse = 1 / (slope * slope - E * curvature / 2)
    step = -(E * slope) * inverse
    margin = ca.fmin(margin, SHORT - ca.fabs(step))
    turn = turned_slightly(turn, step)
    bryant = Bryant(*(ca.substitute(v, unknown, turn) for v in (bryant.cos, bryant.sin)))
    first, second = (c.phi(c.at(base, bryant.rotation())) for c in contacts)
    # Written so that NaN counts as not closed.
    left = (first - second) * (slope * inverse)
    sure = (margin > 0) * (ca.fabs(left) < CLOSED)
    return Placement(ca.vertcat(q[:2], -first), bryant, sure, True, left * left)


def _rotation(angle: int, q: ca.SX) -> tuple[ca.SX, Bryant]:
    """Cosine and sine of the dependent angle, (2,), and all of them."""
    unknown = ca.SX.sym("turn", 2)
    given = iter(ca.vertsplit(q[2:]))
    turns = [
        ca.vertsplit(unknown) if i == angle else [f(v) for v in [next(given)] for f in _ANGLE]
        for i in (3, 4, 5)
    ]
    return unknown, Bryant(*(ca.vertcat(*(turn[k] for turn in turns)) for k in (0, 1)))


_ANGLE = (ca.cos, ca.sin)


def _home_slope(contacts: Sequence[ContactSymbols], angle: int) -> ca.SX:
    """dE / d angle at home."""
    frame = contact_frame(contacts, ca.SX.zeros(3), ca.SX.eye(3))
    return frame.N[angle, 0] - frame.N[angle, 1]


def _equation(
    contacts: Sequence[ContactSymbols], base: ca.SX, R: ca.SX, unknown: ca.SX
) -> Callable[[ca.SX], Derivatives]:
    """E and its derivatives at a cosine and sine, (2,)."""
    hessians = [_hessian(contact) for contact in contacts]
    constant = [H for H in hessians if H is not None]
    points = [contact.at(base, R) for contact in contacts]
    if len(constant) < len(hessians):
        E = contacts[0].phi(points[0]) - contacts[1].phi(points[1])
        along = ca.vertcat(-unknown[1], unknown[0])
        slope = ca.jtimes(E, unknown, along)
        curvature = ca.jtimes(slope, unknown, along)

        def long(turn: ca.SX) -> Derivatives:
            values = ca.substitute(ca.vertcat(E, slope, curvature), unknown, turn)
            return values[0], values[1], values[2]

        return long
    first, second = (
        _coefficients(contact, H, p, unknown)
        for contact, H, p in zip(contacts, constant, points, strict=True)
    )
    k, A, B, D, F = ca.vertsplit(first - second)

    def short(turn: ca.SX) -> Derivatives:
        c, s = turn[0], turn[1]
        v = 1 - c
        w, w1, w2 = D * v + F * s, D * s + F * c, D * c - F * s
        inner = B + w
        return (
            k + A * s + v * inner,
            A * c + s * inner + v * w1,
            c * inner - A * s + 2 * s * w1 + v * w2,
        )

    return short


def _hessian(contact: ContactSymbols) -> ca.SX | None:
    """Second derivative of phi, (3, 3), where it is the same everywhere."""
    p = ca.SX.sym("p", 3)
    H = ca.hessian(contact.phi(p), p)[0]
    return None if ca.depends_on(H, p) else H


def _coefficients(contact: ContactSymbols, H: ca.SX, p: ca.SX, unknown: ca.SX) -> ca.SX:
    """phi of a point that turns with cosine c and sine s: of 1, s, v, v^2, v s with v = 1 - c."""
    # p = start + b s - a v; s^2 = v (2 - v)
    a, b = ca.jacobian(p, unknown[0]), ca.jacobian(p, unknown[1])
    start = ca.substitute(p, unknown, ca.SX([1, 0]))
    gradient, H_a, H_b = contact.gradient(start), H @ a, H @ b
    curvature = ca.dot(b, H_b)
    return ca.vertcat(
        contact.phi(start),
        ca.dot(gradient, b),
        curvature - ca.dot(gradient, a),
        (ca.dot(a, H_a) - curvature) / 2,
        -ca.dot(a, H_b),
    )


def _osculating(E: ca.SX, slope: ca.SX, curvature: ca.SX, side: ca.SX) -> ca.SX:
    """Cosine and sine of the turn to E = 0, were E the sinusoid with these derivatives.

    E + slope sin + curvature (1 - cos) = 0, where its slope has the sign of `side`.
    """
    k, h = E + curvature, slope * slope + curvature * curvature
    inverse, root = 1 / h, ca.sqrt(h - k * k)
    return ca.vertcat(
        curvature * k * inverse + side * slope * inverse * root,
        side * curvature * inverse * root - slope * k * inverse,
    )
