"""Efforts within limits at a tick: an active set, from the efforts of the last one.

    min |x|^2 / 2 + W |lambda - wanted|^2 / 2 + |y|^2 / (2 SLACK)
    subject to   G x + (0, lambda) + S y = right,   x and lambda within limits,

in the reduced equations of `allocation`. Where the limits leave no balance, the acceleration gives
way, S y, which is paid for dearly: y are the efforts that it would take besides, S = C G_m with C
from the inertia's rows, so that contact forces follow. A solution without y is thus off by `SLACK`,
relatively, and where there is none the efforts still missing are least. No unit is in it.

Every step solves the equations of those that are not at a limit, goes that way until one of them
meets its limit, and holds it there; where none does, it lets go the one that a limit hinders most
(the primal active set of Härkegård, IEEE Conf. Decision and Control 2002, 1295-1300). All that is
found on the way is within limits, and each step is better than the one before; so their number can
be fixed, and the next tick goes on. Newton's method on the dual (`allocation`) does not serve where
something is missing: multipliers are then 1 / SLACK times the efforts, efforts pass from limit to
limit within 1e-8 of a step, and of 40 such ticks from cold eight of its steps solved 15 to 32, by
how exactly the end of a step is searched, against 38 here.
"""

from __future__ import annotations

import casadi as ca

from ..kinematics.constraints import solve_small
from .active_set import FAR, Active
from .allocation import (
    TERMS,
    Allocated,
    EffortBox,
    cut_lanes,
    reduced,
    solved,
    start,
    weighted_gram,
)
from .builder import Builder, Lanes

STEPS = 8
SLACK = 1e-8
STIFF = 1e-3  # of contacts: what is missing of them costs so much more
HINDERED = 1e-10  # least multiplier that lets go, over its terms


def within_limits(
    b: Builder,
    Q: ca.SX,
    J: Lanes,
    D: ca.SX,
    limits: EffortBox,
    before: tuple[Lanes, ca.SX, ca.SX],
    inertia: ca.SX,
) -> Allocated:
    """As `allocate`; the residual is what the limits leave no balance for; `converged` says
    whether the steps sufficed.

    Args: before: efforts and contact forces to begin with; 1 if there are any, else 0.
          inertia: dQ / dq'', (6, m).
    """
    r, (efforts, forces, begun) = reduced(b, Q, J, D, limits, inertia), before
    m, k = r.m, 6 - r.m
    wanted = ca.SX.zeros(k) if limits.wanted is None else limits.wanted
    cold, _ = start(b, r, TERMS["square"])
    sizes = [ca.sqrt(ca.sumsqr(G)) for G in r.G]
    inverse = cut_lanes(b, [1 / ca.if_else(size > 0, size, 1) for size in sizes])
    C = ca.vertcat(ca.SX.eye(m), solve_small(r.other_columns[:m, :].T, r.other_columns[m:, :].T).T)
    K = SLACK * C @ weighted_gram(b, r.G, [ca.SX(1)] * len(r.G), m) @ C.T
    for i in range(m, 6):
        K[i, i] += SLACK * STIFF
    K = ca.reshape(b.cut(ca.vec(K)), 6, 6)
    first = [ca.if_else(begun, e / s, ca.dot(G[:m], cold[:m]))
             for e, s, G in zip(efforts, limits.scale, r.G, strict=True)]  # fmt: skip
    own = [Active.of(x, lo, hi) for x, lo, hi in zip(first, r.low, r.high, strict=True)]
    taken = b.total([G[m:] * part.x for G, part in zip(r.G, own, strict=True)])
    forces = ca.if_else(begun, forces, r.right[m:] - taken)
    touch = Active.of(forces, limits.contact_low, limits.contact_high)
    give = ca.SX(0) if limits.weight is None else 1 / limits.weight
    for _ in range(STEPS):
        own = [Active(b.cut(s.x), s.low, s.high, b.cut(s.free)) for s in own]
        touch = Active(b.cut(touch.x), touch.low, touch.high, b.cut(touch.free))
        M = weighted_gram(b, r.G, [s.free for s in own], 6) + K
        held = b.total([G * ((1 - s.free) * s.x) for G, s in zip(r.G, own, strict=True)])
        right = r.right - held
        full = ca.diag(K)
        for j in range(k):
            i, free = m + j, touch.free[j]
            if limits.weight is None:  # free, its multiplier is 0
                for l in range(6):
                    M[i, l] = M[l, i] = ca.if_else(free, float(i == l), M[i, l])
                right[i] = ca.if_else(free, 0, right[i] - touch.x[j])
            else:
                M[i, i] += free * give
                right[i] -= ca.if_else(free, wanted[j], touch.x[j])
        u = b.cut(solved(M, right, full)[0])
        gains = cut_lanes(b, [ca.dot(G, u) for G in r.G])
        # Where something is missing u is 1 / SLACK times the efforts: one step that refines these.
        carried = b.total([G * (s.free * g) for G, s, g in zip(r.G, own, gains, strict=True)])
        left = right - carried - K @ u
        for j in range(k):
            i, free = m + j, touch.free[j]
            rest = 0 if limits.weight is None else left[i] - give * u[i]
            left[i] = ca.if_else(free, rest, left[i])
        more = b.cut(solved(M, left, full)[0])
        gains = [g + ca.dot(G, more) for G, g in zip(r.G, gains, strict=True)]
        u = u + more
        targets = cut_lanes(
            b, [ca.if_else(s.free, g, s.x) for g, s in zip(gains, own, strict=True)]
        )
        moved = b.total([G[m:] * x for G, x in zip(r.G, targets, strict=True)])
        natural = r.right[m:] - moved - K[m:, :] @ u
        if limits.weight is not None:
            natural = wanted + give * u[m:]
        target = b.cut(ca.if_else(touch.free, natural, touch.x))
        share = b.least([s.room(x) for s, x in zip(own, targets, strict=True)])
        for room in ca.vertsplit(touch.room(target)):
            share = ca.fmin(share, room)
        share = b.cut(ca.fmin(share, 1))
        own = [s.moved(x, share) for s, x in zip(own, targets, strict=True)]
        touch = touch.moved(target, share)
        # What hinders most, where nothing was met.
        pull = [(g - s.x) * inv for g, s, inv in zip(gains, own, inverse, strict=True)]
        least = HINDERED * ca.sum1(ca.fabs(u))
        hindered = [s.hindered(p) for s, p in zip(own, pull, strict=True)]
        weight = ca.SX(0) if limits.weight is None else limits.weight
        pressed = touch.hindered(u[m:] - weight * (touch.x - wanted))
        most = -b.least([-h for h in hindered])
        for h in ca.vertsplit(pressed):
            most = ca.fmax(most, h)
        converged = (share >= 1) * (most <= least)
        most = b.cut(ca.if_else((share >= 1) * (most > least), most, FAR))
        own = [s.released(h >= most) for s, h in zip(own, hindered, strict=True)]
        touch = touch.released(pressed >= most)
    x = [s.x for s in own]
    terms = [G * part for G, part in zip(r.G, x, strict=True)]
    left = r.right - b.total(terms) - ca.vertcat(ca.SX.zeros(m), touch.x)
    size = ca.fabs(r.right) + b.total([ca.fabs(t) for t in terms])
    size += ca.vertcat(ca.SX.zeros(m), ca.fabs(touch.x))
    missing = ca.SX(0)
    for i in range(6):
        missing = ca.fmax(missing, ca.fabs(left[i]) / ca.if_else(size[i] > 0, size[i], 1))
    value = b.total([part * part for part in x]) + ca.sum1(left * left / ca.diag(K))
    if limits.weight is not None:
        value += limits.weight * ca.sumsqr(touch.x - wanted)
    effort = [part * scale for part, scale in zip(x, limits.scale, strict=True)]
    return Allocated(effort, touch.x, value, ca.SX(1), ca.SX(0), missing, u, converged)
