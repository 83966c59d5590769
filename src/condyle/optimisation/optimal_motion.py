"""`optimise`: the cycle through poses that costs least, within limits."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from ..backends.choose import BackendName
from ..errors import InputError, UnsupportedError, join
from ..files.limits import sample_count
from ..mechanism import as_mechanism
from ..mechanism.chain import limits, require_fixed_limits
from ..mechanism.mechanism import Mechanism
from ..mechanism.study_file import (
    BelowOne,
    File,
    Finite,
    Fraction,
    MechanismFile,
    NotNegative,
    Positive,
    Share,
    StudyFile,
    require_known,
)
from ..mechanism.table import Table
from ..model.model import Model, derive
from ..motion import Load, Motion, as_load, as_motion, load_place
from ..results.study_answer import StudyAnswer, limit_data, limit_lines
from .activation import Activation
from .collocation import (
    DEGREE,
    Collocation,
    Cycle,
    InitialGuess,
    NodeOutputs,
    QuadraticCost,
    Wanted,
    cheapest_cycle,
    through,
)
from .point_paths import Track

BETWEEN = 4  # samples of a followed path between nodes


class Cost(Table):
    """Weights of what costs; each part is of the order of one."""

    effort: NotNegative = Field(
        default=0.0, description="mean square of efforts over their limits; of activations"
    )
    peak_effort: NotNegative = Field(
        default=0.0, description="the largest effort over its limit; the largest activation"
    )
    contact_force: NotNegative = Field(
        default=0.0, description="mean square of contact forces over `reference_force`"
    )
    jerk: NotNegative = Field(
        default=0.0, description="mean square of third derivatives over width / period^3"
    )
    path: NotNegative = Field(
        default=0.0, description="mean square of distances from `follow` over width"
    )
    time: NotNegative = Field(default=0.0, description="a free period over its greatest")


class TrackTable(Table):
    """A point of the platform near a path, or near a place at a time."""

    point: str = Field(description="of the platform")
    within: Positive = Field(description="how far it may be in each of x, y and z [m]")
    path: File | None = Field(default=None, description="a file of t, x, y, z, over one period")
    place: tuple[Finite, Finite, Finite] | None = Field(default=None, description="x, y, z [m]")
    t: Finite | None = Field(default=None, description="of the place, a node's [s]")
    phase: Finite | None = Field(default=None, description="in the place of t, 0 to 1")


class MotionLimits(Table):
    """What the motion keeps, at every node."""

    share: Share = Field(
        default=1.0, description="part of each limit of an effort; least ones above zero stay"
    )
    activation: tuple[Fraction, Fraction] = Field(
        default=(0.01, 1.0), description="least and greatest of muscles; near 0 the search is slow"
    )
    contact_force: dict[str, Positive] = Field(default={}, description="contact -> greatest [N]")
    singularity_ratio: BelowOne = Field(
        default=0.01, description="least, direct and inverse; 0: any"
    )
    contact_bounds: bool = Field(default=True, description="contacts stay on their surfaces")


class OptimiseStudy(StudyFile):
    """A cycle: poses that it passes, what costs and what is kept."""

    mechanism: MechanismFile | None = Field(
        default=None, description="a file beside the study, or a name"
    )
    period: Positive | tuple[Positive, Positive] = Field(
        description="of the cycle [s]; where it is free, least and greatest"
    )
    pose: tuple[dict[str, Finite], ...] = Field(
        min_length=1,
        description="t [s], or phase, 0 to 1 -> independent coordinates [m, rad]; those left out: "
        "free",
    )
    bounds: dict[str, tuple[Finite, Finite]] = Field(
        default={}, description="coordinate -> least and greatest [m, rad]"
    )
    cost: Cost = Cost(effort=1.0)
    limits: MotionLimits = MotionLimits()
    track: tuple[TrackTable, ...] = Field(default=(), description="points on paths or at places")
    load: File | None = Field(default=None, description="a load file, over one period")
    load_point: str | None = Field(default=None, description="where the load acts")
    follow: File | None = Field(default=None, description="a motion file that `path` is far from")
    start: File | None = Field(default=None, description="a motion file to begin from")
    reference_force: Positive = Field(default=1.0, description="of contact forces [N]")
    intervals: Annotated[int, Field(strict=True, gt=DEGREE, le=500)] = 50
    steps: Annotated[int, Field(strict=True, ge=1, le=10000)] = Field(
        default=300, description="most iterations"
    )
    rate: Positive = Field(default=1000.0, description="samples a second of the motion [Hz]")

    @property
    def periods(self) -> tuple[float, float]:
        """Least and greatest period [s]."""
        one = self.period
        return one if isinstance(one, tuple) else (one, one)


@dataclass(frozen=True, eq=False)
class OptimalMotion(StudyAnswer):
    """A motion of least cost, one period with both ends, and how it was found.

    mechanism: whose motion it is;  cycle: its nodes;
    peaks: limit -> the largest share of it, and when [s].
    """

    kind = "optimise"
    mechanism: Mechanism
    motion: Motion
    cycle: Cycle
    peaks: dict[str, tuple[float, float]]

    def __str__(self) -> str:
        cycle = self.cycle
        lines = [f"cost {cycle.cost:.6g}; of the start {cycle.first_cost:.6g}"]
        lines += [f"period {cycle.period:.6g} s"]
        lines += limit_lines(self.peaks)
        nodes = len(cycle.t)
        lines += [f"{name} holds it at {x} of {nodes} nodes" for name, x in self.binding.items()]
        lines.append(
            f"{cycle.iterations} iterations, {cycle.evaluations} evaluations, "
            f"{cycle.seconds:.2f} s; largest violation {cycle.violation:.1e}"
        )
        return "\n".join(lines)

    @property
    def binding(self) -> dict[str, int]:
        """Limit -> at how many nodes it holds the motion back."""
        return dict(Counter(name for name, _ in self.cycle.binds))

    @property
    def data(self) -> dict[str, Any]:
        told = ("cost", "first_cost", "period", "violation", "iterations", "evaluations", "seconds")
        found = {name: getattr(self.cycle, name) for name in told}
        return {**found, "limits": limit_data(self.peaks), "binding": self.binding}


def optimise(
    study: OptimiseStudy | Mapping[str, Any] | str | os.PathLike[str],
    mechanism: Mechanism | str | os.PathLike[str] | None = None,
    *,
    start: OptimalMotion | Motion | str | os.PathLike[str] | None = None,
    follow: Motion | str | os.PathLike[str] | None = None,
    load: Load | str | os.PathLike[str] | None = None,
    backend: BackendName = "auto",
) -> OptimalMotion:
    """The periodic motion through poses that costs least, within limits.

    Direct collocation over the independent coordinates with exact slopes, solved by IPOPT; efforts
    are those of least norm, or those of muscles, whose activations are unknowns with dynamics of
    their own. Limits hold at the nodes, and nearly between them.

    Args:   study: a study of an optimal motion (TOML), or its tables: see the guide.
            mechanism: in the place of the study's.
            start: where the search begins, an earlier result or a motion: it is stretched to the
            period. Default: the study's, else the curve of least acceleration through the poses.
            follow: the path that `cost.path` is about, in the place of the study's.
            load: in the place of the study's; stretched to the period, as the start is.
    Raises: InputError: for a study that does not fit, and where no motion keeps the limits, with
            the one that is missed most; UnsupportedError: for walls and contacts with friction.
    """
    checked = OptimiseStudy.read(study)
    if (mechanism := mechanism or checked.mechanism) is None:
        raise InputError("mechanism: expected one, in the study or beside it, got none")
    machine = as_mechanism(mechanism)
    require_fixed_limits((), "optimal motion", machine.enabled_walls)
    if rough := [c.name for c in machine.contacts if c.friction.coefficient]:
        raise UnsupportedError(
            f"optimal motion: contact {rough[0]} has friction; set its coefficient to 0"
        )
    model = derive(machine, backend=backend)
    pulling = any(chain.kind == "muscle" for chain in machine.chains)
    if "activation" in checked.limits.model_fields_set and not pulling:
        raise InputError("limits.activation: is of muscles, and the mechanism has none")
    acts = Activation(model, checked.limits.activation, checked.limits.share) if pulling else None
    if (
        acts is not None
        and (longest := 2 * acts.rise.min()) < max(checked.periods) / checked.intervals
    ):
        most = max(checked.periods) / longest
        raise InputError(
            f"intervals: expected {int(most) + 1} or more, got {checked.intervals}: nodes are to "
            f"be {longest:.3g} s apart at most, twice the muscles' shortest activation_time"
        )
    least, greatest = checked.periods
    sample_count(greatest, checked.rate)  # what cannot be written is found before the search
    if not any(x for name, x in checked.cost if name != "time" or least < greatest):
        raise InputError(
            "cost: expected a weight above 0 of effort or another part; time counts where the "
            "period is free, as period = [0.6, 1.0]"
        )
    wanted, width = _wanted(model, checked)
    measures = tuple(_measures(machine, checked, acts))
    free = least if least < greatest else None
    load = checked.load if load is None else load
    if load is None and checked.load_point is not None:
        raise InputError("load_point: requires load, the file of the load that acts there")
    wrench, at = _loaded(machine, checked, as_load(load))
    tracks, unit = dict(_tracks(machine, checked)), np.ones(3)
    measures += tuple(
        NodeOutputs(name, tuple(f"{one.name} in {x}" for x in "xyz"), unit, -unit, unit)
        for name, one in tracks.items()
    )
    problem = Collocation(
        model, greatest, checked.intervals, measures, acts, free, wrench, at, tracks
    )
    follow = checked.follow if follow is None else follow
    if bool(checked.cost.path) != (follow is not None):
        raise InputError(
            "follow: expected with cost.path, the distance from it: give both or neither"
        )
    quadratic = _quadratic(problem, checked, width, None if follow is None else as_motion(follow))
    start = checked.start if start is None else start
    cycle = cheapest_cycle(
        problem, wanted, quadratic, start=_begin(model, problem, start), steps=checked.steps
    )
    count = max(round(sample_count(cycle.period, checked.rate)), DEGREE + 1)
    part = np.linspace(0.0, 1.0, count + 1)
    values = problem.rows(part * problem.period) @ cycle.coefficients
    motion = Motion.from_arrays(part * cycle.period, values, model.independent, source="optimise")
    return OptimalMotion(machine, motion, cycle, dict(_peaks(problem, cycle)))


def _begin(model: Model, problem: Collocation, start: Any) -> InitialGuess | None:
    """Where the search begins, of an earlier result or a motion."""
    if start is None:
        return None
    if isinstance(start, OptimalMotion) and len(start.cycle.t) == problem.N:
        cycle = start.cycle
        activation, excitation = map(cycle.outputs.get, ("activation", "excitation"))
        own = cycle.coefficients, activation, excitation, cycle.period
        return InitialGuess(*own, cycle.multipliers)
    given = start.motion if isinstance(start, OptimalMotion) else as_motion(start)
    coefficients = through(problem, _coordinates_on(model, given, problem.t / problem.period))
    return InitialGuess(coefficients, period=float(given.t[-1] - given.t[0]))


def _loaded(
    machine: Mechanism, study: OptimiseStudy, load: Load
) -> tuple[np.ndarray | None, np.ndarray | None]:
    """The load at the nodes, (N, 6), and where it acts, (3,)."""
    if not load.wrench.any():
        return None, None
    points = machine.platform.points
    at = load_place(study.load_point or load.point, points)
    part = np.arange(study.intervals) / study.intervals
    first, last = (load.t[0], load.t[-1]) if len(load.t) else (0.0, 1.0)
    return load.at(first + part * (last - first)), at


def _tracks(machine: Mechanism, study: OptimiseStudy) -> Iterator[tuple[str, Track]]:
    """Points near paths and places, at the nodes."""
    N, points = study.intervals, machine.platform.points
    for k, track in enumerate(study.track):
        where = f"track {k + 1}"
        require_known([track.point], points, f"{where}: point")
        if (track.path is None) == (track.place is None):
            raise InputError(f"{where}: expected path, or place with t or phase")
        place = np.full((N, 3), np.nan)
        given = {n: x for n, x in (("t", track.t), ("phase", track.phase)) if x is not None}
        if track.path is not None:
            if given:
                raise InputError(f"{where}: t and phase go with place, not with path")
            path = as_motion(track.path)
            if path.names != ("x", "y", "z"):
                raise InputError(f"{where}: expected columns t, x, y, z, got {join(path.names)}")
            times = path.t[0] + np.arange(N) / N * (path.t[-1] - path.t[0])
            place[:] = np.stack([np.interp(times, path.t, x) for x in path.value.T], axis=-1)
        else:
            step = max(study.periods) / N
            node = _when(given, study, where) / step
            if abs(node - round(node)) > 1e-6:
                raise InputError(
                    f"{where}: expected the time of a node, a multiple of {step:.6g} s or of "
                    f"phase {1 / N:.6g}; change it or intervals"
                )
            place[round(node)] = track.place
        name = f"the way of {track.point}" if track.path else f"the place of {track.point}"
        yield where, Track(name, np.array(points[track.point]), place, track.within)


def _measures(
    machine: Mechanism, study: OptimiseStudy, acts: Activation | None
) -> Iterator[NodeOutputs]:
    """What a node's cost and limits are of."""
    cost, limits = study.cost, study.limits
    if acts is not None:
        one, open_, m = np.ones(acts.n), np.full(acts.n, np.inf), len(acts.scale)
        given = acts.names, one, -open_, open_, cost.effort, cost.peak_effort
        yield NodeOutputs("activation", *given)
        balance = tuple(f"balance {i + 1}" for i in range(m))
        yield NodeOutputs("balance", balance, acts.scale, np.zeros(m), np.zeros(m))
    else:
        yield _efforts(machine, study)
    require_known(limits.contact_force, machine.contact_names, "limits.contact_force")
    if cost.contact_force or limits.contact_force or any(c.one_sided for c in machine.contacts):
        most = np.array([limits.contact_force.get(c.name, np.inf) for c in machine.contacts])
        sides = np.array([c.push if c.one_sided else 0 for c in machine.contacts])
        yield NodeOutputs(
            "contact_force",
            tuple(f"load of {name}" for name in machine.contact_names),
            np.full(len(most), study.reference_force),
            np.where(sides > 0, 0.0, -most) / study.reference_force,
            np.where(sides < 0, 0.0, most) / study.reference_force,
            cost.contact_force,
        )
    if limits.singularity_ratio:
        least, none = np.array([limits.singularity_ratio]), np.array([np.inf])
        yield NodeOutputs("singularity_ratio", ("singularity_ratio",), np.ones(1), least, none)
    if limits.contact_bounds and any(c.bounds for c in machine.contacts):
        box = np.tile([-np.inf, np.inf], (len(machine.contacts), 3, 1))
        for i, contact in enumerate(machine.contacts):
            for axis, name in enumerate("xyz"):
                if (edge := getattr(contact.bounds, name, None)) is not None:
                    box[i, axis] = edge
        names = tuple(f"{name}.bounds.{x}" for name in machine.contact_names for x in "xyz")
        size = np.full(len(names), 1e-2)  # m: a violation is of a centimetre
        low, high = box.reshape(-1, 2).T / 1e-2
        yield NodeOutputs("contact_point", names, size, low, high)


def _efforts(machine: Mechanism, study: OptimiseStudy) -> NodeOutputs:
    """Efforts over their limits."""
    own, cost, bounds = [limits(chain) for chain in machine.chains], study.cost, study.limits
    ends = np.array([[x.low, x.high] for x in own])
    finite = np.where(np.isfinite(ends), np.abs(ends), 0.0).max(axis=1)
    scale = np.where(finite > 0, finite, 1.0)
    names = tuple(f"effort of {name}" for name in machine.chain_names)
    low, high = (np.array([x.part(bounds.share)[:2] for x in own]) / scale[:, None]).T
    return NodeOutputs("effort", names, scale, low, high, cost.effort, cost.peak_effort)


def _wanted(model: Model, study: OptimiseStudy) -> tuple[Wanted, np.ndarray]:
    """Poses and bounds; and how wide each coordinate's motion is, (m,)."""
    names = model.independent
    times, points = [], np.full((len(study.pose), len(names)), np.nan)
    for k, pose in enumerate(study.pose):
        times.append(_when(pose, study, f"pose {k + 1}"))
        own = [name for name in pose if name not in ("t", "phase")]
        require_known(own, names, f"pose {k + 1}")
        points[k] = [pose.get(name, np.nan) for name in names]
    for k, when in enumerate(times):
        if when in times[:k]:
            same = times.index(when) + 1
            raise InputError(f"pose {k + 1}: is at the time of pose {same}; join them or move one")
    if free := [n for n, x in zip(names, points.T, strict=True) if np.isnan(x).all()]:
        raise InputError(f"pose: {join(free)} has no value at any time; give one or more")
    require_known(study.bounds, names, "bounds")
    box = np.array([study.bounds.get(name, (-np.inf, np.inf)) for name in names])
    if (box[:, 0] >= box[:, 1]).any():
        raise InputError("bounds: expected [least, greatest] of each coordinate, least first")
    outside = (points < box[:, 0]) | (points > box[:, 1])  # not those that are free
    for k, i in np.argwhere(outside)[:1]:
        low, high = box[i]
        raise InputError(
            f"pose {k + 1}: expected {names[i]} within bounds.{names[i]}, {low:g} to {high:g}, got "
            f"{points[k, i]:g}"
        )
    width = np.where(np.isfinite(box).all(axis=1), box[:, 1] - box[:, 0], 0.0)
    passed = np.nanmax(points, axis=0) - np.nanmin(points, axis=0)
    width = np.where(width > 0, width, passed)
    wanted = Wanted(np.array(times), points, box, study.cost.time)
    return wanted, np.where(width > 0, width, 1.0)


def _when(given: dict[str, float], asked: OptimiseStudy, where: str) -> float:
    """The time of the greatest period [s]."""
    least, greatest = asked.periods
    if "phase" in given and "t" not in given:
        if not 0 <= given["phase"] < 1:
            raise InputError(f"{where}: expected phase from 0 to 1, got {given['phase']}")
        return given["phase"] * greatest
    if given.get("t", 0.0) and least < greatest:
        raise InputError(f"{where}: where the period is free, expected phase in the place of t")
    if "t" not in given or not 0 <= given["t"] < greatest or "phase" in given:
        got = given.get("t", "none")
        raise InputError(f"{where}: expected t from 0 to the period [s], or phase, got {got}")
    return given["t"]


def _coordinates_on(model: Model, motion: Motion, part: np.ndarray) -> np.ndarray:
    """Independent coordinates of a motion at parts of its duration, (K, m)."""
    times = motion.t[0] + part * (motion.t[-1] - motion.t[0])
    how: dict[str, Any] = {"landmark": motion.landmark, "times": times}
    (q, _, _), _ = model.poses.of_motion(
        Motion.from_arrays(motion.t, motion.value, motion.names, **how)
    )
    found: np.ndarray = q
    return found


def _quadratic(
    problem: Collocation, study: OptimiseStudy, width: np.ndarray, follow: Motion | None
) -> QuadraticCost | None:
    """The cost of jerk, and of the distance from a path."""
    if not study.cost.jerk and follow is None:
        return None
    each, N = np.diag(1.0 / width**2), problem.N
    bent = problem.rows(problem.t, 3) * problem.period**3
    P = 2 * study.cost.jerk / N * np.kron(bent.T @ bent, each)
    p, constant = np.zeros(len(P)), 0.0
    if follow is not None:
        part = np.arange(BETWEEN * N) / (BETWEEN * N)
        q, F = _coordinates_on(problem.model, follow, part), problem.rows(part * problem.period)
        share = 2 * study.cost.path / len(part)
        P = P + share * np.kron(F.T @ F, each)
        p = share * (F.T @ q @ each).ravel()
        constant = 0.5 * share * float(np.sum((q / width) ** 2))
    return QuadraticCost(P, p, constant)


def _peaks(problem: Collocation, cycle: Cycle) -> Iterator[tuple[str, tuple[float, float]]]:
    """Largest share of each limit of efforts and loads, and when."""
    for measure in problem.measures:
        if measure.of not in ("effort", "contact_force", "activation"):
            continue
        y, low, high = cycle.outputs[measure.of], measure.low, measure.high
        if measure.of == "activation" and problem.activation is not None:
            low, high = problem.activation.low, problem.activation.high
        end = np.where(y >= 0, high, low)  # of the share that may be used
        share = np.divide(y, end, where=np.isfinite(end) & (end != 0), out=np.full_like(y, np.nan))
        for i, name in enumerate(measure.names):
            if np.isfinite(share[:, i]).any():
                k = int(np.nanargmax(share[:, i]))
                yield name, (float(share[k, i]), float(cycle.t[k]))
