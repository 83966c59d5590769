"""Is the loop stable, and by how much? Eigenvalues of the loop linearised about points of its path.

The plant, with its loads as they are there, is x' = A x + B u, and a tick of the controller, with
encoders, filter and integrator,

    u = H x + H_m w,    w+ = E x + E_m w,    w: its memory,

both by exact derivatives of the questions `rate` and `tick`; of a law that is a function in Python,
which has no memory here, by differences. Sampled with a period T, held, and d
periods late,

    x+ = Phi x + Gamma u_-d,    Phi = exp(A T),    Gamma = int exp(A s) ds B.

Where the path meets loads, the loop is linearised on each of them alone, since others may have
broken, and on all that it meets together: that of a law that holds forces where the load bears them
and all is at rest, of any other law where the path is. Where limits take part of what the law asks
for, it is not judged; with an `effort_rate` a simulation says whether that still acts when a
touchdown should have died away. It is stable for small deviations where all eigenvalues z lie
within the unit circle; s = log(z) / T are those of a continuous loop, of damping -Re s / |s|. The
phase margin is how much all efforts may lag together: the smallest angle between -1 and an
eigenvalue of the open loop L(exp(i w T)) of modulus 1 (generalised Nyquist; Skogestad and
Postlethwaite, Multivariable Feedback Control, 2005, section 4.9).

With sensors, a scenario has an exported controller, whose safe stop brakes: u = -B theta', with the
rates that a tick measures and `condyle.simulation.brake`. This loop is judged at the same points. A
jaw that falls falls against dampers without lag too, slowly: as many eigenvalues as these have
outside the stable half plane are left out (Kelvin, Tait and Chetaev: damping changes not how many).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from ..backends.numpy_kernel import NumpyKernel
from ..errors import UnsupportedError
from ..graph.program import Programs
from ..mechanism.mechanism import Mechanism
from ..model.model import Model
from ..questions import Question
from ..questions.derivative import PREFIX, directional
from ..questions.file_numbers import numbers_of
from ..questions.numbers import specialised
from ..questions.structure import structure_of
from ..questions.tick_limits import TickLimits
from ..results.study_answer import StudyAnswer
from .brake import brake
from .columns import KernelColumns
from .control import MEASURED, Controller
from .integrators import FIXED
from .load_contacts import LoadContacts, spans
from .plan import ClosedLoop, Plan
from .plant import Plant
from .reference_path import instants
from .running import run

POINTS = 11  # along the path, home besides
FREQUENCIES = 400
WEAK = 0.2  # damping, and
SMALL = 30.0  # degrees of phase, below which a loop is called lively
GRID = 401  # instants of the path, held against the loads
BITES = 5  # of each contact with a load
CUT = 1e-4  # share of the accelerations by all efforts, from which on limits act
SAME = 1e-6  # of an eigenvalue and 1
SETTLING, WATCHED = 0.3, 0.1  # s from the first touch on, and the last of them
PARTS, LONGEST = 5, 2e-4  # steps a period, and the longest [s], of that simulation
ACTS = 0.1  # share of ticks at `effort_rate` from which on it is part of the loop
FAST = 1e-3  # of the unit circle: eigenvalues within it are gone after a period


LOCALLY = " for small deviations from these points; touchdown on loads is not covered: simulate it"
VERDICTS = {True: "stable", False: "UNSTABLE", None: "not judged"}


@dataclass(frozen=True)
class PathPoint:
    """The loop at a point of the path.

    time:  [s], None at home.   holds: names of the loads it bites on, or None.
    eigenvalues: s [1/s], complex.
    radius: largest |z|, or 1 + largest Re s of a continuous loop [1/s].
    damping: least of all eigenvalues that last.
    phase: margin [degrees], negative where unstable; inf if L is below 1.
    unjudged: why the loop that runs is not the one that was linearised, or None.
    brake: largest |z| of a safe stop, slow falling left out; None without sensors.
    """

    time: float | None
    eigenvalues: np.ndarray
    radius: float
    damping: float
    phase: float
    holds: str | None = None
    unjudged: str | None = None
    brake: float | None = None

    @property
    def brakes(self) -> bool:
        """Whether a safe stop takes motion away, where there is one."""
        return self.brake is None or self.brake < 1.0

    @property
    def stable(self) -> bool | None:
        """Whether small deviations die away; None: not judged."""
        if self.radius >= 1.0:
            return False
        return None if self.unjudged else True

    def __str__(self) -> str:
        where = "home" if self.time is None else f"t = {self.time:.3g} s"
        where += "" if self.holds is None else f", on {self.holds}"
        slow = min(abs(self.eigenvalues.real), default=0.0)
        return (
            f"{where:>12}  {VERDICTS[self.stable]:<10}  "
            f"slowest {slow:8.4g} 1/s  damping {self.damping:6.3f}  "
            f"phase margin {self.phase:6.1f} deg" + ("" if self.brakes else "  brake UNSTABLE")
        )


@dataclass(frozen=True, eq=False)
class GainReport(StudyAnswer):
    """The loop along its path.

    gaps: what of the law was not judged, and why.
    """

    mechanism: Mechanism
    points: tuple[PathPoint, ...]
    period: float | None
    delay: int
    gaps: tuple[str, ...] = ()

    @property
    def stable(self) -> bool | None:
        """Whether small deviations die away at all points, in a safe stop too; None: stable where
        it was judged, and not judged elsewhere."""
        judged = [point.stable for point in self.points]
        if False in judged or not all(point.brakes for point in self.points):
            return False
        return None if self.gaps or None in judged else True

    @property
    def warnings(self) -> list[str]:
        bad = [point for point in self.points if point.stable is False]
        texts = []
        if bad:
            text = f"the loop is unstable at {len(bad)} of {len(self.points)} points"
            if self.period is not None:
                held = (self.delay + 0.5) * self.period * 1e3
                text += (
                    f": efforts come {held:.3g} ms late on average (delay, and half a period held);"
                    " lower the gains, the delay or the period"
                )
            texts.append(text)
        if shaken := [point for point in self.points if not point.brakes]:
            where = " and ".join(dict.fromkeys(p.holds or "its path" for p in shaken))
            texts.append(
                f"the brake of a safe stop is unstable at {len(shaken)} of {len(self.points)} "
                f"points (on {where}): it swings rather than stops; lower the delay, or raise the "
                "rate or sensors.velocity_cutoff"
            )
        reasons = Counter(p.unjudged for p in self.points if p.stable is None)
        texts += [f"not judged: {gap}; simulate instead" for gap in self.gaps]
        texts += [
            f"not judged at {count} of {len(self.points)} points: {reason}; simulate instead"
            for reason, count in reasons.items()
        ]
        if bad or not self.points:
            return texts
        if (least := min(point.damping for point in self.points)) < WEAK:
            texts.append(f"the loop is hardly damped: {least:.3f}, below {WEAK:g}")
        if (phase := min(point.phase for point in self.points)) < SMALL:
            texts.append(f"the phase margin is {phase:.1f} degrees, below {SMALL:g}")
        return texts

    @property
    def columns(self) -> dict[str, list[Any]]:
        """A point of the path per row; time is NaN at home."""
        return {
            "time": [np.nan if p.time is None else p.time for p in self.points],
            "holds": [p.holds or "" for p in self.points],
            "radius": [p.radius for p in self.points],
            "damping": [p.damping for p in self.points],
            "phase_margin": [p.phase for p in self.points],
            "brake": [np.nan if p.brake is None else p.brake for p in self.points],
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
                "brake": p.brake,
                "eigenvalues": [[float(s.real), float(s.imag)] for s in p.eigenvalues],
            }
            for p in self.points
        ]
        own = {"mechanism": self.mechanism.name, "stable": self.stable}
        return own | {"points": points, "warnings": self.warnings}

    def __str__(self) -> str:
        lines = [*map(str, self.points), f"{VERDICTS[self.stable]}{LOCALLY if self.stable else ''}"]
        return "\n".join(lines)


def report(plan: Plan) -> GainReport:
    """The loop of a plan, linearised about home, points of its path, and where it meets loads.

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
    if plan.sticking:
        raise UnsupportedError(
            "check_gains: the linearised loop has no static friction; remove static_coefficient "
            "of contacts, or simulate"
        )
    if plan.drives is not None:
        raise UnsupportedError(
            "check_gains: the linearised loop takes drives as rigid; remove [drives], or simulate"
        )
    # Gravity as of the file, and the base at rest.
    drive = replace(drive, path=replace(drive.path, around={}))
    lifts, plan = plan.freed is not None, replace(plan, freed=None)
    loop = SampledLoop(replace(plan, drive=drive), drive)
    table = drive.law.table
    unloaded = [] if table is not None and table.always_holds else list(loop.free())
    touching = list(loop.touching())
    gaps = []
    if loop.holds and not touching:
        names = ", ".join(f'"{plan.loads[i].name}"' for i in loop.contacts.bearing)
        gaps = [
            "the law holds a force, and nowhere on its path does a load bear it"
            + (
                f" (loads: {names})"
                if names
                else " (the scenario has no load at its point: add [[load]], such as food)"
            )
        ]
    points = tuple(unloaded + touching)
    if not gaps and all(point.stable for point in points):
        gaps += rate_acts(plan, drive, loop.touch)
    if lifts:
        gaps.append(
            f'the loop is judged with all contacts kept, and [contacts] kind = "'
            f'{plan.scenario.contacts.kind}" lets them lift: simulate what it does there'
        )
    return GainReport(plan.model.mechanism, points, drive.period, drive.delay, tuple(gaps))


def rate_acts(plan: Plan, drive: ClosedLoop, touch: float | None) -> list[str]:
    """Whether `effort_rate` is part of the loop that runs, by a simulation: what it says, if so.

    Args: touch: when the path first meets a load [s], or None.
    """
    rate, period = drive.numbers.get("effort_rate"), drive.period
    if rate is None or period is None:
        return []
    end = min((touch or 0.0) + SETTLING, plan.duration)
    settings = replace(plan.settings, step=min(period / PARTS, LONGEST))
    times = plan.times[plan.times <= end]
    some = replace(plan, duration=end, times=times, method=FIXED[0], settings=settings)
    steps = np.abs(np.diff(run(some).command, axis=0))[-round(WATCHED / period) :]
    share = np.mean((steps > rate * period).any(axis=1)) if len(steps) else 0.0
    if share <= ACTS:
        return []
    since = "" if touch is None else f", {end - touch:.2g} s after touchdown,"
    return [
        f"in a simulation to t = {end:.3g} s{since} the law still asks for efforts that change "
        f"faster than effort_rate in {share:.0%} of the ticks"
    ]


class SampledLoop:
    """Plant and controller of a plan, and their derivatives `rate` and `tick` where they stand."""

    def __init__(self, plan: Plan, drive: ClosedLoop) -> None:
        self._brake = None  # damping at the joints, (n,)
        if drive.sensing is not None and drive.function is None:
            self._brake = brake(plan, drive)
        if (exact := drive.sensing) is not None:
            numbers = exact.numbers | {"resolution": 0.0 * exact.numbers["resolution"]}
            exact = replace(exact, numbers=numbers, noise=0.0)
        drive = replace(drive, sensing=exact)
        self._limits = plan.low, plan.high
        self._rate_limit = drive.numbers.get("effort_rate")
        self._limited = None
        if drive.limits != TickLimits():
            self._limited = Controller([replace(plan, drive=drive)])
        # A law does not know of limits: neither does what is linearised.
        wide = np.full(len(plan.low), np.inf)
        drive = replace(drive, limits=TickLimits(), numbers={})
        plan = replace(plan, low=-wide, high=wide, drive=drive)
        self._plan, self._drive, self._m = plan, drive, len(plan.q)
        self.plant: Plant = Plant([plan])
        self.control: Controller = Controller([plan])
        self.contacts: LoadContacts = LoadContacts(plan, self.plant)
        self.holds: bool = drive.law.table is not None and drive.law.table.holding is not None
        self.touch: float | None = None  # when `touching` first met a load [s]
        self._end = min(plan.duration, float(drive.path.times[-1]))
        self.rate: Derivative = Derivative(
            plan.model, "rate", self.plant.details, self.plant.columns,
            ("q", "q1", "effort"), ("rate", "joint", "joint_rate", "measured_force", "load_place"),
        )  # fmt: skip
        self._ports = [p for p in self.control.columns.kernel.interface.ports if p.name in PORTS]
        # A filter's gain is what it has come to: its covariance is held.
        self._before = {p: r for p, r in self.control.carry.items() if p not in HELD}
        self._acted = ("acted",) if self.control.filters else ()
        own: tuple[str, ...] = MEASURED if drive.function is not None else ()
        own += ("joint_rate",) * (self._brake is not None)
        self.tick: Derivative = Derivative(
            drive.model, "tick", self.control.details, self.control.columns,
            [*(p.name for p in self._ports), *self._before, *self._acted],
            tuple(dict.fromkeys(("asked", *self._before.values(), *own))),
        )  # fmt: skip

    def free(self) -> Iterator[PathPoint]:
        """Points at home and along the path, loads as they are before they are touched."""
        drive, m = self._drive, self._m
        times = np.linspace(0.0, self._end, POINTS)
        home = drive.path.at(np.zeros(1))
        home[0, : 3 * m] = 0.0
        at = instants(drive.model, home[:, :m], home[:, :m]).values
        home[0, 3 * m : -1] = np.concatenate([at["joint"][:, 0], at["joint_rate"][:, 0]])
        for time, reference in zip(
            [None, *times.tolist()], [*home, *drive.path.at(times)], strict=True
        ):
            yield self.at(time, reference)

    def touching(self) -> Iterator[PathPoint]:
        """Where the path meets loads: on each of them alone, and on all that it meets then.

        A law that holds forces is where loads bear them; any other one is where the path is.
        """
        plan, drive, contacts, m = self._plan, self._drive, self.contacts, self._m
        if not contacts.bearing:
            return
        times = np.linspace(0.0, self._end, GRID)
        references = drive.path.at(times)
        touched = contacts.touched(references[:, :m])
        if touched.any():
            self.touch = float(times[touched.any(axis=1).argmax()])
        begun = contacts.modes(references[0, :m])
        own = [i for i in contacts.bearing if plan.loads[i].place == drive.law.place]
        if not self.holds:  # loads that bear from the beginning are part of the free loop
            own = [i for i in contacts.bearing if plan.loads[i].law.bears != begun[i]]
        done: set[tuple[int, tuple[int, ...]]] = set()
        for i in own:
            for first, last in spans(touched[:, i]):
                for k in np.unique(np.linspace(first, last, BITES).astype(int)).tolist():
                    together = [j for j in contacts.bearing if touched[k, j]]
                    for group in ([i], together):
                        if (k, tuple(group)) not in done:
                            done.add((k, tuple(group)))
                            yield from self._on(float(times[k]), references[k], group)

    def _on(self, time: float, reference: np.ndarray, loads: Sequence[int]) -> Iterator[PathPoint]:
        """Points on loads at an instant, if the law stays on them."""
        law, m, n = self._drive.law, self._m, len(self._plan.low)
        still = reference.copy()
        still[m : 3 * m] = still[3 * m + n : 3 * m + 2 * n] = 0.0
        if not self.holds:
            yield self.at(time, still, reference[:m], loads)
            return
        assert law.table is not None and law.table.holding is not None
        memory, force = np.array(law.table.holding), float(reference[-1])
        directions, forces = law.table.held_forces(law.numbers, force)
        if not law.table.always_holds and not force > 0:
            return
        at = self.contacts.pressed(loads, reference[:m], directions, forces, self.rate)
        if at is None or len(loads) > 1 >= len(at[1]):
            return
        if not law.table.always_holds:  # as the path goes there, the law may let go
            self._steadily(time, reference, at[0], at[1], memory)
            if self.control.columns["memory"][0] != memory[0]:
                return
        yield self.at(time, still, at[0], at[1], memory)

    def _steadily(
        self,
        time: float | None,
        reference: np.ndarray,
        q: np.ndarray | None,
        loads: Sequence[int],
        memory: np.ndarray,
    ) -> tuple[np.ndarray, np.ndarray]:
        """State and efforts of a reference, or at rest at q; plant and controller stay there."""
        m = self._m
        y = np.zeros(self._plan.size)
        y[: 2 * m] = reference[: 2 * m]
        if q is not None:
            y[:m], y[m : 2 * m] = q, 0.0
        self.plant.set_modes(self.contacts.modes(y[:m], loads))
        self.plant.evaluate(time or 0.0, y)
        effort = self.control.steadily(reference, memory, y, self.plant)
        self.plant.columns.give("effort", effort)
        return y, effort

    def at(
        self,
        time: float | None,
        reference: np.ndarray,
        q: np.ndarray | None = None,
        loads: Sequence[int] = (),
        memory: np.ndarray | None = None,
    ) -> PathPoint:
        """Linearised about a reference, or about q at rest while `loads` bear.

        Args: memory: of the law; default: to begin with.
        """
        plan, m, drive = self._plan, self._m, self._drive
        memory = drive.law.memory if memory is None else memory
        y, effort = self._steadily(time, reference, q, loads, memory)
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
        sampled = Sampled(A, B, H, results[:n, k:], E, E_m, drive.period, drive.delay, acted)
        step = sampled.held()
        names = " and ".join(plan.loads[i].name for i in loads) or None
        s = z = self._determined(np.linalg.eigvals(step.closed()), force[:, :m])
        if drive.period is None:
            worst = 1.0 + float(s.real.max())
        else:
            worst = float(np.abs(z).max())
            s = np.log(z[np.abs(z) > FAST].astype(complex)) / drive.period
        size = np.abs(s)
        damping = float((-s.real[size > 0] / size[size > 0]).min(initial=1.0))
        phase = step.phase() if worst < 1.0 else -step.phase()
        limit = self._limits_act(time, reference, memory, y, effort, B[m:])
        stop = None
        if self._brake is not None:
            H = -self._brake[:, None] * tick["joint_rate"]
            stopping = replace(sampled, H=H[:, :k] @ by_x, H_m=H[:, k:]).held()
            at_once = A - B * self._brake @ rate["joint_rate"][:, : 2 * m]
            stop = stopping.beyond(at_once)
        return PathPoint(time, s, worst, damping, phase, names, limit, stop)

    def _determined(self, z: np.ndarray, stiffness: np.ndarray) -> np.ndarray:
        """Eigenvalues without the places that a law of given forces leaves to themselves: along
        directions in which nothing resists, `stiffness` of the force by q being 0."""
        law = self._drive.law
        if law.table is None or not law.table.always_holds:
            return z
        directions, _ = law.table.held_forces(law.numbers, 0.0)
        loose = int((~(directions @ stiffness).any(axis=1)).sum())
        one = 0.0 if self._drive.period is None else 1.0
        ordered = z[np.argsort(np.abs(z - one))]
        return ordered[[i >= loose or abs(x - one) > SAME for i, x in enumerate(ordered)]]

    def _limits_act(
        self,
        time: float | None,
        reference: np.ndarray,
        memory: np.ndarray,
        y: np.ndarray,
        wanted: np.ndarray,
        by_effort: np.ndarray,
    ) -> str | None:
        """Why the law without limits is not the one that runs, where it is not."""
        given = np.clip(wanted, *self._limits)
        if self._limited is not None:
            self._limited.steadily(reference, memory, y, self.plant)
            given = self._limited.columns["effort"]
        lost = np.abs(by_effort @ (given - wanted))
        if (lost > CUT * (np.abs(by_effort) @ np.abs(wanted))).any():
            return "limits take part of what the law asks for"
        if time is None or self._rate_limit is None:
            return None
        period = self._drive.period or 1.0
        loaded = self.holds and memory is not self._drive.law.memory
        if loaded and self.control.columns.has("rise"):
            columns = self.control.columns
            rise = max(float(columns.given[columns.rows("rise"), 0][0]), period)
            unloaded = self.control.unloaded(memory, y, self.plant)
            if (np.abs(wanted - unloaded) > self._rate_limit * rise).any():
                return (
                    f"its force, in {rise:.3g} s, takes efforts that change faster than effort_rate"
                )
        if not reference[self._m : 2 * self._m].any():
            return None
        later = self._drive.path.at(np.array([time + period]))[0]
        _, effort = self._steadily(time, later, None, (), memory)
        if (np.abs(effort - wanted) > self._rate_limit * period).any():
            return "the path takes efforts that change faster than effort_rate"
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
        """Slopes by name: (numbers of the result, those of all ports), chains in callers' order."""
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
        transition = expm(block * T)
        known = states + w
        size = known + d * n
        F, G, C = np.zeros((size, size)), np.zeros((size, n)), np.zeros((n, size))
        F[:states, :states] = transition[:states, :states]
        F[states:known, :states], F[states:known, states:known] = self.E, self.E_m
        C[:, :states], C[:, states:known] = -self.H, -self.H_m
        # Efforts on their way: the first acts, the last was asked for just now.
        (F[:states, known : known + n] if d else G[:states])[:] = transition[:states, states:]
        F[known : size - n, known + n :] = np.eye((d - 1) * n) if d else 0
        if self.acted:
            (F[known - n : known, known : known + n] if d else G[known - n : known])[:] = np.eye(n)
        if d:
            G[size - n :] = np.eye(n)
        return F, G, C

    def held(self) -> Sampled:
        """The same without memory that the loop does not hold.

        Efforts do not come from it, as from an integral whose gain is 0, or nothing changes it.
        """
        size = self.H_m.shape[1]
        links = self.E_m != 0
        links[np.diag_indices(size)] = True
        links = np.linalg.matrix_power(links.astype(float), size) > 0
        acted = np.arange(size) >= size - (self.B.shape[1] if self.acted else 0)
        read = (self.H_m != 0).any(axis=0) @ links
        written = links @ ((self.E != 0).any(axis=1) | acted)
        kept = (read & written) | acted
        H_m, E, E_m = self.H_m[:, kept], self.E[kept], self.E_m[np.ix_(kept, kept)]
        return replace(self, H_m=H_m, E=E, E_m=E_m)

    def closed(self) -> np.ndarray:
        F, G, C = self.open()
        return F - G @ C

    def beyond(self, at_once: np.ndarray) -> float:
        """Largest |z| beside those that grow or stay without lag too: x' = at_once x."""
        assert self.period is not None
        z, slow = np.linalg.eigvals(self.closed()), np.linalg.eigvals(at_once) * self.period
        for one in np.exp(slow[slow.real > -SAME]):
            z = np.delete(z, np.abs(z - one).argmin())
        return float(np.abs(z).max(initial=0.0))

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
