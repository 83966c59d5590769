"""The last stage of a tick: what the law asks for, kept within what the machine can do.

A law asks for an acceleration a = q_c'' and a load to be borne. First, with `keeps`, a is led away
from the largest rates of the joints and from the ends of the sockets. A rate r and a place p keep

    |r|' <= k (r_max - |r|),    p'' <= k^2 (p_max - p) - 2 k p',

under which none passes its end (barrier functions of order one and two: Ames et al., IEEE Trans.
Automatic Control 62 (2017) 3861-3876). Of all accelerations the nearest in the metric of the
inertia matrix M is taken, as Gauss's principle does: min |q'' - a|_M^2, where passing an end costs
`STIFF` times what it brings. The pushes of the ends are found one after the other (nonnegative
least squares: Lawson and Hanson, Solving Least Squares Problems, 1974, chapter 23), in a fixed
number of steps.

Then efforts are chosen within limits, and within what they can change in a period, with unilateral
contacts pressed together (`warm_allocation`): from those of the last tick, in a fixed number of
steps, and so that there is an answer where the limits leave none.

What is found after so many steps is used, and is within limits; `unconverged` says that more steps
would have found better. Of random states of the reference mechanism with contacts pressed together,
the first tick is so for 0.06 % with ample limits, 5 % with tight and 27 % with hopeless ones, the
second for 0, 0.02 and 0.6 %, the third for none; of accelerations that rates and sockets bound
0.3 %, and half of those that begin beyond the sockets' ends.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import reduce
from itertools import product

import casadi as ca

from ..dynamics.least_norm import definite_solve
from ..status import Status
from .active_set import FAR, Active
from .allocation import Allocated, EffortBox, least_pattern
from .builder import Builder, Lanes
from .equations import Wrench
from .inertia import Affine, affine
from .inverse import DOUBTFUL
from .platform import PlatformState, contacts, feasibility, platform_at
from .rate import ball_centres
from .warm_allocation import within_limits

MISSING = 1e-5  # share of the motion's forces from which on limits are said to take part of it
STIFF = 1e6  # cost of passing an end, over the gain
STEPS = 10  # of the active set
BEFORE = {  # port -> result
    "effort_before": "effort",
    "contact_before": "contact_force",
    "begun_limits_before": "begun_limits",
}


@dataclass(frozen=True)
class TickLimits:
    """Which of the stage's parts a controller has.

    chooses: efforts are chosen within limits; else they are of least norm, and clipped.
    weighs:  contact forces have a weight, and what it draws them to.
    rated:   efforts change by at most `effort_rate` a second.
    faces:   of bounds that balls do not pass, as joints do not pass their rates: contact, axis and
             1 for the greatest or -1 for the least; None: neither is kept.
    """

    chooses: bool = False
    weighs: bool = False
    rated: bool = False
    faces: tuple[tuple[int, int, int], ...] | None = None


NONE = TickLimits()


@dataclass(frozen=True)
class LimitedEfforts:
    """Efforts, lanes, and 1 where limits take part of what was asked for, else 0."""

    effort: Lanes
    cut: ca.SX


class LimitedTick:
    """The stage of one tick, its ports read in their order."""

    low: Lanes
    high: Lanes

    def __init__(self, b: Builder, parts: TickLimits, period: ca.SX) -> None:
        self._b, self._parts = b, parts
        k = len(b.structure.contacts)
        self.low, self.high = (b.lane_sample(n, unit="N m or N") for n in ("low", "high"))
        self._narrow = self.low, self.high
        if parts.rated or parts.chooses:
            self._before = b.lane_sample("effort_before")
            self._begun = b.sample("begun_limits_before", 1) > 0
            b.output("begun_limits", ca.SX(1), "1")
        if parts.rated:
            ends = zip(b.lane_sample("effort_rate"), self._before, self.low, self.high, strict=True)
            steps = [
                (ca.if_else(self._begun, r * period, ca.inf), ca.fmin(ca.fmax(e, lo), hi))
                for r, e, lo, hi in ends
            ]
            self._narrow = (
                [ca.fmax(lo, e - d) for (d, e), lo in zip(steps, self.low, strict=True)],
                [ca.fmin(hi, e + d) for (d, e), hi in zip(steps, self.high, strict=True)],
            )
        if parts.chooses:
            self._scale = b.lane_sample("scale")
            self._contact = b.sample("contact_low", k, "N"), b.sample("contact_high", k, "N")
            self._weight = b.sample("weight", 1) if parts.weighs else None
            self._wanted = b.sample("contact_wanted", k, "N") if parts.weighs else ca.SX.zeros(k)
            self._contact_before = b.sample("contact_before", k, "N")
        if parts.faces is not None:
            self._speed, self._rate = b.lane_sample("speed"), b.sample("bound_rate", 1, "1/s")
            self._bounds = b.sample("bounds", len(parts.faces), "m")

    def clipped(self, asked: Lanes) -> Lanes:
        """Efforts within limits, and within what they can change."""
        bounds = zip(asked, *self._narrow, strict=True)
        return [ca.fmin(ca.fmax(e, lo), hi) for e, lo, hi in bounds]

    def solve(
        self,
        q: ca.SX,
        q1: ca.SX,
        q2: ca.SX,
        load: Wrench,
        least_norm: Callable[[ca.SX, Wrench], Lanes],
        part: bool,
    ) -> LimitedEfforts:
        """Efforts of an acceleration under a load.

        Args: least_norm: (q'', load) -> efforts without limits;  part: whether the law adds to
              them, so that they are not all that the actuators give.
        """
        b, cut, converged = self._b, ca.SX(0), ca.SX(1)
        if not self._parts.chooses and self._parts.faces is None:
            return LimitedEfforts(least_norm(q2, load), cut)
        platform = platform_at(b, q, q1, ca.SX.zeros(q.numel()))
        eq = affine(b, platform, load, [ca.SX(0) for _ in b.structure.families])
        direction = eq.basis.rates(eq.S)  # c'' = start + along q''
        if self._parts.faces is not None and not part:
            q2, cut, converged = self._limited_acceleration(platform, eq, direction, q2)
        if not self._parts.chooses:
            b.output("unconverged", 1 - converged, "1")
            return LimitedEfforts(least_norm(q2, load), cut)
        b.check(feasibility(b, platform, eq.discriminants), DOUBTFUL, Status.unreachable)
        inertia = eq.H @ direction
        Q = eq.F + eq.H @ eq.start + inertia @ q2
        touch = contacts(b, platform)
        both = eq.B.T @ touch.N, eq.B.T @ touch.T
        rubs = b.structure.friction
        signs = [(1, -1) if i in rubs else (0,) for i in range(len(b.structure.contacts))]
        masks = [b.lane(i, "mask") for i in range(len(eq.rows))]
        ends = (self.low, self.high) if part else self._narrow
        low, high = ([m * x for m, x in zip(masks, own, strict=True)] for own in ends)
        scale = [ca.if_else(m, x, 1) for m, x in zip(masks, self._scale, strict=True)]
        limits = EffortBox(low, high, scale, *self._contact, self._weight, self._wanted)
        before = self._before, self._contact_before, self._begun * (1 - part)

        def within(D: ca.SX, own: EffortBox) -> Allocated:
            return within_limits(b, Q, eq.rows, D, own, before, inertia)

        found = least_pattern(both, list(product(*signs)), limits, within)
        b.output("contact_force", found.force, "N", len(signs))
        b.output("missing", found.residual, "1")
        b.output("unconverged", 1 - converged * found.converged, "1")
        return LimitedEfforts(found.effort, ca.fmax(cut, found.residual > MISSING))

    def _limited_acceleration(
        self, platform: PlatformState, eq: Affine, direction: ca.SX, q2: ca.SX
    ) -> tuple[ca.SX, ca.SX, ca.SX]:
        """q'' that keeps rates and sockets; 1 where it is not what was asked for; 1 where the steps
        sufficed for the nearest one."""
        b, k, size = self._b, self._rate, q2.numel()
        M = direction.T @ eq.H @ direction
        M = ca.reshape(b.cut(ca.vec((M + M.T) / 2)), size, size)
        inverse, _, _ = definite_solve(M, ca.SX.eye(size), ca.diag(M))

        rows: list[ca.SX] = []
        rooms: list[ca.SX] = []
        costs: list[ca.SX] = []

        def add(row: ca.SX, room: ca.SX, mask: ca.SX) -> None:
            """An end, row q'' <= room, and what passing it costs."""
            gain = ca.dot(row, inverse @ row)
            rows.append(b.cut(row))
            rooms.append(b.cut(room))
            costs.append(b.cut(STIFF * mask * (gain > 0) / ca.if_else(gain > 0, gain, 1)))

        for i, row in enumerate(eq.rows):
            bias = eq.biases[i] + ca.dot(row, eq.start)
            for sign in (1, -1):
                room = k * (self._speed[i] - sign * eq.rates[i]) - sign * bias
                add(sign * (direction.T @ row), room, b.lane(i, "mask"))
        lanes = len(rows)
        for row, room in zip(*self._socket(platform), strict=True):
            add(row.T, room, ca.SX(1))
        groups = range(0, lanes, 2)

        def summed(parts: list[ca.SX]) -> ca.SX:
            """The sum of all ends; both ends of a joint are lanes of its group."""
            return b.total([parts[i] + parts[i + 1] for i in groups]) + sum(parts[lanes:])

        def largest(parts: list[ca.SX]) -> ca.SX:
            reduced = -b.least([-ca.fmax(parts[i], parts[i + 1]) for i in groups])
            return reduce(ca.fmax, parts[lanes:], reduced)

        upper = [(i, j) for i in range(size) for j in range(i, size)]
        pushes = [Active(ca.SX(0), ca.SX(0), ca.SX(FAR), ca.SX(0)) for _ in rows]
        demand, cut = b.cut(q2), ca.SX(0)
        for step in range(STEPS):
            terms = []
            for own, row, room, cost in zip(pushes, rows, rooms, costs, strict=True):
                stiff = own.free * cost
                terms.append(
                    ca.vertcat(stiff * room * row, *(stiff * row[i] * row[j] for i, j in upper))
                )
            reduced = summed(terms)
            H = ca.SX(M)
            for at, (i, j) in enumerate(upper):
                H[i, j] = H[j, i] = M[i, j] + reduced[size + at]
            x = b.cut(definite_solve(H, M @ demand + reduced[:size], ca.diag(H))[0])
            over = [b.cut(ca.dot(row, x) - room) for row, room in zip(rows, rooms, strict=True)]
            targets = [own.free * c * v for own, c, v in zip(pushes, costs, over, strict=True)]
            rest = [-own.room(t) for own, t in zip(pushes, targets, strict=True)]
            share = b.cut(ca.fmin(-largest(rest), 1))
            hindered = [(1 - own.free) * ca.sqrt(c) * ca.fmax(v, 0)
                        for own, c, v in zip(pushes, costs, over, strict=True)]  # fmt: skip
            most = largest(hindered)
            cut = most > 0 if step == 0 else cut
            converged = (share >= 1) * (most <= 0)
            most = b.cut(ca.if_else((share >= 1) * (most > 0), most, FAR))
            pushes = [
                own.moved(t, share).released(h >= most)
                for own, t, h in zip(pushes, targets, hindered, strict=True)
            ]
            pushes = [Active(b.cut(o.x), o.low, o.high, b.cut(o.free)) for o in pushes]
        pushed = summed([own.x * row for own, row in zip(pushes, rows, strict=True)])
        return demand - inverse @ pushed, cut, converged

    def _socket(self, platform: PlatformState) -> tuple[list[ca.SX], list[ca.SX]]:
        """Rows (1, m) of the balls' accelerations, and what they may be."""
        b, k, motion = self._b, self._rate, platform.motion
        V, omega = motion.twist[:3], motion.twist[3:]
        T = motion.E @ motion.M_J
        rows: list[ca.SX] = []
        rooms: list[ca.SX] = []
        faces = self._parts.faces or ()
        centres = ball_centres(b, platform, [i for i, _, _ in faces])
        for (place, lever), (_, axis, sign), end in zip(
            centres, faces, ca.vertsplit(self._bounds), strict=True
        ):
            turned = ca.cross(omega, lever)
            speed = V + turned
            bias = motion.twist_rate[:3] + ca.cross(motion.twist_rate[3:], lever)
            bias += ca.cross(omega, turned)
            J = T[:3, :] - ca.skew(lever) @ T[3:, :]
            rows.append(sign * J[axis, :])
            room = k * k * (end - place) - 2 * k * speed - bias
            rooms.append(sign * room[axis])
        return rows, rooms
