"""Efforts within limits: a separable objective minimised subject to the force balance.

    min sum_i f(x_i) + W |lambda|^2 / 2   subject to   Q = J^T effort + D lambda,
    effort = scale x,   low <= effort <= high,   contact_low <= lambda <= contact_high

Householder reflections eliminate the contacts, which leaves G x + (0, lambda) = right. With
multipliers u = (v, s) of these equations and g_i = G_i . u, every effort minimises f(x) - g x
within its limits, and the dual

    d(u) = right . u - sum_i f*(G_i . u) - sum_k h*(s_k)

is concave in six unknowns, whatever the number of efforts. Newton's method with a line search
maximises it. At the maximum the gradient vanishes, that is, the equations hold; limits and
conditions of optimality hold by construction. A contact force without a weight, W = 0, allows its
multiplier one sign only, or 0 where it has no bound: such multipliers are held at 0 until the
force would leave its bounds.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import casadi as ca

from ..dynamics.least_norm import gram
from ..graph.program import Program
from ..kinematics.constraints import all_of
from .builder import Builder, Lanes
from .structure import Structure

REGULAR = 1e-10  # minimum squared sine between contacts
CONDITIONED = 1e-6  # minimum pivot of the efforts' equations, over its diagonal
FLAT = 1e-13  # relative pivot below which a direction has no curvature
ROUNDING = 1e-13  # relative to the terms of a sum
FARKAS = 1e-9  # relative margin of a certificate of infeasibility
TIE = 1e-12  # relative difference below which sign patterns are equal, and the first counts
ENOUGH = 0.1  # slope at the end of a line search, over its first
SOFT = 1e-12  # curvature of a cube at 0, over the efforts: below the certificate
HUGE = 1e290  # counts as infinite
TURNS = 3  # Newton steps in a call of the question


@dataclass(frozen=True)
class CostTerm:
    """One term f of an objective.

    answer:  (g, low, high, soft) -> x that minimises f(x) - g x in [low, high].
    yields:  (x, soft) -> dx / dg between the limits.
    value:   f(x).
    degree:  of g in the efforts, by which multipliers of squares are scaled.
    turns:   Newton steps that suffice for nearly all samples.
    probes:  slopes evaluated in a line search; of roots, whose slope is steep at 0, with fewer
             than four some samples go in circles.
    damping: of Newton's step, over the curvature of all efforts.
    """

    answer: Callable[[ca.SX, ca.SX, ca.SX, ca.SX], ca.SX]
    yields: Callable[[ca.SX, ca.SX], ca.SX]
    value: Callable[[ca.SX], ca.SX]
    degree: int
    turns: int
    probes: int
    damping: float = 0.0

    def careful(self) -> CostTerm:
        """For samples whose efforts are nearly all at their limits, as of slack cables: the dual is
        flat there, steps are long, and a line search has to find the way back. Of 1,002 samples of
        the cable robot 6 to 33 % are proved without it, and all but one with it."""
        return replace(self, turns=30, probes=12, damping=1e-7)


def _clipped(x: ca.SX, low: ca.SX, high: ca.SX) -> ca.SX:
    return ca.fmin(ca.fmax(x, low), high)


def _root(g: ca.SX, low: ca.SX, high: ca.SX, soft: ca.SX) -> ca.SX:
    """The root of x^2 + soft x = g without cancellation."""
    g = ca.fmax(g, 0)
    return _clipped(g / (soft / 2 + ca.sqrt(soft * soft / 4 + g)), low, high)


TERMS = {
    "square": CostTerm(
        lambda g, low, high, soft: _clipped(g, low, high),
        lambda x, soft: ca.SX(1),
        lambda x: x * x / 2,
        degree=1,
        turns=7,
        probes=2,
    ),
    "cube": CostTerm(
        _root,
        lambda x, soft: 1 / (2 * x + soft),
        lambda x: x**3 / 3,
        degree=2,
        turns=18,
        probes=4,
    ),
}


def cost_term(own: Any) -> CostTerm:
    """The term of a name of `TERMS`, or of an objective's class; see `Objective.inverse`."""
    if isinstance(own, str):
        return TERMS[own]

    def yields(x: ca.SX, soft: ca.SX) -> ca.SX:
        return 1 / (own.curvature(x) + SOFT * own.curvature(soft / SOFT))

    return CostTerm(
        lambda g, low, high, soft: _clipped(own.inverse(g), low, high),
        yields,
        own.cost,
        degree=own.degree,
        turns=18,
        probes=4,
    )


@dataclass(frozen=True)
class EffortBox:
    """Bounds of efforts (lanes) and contact forces (k,); scale of efforts, lanes; W or None, and
    in ticks the contact forces that it draws to, (k,).

    With a sign, bounds of a contact force that cross exclude what is between them.
    """

    low: Lanes
    high: Lanes
    scale: Lanes
    contact_low: ca.SX
    contact_high: ca.SX
    weight: ca.SX | None = None
    wanted: ca.SX | None = None

    @staticmethod
    def ports(b: Builder, weighs: bool) -> EffortBox:
        """As inputs of every sample."""
        k = len(b.structure.contacts)
        masks = [b.lane(group, "mask") for group in range(len(b.structure.chains))]
        low, high, scale = (
            [ca.if_else(m, x, none) for m, x in zip(masks, b.lane_sample(name), strict=True)]
            for name, none in (("low", 0), ("high", 0), ("scale", 1))
        )
        least, most = b.sample("contact_low", k, "N"), b.sample("contact_high", k, "N")
        return EffortBox(low, high, scale, least, most, b.sample("weight", 1) if weighs else None)

    def signed(self, sigma: ca.SX) -> EffortBox:
        """The box with contact forces restricted to these signs, or 0; sigma = 0 for any sign."""
        low, high, none = self.contact_low, self.contact_high, ca.SX(float("inf"))
        crossed = low > high
        low, high = (
            ca.if_else(sigma > 0, ca.fmax(low, 0), ca.if_else(crossed * (sigma < 0), -none, low)),
            ca.if_else(sigma < 0, ca.fmin(high, 0), ca.if_else(crossed * (sigma > 0), none, high)),
        )
        return replace(self, contact_low=low, contact_high=high)


@dataclass(frozen=True)
class Allocated:
    """Efforts (lanes), contact forces (k,), and the value of the objective.

    sure: 1 where optimality is proved, else 0;  none: 1 where infeasibility is proved, else 0;
    residual: of the equations, relative to their terms;  multipliers: (6,).
    converged: 0 where steps of a fixed number ran out, of any sign pattern, else 1.
    """

    effort: Lanes
    force: ca.SX
    value: ca.SX
    sure: ca.SX
    none: ca.SX
    residual: ca.SX
    multipliers: ca.SX
    converged: ca.SX = field(default_factory=lambda: ca.SX(1))


def allocate(
    b: Builder,
    Q: ca.SX,
    J: Lanes,
    D: ca.SX,
    limits: EffortBox,
    term: CostTerm,
    turns: int,
    before: tuple[ca.SX, ca.SX] | None = None,
) -> Allocated:
    """Efforts and contact forces that balance Q, (6,).

    Args: J: rows of the actuator Jacobian, (6,) a group;  D: wrenches of unit forces, (6, k).
          turns: Newton steps;  before: initial multipliers, (6,), used where the second is 1.
    """
    r = reduced(b, Q, J, D, limits)
    u, quality = start(b, r, term)
    if before is not None:
        u = ca.if_else(before[1], before[0], u)
    here = _point(b, r, term, u)
    for _ in range(turns):
        u, change = _turn(b, r, term, here)
        here = _point(b, r, term, u)
    force = here.force
    value = b.total([term.value(x) for x in here.x])
    if limits.weight is not None:
        value += limits.weight * ca.sumsqr(force) / 2
    bounds = map(ca.vertsplit, (limits.contact_low, limits.contact_high))
    possible = all_of(low <= high for low, high in zip(*bounds, strict=True))
    sure = possible * r.regular * (quality > CONDITIONED) * here.met
    none = r.regular * (1 - (1 - _empty(b, r, here.u)) * (1 - _empty(b, r, change)))
    none = 1 - possible * (1 - none * (1 - here.met))
    effort = [x * s for x, s in zip(here.x, limits.scale, strict=True)]
    return Allocated(effort, force, value, sure, none, here.missed, here.u)


def least_pattern(
    contacts: tuple[ca.SX, ca.SX],
    patterns: Sequence[Sequence[int]],
    limits: EffortBox,
    solve: Callable[[ca.SX, EffortBox], Allocated],
) -> Allocated:
    """The minimum over sign patterns of the contact forces with friction.

    Args: contacts: N and T, (6, k) each: D = N - sigma T;  patterns: sigma, (k,) each.
          solve: (D, limits with these signs) -> the minimum of one pattern.
    """
    N, T = contacts
    best: Allocated | None = None
    for signs in patterns:
        sigma = ca.SX(ca.DM(list(signs)))
        tried = solve(N - T @ ca.diag(sigma), limits.signed(sigma))
        if best is None:
            best = tried
            continue
        less = tried.value < best.value - TIE * ca.fabs(best.value)
        taken = tried.sure * (1 - best.sure * (1 - less))
        known = (best.sure + best.none - best.sure * best.none) * (tried.sure + tried.none)
        pairs = zip(tried.effort, best.effort, strict=True)
        best = Allocated(
            [ca.if_else(taken, x, y) for x, y in pairs],
            ca.if_else(taken, tried.force, best.force),
            ca.if_else(taken, tried.value, best.value),
            known * ca.fmax(tried.sure, best.sure),
            tried.none * best.none,
            ca.if_else(taken, tried.residual, best.residual),
            ca.if_else(taken, tried.multipliers, best.multipliers),
            tried.converged * best.converged,
        )
    assert best is not None
    return best


def allocation(
    structure: Structure, term: Any = "square", weighs: bool = False, careful: bool = False
) -> Program:
    """Efforts from the force balance, with given signs of contact forces, without a mechanism.

    `TURNS` Newton steps from the port multipliers, if `begun`. Samples that it neither proves nor
    disproves are continued with the multipliers that it returns.
    """
    b = Builder(structure)
    Q, J, D, limits = balance_ports(b, weighs)
    before = b.sample("multipliers", 6), b.sample("begun", 1)
    own = cost_term(term).careful() if careful else cost_term(term)
    answer = allocate(b, Q, J, D, limits, own, TURNS, before)
    b.output("effort", answer.effort, "N m or N")
    b.output("contact_force", answer.force, "N", len(structure.contacts))
    b.output("value", answer.value, "")
    b.output("none", answer.none, "")
    b.output("residual", answer.residual, "")
    b.output("multipliers", answer.multipliers, "")
    b.check(answer.sure, 0.5)
    return b.finish()


def balance_ports(b: Builder, weighs: bool) -> tuple[ca.SX, Lanes, ca.SX, EffortBox]:
    """Q, J, D and limits with given signs of contact forces, as inputs of every sample."""
    k = len(b.structure.contacts)
    masks = [b.lane(group, "mask") for group in range(len(b.structure.chains))]
    Q, J = b.sample("Q", 6), b.lane_sample("J", 6)
    N, T = (ca.reshape(b.sample(name, 6 * k), 6, k) for name in ("normal", "friction"))
    sigma, limits = b.sample("sigma", k), EffortBox.ports(b, weighs)
    J = [ca.if_else(mask, row, 0) for mask, row in zip(masks, J, strict=True)]
    return Q, J, N - T @ ca.diag(sigma), limits.signed(sigma)


# -- one pattern ---------------------------------------------------------------------------


@dataclass(frozen=True)
class Reduced:
    """G x + (0, lambda) = right: m rows of efforts alone, then those that give lambda.

    max_gain: largest |G| of every row;  soft: additional curvature of a term.
    other_columns: which are to be had in the same equations, (6, ...).
    """

    G: Lanes
    right: ca.SX
    low: Lanes
    high: Lanes
    limits: EffortBox
    max_gain: ca.SX
    soft: ca.SX
    typical: ca.SX
    regular: ca.SX
    other_columns: ca.SX

    @property
    def m(self) -> int:
        return 6 - self.limits.contact_low.numel()


def reduced(
    b: Builder, Q: ca.SX, J: Lanes, D: ca.SX, limits: EffortBox, other_columns: ca.SX | None = None
) -> Reduced:
    """The equations Q = J^T effort + D lambda, reduced; `other_columns` as Q."""
    k = D.shape[1]
    lanes = [row * s for row, s in zip(J, limits.scale, strict=True)]
    squares = b.total([x * x for x in lanes]) + ca.sum2(D * D)
    force, moment = ca.sum1(squares[:3]), ca.sum1(squares[3:])
    usable = (force > 0) * (moment > 0)
    ratio = ca.if_else(usable, force, 1) / ca.if_else(usable, moment, 1)
    rows = ca.vertcat(ca.SX.ones(3), ca.repmat(ca.sqrt(ratio), 3, 1))
    right = Q if other_columns is None else ca.horzcat(Q, other_columns)
    right = right * ca.repmat(rows, 1, right.shape[1])
    D, lanes = D * ca.repmat(rows, 1, k), [x * rows for x in lanes]
    regular = ca.SX(1)
    column_squares = ca.sum1(D * D)
    for j in range(k):
        v = D[j:, j]
        square = ca.sumsqr(v)
        regular *= square > REGULAR * column_squares[j]
        v[0] += ca.if_else(v[0] < 0, -1, 1) * ca.sqrt(square)
        v = b.cut(v)
        factor = 2 / ca.sumsqr(v)

        def reflected(a: ca.SX, v: ca.SX = v, factor: ca.SX = factor, j: int = j) -> ca.SX:
            below = a[j:, :]
            return ca.vertcat(a[:j, :], below - v @ (factor * (v.T @ below)))

        D, right = (ca.reshape(b.cut(reflected(a)), *a.shape) for a in (D, right))
        lanes = cut_lanes(b, [reflected(x) for x in lanes])
    # R lambda + (rows of efforts) x = right: solved for lambda from the last one up.
    for j in reversed(range(k)):
        inverse = 1 / D[j, j]
        for a in (right, *lanes):
            a[j, :] = (a[j, :] - sum(D[j, l] * a[l, :] for l in range(j + 1, k))) * inverse
    right = ca.vertcat(right[k:, :], right[:k, :])
    right, others = b.cut(right[:, 0]), right[:, 1:]
    lanes = cut_lanes(b, [ca.vertcat(x[k:], x[:k]) for x in lanes])
    low, high = (
        cut_lanes(b, [a / s for a, s in zip(own, limits.scale, strict=True)])
        for own in (limits.low, limits.high)
    )
    max_gain = -b.least([-ca.fabs(x) for x in lanes])
    sizes = b.total([ca.fabs(x[: 6 - k]) for x in lanes])
    typical = ca.SX(0)
    for i in range(6 - k):
        own = ca.if_else(sizes[i] > 0, ca.fabs(right[i]) / sizes[i], 0)
        typical = ca.fmax(typical, own)
    typical = b.cut(ca.if_else(typical > 0, typical, 1))
    soft = SOFT * typical
    return Reduced(lanes, right, low, high, limits, max_gain, soft, typical, regular, others)


def cut_lanes(b: Builder, lanes: Sequence[ca.SX]) -> Lanes:
    return [b.cut(x) for x in lanes]


@dataclass(frozen=True)
class _Point:
    """Efforts and contact forces at multipliers u, and the gradient of the dual.

    free: 1 where a contact's multiplier may move, (k,);  yields: d lambda / ds, (k,);
    missed: relative residual of the equations;  met: whether that is rounding.
    """

    u: ca.SX
    x: Lanes
    force: ca.SX
    gradient: ca.SX
    free: ca.SX
    yields: ca.SX
    missed: ca.SX
    met: ca.SX


def _allowed(r: Reduced, u: ca.SX) -> ca.SX:
    """Multipliers projected on the domain of the dual."""
    low, high, m = r.limits.contact_low, r.limits.contact_high, r.m
    s = u[m:]
    if r.limits.weight is None:
        barred = (s < 0) * (low < -HUGE) + (s > 0) * (high > HUGE)
        s = ca.if_else(barred, 0, s)
    return ca.vertcat(u[:m], s)


def _touching(r: Reduced, s: ca.SX, natural: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Contact forces at their multipliers s, yields and free ones, (k,) each: see `_Point`.

    Args: natural: forces that would meet the equations.
    """
    low, high, weight = r.limits.contact_low, r.limits.contact_high, r.limits.weight
    if weight is not None:
        force = s / weight
        yields = (force > low) * (force < high) / weight
        return _clipped(force, low, high), yields, ca.SX.ones(6 - r.m)
    held = (s == 0) * (natural >= low) * (natural <= high)
    at_low = ca.if_else(s < 0, 1, (s == 0) * (natural < low))
    force = ca.if_else(held, natural, ca.if_else(at_low, low, high))
    return force, ca.SX.zeros(6 - r.m), 1 - held


def _efforts(b: Builder, r: Reduced, term: CostTerm, gains: Lanes) -> Lanes:
    bounds = zip(gains, r.low, r.high, strict=True)
    return cut_lanes(b, [term.answer(g, least, most, r.soft) for g, least, most in bounds])


def _point(b: Builder, r: Reduced, term: CostTerm, u: ca.SX) -> _Point:
    m, u = r.m, b.cut(_allowed(r, u))
    x = _efforts(b, r, term, [ca.dot(G, u) for G in r.G])
    gradient = r.right - b.total([G * own for G, own in zip(r.G, x, strict=True)])
    force, yields, free = _touching(r, u[m:], gradient[m:])
    gradient = b.cut(ca.vertcat(gradient[:m], gradient[m:] - force))
    size = ca.fabs(r.right) + r.max_gain * b.total([ca.fabs(own) for own in x])
    size += ca.vertcat(ca.SX.zeros(m), ca.fabs(force))
    missed = ca.SX(0)
    for i in range(6):
        missed = ca.fmax(missed, ca.fabs(gradient[i]) / ca.if_else(size[i] > 0, size[i], 1))
    return _Point(u, x, force, gradient, free, yields, missed, missed <= ROUNDING)


def weighted_gram(b: Builder, G: Lanes, weight: Lanes, size: int) -> ca.SX:
    """G diag(weight) G^T of the first `size` rows."""
    weighted = cut_lanes(b, [g[:size] * w for g, w in zip(G, weight, strict=True)])
    return gram(b.total, [g[:size] for g in G], weighted)


def solved(
    M: ca.SX, right: ca.SX, full: ca.SX, flat: float = FLAT, empty: float = 1.0
) -> tuple[ca.SX, ca.SX]:
    """M^-1 right by L D L^T, and the smallest pivot over `full`, the size of M's diagonal, which
    times `empty` replaces pivots without curvature, below `flat`."""
    size = right.numel()
    rows = [[M[i, j] for j in range(i + 1)] for i in range(size)]
    x, inverse, quality = ca.vertsplit(right), [], ca.SX(1)
    for j in range(size):
        whole = ca.if_else(full[j] > 0, full[j], 1)
        pivot = rows[j][j]
        quality = ca.fmin(quality, pivot / whole)
        inverse.append(1 / ca.if_else(pivot > flat * whole, pivot, empty * whole))
        column = [rows[i][j] for i in range(j + 1, size)]
        for i in range(j + 1, size):
            factor = rows[i][j] * inverse[j]
            for l in range(j + 1, i + 1):
                rows[i][l] = rows[i][l] - factor * column[l - j - 1]
            x[i] = x[i] - factor * x[j]
            rows[i][j] = factor
    for j in reversed(range(size)):
        x[j] = x[j] * inverse[j]
        for i in range(j + 1, size):
            x[j] = x[j] - rows[i][j] * x[i]
    return ca.vertcat(*x), quality


def start(b: Builder, r: Reduced, term: CostTerm) -> tuple[ca.SX, ca.SX]:
    """Multipliers of the minimum norm without limits, and their conditioning."""
    M = weighted_gram(b, r.G, [ca.SX(1)] * len(r.G), r.m)
    v, quality = solved(M, r.right[: r.m], ca.diag(M))
    v = v * r.typical ** (term.degree - 1)
    return ca.vertcat(v, ca.SX.zeros(6 - r.m)), quality


def _turn(b: Builder, r: Reduced, term: CostTerm, here: _Point) -> tuple[ca.SX, ca.SX]:
    """The next multipliers, and Newton's step towards them."""
    bounds = zip(here.x, r.low, r.high, strict=True)
    softness = [
        ca.if_else((x > low) * (x < high), term.yields(x, r.soft), 0) for x, low, high in bounds
    ]
    M = weighted_gram(b, r.G, softness, 6)
    typical = -b.least([-own for own in softness])
    full = b.total([G * G for G in r.G]) * ca.if_else(typical > 0, typical, 1)
    free = ca.vertcat(ca.SX.ones(r.m), here.free)
    for i in range(r.m, 6):
        for j in range(i):
            M[i, j] = M[i, j] * free[i] * free[j]
        M[i, i] = ca.if_else(free[i], M[i, i] + here.yields[i - r.m], 1)
        full[i] = ca.if_else(free[i], full[i] + here.yields[i - r.m], 1)
    if term.damping:
        M += term.damping * ca.diag(full)
    change, _ = solved(M, here.gradient, full)
    change = b.cut(change)
    first = ca.dot(here.gradient, change)
    m = r.m
    contacts = [G[m:] for G in r.G]
    fixed = cut_lanes(b, [ca.dot(G[:m], here.u[:m]) for G in r.G])
    moving = cut_lanes(b, [ca.dot(G[:m], change[:m]) for G in r.G])
    level = ca.dot(r.right[:m], change[:m])

    def slope_at(t: ca.SX) -> ca.SX:
        s = _allowed(r, here.u + t * change)[m:]
        parts = zip(fixed, moving, contacts, strict=True)
        x = _efforts(b, r, term, [f + t * g + ca.dot(G, s) for f, g, G in parts])
        both = zip(moving, contacts, x, strict=True)
        taken = b.total([ca.vertcat(g, G) * own for g, G, own in both])
        natural = r.right[m:] - taken[1:, :]
        force, _, _ = _touching(r, s, natural)
        return level - taken[0] + ca.dot(natural - force, change[m:])

    # Line search: the root of the slope of d along the step, bracketed.
    t, top = ca.SX(1), ca.SX(float("inf"))
    low, low_slope, top_slope = ca.SX(0), first, ca.SX(0)
    for _ in range(term.probes):
        slope = slope_at(t)
        rises = slope > 0
        low_slope, top_slope = (
            ca.if_else(rises, slope, low_slope),
            ca.if_else(rises, top_slope, slope),
        )
        low, top = ca.if_else(rises, t, low), ca.if_else(rises, top, t)
        span = top - low
        secant = low + span * low_slope / (low_slope - top_slope)
        between = _clipped(secant, low + 0.1 * span, top - 0.1 * span)
        found = ca.if_else(top > HUGE, 4 * t, between)
        t = b.cut(ca.if_else(ca.fabs(slope) <= ENOUGH * first, t, found))
        low, top, low_slope, top_slope = (b.cut(a) for a in (low, top, low_slope, top_slope))
    t = ca.if_else(top > HUGE, low, t)
    return here.u + ca.if_else(here.met, 0, t) * change, change


def _empty(b: Builder, r: Reduced, u: ca.SX) -> ca.SX:
    """Whether multipliers prove that the bounds are infeasible: 1, else 0.

    Weighted by u the equations read right . u = g . x + s . lambda, and within the bounds the
    right side stays below the left (Farkas).
    """
    u = _allowed(r, u)
    low, high = r.limits.contact_low, r.limits.contact_high
    lanes = zip(r.G, r.low, r.high, strict=True)
    most = b.total([_support(ca.dot(G, u), *both) for G, *both in lanes])
    for s, *both in zip(*(ca.vertsplit(a) for a in (u[r.m :], low, high)), strict=True):
        most += _support(s, *both)
    products = u * r.right
    return ca.sum1(products) - most > FARKAS * ca.sum1(ca.fabs(products))


def _support(g: ca.SX, low: ca.SX, high: ca.SX) -> ca.SX:
    """The maximum of g x in [low, high]."""
    return ca.if_else(g > 0, g * high, ca.if_else(g < 0, g * low, 0))
