"""Which contacts act: complementarity of accelerations, and impulses of landings.

Numbers alone: c contacts are few, so all sets of active ones are tried.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain, combinations

import numpy as np

NEGLIGIBLE = 1e-10  # of the largest acceleration, or force: rounding of none
REGULAR = 1e-10  # least over greatest singular value of the response of an active set
ROUNDS, SWEEPS = 40, 8  # over contacts with friction, and between two exact solutions
CONVERGED = 1e-15  # of the largest impulse, or of a direction
HALVINGS = 40  # of the factor on restitution
NEAR = 1e-6  # of the largest impulse: it opens or slides within that
TURNS = 100  # of all sliding directions
MORE, FEW = 12, 2  # of that of one contact: before all are looked at, and of one among others
QUICK = 5  # rounds of few turns
DIRECTIONS = 180  # that are looked at where turns do not lead to one


class NoImpactError(Exception):
    """The impulses of a landing were not found."""


@dataclass(frozen=True)
class Complementary:
    """A solution: which contacts are active, their magnitudes p, and what opens, a, (c,) each."""

    active: np.ndarray
    p: np.ndarray
    a: np.ndarray


def complementary(R: np.ndarray, b: np.ndarray) -> list[Complementary]:
    """Solutions of a = b + R p, a >= 0, p >= 0, a_i p_i = 0, each once, fewest contacts first.

    One where R is positive definite; friction may leave none, or several.

    Args: R: (c, c);  b: (c,).
    """
    solutions: list[Complementary] = []
    for some in _sets(len(b)):
        S, p = list(some), np.zeros(len(b))
        if S:
            own = R[np.ix_(S, S)]
            sigma = np.linalg.svd(own, compute_uv=False)
            if not sigma[-1] > REGULAR * sigma[0]:
                continue  # they depend on each other: fewer of them do the same
            p[S] = np.linalg.solve(own, -b[S])
        a = b + R @ p
        a[S] = 0.0
        size = NEGLIGIBLE * (np.abs(b).max() + np.abs(R @ p).max())
        if (a < -size).any() or (p < -NEGLIGIBLE * np.abs(p).max()).any():
            continue
        if not any(np.abs(a - solution.a).max() <= 10 * size for solution in solutions):
            active = np.zeros(len(b), dtype=bool)
            active[S] = True
            solutions.append(Complementary(active, p, a))
    return solutions


def _sets(count: int) -> Iterator[tuple[int, ...]]:
    return chain.from_iterable(combinations(range(count), size) for size in range(count + 1))


def impulses(
    G: np.ndarray, velocity: np.ndarray, restitution: np.ndarray, friction: np.ndarray
) -> np.ndarray:
    """Impulses of contacts that touch, (c, 3): normal, and along two tangents [N s].

    Poisson's law: compression ends where no contact approaches any more, and restitution gives back
    a part of each normal impulse. With one contact without friction that is Newton's law too,
    v+ = -e v-. Friction is Coulomb's in both phases: it sticks, or slides against what is left of
    the velocity. Where both together would add energy, which with several contacts they may, all
    of e are less by a factor with which they add none.

    Args:   G: (c, 3, c, 3), of velocities to unit impulses;  velocity: (c, 3), before.
            restitution, friction: e and mu of each, (c,).
    Raises: NoImpactError.
    """
    G, none = _regular(G), np.zeros(len(velocity))
    pressed = _phase(G, velocity, none, friction)
    after = velocity + np.einsum("iajb,jb->ia", G, pressed)

    def given_back(part: float) -> tuple[np.ndarray, float]:
        """Impulses with a part of e, and the energy that they add [J]."""
        P = pressed + _phase(G, after, part * restitution * pressed[:, 0], friction)
        return P, float((P * (velocity + np.einsum("iajb,jb->ia", G, P) / 2)).sum())

    P, added = given_back(1.0)
    if added <= NEGLIGIBLE * float((np.abs(P) * np.abs(velocity)).sum()):
        return P
    low, high = 0.0, 1.0
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        low, high = (low, middle) if given_back(middle)[1] > 0 else (middle, high)
    return given_back(low)[0]


def _regular(G: np.ndarray) -> np.ndarray:
    """The response, with one of its size along directions in which other contacts hold a point:
    there are no velocities, hence no impulses, and equations have one solution."""
    G = G.copy()
    for i in range(len(G)):
        sizes, directions = np.linalg.eigh(G[i, :, i, :])
        held = directions[:, sizes <= REGULAR * sizes[-1]]
        G[i, :, i, :] += sizes[-1] * held @ held.T
    return G


def _phase(G: np.ndarray, velocity: np.ndarray, least: np.ndarray, mu: np.ndarray) -> np.ndarray:
    """Impulses of at least `least` along the normals, and more where a contact would approach."""
    count = len(velocity)
    P = np.zeros((count, 3))
    P[:, 0] = least
    if not mu.any():
        normal = G[:, 0, :, 0]
        P[:, 0] += complementary(normal, velocity[:, 0] + normal @ least)[0].p
        return P
    turns = MORE if count == 1 else FEW
    for turn in range(ROUNDS):
        if turn == QUICK:
            turns = MORE
        for _ in range(SWEEPS):
            before = P.copy()
            for i in range(count):
                own = G[i, :, i, :]
                at = velocity[i] + np.einsum("ajb,jb->a", G[i], P) - own @ P[i]
                P[i] = _alone(own, at, least[i], mu[i], turns)
            if np.abs(P - before).max() <= CONVERGED * np.abs(P).max(initial=0.0):
                if _valid(G, velocity, least, mu, P):
                    return P
                if turns == MORE:
                    raise NoImpactError
                turns = MORE
        if (exact := _exactly(G, velocity, least, mu, P)) is not None:
            return exact
    raise NoImpactError


def _exactly(
    G: np.ndarray, velocity: np.ndarray, least: np.ndarray, mu: np.ndarray, near: np.ndarray
) -> np.ndarray | None:
    """The impulses whose contacts open, stick and slide as those of `near`, (c, 3), if they do so.

    Linear equations once the sliding directions are known, which are repeated.
    """
    count, size = len(velocity), np.abs(near).max()
    v = velocity + np.einsum("iajb,jb->ia", G, near)
    opens = near[:, 0] <= least + NEAR * size
    slides = np.linalg.norm(near[:, 1:], axis=1) >= mu * near[:, 0] * (1 - NEAR)
    sizes = np.linalg.norm(near[:, 1:], axis=1)
    sliding = near[:, 1:] / np.where(sizes > 0, sizes, 1.0)[:, None]
    every = G.reshape(3 * count, 3 * count)
    for _ in range(TURNS):
        A, right = every.copy(), -velocity.ravel()
        for i in range(count):
            if opens[i]:
                A[3 * i], right[3 * i] = 0.0, least[i]
                A[3 * i, 3 * i] = 1.0
            if slides[i]:
                for axis in (1, 2):
                    A[3 * i + axis], right[3 * i + axis] = 0.0, 0.0
                    A[3 * i + axis, 3 * i + axis] = 1.0
                    A[3 * i + axis, 3 * i] = -mu[i] * sliding[i, axis - 1]
        try:
            P = np.linalg.solve(A, right).reshape(count, 3)
        except np.linalg.LinAlgError:
            return None
        v = velocity + np.einsum("iajb,jb->ia", G, P)
        speed = np.linalg.norm(v[:, 1:], axis=1)
        against = -v[:, 1:] / np.where(speed > 0, speed, 1.0)[:, None]
        turned = np.where((slides & (speed > 0))[:, None], against, sliding)
        change, sliding = np.abs(turned - sliding).max(), turned
        if change <= CONVERGED:
            break
    return P if _valid(G, velocity, least, mu, P) else None


def _valid(
    G: np.ndarray, velocity: np.ndarray, least: np.ndarray, mu: np.ndarray, P: np.ndarray
) -> bool:
    """Whether contacts push, do not approach, and stick or slide against their velocity."""
    change = np.einsum("iajb,jb->ia", G, P)
    v, size = velocity + change, np.abs(P).max()
    speeds = np.abs(velocity).max() + np.abs(change).max()
    good = (P[:, 0] >= least - NEGLIGIBLE * size) & (v[:, 0] >= -NEGLIGIBLE * speeds)
    good &= np.linalg.norm(P[:, 1:], axis=1) <= mu * P[:, 0] + NEGLIGIBLE * size
    good &= (v[:, 1:] * P[:, 1:]).sum(axis=1) <= NEGLIGIBLE * size * speeds
    return bool(good.all())


def _alone(G: np.ndarray, v: np.ndarray, least: float, mu: float, turns: int) -> np.ndarray:
    """The impulse of one contact, (3,): at least `least`, and so that it does not approach.

    Args: G: (3, 3);  v: (3,), without it.
    """
    P = _rubbed(G, v, mu, least, turns)
    return P if v[0] + G[0] @ P >= 0 else _rubbed(G, v, mu, None, turns)


def _rubbed(
    G: np.ndarray, v: np.ndarray, mu: float, normal: float | None, turns: int
) -> np.ndarray:
    """The impulse with friction, its normal part given, or None: so that v_n is 0 after it."""
    if not mu:
        return np.array([-v[0] / G[0, 0] if normal is None else normal, 0.0, 0.0])
    if normal is None:
        P = np.linalg.solve(G, -v)
    else:
        tangential = np.linalg.solve(G[1:, 1:], -(v[1:] + G[1:, 0] * normal))
        P = np.array([normal, *tangential])
    size = np.linalg.norm(P[1:])
    if size <= mu * P[0] or not size:
        return P  # it sticks
    direction = P[1:] / size
    for _ in range(turns):
        P, left = _slid(G, v, mu, normal, direction)
        size = np.linalg.norm(left)
        if not size:
            return P
        turned = -left / size
        if np.abs(turned - direction).max() <= CONVERGED:
            return P
        direction = turned
    return P if turns == FEW else _scanned(G, v, mu, normal, P)


def _slid(
    G: np.ndarray, v: np.ndarray, mu: float, normal: float | None, along: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The impulse whose friction has a direction, (..., 2), and the velocity that is left along the
    surface."""
    way = np.concatenate([np.ones_like(along[..., :1]), mu * along], axis=-1)
    size = -v[0] / (way @ G[0]) if normal is None else np.full(along.shape[:-1], normal)
    P = way * size[..., None]
    return P, v[1:] + P @ G[1:].T


def _scanned(
    G: np.ndarray, v: np.ndarray, mu: float, normal: float | None, otherwise: np.ndarray
) -> np.ndarray:
    """The impulse whose friction is against the velocity that is left: of all directions."""

    def turning(angle: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """P, and the part of what is left across the direction and along it."""
        along = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        P, left = _slid(G, v, mu, normal, along)
        across = left[..., 0] * along[..., 1] - left[..., 1] * along[..., 0]
        return P, across, (left * along).sum(axis=-1)

    from scipy.optimize import brentq

    angles = np.linspace(0.0, 2 * np.pi, DIRECTIONS + 1)
    P, across, with_it = turning(angles)
    passes = (across[1:] * across[:-1] <= 0) & (with_it[1:] < 0) & (P[1:, 0] > 0)
    for i in np.flatnonzero(passes):
        angle = brentq(lambda x: float(turning(x)[1]), angles[i], angles[i + 1], xtol=1e-15)
        P, across, with_it = turning(np.array(angle))
        if with_it <= 0 and P[0] > 0:
            return P
    return otherwise
