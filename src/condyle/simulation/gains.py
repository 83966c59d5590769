"""Is the loop stable, and by how much? Eigenvalues of the loop linearised about points of its path.

The plant, with its loads as they are there, is x' = A x + B u, and a tick of the controller, with
encoders, filter and integrator,

    u = H x + H_m w,    w+ = E x + E_m w,    w: its memory,

both by exact derivatives of the questions `rate` and `tick`; of a law that is a function in Python,
which has no memory here, by differences. Sampled with a period T, held, and d
periods late,

    x+ = Phi x + Gamma u_-d,    Phi = exp(A T),    Gamma = int exp(A s) ds B.

A law that holds a force is checked while it does: on each load at its point alone, since others may
have broken, and on all that bear together. It is stable
where all eigenvalues z lie within the unit circle; s = log(z) / T are those of a continuous loop,
of damping -Re s / |s|. The margin of phase is how much all efforts may lag together: the smallest
angle between -1 and an eigenvalue of the open loop L(exp(i w T)) of modulus 1 (generalised Nyquist;
Skogestad and Postlethwaite, Multivariable Feedback Control, 2005, section 4.9).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from ..backends.numpy_kernel import NumpyKernel
from ..errors import UnsupportedError
from ..graph.program import Programs
from ..mechanism.home import characteristic_length
from ..mechanism.mechanism import Mechanism
from ..model.model import Model
from ..questions import Question
from ..questions.derivative import PREFIX, directional
from ..questions.file_numbers import numbers_of
from ..questions.numbers import specialised
from ..questions.structure import structure_of
from ..questions.tick_limits import TickLimits
from ..results.study_answer import StudyAnswer
from .columns import KernelColumns
from .control import MEASURED, Controller
from .integrators import NoRateError
from .plan import ClosedLoop, Plan
from .plant import Plant
from .reference_path import instants

POINTS = 11  # along the path, home besides
FREQUENCIES = 400
WEAK = 0.2  # damping, and
SMALL = 30.0  # degrees of phase, below which a loop is called lively
SHORT = 1e-3  # of the mechanism's size, first step of a search
FAST = 1e-3  # of the unit circle: eigenvalues within it are gone after a period


@dataclass(frozen=True)
class PathPoint:
    """The loop at a point of the path.

    time:  [s], None at home.   holds: names of the loads it bites on, or None.
    eigenvalues: s [1/s], complex.
    radius: largest |z|, or 1 + largest Re s of a continuous loop [1/s].
    damping: least of all eigenvalues that last.
    phase: margin [degrees], negative where unstable; inf if L is below 1.
    """

    time: float | None
    eigenvalues: np.ndarray
    radius: float
    damping: float
    phase: float
    holds: str | None = None

    @property
    def stable(self) -> bool:
        """Whether what is off dies away."""
        return self.radius < 1.0

    def __str__(self) -> str:
        where = "home" if self.time is None else f"t = {self.time:.3g} s"
        where += "" if self.holds is None else f", on {self.holds}"
        slow = min(abs(self.eigenvalues.real), default=0.0)
        verdict = "stable" if self.stable else "UNSTABLE"
        return (
            f"{where:>12}  {verdict:<8}  slowest {slow:8.4g} 1/s  damping {self.damping:6.3f}  "
            f"phase margin {self.phase:6.1f} deg"
        )


@dataclass(frozen=True, eq=False)
class GainReport(StudyAnswer):
    """The loop along its path."""

    mechanism: Mechanism
    points: tuple[PathPoint, ...]
    period: float | None
    delay: int

    @property
    def stable(self) -> bool:
        return all(point.stable for point in self.points)

    @property
    def warnings(self) -> list[str]:
        bad = [point for point in self.points if not point.stable]
        if bad:
            text = f"the loop is unstable at {len(bad)} of {len(self.points)} points"
            if self.period is not None:
                held = (self.delay + 0.5) * self.period * 1e3
                text += (
                    f": efforts come {held:.3g} ms late on average (delay, and half a period held);"
                    " lower the gains, the delay or the period"
                )
            return [text]
        found = []
        if (least := min(point.damping for point in self.points)) < WEAK:
            found.append(f"the loop is hardly damped: {least:.3f}, below {WEAK:g}")
        if (phase := min(point.phase for point in self.points)) < SMALL:
            found.append(f"the phase margin is {phase:.1f} degrees, below {SMALL:g}")
        return found

    @property
    def columns(self) -> dict[str, list[Any]]:
        """A point of the path per row; time is NaN at home."""
        return {
            "time": [np.nan if p.time is None else p.time for p in self.points],
            "holds": [p.holds or "" for p in self.points],
            "radius": [p.radius for p in self.points],
            "damping": [p.damping for p in self.points],
            "phase_margin": [p.phase for p in self.points],
        }

    @property
    def data(self) -> dict[str, Any]:
        points = [
            {
                "time": p.time,
                "stable": p.stable,
                "radius": p.radius,
                "damping": p.damping,
                "phase_margin": p.phase,
                "holds": p.holds,
                "eigenvalues": [[float(s.real), float(s.imag)] for s in p.eigenvalues],
            }
            for p in self.points
        ]
        own = {"mechanism": self.mechanism.name, "stable": self.stable}
        return own | {"points": points, "warnings": self.warnings}

    def __str__(self) -> str:
        return "\n".join(map(str, self.points))


def report(plan: Plan) -> GainReport:
    """The loop of a plan, linearised about home and points of its path.

    Raises: UnsupportedError: in open loop.
    """
    drive = plan.drive
    if not isinstance(drive, ClosedLoop):
        raise UnsupportedError("there is no loop to check: the scenario has no controller")
    if len(plan.activation):
        raise UnsupportedError(
            "check_gains: activations of muscles are states that the linearised loop does not "
            "have; simulate instead, or take the same lines as cables"
        )
    # Gravity as of the file, and the base at rest.
    drive = replace(drive, path=replace(drive.path, around={}))
    loop = SampledLoop(replace(plan, drive=drive), drive)
    end = min(plan.duration, float(drive.path.times[-1]))
    times = np.linspace(0.0, end, POINTS)
    home = drive.path.at(np.zeros(1))
    m = len(plan.q)
    home[0, : 3 * m] = 0.0
    at = instants(drive.model, home[:, :m], home[:, :m]).values
    home[0, 3 * m : -1] = np.concatenate([at["joint"][:, 0], at["joint_rate"][:, 0]])
    references = [*home, *drive.path.at(times)]
    found = []
    for time, reference in zip([None, *times.tolist()], references, strict=True):
        found += [loop.at(time, reference), *loop.holding(time, reference)]
    return GainReport(plan.model.mechanism, tuple(found), drive.period, drive.delay)


class SampledLoop:
    """Plant and controller of a plan, and their derivatives `rate` and `tick` where they stand."""

    def __init__(self, plan: Plan, drive: ClosedLoop) -> None:
        # A law does not know of limits: neither does this.
        wide = np.full(len(plan.low), np.inf)
        plan = replace(plan, low=-wide, high=wide)
        if (exact := drive.sensing) is not None:
            numbers = exact.numbers | {"resolution": 0.0 * exact.numbers["resolution"]}
            exact = replace(exact, numbers=numbers, noise=0.0)
        drive = replace(drive, sensing=exact, limits=TickLimits(), numbers={})
        plan = replace(plan, drive=drive)
        self._plan, self._drive, self._m = plan, drive, len(plan.q)
        self.plant: Plant = Plant([plan])
        self.control: Controller = Controller([plan])
        self.rate: Derivative = Derivative(
            plan.model, "rate", self.plant.details, self.plant.columns,
            ("q", "q1", "effort"), ("rate", "joint", "joint_rate", "measured_force", "load_place"),
        )  # fmt: skip
        self._ports = [p for p in self.control.columns.kernel.interface.ports if p.name in PORTS]
        # A filter's gain is what it has come to: its covariance is held.
        self._before = {p: r for p, r in self.control.carry.items() if p not in HELD}
        self._acted = ("acted",) if self.control.filters else ()
        own = MEASURED if drive.function is not None else ()
        self.tick: Derivative = Derivative(
            drive.model, "tick", self.control.details, self.control.columns,
            [*(p.name for p in self._ports), *self._before, *self._acted],
            tuple(dict.fromkeys(("asked", *self._before.values(), *own))),
        )  # fmt: skip

    def at(
        self,
        time: float | None,
        reference: np.ndarray,
        q: np.ndarray | None = None,
        loads: Sequence[int] = (),
    ) -> PathPoint:
        """Linearised about a reference, or about q while `loads` bear the force."""
        plan, m, drive = self._plan, self._m, self._drive
        y = np.zeros(plan.size)
        y[: 2 * m] = reference[: 2 * m]
        modes = self._modes(y)
        memory = drive.law.memory
        if q is not None:
            y[:m], y[m : 2 * m] = q, 0.0
            for i in loads:
                modes[i] = plan.loads[i].law.bears or 0
            memory = np.array(drive.law.table.holding)  # type: ignore[union-attr]
        self.plant.set_modes(modes)
        self.plant.evaluate(time or 0.0, y)
        effort = self.control.steadily(reference, memory, y, self.plant)
        self.plant.columns.give("effort", effort)
        rate, tick = self.rate(), self.tick()
        if drive.function is not None:
            tick["asked"] = self.control.slopes(time or 0.0) @ np.vstack(
                [tick[n] for n in MEASURED]
            )
        A, B = rate["rate"][: 2 * m, : 2 * m], rate["rate"][: 2 * m, 2 * m :]
        # What is measured, by x.
        C = {"q": np.eye(2 * m)[:m], "q1": np.eye(2 * m)[m:]}
        C |= {name: rate[name][:, : 2 * m] for name in ("joint", "joint_rate")}
        force = rate.get("measured_force", np.zeros((3, 2 * m)))
        C["force"] = force[:, : 2 * m]
        by_x = np.vstack([C[port.name] for port in self._ports])
        results = np.vstack([tick["asked"], *(tick[name] for name in self._before.values())])
        n, k = len(plan.low), len(by_x)
        H, E = results[:n, :k] @ by_x, results[n:, :k] @ by_x
        E_m = results[n:, k:]
        if self._acted:  # the efforts that act now, for the next tick
            E, E_m = (np.vstack([a, np.zeros((n, a.shape[1]))]) for a in (E, E_m))
        acted = bool(self._acted)
        step = Sampled(A, B, H, results[:n, k:], E, E_m, drive.period, drive.delay, acted)
        holds = " and ".join(plan.loads[i].name for i in loads) or None
        s = z = np.linalg.eigvals(step.closed())
        if drive.period is None:
            worst = 1.0 + float(s.real.max())
        else:
            worst = float(np.abs(z).max())
            s = np.log(z[np.abs(z) > FAST].astype(complex)) / drive.period
        size = np.abs(s)
        damping = float((-s.real[size > 0] / size[size > 0]).min(initial=1.0))
        phase = step.phase() if worst < 1.0 else -step.phase()
        return PathPoint(time, s, worst, damping, phase, holds)

    def _modes(self, y: np.ndarray) -> list[int]:
        """Of the loads, where they have not been touched."""
        if not self._plan.loads:
            return []
        self.plant.set_modes([0] * len(self._plan.loads))
        self.plant.evaluate(0.0, y)
        places = self.plant["load_place"].reshape(-1, 6)
        return [load.begin(at[:3]) for load, at in zip(self._plan.loads, places, strict=True)]

    def holding(self, time: float | None, reference: np.ndarray) -> Iterator[PathPoint]:
        """The same while the law holds its force on each load that bears it, where it can."""
        law, m = self._drive.law, self._m
        holding = None if law.table is None else law.table.holding
        if holding is None or not reference[-1] > 0:
            return
        loads = self._plan.loads
        bearing = [i for i, load in enumerate(loads) if load.law.bears is not None]
        groups = [[i] for i in bearing if loads[i].place == law.place]
        if groups and len(bearing) > 1:
            groups.append(bearing)
        for group in groups:
            q = self._pressed(group, reference[:m], float(reference[-1]), law.numbers["direction"])
            if q is None:
                continue
            if len(group) > 1:  # those that the teeth reach
                forces = self.plant["load_force"].reshape(-1, 3)
                group = [i for i in group if forces[i].any()]
                if len(group) == 1:
                    continue
            point = self.at(time, reference, q, group)
            if self.control.columns["memory"][0] == holding[0]:  # it goes on holding
                yield point

    def _pressed(
        self, loads: Sequence[int], q: np.ndarray, force: float, direction: np.ndarray
    ) -> np.ndarray | None:
        """Coordinates along the bite from q where loads bear a force [N], if there are any."""
        from scipy.optimize import brentq

        plan, plant, m = self._plan, self.plant, self._m
        y = np.zeros(plan.size)
        modes = [0] * len(plan.loads)
        for i in loads:
            modes[i] = plan.loads[i].law.bears or 0

        def beyond(way: float) -> float:
            y[:m] = q + way * along
            plant.evaluate(0.0, y)
            return float(-direction @ plant["measured_force"]) - force

        here = next(i for i in loads if plan.loads[i].place == self._drive.law.place)
        plant.set_modes(modes)
        y[:m] = q
        try:
            plant.evaluate(0.0, y)
            row = direction @ self.rate()["load_place"].reshape(len(modes), 6, -1)[here, :3, :m]
            along = row / (row @ row)
            size = characteristic_length(plan.model.mechanism)
            ends = [SHORT * size, SHORT * size]
            for i, sign in enumerate((1, -1)):
                while sign * beyond(sign * ends[i]) < 0 and ends[i] < size:
                    ends[i] *= 2
            found = q + brentq(beyond, -ends[1], ends[0]) * along
            y[:m] = found
            plant.evaluate(0.0, y)
            return found
        except (NoRateError, ValueError):  # out of reach, or too soft for it
            return None


HELD = ("covariance_before", "begun_before")
PORTS = ("q", "q1", "joint", "joint_rate", "force")  # ports of a tick


class Derivative:
    """Exact derivatives of a question, where the rows of its kernel stand."""

    def __init__(
        self,
        model: Model,
        question: str,
        details: Sequence[Any],
        columns: KernelColumns,
        by: Sequence[str],
        of: Sequence[str],
    ) -> None:
        """Args: columns: what its ports are given;  by: ports;  of: results."""
        structure = structure_of(model.mechanism, model.formulation, model.route)
        numbers = numbers_of(structure, model.mechanism)
        structure = specialised(structure, numbers)
        asked = Question.about(structure, question, *details).variants()
        program = directional(asked.robust or asked.main, by, of)
        self._kernel, self._columns, self.by = NumpyKernel(Programs(program), numbers), columns, by

    def __call__(self) -> dict[str, np.ndarray]:
        """By name: (numbers of the result, those of all ports), chains in the callers' order."""
        columns, sizes = self._columns, [len(self._columns.rows(name)) for name in self.by]
        size, start, ports = sum(sizes), 0, {}
        for name, own in zip(self.by, sizes, strict=True):
            ports[PREFIX + name] = np.eye(size)[:, start : start + own]
            start += own
        for port in self._kernel.interface.ports:
            if port.name not in ports:
                ports[port.name] = np.tile(columns.given[columns.rows(port.name), 0], (size, 1))
        values = self._kernel.run(ports).values
        return {name.removeprefix(PREFIX): a.reshape(-1, size) for name, a in values.items()}


@dataclass(frozen=True)
class Sampled:
    """The sampled loop of x' = A x + B u, u = H x + H_m w, w+ = E x + E_m w, d periods late.

    Its state: x, the controller's memory w, and efforts that are on their way; x alone where it is
    at all times, without a period.

    acted: whether w ends with the efforts that acted since the last tick.
    """

    A: np.ndarray
    B: np.ndarray
    H: np.ndarray
    H_m: np.ndarray
    E: np.ndarray
    E_m: np.ndarray
    period: float | None
    delay: int
    acted: bool = False

    def open(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """F, G, C of state+ (or its rate) = F state + G u, and u = -C state, which it asks for."""
        from scipy.linalg import expm

        (states, n), w, d, T = self.B.shape, self.H_m.shape[1], self.delay, self.period
        if T is None:
            return self.A, self.B, -self.H
        block = np.zeros((states + n, states + n))
        block[:states, :states], block[:states, states:] = self.A, self.B
        whole = expm(block * T)
        known = states + w
        size = known + d * n
        F, G, C = np.zeros((size, size)), np.zeros((size, n)), np.zeros((n, size))
        F[:states, :states] = whole[:states, :states]
        F[states:known, :states], F[states:known, states:known] = self.E, self.E_m
        C[:, :states], C[:, states:known] = -self.H, -self.H_m
        # Efforts on their way: the first acts, the last was asked for just now.
        (F[:states, known : known + n] if d else G[:states])[:] = whole[:states, states:]
        F[known : size - n, known + n :] = np.eye((d - 1) * n) if d else 0
        if self.acted:
            (F[known - n : known, known : known + n] if d else G[known - n : known])[:] = np.eye(n)
        if d:
            G[size - n :] = np.eye(n)
        return F, G, C

    def closed(self) -> np.ndarray:
        F, G, C = self.open()
        return F - G @ C

    def phase(self) -> float:
        """Least angle between -1 and where an eigenvalue's modulus passes 1 [degrees]."""
        (F, G, C), T = self.open(), self.period
        w = 1j * np.geomspace(1e-1, 1e5 if T is None else np.pi / T, FREQUENCIES)
        one, least = np.eye(len(F)), np.inf
        loops = [
            np.linalg.eigvals(C @ np.linalg.solve(z * one - F, G))
            for z in (w if T is None else np.exp(w * T))
        ]
        ordered = [loop[np.argsort(-np.abs(loop))] for loop in loops]
        for before, after in pairwise(ordered):
            with np.errstate(divide="ignore"):
                a, b = np.log(np.abs(before)), np.log(np.abs(after))
            i = np.flatnonzero(a * b < 0)
            turned = a[i] / (a[i] - b[i]) * np.angle(after[i] / before[i])
            values = before[i] * np.exp(1j * turned)
            least = min(least, np.degrees(np.abs(np.angle(-values))).min(initial=np.inf))
        return float(least)


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
