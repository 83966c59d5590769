"""Forward dynamics with Coulomb friction: which contacts push which way.

Friction takes T y off what the contacts put on the platform, with y = |lambda|. All else is linear,
so that the forces of the contacts that rub are

    lambda = lambda_0 + K y,    that is    (sigma - K) y = lambda_0,    y >= 0,

where sigma, a diagonal matrix of signs, is the pattern, and lambda_0 what is found without
friction. A pattern is consistent where y >= 0. There is one such pattern where friction is not too
strong for the mechanism: the absolute value equation then has one solution. With none or several it
jams.
"""

from __future__ import annotations

import casadi as ca

HUGE = 1e300


def consistent(K: ca.SX, force: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Sizes y of the consistent pattern's forces, and how many patterns are consistent.

    Args: K: (f, f).  force: lambda_0, (f,).
    """
    f = force.numel()
    chosen, count = ca.SX.zeros(f), ca.SX(0)
    for y in _solutions(-K, force):
        kept = ca.SX(1)
        for one in y:
            kept = kept * (one >= 0) * (one < HUGE)
        count = count + kept
        chosen = ca.if_else(kept, ca.vertcat(*y), chosen)
    return chosen, count


def _solutions(A: ca.SX, right: ca.SX) -> list[list[ca.SX]]:
    """Solutions of (sigma + A) y = right for every pattern; eliminations are shared."""
    inverses = [1 / (A[0, 0] + sign) for sign in (1, -1)]
    if right.numel() == 1:
        return [[right * inverse] for inverse in inverses]
    found = []
    for inverse in inverses:
        ratio = A[1:, 0] * inverse
        for rest in _solutions(A[1:, 1:] - ratio @ A[0, 1:], right[1:] - ratio * right[0]):
            first = right[0] - A[0, 1:] @ ca.vertcat(*rest)
            found.append([first * inverse, *rest])
    return found
