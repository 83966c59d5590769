"""Dependent coordinates where they have no closed form: Newton's method as one expression.

A fixed number of steps, for kernels that cannot loop until it is enough. The residual that is
left says whether it was; where not, the sample needs `Closure`, which follows it from home.

Most mechanisms on curved surfaces z = f(x, y) depend in Z and one angle. Their difference of phi
is one equation in that angle, solved from its second-order Taylor expansion at home; the angle's
cosine and sine are turned along, without trigonometry.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import casadi as ca

from .contact import (
    ContactSymbols,
    Placement,
    contact_frame,
    indices,
    parasitic_jacobian,
    residuals,
    solve_small,
)
from .rotation import Bryant

STEPS = 5
RESIDUAL = 1e-13  # metres off a surface that count as on it
ROUNDING = 1e-24  # square of a step that is as good as none
SHORT = 2e-4  # radians of the second step at the most; the first is exact whatever its length


def newton(contacts: Sequence[ContactSymbols], dependent: Sequence[str], q: ca.SX) -> Placement:
    """A pose with phi = 0, from q in the order of X_EE.

    Its `reach` is near 1 where the steps sufficed, and 0 where they did not.
    """
    dep = indices(dependent)
    if all(_is_graph(c) for c in contacts) and 2 in dep:
        if len(dep) == 1:
            return _height(contacts[0], q)
        if len(dep) == 2 and max(dep) >= 3:
            return _one_angle(contacts, max(dep), q)
    return _all_at_once(contacts, dependent, q)


def _is_graph(contact: ContactSymbols) -> bool:
    """Whether phi = z - f(x, y), so that Z is found by adding."""
    p = ca.SX.sym("p", 3)
    return contact.anchored and ca.jacobian(contact.phi(p), p[2]).is_one()


def _height(contact: ContactSymbols, q: ca.SX) -> Placement:
    """One contact: Z follows from the other five coordinates directly."""
    bryant = Bryant.of(q[2:])
    below = ca.vertcat(q[:2], 0)
    Z = -contact.phi(contact.at(below, bryant.rotation()))
    return Placement(ca.vertcat(q[:2], Z), bryant, None)


@dataclass(frozen=True)
class _Circle:
    """Ball centre as an angle turns: cos a + sin b + k, (3,) each, with Z left out."""

    a: ca.SX
    b: ca.SX
    k: ca.SX

    def at(self, turn: ca.SX) -> ca.SX:
        return turn[0] * self.a + turn[1] * self.b + self.k

    def slope(self, turn: ca.SX) -> ca.SX:
        return turn[0] * self.b - turn[1] * self.a


def _one_angle(contacts: Sequence[ContactSymbols], angle: int, q: ca.SX) -> Placement:
    """Z and one angle: Newton on phi_1 - phi_2 = 0, which is free of Z."""
    first, second = contacts
    circles, bryant, unknown = _circles(contacts, angle, q)
    turn = _far(_taylor(contacts, angle, q))
    inverse_slope, steps = ca.SX(0), []
    for last in (False, False, True):
        p, r = (c.at(turn) for c in circles)
        off = first.phi(p) - second.phi(r)
        if not last:  # the last step is so short that the slope before it does
            slopes = (
                ca.dot(contact.gradient(point), circle.slope(turn))
                for contact, circle, point in zip(contacts, circles, (p, r), strict=True)
            )
            inverse_slope = 1 / (next(slopes) - next(slopes))
        steps.append(-off * inverse_slope)
        turn = _turned(turn, _near(steps[-1]) if len(steps) > 1 else _far(steps[-1]))
    p, r = (c.at(turn) for c in circles)
    heights = first.phi(p), second.phi(r)
    bryant = Bryant(*(ca.substitute(v, unknown, turn) for v in (bryant.cos, bryant.sin)))
    Z = -(heights[0] + heights[1]) / 2
    short = ca.fmax(1 - ca.fabs(steps[1]) / SHORT, 0)
    # The slope changes its sign where the branch of home meets another.
    same = ca.fmax(inverse_slope * _home_slope(contacts, angle), 0)
    reach = ca.fmin(ca.fmin(short, same), _converged(heights[0] - heights[1]))
    return Placement(ca.vertcat(q[:2], Z), bryant, reach, iterated=True)


def _circles(
    contacts: Sequence[ContactSymbols], angle: int, q: ca.SX
) -> tuple[list[_Circle], Bryant, ca.SX]:
    unknown = ca.SX.sym("turn", 2)
    given = iter(ca.vertsplit(q[2:]))
    cos, sin = [], []
    for i in (3, 4, 5):
        value = None if i == angle else next(given)
        cos.append(unknown[0] if value is None else ca.cos(value))
        sin.append(unknown[1] if value is None else ca.sin(value))
    bryant = Bryant(ca.vertcat(*cos), ca.vertcat(*sin))
    R, base = bryant.rotation(), ca.vertcat(q[:2], 0)
    circles = []
    for contact in contacts:
        p = contact.at(base, R)
        a, b = ca.jacobian(p, unknown[0]), ca.jacobian(p, unknown[1])
        circles.append(_Circle(a, b, ca.substitute(p, unknown, ca.SX.zeros(2))))
    return circles, bryant, unknown


def _home_slope(contacts: Sequence[ContactSymbols], angle: int) -> ca.SX:
    """d (phi_1 - phi_2) / d angle at home."""
    frame = contact_frame(contacts, ca.SX.zeros(3), ca.SX.eye(3))
    return frame.N[angle, 0] - frame.N[angle, 1]


def _far(angle: ca.SX) -> ca.SX:
    """Cosine and sine of 2 atan(angle / 2): near those of the angle, and of exactly unit length."""
    t = angle / 2
    scale = 1 / (1 + t * t)
    return ca.vertcat((1 - t * t) * scale, 2 * t * scale)


def _near(angle: ca.SX) -> ca.SX:
    """Cosine and sine of an angle below `SHORT`, whose fourth power is below rounding."""
    square = angle * angle
    return ca.vertcat(1 - square * 0.5, angle * (1 - square * (1 / 6)))


def _turned(turn: ca.SX, by: ca.SX) -> ca.SX:
    return ca.vertcat(turn[0] * by[0] - turn[1] * by[1], turn[1] * by[0] + turn[0] * by[1])


def _taylor(contacts: Sequence[ContactSymbols], angle: int, q: ca.SX) -> ca.SX:
    """The dependent angle to second order in q, about home.

    From E(angle, q) = 0: E_a g = -E_q, E_a H = -(E_qq + E_qa g^T + g E_qa^T + E_aa g g^T).
    """
    m = q.shape[0]
    v = ca.SX.sym("v", m + 1)  # q, then the angle
    circles, _, _ = _circles(contacts, angle, v[:m])
    turn = ca.vertcat(ca.cos(v[m]), ca.sin(v[m]))
    E = contacts[0].phi(circles[0].at(turn)) - contacts[1].phi(circles[1].at(turn))
    H, gradient = ca.hessian(E, v)
    H, gradient = ca.substitute([H, gradient], [v], [ca.SX.zeros(m + 1)])
    inverse = 1 / gradient[m]
    g = -gradient[:m] * inverse
    E_qa = H[:m, m]
    bend = -(H[:m, :m] + E_qa @ g.T + g @ E_qa.T + H[m, m] * (g @ g.T)) * inverse
    value = ca.dot(g, q)
    for i in range(m):
        for j in range(i, m):
            value += (bend[i, j] * (0.5 if i == j else 1.0)) * (q[i] * q[j])
    return value


def _all_at_once(
    contacts: Sequence[ContactSymbols], dependent: Sequence[str], q: ca.SX
) -> Placement:
    """Newton on all dependent coordinates, from home's tangent."""
    dep = indices(dependent)
    ind = [i for i in range(6) if i not in dep]
    home = contact_frame(contacts, ca.SX.zeros(3), ca.SX.eye(3))
    pose = ca.SX.zeros(6)
    # At home R_omega is the identity.
    pose[ind], pose[dep] = q, parasitic_jacobian(home.N.T, dependent)[dep, :] @ q
    lengths = [_square(contacts, pose)]
    for _ in range(STEPS):
        step = ca.SX.zeros(6)
        step[dep] = solve_small(*_linear(contacts, dep, pose))
        pose = pose - step
        lengths.append(_square(contacts, step))
    off = ca.SX(0.0)
    for phi in ca.vertsplit(residuals(contacts, pose)):
        off = ca.fmax(off, ca.fabs(phi))
    # As in `Closure`: steps that shrink to a quarter do not leave the branch of home.
    reach = ca.fmin(_converged(off), 1 - lengths[0])
    for before, after in pairwise(lengths[:3]):
        reach = ca.fmin(reach, 1 - after / (before / 16 + ROUNDING))
    return Placement(pose[:3], Bryant.of(pose[3:]), ca.fmax(reach, 0), iterated=True)


def _square(contacts: Sequence[ContactSymbols], step: ca.SX) -> ca.SX:
    """Squared length of a change of pose, dimensionless: angles, and lengths by the levers'."""
    lever = sum((ca.dot(c.point, c.point) for c in contacts), ca.SX(0)) / len(contacts)
    return ca.dot(step[:3], step[:3]) / lever + ca.dot(step[3:], step[3:])


def _converged(off: ca.SX) -> ca.SX:
    """Near 1 where a residual [m] is at rounding, 0 beyond `RESIDUAL`."""
    return ca.fmax(1 - ca.fabs(off) / RESIDUAL, 0)


def _linear(contacts: Sequence[ContactSymbols], dep: list[int], pose: ca.SX) -> tuple[ca.SX, ca.SX]:
    """C_dep, (k, k), and phi, (k,), at a pose."""
    bryant = Bryant.of(pose[3:])
    R = bryant.rotation()
    frame = contact_frame(contacts, pose[:3], R)
    C = frame.N.T @ ca.diagcat(ca.SX.eye(3), bryant.angular_velocity())
    phi = ca.vertcat(*(c.phi(c.at(pose[:3], R)) for c in contacts))
    return C[:, dep], phi
