"""False contact states among random rests and landings of bodies on one to three contacts:

    python -m benchmarks.contacts 1e5

A false state is active and pulling, open and overlapping, beyond friction's cone, or has more
energy than before. What is judged is the body's motion, by its inertia and wrenches.
"""

from __future__ import annotations

import sys

import numpy as np

from condyle.simulation.impact import NoImpactError, complementary, impulses

FALSE = 1e-9  # of the largest speed, acceleration, impulse or energy


def body(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Wrenches (6, c, 3) of unit impulses at random contact points, and a random inertia (6, 6)."""
    count = int(rng.integers(1, 4))
    A = rng.normal(size=(3, 3))
    inertia = np.zeros((6, 6))
    inertia[:3, :3] = np.exp(rng.normal()) * np.eye(3)
    inertia[3:, 3:] = A @ A.T + 0.1 * np.eye(3)
    points, normals = rng.normal(size=(2, count, 3))
    W = np.empty((6, count, 3))
    for i in range(count):
        frame = np.linalg.qr(np.column_stack([normals[i], rng.normal(size=(3, 2))]))[0]
        W[:3, i], W[3:, i] = frame, np.cross(points[i], frame.T).T
    return W, inertia


def false_landing(rng: np.random.Generator) -> bool | None:
    """Whether a random landing ends in a false state; None where no impulses were found."""
    W, inertia = body(rng)
    count, twist = W.shape[1], rng.normal(size=6)
    G = np.einsum("xia,xy,yjb->iajb", W, np.linalg.inv(inertia), W)
    before = np.einsum("xia,x->ia", W, twist)
    mu = rng.uniform(0, 0.4, count) * (rng.random() < 0.7)
    e = np.full(count, rng.choice([0.0, 1.0, rng.uniform(0, 1)]))
    try:
        P = impulses(G, before, e, mu)
    except NoImpactError:
        return None
    moved = twist + np.linalg.solve(inertia, np.einsum("xia,ia->x", W, P))
    after = np.einsum("xia,x->ia", W, moved)
    speed, most = np.abs(before).max(), np.abs(P).max()
    energy = [v @ inertia @ v / 2 for v in (twist, moved)]
    cone = np.linalg.norm(P[:, 1:], axis=1) - mu * P[:, 0]
    wrong = (P[:, 0] < -FALSE * most) | (after[:, 0] < -FALSE * speed) | (cone > FALSE * most)
    false = bool(wrong.any()) or energy[1] > energy[0] * (1 + FALSE)
    if not (before[:, 0] < 0).any():
        false |= bool(P.any())  # nothing lands
    if count == 1 and not mu.any() and before[0, 0] < 0:  # Newton's law
        false |= abs(after[0, 0] + e[0] * before[0, 0]) > FALSE * speed
        false |= e[0] == 1 and abs(energy[1] / energy[0] - 1) > FALSE
    return false


def false_rest(rng: np.random.Generator) -> bool:
    """Whether contacts of a random body under a random wrench have a false state."""
    W, inertia = body(rng)
    normal, free = W[:, :, 0], rng.normal(size=6) * [1, 1, 1, 3, 3, 3]
    R, b = normal.T @ np.linalg.solve(inertia, normal), normal.T @ free
    found = complementary(R, b)
    if len(found) != 1:
        return True
    p, active = found[0].p, found[0].active
    a = normal.T @ (free + np.linalg.solve(inertia, normal @ p))
    size = FALSE * np.abs(b).max()
    return bool((p < 0).any() or p[~active].any() or (a < -size).any() or (a[active] > size).any())


def judged(count: int, seed: int = 46) -> dict[str, int]:
    """How many of random landings and rests are false, and of how many no impulses were found."""
    rng = np.random.default_rng(seed)
    landings = [false_landing(rng) for _ in range(count)]
    return {
        "landings": sum(one is True for one in landings),
        "refused": sum(one is None for one in landings),
        "rests": sum(false_rest(rng) for _ in range(count)),
    }


if __name__ == "__main__":
    count = int(float(sys.argv[1])) if len(sys.argv) > 1 else 100_000
    print(f"of {count} each, false: {judged(count)}")
