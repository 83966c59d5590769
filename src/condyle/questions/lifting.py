"""Unilateral contacts that lift and land, as parts of the equations of a platform that they do not
hold.

With unit pushes D_i, normal less friction, of magnitudes p_i >= 0, accelerations are affine in p:

    gap_i'' = bias_i + sum_j R_ij p_j.

Of active contacts gap'' = 0, of open ones p = 0; which are active is `condyle.simulation.lifting`'s
to say. Compliant contacts have p from outside, by their laws. The sign of friction is known, since
the surface can only push.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca

from ..graph.program import Programs
from ..kinematics.constraints import ContactSymbols, contact_bias, contact_frame, solve_small
from ..mechanism.surface import of_form
from .builder import Builder
from .curvature import fundamental_form
from .equations import Wrench
from .forward import Accelerated, Response, accelerated, responses, twist_rate
from .inertia import affine
from .platform import PlatformState, closed
from .structure import Structure

# Of one: the form of its surface, how many constants that has, whether it has friction.
LiftingContact = tuple[str, int, bool]
AXES = 3
NEVER = -1.0  # a guard of a mode that is not on
QUIET = 1e-10  # m/s^2, along the normal: none
OPEN = 1e-14  # metres: gaps of compliant contacts that have lifted
ANY_AXIS = 0.8  # |n_x| above which the first tangent is taken across another axis


@dataclass(frozen=True)
class Touches:
    """Contacts of one sample, one a column; wrenches are dual to the twist [V; omega].

    gap, gap_rate, bias: along the unit normals away from the surface, (c,) each.
    curvature: (c, 3) [1/m], of the surfaces: see `curvature`; 0 where it is not asked for.
    push:     (6, c), wrench of a unit force of the surface.   drag: (6, c), of its friction.
    tangents: (6, 2 c), two a contact where the ball touches.
    rub:      (c,), power of friction a unit force [m/s].
    """

    gap: ca.SX
    gap_rate: ca.SX
    bias: ca.SX
    curvature: ca.SX
    push: ca.SX
    drag: ca.SX
    tangents: ca.SX
    rub: ca.SX


def touches(
    b: Builder,
    platform: PlatformState,
    some: Sequence[LiftingContact],
    curved: Sequence[int] = (),
) -> Touches:
    """Contacts whose numbers are ports: of contact i its point, constants, sign of the push, ball
    radius, and, with friction, mu and the square of its smoothing speed.

    Args: curved: those whose curvature is asked for, by number.
    """
    symbols, signs, radii, friction = [], [], [], []
    for i, (form, count, rubs) in enumerate(some):
        own = f"contact_{i}_"
        point, constants = b.sample(f"{own}point", AXES, "m"), b.sample(f"{own}surface", count)
        symbols.append(ContactSymbols(of_form(form), point, constants))
        signs.append(b.sample(f"{own}push", 1))
        radii.append(b.sample(f"{own}radius", 1, "m"))
        friction.append(b.sample(f"{own}friction", 2) if rubs else ca.DM([0.0, 1.0]))
    position, twist = platform.position, platform.motion.twist
    frame = contact_frame(symbols, position, platform.R)
    biases = contact_bias(symbols, frame, position, twist)
    columns: list[tuple[ca.SX, ...]] = []
    for i, (g, r) in enumerate(zip(frame.gradients, frame.levers, strict=True)):
        inverse = signs[i] / ca.norm_2(g)
        n = inverse * g
        wrench = ca.vertcat(n, ca.cross(r, n))
        c = r - radii[i] * n  # where the ball touches
        v = twist[:3] + ca.cross(twist[3:], c)
        mu, square = ca.vertsplit(friction[i])
        u = mu * v / ca.sqrt(ca.dot(v, v) + square)
        along = [ca.vertcat(t, ca.cross(c, t)) for t in tangents(n)]
        bent = ca.SX.zeros(1, 3)
        if i in curved:
            bent = fundamental_form(symbols[i], position + r, g, platform.R)[0]
        columns.append(
            (
                inverse * symbols[i].phi(position + r),
                ca.dot(wrench, twist),
                inverse * biases[i],
                bent,
                wrench,
                ca.vertcat(u, ca.cross(c, u)),
                ca.horzcat(*along),
                ca.dot(u, v),
            )
        )
    gap, gap_rate, bias, curvature, push, drag, both, rub = zip(*columns, strict=True)
    return Touches(
        gap=ca.vertcat(*gap),
        gap_rate=ca.vertcat(*gap_rate),
        bias=ca.vertcat(*bias),
        curvature=ca.vertcat(*curvature),
        push=ca.horzcat(*push),
        drag=ca.horzcat(*drag),
        tangents=ca.horzcat(*both),
        rub=ca.vertcat(*rub),
    )


def tangents(n: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Two unit vectors across a unit normal and each other, (3,) each."""
    other = ca.if_else(ca.fabs(n[0]) > ANY_AXIS, ca.DM([0, 1, 0]), ca.DM([1, 0, 0]))
    first = ca.cross(n, other)
    first = first / ca.norm_2(first)
    return first, ca.cross(n, first)


@dataclass(frozen=True)
class Pressed:
    """Accelerations q'' (m,) with the active contacts, and the magnitudes p of these, (c,).

    force: of the contacts that hold the platform, (k,).   wrench: of the active ones, (6,).
    guards: (c,), which pass zero where one lifts: of rigid ones, where it would leave by more than
    rounding.   power: that the contacts take [W].
    """

    q2: ca.SX
    p: ca.SX
    force: ca.SX
    wrench: ca.SX
    touch: Touches
    bias: ca.SX
    R: ca.SX
    q_response: ca.SX
    guards: ca.SX
    power: ca.SX

    def add_results(self, b: Builder) -> None:
        """What decides which contacts are active: gap, gap_rate, gap_bias (c,): gap'' without any
        of the contacts; gap_response (c, c), R; q_response (m, c): of q'' to unit pushes; pressing
        (c,), p; pressed_wrench (6,)."""
        count = self.p.numel()
        b.output("gap", self.touch.gap, "m", count)
        b.output("gap_rate", self.touch.gap_rate, "m/s", count)
        b.output("gap_bias", self.bias, "m/s^2", count)
        b.output("gap_response", self.R, "1/kg", count, count)
        b.output("q_response", self.q_response, "", b.structure.m, count)
        b.output("pressing", self.p, "N", count)
        b.output("pressed_wrench", self.wrench, "N, N m", 6)


def pressed(
    b: Builder,
    platform: PlatformState,
    moved: Accelerated,
    twist_rate: ca.SX,
    some: Sequence[LiftingContact],
    compliant: bool = False,
) -> Pressed:
    """The platform with its active contacts, ports active (c,), and of compliant ones p as
    `pressing_force`.

    Args: moved, twist_rate: without the contacts.
    """
    touch, count = touches(b, platform, some), len(some)
    active = b.sample("active", count)
    D, answer, bias, R = _pushed(b, platform, moved, twist_rate, touch)
    if compliant:
        p = b.sample("pressing_force", count, "N")
        guards = ca.if_else(active > 0, touch.gap - OPEN, NEVER)
        power = ca.dot(p, touch.rub - touch.gap_rate)
    else:
        on = ca.diag(active)
        p = solve_small(on @ R @ on + ca.diag(1 - active), -active * bias)
        guards, power = -ca.diag(R) * p - QUIET, ca.dot(p, touch.rub)
    q2, force = moved.q2 + answer.q2 @ p, moved.force + answer.force @ p
    return Pressed(q2, p, force, D @ p, touch, bias, R, answer.q2, guards, power)


def _pushed(
    b: Builder, platform: PlatformState, moved: Accelerated, free: ca.SX, touch: Touches
) -> tuple[ca.SX, Response, ca.SX, ca.SX]:
    """Unit pushes less their friction, D (6, c), the response to them, gap'' without any, (c,), and
    R (c, c).

    Args: free: the twist's rate without the contacts.
    """
    D = touch.push - touch.drag
    answer = responses(b, platform, moved.equations, D)
    bias = touch.push.T @ free + touch.bias
    return D, answer, bias, touch.push.T @ answer.twist


def lifting(
    structure: Structure, some: Sequence[LiftingContact], curved: Sequence[int] = ()
) -> Programs:
    """Forward dynamics without the contacts that lift, and what they change: for exports, which
    find the magnitudes p of the pushes themselves.

    Results: acceleration (m,) and contact_force (k,), affine in p by q_response (m, c) and
    force_response (k, c); gap, gap_rate, gap_bias (c,) and gap_response (c, c), as of `rate`;
    wall_curvature (c, 3), of those that are `curved`.
    """
    b = Builder(structure)
    platform = closed(b, rates=1)
    effort = b.lane_sample("effort", unit="N m or N")
    moved = accelerated(b, platform, Wrench.of(b), effort)
    touch, count, k = touches(b, platform, some, curved), len(some), len(structure.contacts)
    free = twist_rate(platform, moved.equations, moved.w)
    _, answer, bias, R = _pushed(b, platform, moved, free, touch)
    b.output("acceleration", moved.q2, "per s^2", structure.m)
    b.output("contact_force", moved.force, "N", k)
    b.output("gap", touch.gap, "m", count)
    b.output("gap_rate", touch.gap_rate, "m/s", count)
    b.output("gap_bias", bias, "m/s^2", count)
    b.output("gap_response", R, "1/kg", count, count)
    b.output("q_response", answer.q2, "", structure.m, count)
    b.output("force_response", answer.force, "", k, count)
    b.output("wall_curvature", touch.curvature, "1/m", count, AXES)
    return Programs(b.finish(), single=True)


def impact(structure: Structure, some: Sequence[LiftingContact]) -> Programs:
    """What impulses at the contacts change, at q and q'.

    Results: gap (c,); velocity (c, 3) where the balls touch: along the normal and two tangents;
    impulse_response (3 c, 3 c): of the velocities to unit impulses; q_response (m, 3 c): of q'.
    """
    b = Builder(structure)
    platform = closed(b, rates=1)
    zero = ca.SX.zeros(3)
    eq = affine(b, platform, Wrench(zero, zero, zero), [ca.SX(0)] * len(structure.chains))
    touch, count = touches(b, platform, some), len(some)
    directions = [
        column
        for i in range(count)
        for column in (touch.push[:, i], touch.tangents[:, 2 * i], touch.tangents[:, 2 * i + 1])
    ]
    W = ca.horzcat(*directions)
    answer = responses(b, platform, eq, W)
    b.output("gap", touch.gap, "m", count)
    b.output("velocity", W.T @ platform.motion.twist, "m/s", AXES * count)
    b.output("impulse_response", W.T @ answer.twist, "1/kg", AXES * count, AXES * count)
    b.output("q_response", answer.q2, "", structure.m, AXES * count)
    return Programs(b.finish(), single=True)
