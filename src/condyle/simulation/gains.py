"""Is the loop stable, and by how much? Eigenvalues of the loop linearised about points of its path.

The mechanism is x' = A x + B u there, by exact derivatives (`Evaluator.linearised`); the law is
u = -K x by differences. Sampled with a period T, held, and d periods late,

    x+ = Phi x + Gamma u_-d,    Phi = exp(A T),    Gamma = int exp(A s) ds B,

with encoders' rates v+ = smoothing v + (1 - smoothing) (q - q_before) / T in the loop. It is stable
where all eigenvalues z lie within the unit circle; s = log(z) / T are those of a continuous loop,
of damping -Re s / |s|. The margin of phase is how much all efforts may lag together: the smallest
angle between -1 and an eigenvalue of the open loop L(exp(i w T)) of modulus 1 (generalised Nyquist;
Skogestad and Postlethwaite, Multivariable Feedback Control, 2005, section 4.9).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from ..errors import UnsupportedError
from .controllers import Law, Measured, Reference
from .plan import ClosedLoop, Plan
from .point import Instant

POINTS = 11  # along the path, home besides
DIFFERENCE = 1e-6  # of q and q', relative to 1 [m, rad; per s]
FREQUENCIES = 400
WEAK = 0.2  # damping, and
SMALL = 30.0  # degrees of phase, below which a loop is called lively
FAST = 1e-3  # of the unit circle: eigenvalues within it are gone after a period


@dataclass(frozen=True)
class Point:
    """The loop at a point of the path.

    time:  [s], None at home.   eigenvalues: s [1/s], complex.
    radius: largest |z|, or 1 + largest Re s of a continuous loop [1/s].
    damping: least of all eigenvalues that last.   phase: margin [degrees]; inf if L is below 1.
    """

    time: float | None
    eigenvalues: np.ndarray
    radius: float
    damping: float
    phase: float

    @property
    def stable(self) -> bool:
        return self.radius < 1.0

    def __str__(self) -> str:
        where = "home" if self.time is None else f"t = {self.time:.3g} s"
        slow = min(abs(self.eigenvalues.real), default=0.0)
        verdict = "stable" if self.stable else "UNSTABLE"
        return (
            f"{where:>12}  {verdict:<8}  slowest {slow:8.4g} 1/s  damping {self.damping:6.3f}  "
            f"phase margin {self.phase:6.1f} deg"
        )


@dataclass(frozen=True)
class GainReport:
    """The loop along its path."""

    points: tuple[Point, ...]
    period: float | None
    delay: int

    @property
    def stable(self) -> bool:
        return all(point.stable for point in self.points)

    @property
    def warnings(self) -> list[str]:
        """What to look at."""
        bad = [point for point in self.points if not point.stable]
        if bad:
            late = "" if self.period is None else self._late()
            return [f"the loop is unstable at {len(bad)} of {len(self.points)} points{late}"]
        found = []
        if (least := min(point.damping for point in self.points)) < WEAK:
            found.append(f"the loop is hardly damped: {least:.3f}, below {WEAK:g}")
        if (phase := min(point.phase for point in self.points)) < SMALL:
            found.append(f"the phase margin is {phase:.1f} degrees, below {SMALL:g}")
        return found

    def _late(self) -> str:
        assert self.period is not None
        held = (self.delay + 0.5) * self.period * 1e3
        return (
            f": efforts come {held:.3g} ms late on average (delay, and half a period held); lower "
            "the gains, the delay or the period"
        )

    def data(self) -> dict[str, Any]:
        """For programs."""
        points = [
            {
                "time": p.time,
                "stable": p.stable,
                "radius": p.radius,
                "damping": p.damping,
                "phase_margin": p.phase,
                "eigenvalues": [[float(s.real), float(s.imag)] for s in p.eigenvalues],
            }
            for p in self.points
        ]
        return {"stable": self.stable, "points": points, "warnings": self.warnings}

    def __str__(self) -> str:
        return "\n".join(map(str, self.points))


def check_gains(plan: Plan) -> GainReport:
    """The loop of a plan, linearised about home and points of its path, without loads.

    Raises: UnsupportedError: in open loop.
    """
    drive = plan.drive
    if not isinstance(drive, ClosedLoop):
        raise UnsupportedError("there is no loop to check: the scenario has no controller")
    still = np.zeros_like(plan.q)
    home = drive.path.references(np.zeros(1))[0]
    at = Instant(drive.law.model)
    at(still, still)
    rest = np.zeros(len(plan.low))
    home = Reference(still, still, still, at["joint"].copy(), rest, home.force)
    end = min(plan.duration, float(drive.path.times[-1]))
    times = np.linspace(0.0, end, POINTS)
    places = [(None, home), *zip(times.tolist(), drive.path.references(times), strict=True)]
    found = tuple(_point(plan, drive, time, aim) for time, aim in places)
    return GainReport(found, drive.period, drive.delay)


def _point(plan: Plan, drive: ClosedLoop, time: float | None, aim: Reference) -> Point:
    model, m = plan.model, len(plan.q)
    on_path = Measured(0.0, aim.q, aim.q1, aim.joint, aim.joint_rate, np.zeros(3))
    effort, _ = drive.law(on_path, aim, drive.law.begin())
    rows = (a[None] for a in (aim.q, aim.q1, effort, np.zeros(9)))
    A, B = (a[0] for a in model.linearised(*rows))
    K = _law(drive.law, aim)
    if drive.period is None:
        s = np.linalg.eigvals(A - B @ K)
        worst = 1.0 + float(s.real.max())
        return Point(time, s, worst, _damping(s), _phase_continuous(A, B, K))
    step = Sampled(A, B, K, drive, m)
    z = np.linalg.eigvals(step.closed())
    lasting = z[np.abs(z) > FAST]
    s = np.log(lasting.astype(complex)) / drive.period
    return Point(time, s, float(np.abs(z).max()), _damping(s), step.phase())


def _law(law: Law, aim: Reference) -> np.ndarray:
    """K of effort = -K (dq, dq'), (n, 2 m), by central differences at the reference."""
    at, m = Instant(law.model), len(aim.q)
    columns = []
    for i in range(2 * m):
        pair = []
        for sign in (1, -1):
            x = np.concatenate([aim.q, aim.q1])
            x[i] += sign * DIFFERENCE
            q, q1 = x[:m], x[m:]
            at(q, q1)
            now = Measured(0.0, q, q1, at["joint"].copy(), at["joint_rate"].copy(), np.zeros(3))
            pair.append(law(now, aim, law.begin())[0])
        columns.append(-(pair[0] - pair[1]) / (2 * DIFFERENCE))
    return np.column_stack(columns)


@dataclass(frozen=True)
class Sampled:
    """The sampled loop of x' = A x + B u, u = -K x.

    Its state: x, the last q and rate that the controller saw, and efforts that are on their way.
    """

    A: np.ndarray
    B: np.ndarray
    K: np.ndarray
    drive: ClosedLoop
    m: int

    def open(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """F, G, C of state+ = F state + G u, and of what the law asks for, u = -C state."""
        from scipy.linalg import expm

        m, (states, n), d = self.m, self.B.shape, self.drive.delay
        T = self.drive.period
        block = np.zeros((states + n, states + n))
        block[:states, :states], block[:states, states:] = self.A, self.B
        whole = expm(block * T)
        Phi, Gamma = whole[:states, :states], whole[:states, states:]
        sensing = self.drive.sensing
        seen = 2 * m if sensing is not None and sensing.difference else 0
        size = states + seen + d * n
        F, G, C = np.zeros((size, size)), np.zeros((size, n)), np.zeros((n, size))
        F[:states, :states] = Phi
        C[:, :m] = self.K[:, :m]
        if seen:
            assert sensing is not None and T is not None
            part = (1 - sensing.smoothing) / T
            rate = np.zeros((m, size))  # what the controller takes for q' now
            rate[:, :m], rate[:, states : states + m] = np.eye(m) * part, -np.eye(m) * part
            rate[:, states + m : states + 2 * m] = np.eye(m) * sensing.smoothing
            C += self.K[:, m:] @ rate
            F[states : states + m, :m] = np.eye(m)
            F[states + m : states + 2 * m] = rate
        else:
            C[:, m : 2 * m] = self.K[:, m:]
        if not d:
            G[:states] = Gamma
            return F, G, C
        start = states + seen
        F[:states, start : start + n] = Gamma
        for i in range(d - 1):
            row = start + i * n
            F[row : row + n, row + n : row + 2 * n] = np.eye(n)
        G[start + (d - 1) * n :] = np.eye(n)
        return F, G, C

    def closed(self) -> np.ndarray:
        F, G, C = self.open()
        return F - G @ C

    def phase(self) -> float:
        F, G, C = self.open()
        T = self.drive.period
        assert T is not None
        frequencies = np.geomspace(1e-1, np.pi / T, FREQUENCIES)
        one = np.eye(len(F))
        return _margin(
            [
                np.linalg.eigvals(C @ np.linalg.solve(np.exp(1j * w * T) * one - F, G))
                for w in frequencies
            ]
        )


def _phase_continuous(A: np.ndarray, B: np.ndarray, K: np.ndarray) -> float:
    one, frequencies = np.eye(len(A)), np.geomspace(1e-1, 1e5, FREQUENCIES)
    return _margin(
        [np.linalg.eigvals(K @ np.linalg.solve(1j * w * one - A, B)) for w in frequencies]
    )


def _margin(loops: list[np.ndarray]) -> float:
    """Least angle between -1 and where an eigenvalue's modulus passes 1 [degrees]."""
    least = np.inf
    ordered = [one[np.argsort(-np.abs(one))] for one in loops]
    for before, after in pairwise(ordered):
        with np.errstate(divide="ignore"):
            a, b = np.log(np.abs(before)), np.log(np.abs(after))
        for i in np.flatnonzero(a * b < 0):
            turned = a[i] / (a[i] - b[i]) * np.angle(after[i] / before[i])
            value = before[i] * np.exp(1j * turned)
            least = min(least, abs(np.degrees(np.angle(-value))))
    return float(least)


def _damping(s: np.ndarray) -> float:
    size = np.abs(s)
    return float((-s.real[size > 0] / size[size > 0]).min(initial=1.0))


def error_bound(stiffness: float, damping: float, disturbance: float) -> float:
    """Greatest |e| that e'' + damping e' + stiffness e = d reaches from rest, with |d| bounded.

        |e| <= max |d| int |h| dt,    h the impulse response:

    1 / stiffness where the response does not overshoot, else that times coth(pi z / (2 sqrt(1 -
    z^2))) with z the damping ratio.
    """
    ratio = damping / (2 * np.sqrt(stiffness))
    static = disturbance / stiffness
    if ratio >= 1:
        return float(static)
    return float(static / np.tanh(np.pi * ratio / (2 * np.sqrt(1 - ratio**2))))
