"""A planar slider-crank whose slider has play in its guide, from event to event.

Coordinates are the angles of crank, rod and slider; masses and forces come from Jacobians of the
mass centres. The slider has two round ends of its half height; those that touch are multipliers,
impacts follow Poisson's law, and friction slides. Nothing is shared with condyle.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import product

import numpy as np
from scipy.integrate import solve_ivp

CRANK, ROD, HALF, HIGH, CLEARANCE = 0.153, 0.306, 0.05, 0.025, 1e-3
MASSES = 0.038, 0.038, 0.076
G, RESTITUTION, FRICTION, SMOOTHING = 9.81, 0.4, 0.01, 1e-3
INERTIAS = (
    MASSES[0] * CRANK**2 / 12,
    MASSES[1] * ROD**2 / 12,
    MASSES[2] * ((2 * HALF) ** 2 + (2 * HIGH) ** 2) / 12,
)
FACES = [(end, wall) for end in (1, -1) for wall in (-1, 1)]  # of the slider, of the guide
TOUCHING, STILL, BRIEF = 1e-11, 1e-10, 1e-7  # m; m/s; s of a flight that ends bounces
CLEAR = 1e-9  # seconds


@dataclass
class Run:
    """landings: time, face, speed;  releases: time, face;  at: times and states, (N,), (N, 6)."""

    landings: list[tuple[float, int, float]] = field(default_factory=list)
    releases: list[tuple[float, int]] = field(default_factory=list)
    t: list[float] = field(default_factory=list)
    y: list[np.ndarray] = field(default_factory=list)


def _arms(q: np.ndarray, w: np.ndarray) -> list[tuple[np.ndarray, np.ndarray, float]]:
    """Jacobians (2, 3) of the mass centres, their accelerations at q'' = 0, and masses."""
    c, s = np.cos(q), np.sin(q)
    turn, pull = np.array([-s, c]), np.array([-c, -s]) * w**2
    found = []
    for lengths, mass in zip(
        ((CRANK / 2, 0, 0), (CRANK, ROD / 2, 0), (CRANK, ROD, 0)), MASSES, strict=True
    ):
        found.append((turn * lengths, pull @ lengths, mass))
    return found


def mass_and_force(q: np.ndarray, w: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """M, (3, 3), and the force without contacts, (3,)."""
    M, F = np.diag(INERTIAS).astype(float), np.zeros(3)
    for J, bias, mass in _arms(q, w):
        M += mass * J.T @ J
        F -= mass * J.T @ (bias + np.array([0.0, G]))
    return M, F


def energy(q: np.ndarray, w: np.ndarray) -> float:
    heights = np.array([CRANK / 2, CRANK, CRANK]), np.array([0.0, ROD / 2, ROD])
    y = np.sin(q[0]) * heights[0] + np.sin(q[1]) * heights[1]
    return float(w @ mass_and_force(q, w)[0] @ w / 2 + G * np.dot(MASSES, y))


def ends(q: np.ndarray, w: np.ndarray) -> list[tuple[float, np.ndarray, float, np.ndarray]]:
    """Of every face: gap, its Jacobian (3,), gap'' at q'' = 0, and the Jacobian along, (3,)."""
    found = []
    for end, wall in FACES:
        lengths = np.array([CRANK, ROD, end * HALF])
        height = lengths @ np.sin(q)
        found.append(
            (
                CLEARANCE - wall * height,
                -wall * lengths * np.cos(q),
                float(wall * lengths @ (np.sin(q) * w**2)),
                -lengths * np.sin(q) - [0, 0, wall * HIGH],
            )
        )
    return found


def _pushes(q: np.ndarray, w: np.ndarray, faces: list[int]) -> tuple[np.ndarray, ...]:
    """Of some faces: N (c, 3), D (3, c) normal less friction, gap'' at q'' = 0."""
    rows = [ends(q, w)[i] for i in faces]
    N = np.array([row[1] for row in rows]).reshape(-1, 3)
    slip = np.array([row[3] @ w for row in rows])
    rub = FRICTION * slip / np.sqrt(slip**2 + SMOOTHING**2)
    D = np.array([row[1] - r * row[3] for row, r in zip(rows, rub, strict=True)]).reshape(-1, 3).T
    return N, D, np.array([row[2] for row in rows])


def accelerations(y: np.ndarray, faces: list[int]) -> tuple[np.ndarray, np.ndarray]:
    """q'' with faces that stay closed, and their forces."""
    q, w = y[:3], y[3:]
    M, F = mass_and_force(q, w)
    free = np.linalg.solve(M, F)
    if not faces:
        return free, np.zeros(0)
    N, D, bias = _pushes(q, w, faces)
    p = np.linalg.solve(N @ np.linalg.solve(M, D), -(N @ free + bias))
    return free + np.linalg.solve(M, D @ p), p


def _impulses(A: np.ndarray, v: np.ndarray, least: np.ndarray) -> np.ndarray:
    """P >= least with v + A P >= 0, one of both equal."""
    for open_ in product((True, False), repeat=len(v)):
        on = ~np.array(open_)
        P = least.copy()
        if on.any():
            P[on] = np.linalg.solve(A[np.ix_(on, on)], -(v + A[:, ~on] @ least[~on])[on])
        after = v + A @ P
        if (P - least >= -1e-14).all() and (after >= -1e-12).all():
            return P
    raise AssertionError("no impulses")


def impact(y: np.ndarray, touching: list[int]) -> np.ndarray:
    """q' after it."""
    q, w = y[:3], y[3:]
    M, _ = mass_and_force(q, w)
    rows = [ends(q, w)[i] for i in touching]
    N, T = np.array([row[1] for row in rows]), np.array([row[3] for row in rows])
    slip = T @ w
    D = (N - FRICTION * np.sign(slip)[:, None] * T).T
    A, v = N @ np.linalg.solve(M, D), N @ w
    first = _impulses(A, v, np.zeros(len(v)))
    second = _impulses(A, v + A @ first, RESTITUTION * first)
    after = w + np.linalg.solve(M, D @ (first + second))
    assert (np.sign(T @ after) == np.sign(slip)).all(), "friction would stick"
    return after


def run(y0: np.ndarray, start: float, end: float) -> Run:
    """From a state without contact to a time."""
    t, y, active, found = start, y0.copy(), list[int](), Run()

    def gap(i: int) -> object:
        def value(t: float, y: np.ndarray) -> float:
            return ends(y[:3], y[3:])[i][0]

        value.terminal, value.direction = True, -1  # type: ignore[attr-defined]
        return value

    def force(k: int, faces: list[int]) -> object:
        def value(t: float, y: np.ndarray) -> float:
            return float(accelerations(y, faces)[1][k])

        value.terminal, value.direction = True, -1  # type: ignore[attr-defined]
        return value

    while t < end:
        faces = list(active)
        others = [i for i in range(4) if i not in faces]
        watched = [gap(i) for i in others] + [force(k, faces) for k in range(len(faces))]
        how = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-14, "max_step": 1e-4}

        def rate(t: float, y: np.ndarray, on: list[int] = faces) -> np.ndarray:
            return np.concatenate([y[3:], accelerations(y, on)[0]])

        clear = solve_ivp(rate, (t, t + CLEAR), y, **how)  # gaps that open are above rounding then
        step = solve_ivp(rate, (t + CLEAR, end), clear.y[:, -1], **how, events=watched)
        found.t += step.t.tolist()
        found.y += list(step.y.T)
        t, y = float(step.t[-1]), step.y[:, -1].copy()
        if step.status != 1:
            break
        which = next(k for k, times in enumerate(step.t_events) if len(times))
        rows = ends(y[:3], y[3:])
        if which < len(others):
            landed = others[which]
            touching = [i for i, row in enumerate(rows) if row[0] < TOUCHING]
            found.landings.append((t, landed, float(-rows[landed][1] @ y[3:])))
            y[3:] = impact(y, touching)
        else:
            touching = list(faces)
            found.releases.append((t, faces[which - len(others)]))
        active = _staying(y, touching)
        if active:  # what hardly leaves stays
            N, D, _ = _pushes(y[:3], y[3:], active)
            M, _ = mass_and_force(y[:3], y[3:])
            A = N @ np.linalg.solve(M, D)
            y[3:] -= np.linalg.solve(M, D @ np.linalg.solve(A, N @ y[3:]))
    return found


def _staying(y: np.ndarray, touching: list[int]) -> list[int]:
    """Faces that neither leave nor would have to pull."""
    rows, free = ends(y[:3], y[3:]), accelerations(y, [])[0]
    slow = []
    for i in touching:
        leaving, falling = rows[i][1] @ y[3:], rows[i][1] @ free + rows[i][2]
        if leaving <= STILL or (falling < 0 and -2 * leaving / falling < BRIEF):
            slow.append(i)
    for some in product((True, False), repeat=len(slow)):
        on = [i for i, used in zip(slow, some, strict=True) if used]
        a, p = accelerations(y, on)
        opens = [rows[i][1] @ a + rows[i][2] >= -1e-9 for i in slow if i not in on]
        if (p > 1e-9).all() and all(opens):
            return on
    raise AssertionError("no contact state")
