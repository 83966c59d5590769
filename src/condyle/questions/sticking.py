"""Contacts that stick by static friction, and slide by Coulomb's, as parts of the equations.

A contact that sticks bears what keeps its material point at rest, p along two tangents, as long as

    |p| <= static_coefficient |lambda|.

One that slides is rubbed by mu |lambda| against

    w = v + s exp(-|v|^2 / s^2) d,

with s the `smoothing_speed` and d the direction in which it began to slide: so friction is there in
full from rest on, and where v passes zero against d nothing jumps. It stops where v w does, and
sticks, or slides the other way. Which contacts stick is `condyle.simulation.sticking`'s to say.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca

from ..dynamics.least_norm import definite_solve
from ..kinematics.constraints import ContactSymbols, contact_frame
from ..status import Status
from .builder import Builder
from .forward import Accelerated, responses, twist_rate
from .friction import consistent
from .lifting import AXES, NEVER, tangents
from .numbers import single_contacts
from .platform import PlatformState, contacts

REST = 1e-30  # (m/s)^2: no direction at all
# Of the response of tangential forces: where contacts hold each other, they share what they bear in
# the ratio of what they can. MOST: of that ratio.
SOFT, MOST = 1e-6, 100.0
DRIFT = 100.0  # 1/s: how fast a point that sticks loses the speed that steps have left it


@dataclass(frozen=True)
class Sticking:
    """Accelerations q'' (m,) and contact forces (k,) with the friction of all contacts.

    guards: that pass zero where one slips (s,), and where one stops (s,).
    friction: (3, k), forces on the platform;  wrench: (6,), theirs about O_M.
    power: that sliding takes [W];  hold: (3, s), p of those that stick.
    stopped: (m + 1,), what q' changes to stop those that stick, and the energy that goes [J].
    """

    q2: ca.SX
    force: ca.SX
    guards: ca.SX
    friction: ca.SX
    wrench: ca.SX
    slip: ca.SX
    power: ca.SX
    hold: ca.SX
    stopped: ca.SX

    def add_results(self, b: Builder) -> None:
        """What decides which contacts stick, and what friction does."""
        m, k, s = b.structure.m, self.slip.shape[1], self.hold.shape[1]
        b.output("stopped", self.stopped, "per s, J", m + 1)
        b.output("hold", self.hold.T, "N", s, AXES)
        b.output("slip", self.slip.T, "m/s", k, AXES)
        b.output("friction_force", self.friction.T, "N", k, AXES)
        b.output("friction_wrench", self.wrench, "N, N m", 6)


def sticking(
    b: Builder, platform: PlatformState, moved: Accelerated, some: Sequence[int]
) -> Sticking:
    """The platform with friction.

    Ports: stuck (s,): 1 of contacts that stick;  static_coefficient (s,);  slip_direction (3 s,).

    Args: moved: without any friction;  some: contacts with static friction, by number.
    """
    s, count = b.structure, len(some)
    stuck, static = b.sample("stuck", count), b.sample("static_coefficient", count)
    directions = ca.reshape(b.sample("slip_direction", AXES * count), AXES, count)
    touch, omega = contacts(b, platform), platform.motion.twist[3:]
    symbols = single_contacts(s, b.parameter)
    frame = contact_frame(symbols, platform.position, platform.R)
    drags, arms, pairs, biases, rates, stops = [], [], [], [], [], []
    for i in s.friction:
        mu, square, radius = ca.vertsplit(b.parameter(f"friction_{i}"))
        v, n, lever = touch.slip[:, i], touch.normal[:, i], frame.levers[i]
        arms.append(lever - radius * n)
        if i not in some:
            drags.append(touch.drag[:, i])
            continue
        d, speed = directions[:, some.index(i)], ca.dot(v, v)
        w = v + ca.sqrt(square) * ca.exp(-speed / square) * d
        drags.append(mu * w / ca.sqrt(ca.dot(w, w) + REST))
        stops.append(-ca.dot(v, w) / (speed + square))
        centre = platform.position + lever
        turning = _normal_rate(symbols[i], centre, v + ca.cross(omega, radius * n))
        moving = ca.cross(omega, ca.cross(omega, lever) - radius * turning)
        both = ca.horzcat(*tangents(n))
        pairs.append(both)
        biases.append(both.T @ (moving + DRIFT * v))
        rates.append(both.T @ v)
    free = ca.vertcat(*(1 - stuck[some.index(i)] if i in some else ca.SX(1) for i in s.friction))
    drag = ca.horzcat(*(free[j] * column for j, column in enumerate(drags)))
    arm_of = dict(zip(s.friction, arms, strict=True))
    T = ca.horzcat(*(_wrench(u, c) for u, c in zip(ca.horzsplit(drag), arms, strict=True)))
    W = ca.horzcat(
        *(_wrench(t, arm_of[i]) for i, pair in zip(some, pairs, strict=True)
          for t in ca.horzsplit(pair))
    )  # fmt: skip
    f = len(s.friction)
    answer = responses(b, platform, moved.equations, ca.horzcat(-T, W))
    turned = W.T @ answer.twist
    on = ca.vec(ca.repmat(stuck.T, 2, 1))
    R = turned[:, f:]
    bears = ca.vertcat(*((static[j] * moved.force[i]) ** 2 for j, i in enumerate(some)))
    share = ca.fmin(ca.sum1(bears) / (count * bears + REST), MOST)
    soft = SOFT * ca.trace(R) / on.numel() * ca.vec(ca.repmat(share.T, 2, 1))
    held = ca.diag(on) @ R @ ca.diag(on) + ca.diag(1 - on)
    bias = W.T @ twist_rate(platform, moved.equations, moved.w) + ca.vertcat(*biases)
    right = ca.horzcat(bias, turned[:, :f], ca.vertcat(*rates))
    right = -ca.diag(on) @ right
    softened = held + ca.diag(soft)
    p = ca.SX.zeros(right.shape)
    for _ in range(2):  # what the softness has left is SOFT^2
        left = right - held @ p
        p = p + definite_solve(softened, left, ca.diag(softened))[0]
    by_drag, by_hold = answer.force[:, :f], answer.force[:, f:]
    start = moved.force + by_hold @ p[:, 0]
    K = by_drag + by_hold @ p[:, 1 : f + 1]
    frictional = list(s.friction)
    size = ca.sum1(ca.fabs(moved.force)) + ca.sum1(ca.fabs(by_hold) @ ca.fabs(p[:, 0]))
    solution = consistent(K[frictional, :], start[frictional], size)
    b.check(1 - 2 * solution.none, 0.5, Status.jammed)
    b.check(1 - 2 * solution.several, 0.5, Status.ambiguous)
    b.check(2 * (solution.single + solution.none + solution.several) - 1, 0.5)
    y = solution.y
    hold = p[:, 0] + p[:, 1 : f + 1] @ y
    force = start + K @ y
    held_by = ca.horzcat(*(pair @ hold[2 * j : 2 * j + 2] for j, pair in enumerate(pairs)))
    slips = []
    for j, i in enumerate(some):
        pulled, most = ca.norm_2(hold[2 * j : 2 * j + 2]), static[j] * ca.fabs(force[i])
        slips.append(ca.if_else(stuck[j], (pulled - most) / (pulled + most + REST), NEVER))
        stops[j] = ca.if_else(stuck[j], NEVER, stops[j])
    friction = ca.SX.zeros(AXES, len(s.contacts))
    for j, i in enumerate(s.friction):
        friction[:, i] = -y[j] * drag[:, j]
    for j, i in enumerate(some):
        friction[:, i] += held_by[:, j]
    stop = p[:, f + 1]
    return Sticking(
        q2=moved.q2 + answer.q2 @ ca.vertcat(y, hold),
        force=force,
        guards=ca.vertcat(*slips, *stops),
        friction=friction,
        wrench=-T @ y + W @ hold,
        slip=touch.slip,
        power=-ca.dot(friction, touch.slip),
        hold=held_by,
        stopped=ca.vertcat(answer.q2[:, f:] @ stop, -ca.dot(stop, ca.vertcat(*rates)) / 2),
    )


def _wrench(force: ca.SX, at: ca.SX) -> ca.SX:
    return ca.vertcat(force, ca.cross(at, force))


def _normal_rate(contact: ContactSymbols, centre: ca.SX, velocity: ca.SX) -> ca.SX:
    """How the unit normal turns where the ball's centre moves, (3,)."""
    at = ca.SX.sym("at", AXES)
    g = ca.gradient(contact.phi(at), at)
    return ca.substitute(ca.jtimes(g / ca.norm_2(g), at, velocity), at, centre)
