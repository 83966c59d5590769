"""Efforts of least maximum, and of these the least squares: a path of active sets.

    min t, then |x|^2   subject to   G x + (0, lambda) = right,   |x_i| <= t, and within limits

in the reduced equations of `allocation`. It begins at the least squares within limits, which are
those of t = max |x_i|, and lowers t. Between two changes of the active set x = G^T u and u are
linear in t. Those between their limits follow G_F^T (u + w (t_0 - t)), with

    G_F G_F^T u = right - sum_held G_i x_i,     G_F G_F^T w = sum_held G_i dx_i / dt,

until one of them meets a limit and is held, or the multiplier of a limit vanishes and lets go. The
step that makes G_F G_F^T singular leaves a null vector v: multipliers may move along it, until that
of another limit vanishes, which lets go; where none does no x with a lower t balances, the path has
ended, and v is the certificate (multipliers of the linear program), as u is of least squares.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import reduce

import casadi as ca

from ..graph.program import Program
from .active_set import FAR
from .allocation import Reduced, balance_ports, cut_lanes, reduced, solved, weighted_gram
from .builder import Builder, Lanes
from .structure import Structure

CHANGES = 3  # of the active set in a call of the question
FLAT = 1e-11  # relative pivot below which G_F G_F^T is singular
NOTHING = 1e-30  # what replaces pivots without curvature, so that null vectors stand out
RESIDUAL, CERTAIN = 1e-12, 1e-9  # relative, of the equations and of the other conditions
LEVEL = 1e-14  # relative difference below which a limit is at the level


def levelled(structure: Structure) -> Program:
    """Levelled efforts from the force balance itself, as `allocation`.

    Ports: side, contact_side: 1 where an effort or a force is held at its greatest, -1 at its
    least, else 0;  level: t, over scale. `CHANGES` of these at most are made.
    Results: those anew; ended: 1 where the path ended, else 0.
    """
    b = Builder(structure)
    Q, J, D, limits = balance_ports(b, weighs=False)
    r = reduced(b, Q, J, D, limits)
    sides, forces = b.lane_sample("side"), b.sample("contact_side", len(structure.contacts))
    level = b.sample("level", 1)
    here = _piece(b, r, sides, forces, level)
    for _ in range(CHANGES):
        here = _piece(b, r, *_changed(b, r, here))
    b.output("effort", [x * s for x, s in zip(here.x, limits.scale, strict=True)], "N m or N")
    b.output("contact_force", here.force, "N", len(structure.contacts))
    b.output("value", here.level, "")
    b.output("residual", here.missed, "")
    b.output("side", here.sides, "")
    b.output("contact_side", here.forces, "", len(structure.contacts))
    b.output("level", here.level, "")
    b.output("ended", here.ended, "")
    b.check(_proved(b, r, here), 0.5)
    return b.finish()


@dataclass(frozen=True)
class _Piece:
    """A piece of the path, at its first t: efforts x (lanes), contact forces (k,), multipliers u of
    their squares and v of t, (6,); d_x and d_force: as t is lowered by 1.

    gains, d_gains: G_i . u and G_i . w, or v where `singular`, as w is.
    floor: least t that all limits allow.
    exits, force_exits, exit: how far multipliers move along v until those of limits of efforts and
    of contact forces vanish, and the first of them.
    """

    sides: Lanes
    forces: ca.SX
    level: ca.SX
    u: ca.SX
    w: ca.SX
    x: Lanes
    d_x: Lanes
    gains: Lanes
    d_gains: Lanes
    force: ca.SX
    d_force: ca.SX
    missed: ca.SX
    singular: ca.SX
    exits: Lanes
    force_exits: Lanes
    exit: ca.SX
    floor: ca.SX

    @property
    def ended(self) -> ca.SX:
        """Whether t cannot be lowered."""
        return ca.fmax(self.singular * (self.exit >= FAR), self.lowest)

    @property
    def lowest(self) -> ca.SX:
        """Whether t is what a limit asks of an effort by itself."""
        return self.level <= self.floor


def _piece(b: Builder, r: Reduced, sides: Lanes, forces: ca.SX, level: ca.SX) -> _Piece:
    sides, forces, level = cut_lanes(b, sides), b.cut(forces), b.cut(level)
    m, k = r.m, 6 - r.m
    held = [_end(side, level, *ends) for side, *ends in zip(sides, r.low, r.high, strict=True)]
    free = cut_lanes(b, [side == 0 for side in sides])
    at_end = ca.if_else(forces > 0, r.limits.contact_high, r.limits.contact_low)
    at_end = ca.if_else(forces == 0, 0, at_end)
    M = weighted_gram(b, r.G, free, 6)
    sums = b.total([ca.vertcat(G * x, G * d) for G, (x, d) in zip(r.G, held, strict=True)])
    right = r.right - sums[:6] - ca.vertcat(ca.SX.zeros(m), at_end)
    rate, full = sums[6:], b.total([G * G for G in r.G])
    for j in range(k):
        i, moves = m + j, forces[j] != 0
        for l in range(6):
            M[i, l] = M[l, i] = ca.if_else(moves, M[i, l], float(i == l))
        full[i] = ca.if_else(moves, full[i], 1)
        right[i], rate[i] = ca.if_else(moves, right[i], 0), ca.if_else(moves, rate[i], 0)
    u, quality = solved(M, right, full, FLAT)
    w, _ = solved(M, rate, full, FLAT, NOTHING)
    u, w, singular = b.cut(u), b.cut(w), b.cut(quality <= FLAT)
    gains, d_gains = (cut_lanes(b, [ca.dot(G, a) for G in r.G]) for a in (u, w))
    ways = zip(free, gains, d_gains, held, strict=True)
    both = [(ca.if_else(f, g, x), ca.if_else(f, dg, -d)) for f, g, dg, (x, d) in ways]
    x, d_x = (cut_lanes(b, [pair[i] for pair in both]) for i in (0, 1))
    carried = b.total([ca.vertcat(G * a, G[m:] * d) for G, a, d in zip(r.G, x, d_x, strict=True)])
    left = r.right - carried[:6]
    force = ca.if_else(forces == 0, left[m:], at_end)
    d_force = ca.if_else(forces == 0, -carried[6:], 0)
    left -= ca.vertcat(ca.SX.zeros(m), force)
    size = ca.fabs(r.right) + r.max_gain * b.total([ca.fabs(own) for own in x])
    missed = ca.SX(0)
    for i in range(6):
        missed = ca.fmax(missed, ca.fabs(left[i]) / ca.if_else(size[i] > 0, size[i], 1))
    tiny = b.cut(-CERTAIN * b.least([-ca.fabs(g) for g in d_gains]))
    lanes = zip(sides, x, gains, d_gains, r.low, r.high, strict=True)
    exits = cut_lanes(b, [
        _vanishing(s * (gain - a), s * pull, ca.if_else(low < high, tiny, FAR))
        for s, a, gain, pull, low, high in lanes
    ])  # fmt: skip
    of_forces = ca.vertsplit(forces * u[m:]), ca.vertsplit(forces * w[m:])
    slight = CERTAIN * ca.sum1(ca.fabs(w))
    force_exits = [b.cut(_vanishing(*pair, slight)) for pair in zip(*of_forces, strict=True)]
    first = b.cut(reduce(ca.fmin, force_exits, b.least(exits)))
    ends = zip(r.low, r.high, strict=True)
    floor = b.cut(ca.fmax(0, -b.least([ca.fmin(-low, high) for low, high in ends])))
    return _Piece(
        sides, forces, level, u, w, x, d_x, gains, d_gains, b.cut(force), b.cut(d_force),
        b.cut(missed), singular, exits, force_exits, first, floor,
    )  # fmt: skip


def _vanishing(multiplier: ca.SX, speed: ca.SX, tiny: ca.SX) -> ca.SX:
    """Where a multiplier vanishes that falls by more than rounding; before 0 too."""
    falls = speed < -tiny
    return ca.if_else(falls, multiplier / ca.if_else(falls, -speed, 1), FAR)


def _end(side: ca.SX, level: ca.SX, low: ca.SX, high: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Where an effort is held, 0 where it is not, and how that changes with the level."""
    near = level * (1 - LEVEL)
    above, below = near <= high, -near >= low
    x = ca.if_else(side > 0, ca.fmin(high, level), ca.if_else(side < 0, ca.fmax(low, -level), 0))
    return x, ca.if_else(side > 0, above, ca.if_else(side < 0, -below, 0))


def _until(room: ca.SX, speed: ca.SX) -> ca.SX:
    """How far t is lowered until a room is used up at a speed."""
    return ca.if_else(speed > 0, ca.fmax(room, 0) / ca.if_else(speed > 0, speed, 1), FAR)


def _changed(b: Builder, r: Reduced, p: _Piece) -> tuple[Lanes, ca.SX, ca.SX]:
    """Sides of efforts and contact forces, and the level, at the end of a piece."""
    t, m = p.level, r.m
    ups, downs, releases, waits = [], [], [], []
    lanes = zip(p.sides, p.x, p.d_x, p.gains, p.d_gains, r.low, r.high, strict=True)
    for side, x, d_x, gain, d_gain, low, high in lanes:
        free = side == 0
        up = ca.fmin(_until(high - x, d_x), _until(t - x, 1 + d_x))
        down = ca.fmin(_until(x - low, -d_x), _until(t + x, 1 - d_x))
        release = _until(side * (gain - x), -side * (d_gain - d_x))
        ups.append(ca.if_else(free, up, FAR))
        downs.append(ca.if_else(free, down, FAR))
        releases.append(ca.if_else((1 - free) * (low < high), release, FAR))
        own = ca.if_else(side > 0, high, -low)  # below it the level holds the effort
        waits.append(ca.if_else((1 - free) * (own > 0) * (t * (1 - LEVEL) > own), t - own, FAR))
    ups, downs, releases, waits = (cut_lanes(b, a) for a in (ups, downs, releases, waits))
    step = b.least([_smallest(*lane) for lane in zip(ups, downs, releases, waits, strict=True)])
    contacts = []
    for j in range(6 - m):
        free, force, d_force = p.forces[j] == 0, p.force[j], p.d_force[j]
        up = _until(r.limits.contact_high[j] - force, d_force)
        down = _until(force - r.limits.contact_low[j], -d_force)
        release = _until(p.forces[j] * p.u[m + j], -p.forces[j] * p.w[m + j])
        up, down = ca.if_else(free, up, FAR), ca.if_else(free, down, FAR)
        contacts.append((p.forces[j], up, down, ca.if_else(free, FAR, release), p.force_exits[j]))
        step = ca.fmin(step, _smallest(*contacts[-1][1:4]))
    lowers = (1 - p.singular) * (1 - p.lowest)
    step = b.cut(ca.if_else(lowers, ca.fmin(step, t - p.floor), -1))
    exit = ca.if_else(p.singular * (p.exit < FAR), p.exit, -FAR)

    def changed(side: ca.SX, up: ca.SX, down: ca.SX, release: ca.SX, leave: ca.SX) -> ca.SX:
        side = ca.if_else(ca.fmax(release <= step, leave <= exit), 0, side)
        return ca.if_else(up <= step, 1, ca.if_else(down <= step, -1, side))

    lanes = zip(p.sides, ups, downs, releases, p.exits, strict=True)
    sides = [changed(*lane) for lane in lanes]
    forces = ca.vertcat(ca.SX(0, 1), *(changed(*contact) for contact in contacts))
    level = ca.if_else(step >= t - p.floor, p.floor, t - ca.fmax(step, 0))
    return sides, forces, level


def _smallest(*parts: ca.SX) -> ca.SX:
    return reduce(ca.fmin, parts)


def _proved(b: Builder, r: Reduced, p: _Piece) -> ca.SX:
    """Whether the path has ended at the answer: 1, else 0."""
    pulls = [ca.fabs(g) for g in p.d_gains]
    largest, greatest = (b.cut(-b.least([-ca.fabs(a) for a in lanes])) for lanes in (pulls, p.x))
    tiny, near = b.cut(CERTAIN * largest), b.cut(CERTAIN * greatest)
    excess: Lanes = []
    lanes = zip(p.sides, p.x, p.gains, p.d_gains, r.low, r.high, strict=True)
    for side, x, gain, pull, low, high in lanes:
        outside = ca.fmax(ca.fmax(x - high, low - x), ca.fabs(x) - p.level) > near
        pull = ca.if_else(p.lowest, 0, pull)
        wrong = ca.if_else(side == 0, ca.fabs(pull) > tiny, side * pull < -tiny)
        # Where t does not hold it, least squares have to.
        loose = (side != 0) * (side * pull <= tiny) * (side * (gain - x) < -near)
        excess.append(-ca.fmax(outside, (low < high) * ca.fmax(wrong, loose)))
    good = b.least(excess) >= 0
    low, high = r.limits.contact_low, r.limits.contact_high
    size = greatest + ca.sum1(ca.fabs(p.force))
    for j in range(6 - r.m):
        side, v = p.forces[j], ca.if_else(p.lowest, 0, p.w[r.m + j])
        outside = ca.fmax(p.force[j] - high[j], low[j] - p.force[j]) > CERTAIN * size
        multiplier = side * v < -CERTAIN * ca.sum1(ca.fabs(p.w))
        loose = (side * v <= CERTAIN * ca.sum1(ca.fabs(p.w))) * (side * p.u[r.m + j] < -CERTAIN)
        good *= 1 - ca.fmax(outside, (side != 0) * ca.fmax(multiplier, loose))
    return p.ended * good * (p.missed <= RESIDUAL)
