"""Coulomb friction at the contacts, linear in their forces once the signs of these are given.

At the point of contact, with v the velocity of the material point of the platform, the surface puts
-mu |lambda| u on the platform, u = v / sqrt(|v|^2 + s^2). With sigma = sign(lambda),

    Q = J^T tau + sum lambda_k D_k,    D_k = N_k - sigma_k T_k,    T_k = mu [u; c_k x u],

and a sign pattern sigma is consistent where sigma_k lambda_k >= 0. Inverse dynamics takes the
consistent pattern of minimum norm; forward dynamics requires that there is exactly one solution.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import reduce
from itertools import product

import casadi as ca

from ..dynamics.least_norm import TINY, Pivots
from ..kinematics.constraints import all_of, determinant, independent_indices, indices, solve_small
from .bound import square_volume
from .builder import Builder, Lanes
from .equations import Equations, total
from .platform import Basis, Contacts

MOST = 2  # maximum number of contacts with friction that a kernel of inverse dynamics takes
HUGE = 1e300
FLAT = 1e-3  # part of a square below which a difference has lost too many digits
HELD = 0.1  # least determinant of the contacts' block over that without friction
GROWTH = 30.0  # square of a step before it is projected, over that of the efforts
BORDER = 1e-6  # of the forces that add up to a contact force: below, its sign is left to numpy
PIVOT = 1e-3  # of 1: below, a pivot sigma - K has lost too many digits

LeastNorm = Callable[..., tuple[Lanes, ca.SX, Pivots]]


@dataclass(frozen=True)
class FrictionSolution:
    """Efforts and contact forces of the best sign pattern.

    sure: 1 where no other pattern can be better, else 0;  pivots: the smallest of all solves;
    accuracy: V^2, s^2 and c^2 of its equations: see `bound`.
    """

    effort: Lanes
    force: ca.SX
    sure: ca.SX
    pivots: ca.SX
    accuracy: ca.SX


@dataclass(frozen=True)
class _Candidate:
    """Minimum norm with given signs, or with some forces held at 0: `steps` of `_Pattern.free`.

    norm: sum of squares;  consistent: whether the other forces have their signs: 1, else 0.
    volume: square of that of the directions in `steps`, each over its `B`; at most 1.
    """

    norm: ca.SX
    consistent: ca.SX
    steps: dict[int, ca.SX]
    volume: ca.SX | float = 1.0


@dataclass(frozen=True)
class _Pattern:
    """The minimum norm with given signs, and the directions towards vanishing contact forces.

    effort: lanes;  force: (k,);  broken: by contact, whether its force has the wrong sign.
    B:      lanes of d lambda = -B d effort, (k,).
    free:   by contact, the part of B_i in the null space of the equations, lanes.
    flat:   by contact, 1 where that part is too small to be known, else 0.
    held:   1 where the contacts hold the dependent coordinates nearly as well as without friction.
    """

    effort: Lanes
    force: ca.SX
    norm: ca.SX
    broken: dict[int, ca.SX]
    B: Lanes
    free: dict[int, Lanes]
    flat: dict[int, ca.SX]
    candidates: list[_Candidate]
    pivots: ca.SX
    accuracy: ca.SX
    held: ca.SX

    def least(self, b: Builder) -> tuple[ca.SX, Lanes, ca.SX, ca.SX, ca.SX]:
        """Norm, efforts and contact forces of the best candidate, the size of its steps, and the
        square of their volume."""
        norm, volume = ca.SX(float("inf")), ca.SX(1)
        steps = {i: ca.SX(0) for i in self.free}
        held = dict(steps)
        for candidate in self.candidates:
            better = candidate.consistent * (candidate.norm < norm)
            norm = ca.if_else(better, candidate.norm, norm)
            volume = ca.if_else(better, candidate.volume, volume)
            for i in self.free:
                steps[i] = ca.if_else(better, candidate.steps.get(i, 0), steps[i])
                held[i] = ca.if_else(better, int(i in candidate.steps), held[i])
        if not steps:
            return norm, self.effort, self.force, ca.SX(0), volume
        change = [sum(steps[i] * self.free[i][g] for i in steps) for g in range(len(self.effort))]
        effort = [t + d for t, d in zip(self.effort, change, strict=True)]
        force = self.force - b.total([a * d for a, d in zip(self.B, change, strict=True)])
        for i in held:
            force[i] *= 1 - held[i]
        squares = {i: b.total([a[i] * a[i] for a in self.B]) for i in steps}
        size = total([steps[i] * steps[i] * squares[i] for i in steps])
        return norm, effort, force, size, volume


def least_norm_pattern(
    b: Builder, eq: Equations, c: Contacts, solve: LeastNorm
) -> FrictionSolution:
    """The consistent solution of minimum norm over all sign patterns.

    The minimum norm under sigma_k lambda_k >= 0 has some of these forces at 0 and the others free.
    So it is found among the consistent candidates: every force with one sign, the other, or 0.
    """
    s = b.structure
    best, known = ca.SX(float("inf")), ca.SX(0)
    pivots, accuracy = ca.SX(1.0), ca.SX.ones(3)
    effort: Lanes = []
    force = ca.SX.zeros(len(s.contacts))
    tried: dict[tuple[int, ...], _Pattern] = {}
    for signs in product((1, -1), repeat=len(s.friction)):
        pattern = tried[signs] = _pattern(b, eq, c, solve, signs)
        pivots = ca.fmin(pivots, pattern.pivots)
        norm, efforts, carried, steps, volume = pattern.least(b)
        better = norm < best
        accuracy = ca.if_else(better, pattern.accuracy * ca.vertcat(volume, 1, 1), accuracy)
        known = ca.if_else(better, pattern.held * (steps <= GROWTH * norm), known)
        best = ca.if_else(better, norm, best)
        force = ca.if_else(better, carried, force)
        effort = [
            t if not effort else ca.if_else(better, t, effort[g]) for g, t in enumerate(efforts)
        ]
    return FrictionSolution(effort, force, known * _sure(s.friction, tried, best), pivots, accuracy)


def _pattern(
    b: Builder, eq: Equations, c: Contacts, solve: LeastNorm, signs: tuple[int, ...]
) -> _Pattern:
    s = b.structure
    dep, ind = indices(s.dependent), independent_indices(s.dependent)
    N, T = eq.state.B.T @ c.N, eq.state.B.T @ c.T
    D = ca.SX(N)
    sign = dict(zip(s.friction, signs, strict=True))
    for i in s.friction:
        D[:, i] = N[:, i] - sign[i] * T[:, i]
    held = ca.fabs(determinant(D[dep, :])) > HELD * ca.fabs(determinant(N[dep, :]))
    basis = Basis(ind, dep, -solve_small(D[dep, :].T, D[ind, :].T))
    rows = [basis.generalized_force(chain.row) for chain in eq.chains]
    solution, pivots, eliminated = solve(b.total, rows, basis.generalized_force(eq.Q))
    carried = b.total([ch.row[dep] * t for ch, t in zip(eq.chains, solution, strict=True)])
    force = solve_small(D[dep, :], eq.Q[dep] - carried)
    norm = b.total([t * t for t in solution])
    broken = {i: 1 - (sign[i] * force[i] >= 0) for i in s.friction}
    candidates = [_Candidate(norm, all_of(1 - one for one in broken.values()), {})]
    free: dict[int, Lanes] = {}
    part: dict[int, ca.SX] = {}
    B: Lanes = []
    # A force held at 0 has both signs: from these patterns all signs of the others are in reach.
    if s.n > s.m and signs in ((1,), (1, 1), (-1, -1)):
        B = [solve_small(D[dep, :], chain.row[dep]) for chain in eq.chains]
        for i in s.friction:
            own = [a[i] for a in B]
            taken = b.total([row * a for row, a in zip(rows, own, strict=True)])
            known, quality, _ = solve(b.total, rows, taken)
            pivots = ca.fmin(pivots, quality)
            free[i] = [a - p for a, p in zip(own, known, strict=True)]
            part[i] = b.total([x * x for x in free[i]]) / (b.total([a * a for a in own]) + TINY)
        candidates += _held(b, force, norm, sign, free, part, s.n - s.m)
    flat = {i: square < FLAT for i, square in part.items()}
    held_by = square_volume(b, D.T, s.dependent)
    accuracy = ca.vertcat(eliminated.square, eliminated.terms, held_by)
    return _Pattern(
        solution, force, norm, broken, B, free, flat, candidates, pivots, accuracy, held
    )


def _held(
    b: Builder,
    force: ca.SX,
    norm: ca.SX,
    sign: dict[int, int],
    free: dict[int, Lanes],
    part: dict[int, ca.SX],
    most: int,
) -> list[_Candidate]:
    """Candidates with one force held at 0, and with both; limited by the redundancy.

    Args: part: squares of the lengths of `free` over those of B.
    """
    overlap = {
        (i, j): b.total([x * y for x, y in zip(free[i], free[j], strict=True)])
        for i, j in product(free, free)
    }
    candidates = []
    for i in free:
        step = force[i] / overlap[i, i]
        left = [force[j] - overlap[j, i] * step for j in free if j != i]
        signs = [sign[j] for j in free if j != i]
        broken = [part[i] < FLAT, *(1 - (s * x >= 0) for s, x in zip(signs, left, strict=True))]
        candidates.append(
            _Candidate(
                norm + step * force[i], all_of(1 - flag for flag in broken), {i: step}, part[i]
            )
        )
    if len(free) == 2 and most >= 2 and all(s > 0 for s in sign.values()):
        i, j = free
        a, c, d = overlap[i, i], overlap[i, j], overlap[j, j]
        determinant = a * d - c * c
        both = {
            i: (d * force[i] - c * force[j]) / determinant,
            j: (a * force[j] - c * force[i]) / determinant,
        }
        broken = [part[i] < FLAT, part[j] < FLAT, determinant < FLAT * a * d]
        increase = both[i] * force[i] + both[j] * force[j]
        volume = part[i] * part[j] * determinant / (a * d)
        candidates.append(
            _Candidate(norm + increase, all_of(1 - flag for flag in broken), both, volume)
        )
    return candidates


def _sure(friction: Sequence[int], tried: dict[tuple[int, ...], _Pattern], best: ca.SX) -> ca.SX:
    """Whether no untried candidate can be better than the best one: 1, else 0.

    Untried are forces held at 0 for which the equations leave no freedom, to rounding. Such a
    force belongs to both patterns that differ in its sign alone, and so is the minimum of both.
    Neither has a smaller minimum without the constraint, and from the constrained minimum of a
    convex function the path to the free one leaves an active bound: both patterns break the sign
    of the force that is 0. With two forces at 0 all candidates but that one are broken, and where
    it was not tried there is no best.
    """
    sure = best < HUGE
    for signs, pattern in tried.items():
        for at, i in enumerate(friction):
            if signs[at] < 0:
                continue
            other = tried[(*signs[:at], -1, *signs[at + 1 :])]
            neither = pattern.broken[i] * other.broken[i]
            untried = next((p.flat[i] for p in (pattern, other) if i in p.flat), 1)
            sure = sure * (1 - neither * untried * (ca.fmax(pattern.norm, other.norm) < best))
    return sure


# -- forward dynamics ----------------------------------------------------------------------


@dataclass(frozen=True)
class Consistent:
    """Sign patterns of forward dynamics that are consistent.

    y:       magnitudes of the contact forces of one of them, (f,).
    single, several, none: 1 where that many solutions are certain, else 0; none of the three
             within `BORDER` of a border.
    """

    y: ca.SX
    single: ca.SX
    several: ca.SX
    none: ca.SX


def consistent(K: ca.SX, force: ca.SX, size: ca.SX) -> Consistent:
    """Magnitudes y of the contact forces in forward dynamics, and the number of solutions.

    Friction reduces the contact wrenches by T y, y = |lambda|. All else is linear, so that

        lambda = lambda_0 + K y,    that is    (sigma - K) y = lambda_0,    y >= 0,

    with lambda_0 the solution without friction and sigma a diagonal matrix of signs. Where
    det(sigma - K) det(sigma) is positive for every sigma there is exactly one solution [Rump1997],
    and it is the pattern of the largest smallest y, whatever rounding does to a y that is 0.
    Elsewhere the patterns are counted, with a margin.

    Args: K: (f, f).  force: lambda_0, (f,).  size: of the forces that lambda_0 is a sum of.
    """
    chosen, best = ca.SX.zeros(force.numel()), ca.SX(-float("inf"))
    determinants, pivot = ca.SX(float("inf")), ca.SX(float("inf"))
    near, clear = ca.SX(0), ca.SX(0)
    margin = BORDER * size
    for y, turned, quality in _solutions(-K, force):
        least = reduce(ca.fmin, y)
        better = least > best
        best = ca.if_else(better, least, best)
        chosen = ca.if_else(better, ca.vertcat(*y), chosen)
        determinants, pivot = ca.fmin(determinants, turned), ca.fmin(pivot, quality)
        near += least >= -margin
        clear += least > margin
    regular, unique = pivot > PIVOT, determinants > 0
    single = ca.if_else(unique, near > 0, (near == 1) * (clear == 1))
    several, none = (clear > 1) * (1 - unique), (near == 0) * (1 - unique)
    return Consistent(chosen, regular * single, regular * several, regular * none)


def _solutions(A: ca.SX, right: ca.SX) -> list[tuple[list[ca.SX], ca.SX, ca.SX]]:
    """Solutions of (sigma + A) y = right for every sigma; eliminations are shared.

    Each with det(sigma + A) det(sigma), and its smallest pivot.
    """
    solutions = []
    for sign in (1, -1):
        pivot = A[0, 0] + sign
        known, inverse = ca.fabs(pivot), 1 / pivot
        if right.numel() == 1:
            solutions.append(([right * inverse], sign * pivot, known))
            continue
        ratio = A[1:, 0] * inverse
        rest = _solutions(A[1:, 1:] - ratio @ A[0, 1:], right[1:] - ratio * right[0])
        for y, turned, quality in rest:
            first = (right[0] - A[0, 1:] @ ca.vertcat(*y)) * inverse
            solutions.append(([first, *y], sign * pivot * turned, ca.fmin(known, quality)))
    return solutions
