"""Newton's method on the dual, all samples at once.

The least of f(x) + W |lambda|^2 / 2 under G x + (0, lambda) = right and bounds is the greatest of

    d(u) = right . u - sum_i f*(G_i . u) - sum_k h*(s_k),

concave in the six multipliers u = (v, s). Its gradient is what the equations miss when efforts
answer to the prices G^T u (see `law`); its curvature is G (dx/dg) G^T. A contact force without
cost, W = 0, allows its multiplier one sign only, or 0 where it has no bound: such multipliers are
held at 0 until the force would leave its bounds. A step that does not raise d enough is shortened.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .law import Law
from .reduced import Reduced
from .small import gram, pick, solve, total

ENOUGH = 1e-4  # part of the promised rise that a step must give
SHORTER = 0.3  # what a step that does not is multiplied by
STRAIGHT, LONGER = 0.9, 4.0  # part of the rise above which the next step is longer; by how much
DOUBT = 2  # steps after which to look whether there is a solution at all
FARKAS = 1e-9  # of its terms, by which that proof must hold
ROUNDING = 1e-13  # of the terms of a sum


@dataclass
class Answer:
    """A solution: x (n, R), contact forces (k, R), multipliers u (6, R).

    found: whether it is one, (R,).
    beaten: whether it is proved that no solution has a value below a cutoff, (R,).
    residual, excess, error: the certificate, (R,) each, once it is known: equations, constraints
            and conditions of optimality.
    """

    x: np.ndarray
    force: np.ndarray
    u: np.ndarray
    found: np.ndarray
    beaten: np.ndarray
    residual: np.ndarray
    excess: np.ndarray
    error: np.ndarray

    @classmethod
    def of(
        cls,
        x: np.ndarray,
        force: np.ndarray,
        u: np.ndarray,
        found: np.ndarray | bool,
        beaten: np.ndarray | bool = False,
    ) -> Answer:
        """A solution without a certificate."""
        count = x.shape[1]
        flags = [np.broadcast_to(flag, count).copy() for flag in (found, beaten)]
        return cls(x, force, u, *flags, *(np.full(count, np.nan) for _ in range(3)))

    @classmethod
    def empty(cls, n: int, k: int, count: int) -> Answer:
        """No solution."""
        shapes = ((n, count), (k, count), (6, count))
        x, force, u = (np.full(shape, np.nan) for shape in shapes)
        return cls.of(x, force, u, found=False)

    def put(self, rows: np.ndarray, part: Answer) -> None:
        """Write the answers of some samples."""
        for name, array in vars(self).items():
            array[..., rows] = getattr(part, name)

    def take(self, rows: np.ndarray) -> Answer:
        """Some of the samples."""
        return Answer(*(pick(a, rows) for a in vars(self).values()))


@dataclass
class Point:
    """d, its gradient, the answers x and the curvature's parts at multipliers u."""

    u: np.ndarray
    x: np.ndarray
    force: np.ndarray
    held: np.ndarray  # contacts whose multiplier stays where it is, (k, R)
    soft: np.ndarray  # d lambda / ds, (k, R)
    gradient: np.ndarray
    size: np.ndarray  # of the terms that the gradient is a sum of, (6, R)
    d: np.ndarray

    def take(self, rows: np.ndarray) -> Point:
        return Point(*(pick(a, rows) for a in vars(self).values()))

    def where(self, good: np.ndarray, other: Point) -> Point:
        """This point, and another where it is not `good`, (R,)."""
        pairs = zip(vars(self).values(), vars(other).values(), strict=True)
        return Point(*(np.where(good, a, b) for a, b in pairs))


def point(r: Reduced, law: Law, u: np.ndarray) -> Point:
    """Evaluate the dual; multipliers of contacts are first put where they may be."""
    m, k = r.m, r.k
    s = u[m:]
    if r.weight == 0.0 and k:
        low, high = np.isfinite(r.contact_low), np.isfinite(r.contact_high)
        s = np.where((s < 0) & ~low, 0.0, np.where((s > 0) & ~high, 0.0, s))
        u = np.concatenate([u[:m], s])
    g = total(r.G * u[:, None], 0)
    x = law.answer(g, r.low, r.high)
    gradient = r.right - total(r.G * x, 1)
    steepest, known = r.size
    size = known + steepest * total(np.abs(x), 0)
    d = total(u * r.right, 0) - total(g * x - law.value(x), 0)
    if not k:
        empty = np.zeros((0, r.count))
        return Point(u, x, empty, empty.astype(bool), empty, gradient, size, d)
    natural = gradient[m:]
    if r.weight > 0.0:
        price = s / r.weight
        force = np.minimum(np.maximum(price, r.contact_low), r.contact_high)
        inside = (price > r.contact_low) & (price < r.contact_high)
        soft, held = inside / r.weight, np.zeros(s.shape, dtype=bool)
        d = d - total(s * force - 0.5 * r.weight * force**2, 0)
    else:
        soft = np.zeros(s.shape)
        inside = (natural >= r.contact_low) & (natural <= r.contact_high)
        held = (s == 0.0) & inside
        at_low = (s < 0) | ((s == 0) & (natural < r.contact_low))
        force = np.where(held, natural, np.where(at_low, r.contact_low, r.contact_high))
        d = d - total(np.where(s == 0.0, 0.0, s * np.where(held, 0.0, force)), 0)
    gradient = np.concatenate([gradient[:m], natural - force])
    size[m:] += np.abs(force)
    return Point(u, x, force, held, soft, gradient, size, d)


def step(r: Reduced, law: Law, p: Point) -> tuple[np.ndarray, np.ndarray]:
    """Newton's step from a point, (6, R), and the least pivot of its curvature, (R,)."""
    m = r.m
    compliance = law.compliance(p.x, r.low, r.high)
    everything = bool(r.k) and (r.weight > 0.0 or not p.held.all())
    size = 6 if everything else m
    M = gram(r.G, compliance, size)
    typical = compliance.max(axis=0)
    full = total(r.G[:size] ** 2, 1) * np.where(typical > 0, typical, 1.0)
    if everything:
        free = np.where(p.held, 0.0, 1.0)
        for i in range(r.k):
            for j in range(m + i):
                M[m + i][j] = M[m + i][j] * free[i] * (free[j - m] if j >= m else 1.0)
            M[m + i][m + i] = np.where(p.held[i], 1.0, M[m + i][m + i] + p.soft[i])
            full[m + i] = np.where(p.held[i], 1.0, full[m + i] + p.soft[i])
    change, quality = solve(M, p.gradient[:size], full)
    if size < 6:
        change = np.concatenate([change, np.zeros((r.k, r.count))])
    return change, quality


def maximise(r: Reduced, law: Law, u: np.ndarray, cutoff: np.ndarray, steps: int = 12) -> Answer:
    """Greatest d from a start u, (6, R); `found` where its gradient vanishes.

    Args: cutoff: d beyond which a sample is given up as `beaten`, (R,): d is never above the
          least value, so no solution is below the cutoff; none is where there is none at all.
    """
    answer = Answer.empty(r.n, r.k, r.count)
    rows = np.arange(r.count)
    here = point(r, law, u)
    change, length, first = np.zeros_like(u), np.ones(r.count), np.ones(r.count)
    good = np.ones(r.count, dtype=bool)
    for turn in range(steps + 1):
        if turn:
            trial = point(r, law, here.u + length * change)
            rise = total(here.gradient * (trial.u - here.u), 0)
            noise = ROUNDING * (np.abs(here.d) + total(np.abs(trial.u) * trial.size, 0))
            gain = trial.d - here.d
            good = gain >= ENOUGH * rise - noise
            # Half of the rise is what curvature leaves; all of it means that d is straight here.
            first = np.where(good, np.where(gain > STRAIGHT * rise, LONGER * length, 1.0), first)
            length = np.where(good, first, SHORTER * length)
            here = trial if good.all() else trial.where(good, here)
        done = (np.abs(here.gradient) <= ROUNDING * here.size).all(axis=0)
        beaten = ~done & (here.d > cutoff)
        if turn >= DOUBT:
            beaten |= ~done & (empty(r, here.u) | empty(r, change))
        ended = done | beaten | (turn == steps)
        if ended.any():
            part = Answer.of(here.x, here.force, here.u, done, beaten)
            if ended.all() and len(rows) == answer.found.size:
                return part
            answer.put(rows[ended], part.take(ended))
            left = ~ended
            if not left.any():
                break
            rows, r, here, law = rows[left], r.take(left), here.take(left), law.take(left)
            good, length, first = good[left], length[left], first[left]
            change, cutoff = pick(change, left), cutoff[left]
        newton, _ = step(r, law, here)
        change = newton if good.all() else np.where(good, newton, change)
    return answer


def empty(r: Reduced, u: np.ndarray) -> np.ndarray:
    """Whether multipliers prove that no x and lambda within bounds meet the equations, (R,).

    The equations weighed by u read right . u = g . x + s . lambda, and the right side cannot be as
    great as the left (Farkas).
    """
    price = np.concatenate([total(r.G * u[:, None], 0), u[r.m :]])
    bound = np.where(
        price > 0, np.concatenate([r.high, r.contact_high]), np.concatenate([r.low, r.contact_low])
    )
    most = total(price * np.where(price == 0, 0.0, bound), 0)
    products = u * r.right
    with np.errstate(invalid="ignore"):
        return total(products, 0) - most > FARKAS * total(np.abs(products), 0)


def greatest(r: Reduced, law: Law) -> np.ndarray:
    """A value that no x within bounds exceeds, (R,): where d does, nothing fits."""
    most = np.maximum(np.abs(r.low), np.abs(r.high))
    return total(law.value(most), 0) * (1 + 1e-9)
