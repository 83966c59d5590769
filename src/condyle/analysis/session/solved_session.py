"""Every trial of a session: its motion, its solution, its cycles."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import InputError, ProblemsError, few
from ...markers import (
    MarkerMotion,
    Registration,
    SessionFile,
    between_trials,
    motions_of,
    places_at_home,
    registered_places,
    with_mvc,
)
from ...markers.recorded_tables import read_recording
from ...markers.recording import Recording
from ...markers.session_file import Trial
from ...mechanism import load_mechanism
from ...mechanism.mechanism import Mechanism
from ...mechanism.scaling import ScaledMechanism, scaled_to
from ...mechanism.vocabulary import words_of
from ...model.distributing import Distribution
from ...model.model import Model, derive, model_for
from ...motion import as_load
from ...progress import stepping
from ...results.solving import solve
from ..run_motion import study_for
from ..sweep import Study
from ..sweep.bands import VariantResults, banded, variants_of
from .closures import ClosureStep, closure_step
from .cycle_finding import CycleDetection, find_cycles
from .cycle_measures import band_columns, complete_spans, cycle_rows, variant_measures
from .jaw_measures import jaw_rows, skull_axes
from .subject_eminence import SubjectEminence, subject_eminence

if TYPE_CHECKING:
    import xarray as xr

ALL = "all"  # a group whose trials have no words


@dataclass(frozen=True, eq=False)
class SolvedTrial:
    """A trial: what was recorded, the solution with markers and EMG, and its cycles.

    motions: of each interval between gaps that are too long to fill; the solution is of all.
    rows: one a cycle, with the trial's name and words.
    variants: of the study of bands; None without one.
    axes: forward, left and up of the skull's plane of reference in {S}, (3, 3).
    group: subject, task and the labels that means tell apart: key -> word, "" where it has none.
    slip: the largest step between closures; None where there are too few.
    moved: distance of the fixed markers in {S} from where the subject's first trial has them, root
    mean square [m]: points that were registered elsewhere than the markers were; None of the first.
    """

    trial: Trial
    motions: tuple[MarkerMotion, ...]
    solution: xr.Dataset
    found: CycleDetection
    rows: list[dict[str, Any]]
    axes: np.ndarray
    group: dict[str, Any]
    slip: ClosureStep | None
    variants: VariantResults | None = None
    moved: float | None = None

    @property
    def motion(self) -> MarkerMotion:
        """The first interval's, whose residuals and gaps are of all."""
        return self.motions[0]

    @cached_property
    def whole(self) -> np.ndarray:
        """Start and end of the cycles that count for means: all their samples have a result."""
        return complete_spans(self.solution, self.found.spans)

    @cached_property
    def by_variant(self) -> dict[str, np.ndarray]:
        """Peaks and impulses of each cycle by column, (V, C); nothing without variants."""
        if self.variants is None:
            return {}
        return variant_measures(self.solution, self.variants, self.found.spans)


@dataclass(frozen=True, eq=False)
class SolvedSession:
    """All trials of a session.

    mechanism: scaled to the subject, where `scaled` says so, and with its `eminence`.
    registered: on the mechanism before it was scaled; None where it was not.
    warnings: each once.
    """

    file: SessionFile
    mechanism: Mechanism
    scaled: ScaledMechanism | None
    registered: Registration | None
    trials: tuple[SolvedTrial, ...]
    warnings: tuple[str, ...] = field(default=())
    eminence: SubjectEminence | None = None

    @cached_property
    def groups(self) -> dict[str, list[SolvedTrial]]:
        """Trials of one subject, task and labels, by those words; "all" where they have none."""
        found: dict[str, list[SolvedTrial]] = {}
        for one in self.trials:
            name = ", ".join(str(word) for word in one.group.values() if word != "") or ALL
            found.setdefault(name, []).append(one)
        return found


def solve_session(file: SessionFile) -> SolvedSession:
    """Motions, solutions and cycles of all trials.

    Raises: InputError: for recordings that cannot be used, named by the trial.
    """
    machine = load_mechanism(file.mechanism)
    named = [path for trial in file.trials for path in (trial.file, trial.channels) if path]
    named += [] if file.static is None else [file.static.file]
    named += [] if file.emg is None else [*file.emg.mvc]
    if missing := [path for path in named if not os.path.isfile(path)]:
        raise ProblemsError("session", [f"{path}: no such file" for path in missing])
    file = with_mvc(file)
    static = None if file.static is None else read_recording(file.static.file, file.unit)
    scaled, registered, warnings = None, None, _Warnings()
    if file.scale is not None:
        scaled, registered = _scaled(file, machine, static)
        machine = scaled.mechanism
        warnings.add((*registered.warnings, *scaled.warnings))
    eminence = subject_eminence(
        file, machine, lambda trial: _motions(trial, machine, file, static, on_contacts=False)
    )
    machine = machine if eminence is None else eminence.mechanism
    how = file.solve
    study = None if how.vary is None else study_for(how.vary, machine)
    name: Any = how.distribution
    chosen = Distribution(name, how.preload, how.contact_weight, how.emg_weight)
    model = derive(machine, distribution=chosen)
    trials: list[SolvedTrial] = []
    for trial in stepping("solving trials", file.trials):
        try:
            solved = _solved(trial, file, model, static, study)
        except ProblemsError:
            raise
        except InputError as error:
            raise InputError(f'trial "{trial.name}": {error.message}', error.hint) from error
        mates = [one for one in trials if one.trial.subject == trial.subject]
        if mates:
            apart, odd = between_trials([mates[0].motion, solved.motion])
            solved = replace(solved, moved=next(iter(apart.values())).get("fixed"))
            warnings.add(odd)
        trials.append(solved)
        for motion in solved.motions:
            warnings.add(motion.warnings, trial.name)
        if solved.slip is not None and solved.slip.large:
            warnings.add([str(solved.slip)], trial.name)
        warnings.add([notice.text for notice in solved.solution.condyle.notices], trial.name)
        if solved.found.phases is not None and not len(solved.found.spans):
            by = getattr(file.cycles_of(trial), "by", "")
            warnings.add([f"no cycles by {by} were found in it"], trial.name)
    texts = tuple(map(words_of(machine), warnings.texts(len(trials))))
    return SolvedSession(file, machine, scaled, registered, tuple(trials), texts, eminence)


class _Warnings:
    """Warnings of a session, each with the trials that gave it."""

    def __init__(self) -> None:
        self.trials: dict[str, list[str]] = {}

    def add(self, texts: Iterable[str], trial: str = "") -> None:
        for text in texts:
            names = self.trials.setdefault(text, [])
            if trial and trial not in text and trial not in names:
                names.append(trial)

    def texts(self, count: int) -> tuple[str, ...]:
        """All of them; one that every trial of several gave names none."""
        return tuple(
            f"{few(names)}: {text}" if names and (len(names) < count or count == 1) else text
            for text, names in self.trials.items()
        )


def _scaled(
    file: SessionFile, machine: Mechanism, static: Recording | None
) -> tuple[ScaledMechanism, Registration]:
    """The mechanism scaled to the places that the static trial, or else the first, gives."""
    scale = file.scale
    assert scale is not None
    there = static or read_recording(file.trials[0].file, file.unit)
    places, registered = registered_places(there, file, machine, static)
    wanted = {name: places[name] for name in scale.landmarks}
    try:
        return scaled_to(
            machine, wanted, scale.kind, error=scale.error, regularise=scale.regularise
        ), registered
    except InputError as error:
        if not registered.warnings:
            raise
        said = ". ".join((*registered.warnings, error.message))
        raise InputError(said, error.hint) from None


def _motions(
    trial: Trial,
    machine: Mechanism,
    file: SessionFile,
    static: Recording | None,
    on_contacts: bool = True,
) -> list[MarkerMotion]:
    """One of each interval between gaps."""
    return motions_of(
        read_recording(trial.file, file.unit, trial.channels),
        file,
        machine,
        static=static,
        max_residual=file.filter.max_residual,
        max_gap=file.filter.max_gap,
        keep="longest" if file.filter.longest else "all",
        cutoff=file.filter.cutoff,
        trim=file.trim,
        on_contacts=on_contacts,
    )


def _solved(
    trial: Trial, file: SessionFile, model: Model, static: Recording | None, study: Study | None
) -> SolvedTrial:
    motions = _motions(trial, model.mechanism, file, static)
    # Trials of a session are about as long as each other.
    model = model_for(model, len(file.trials) * sum(len(one.motion) for one in motions))
    point, solutions, intervals = file.solve.load_point, [], []
    for found in motions:
        one = solve(
            model, found.motion, found.load, load_point=point, flag=True, measured=found.channels
        )
        solutions.append(one)
        if study is not None:
            acting = as_load(found.load)
            intervals.append(variants_of(one, study, found.motion, acting, model.mechanism))
    solution = _joined(solutions)
    variants = VariantResults.joined(intervals) if intervals else None
    if variants is not None:
        solution = banded(solution, variants)
    said = [*(text for one in motions for text in one.warnings), *solution.condyle.warnings]
    solution.attrs["warnings"] = json.dumps(list(dict.fromkeys(said)))
    table = file.cycles_of(trial)
    axes = np.eye(3)
    if file.plane is not None:
        places = places_at_home(file.plane.places, motions[0], file, static)
        axes = skull_axes(file.plane, model.mechanism, places)
    cycles = find_cycles(table, solution, motions[0].recording, trial.task, axes)
    words = {"trial": trial.name, **{w: trial.words.get(w) for w in file.words}}
    by = None if table is None else table.by
    rows = [words | row for row in cycle_rows(solution, cycles, by)]
    free = np.concatenate([one.free for one in motions])
    times = solution["time"].values
    measured = jaw_rows(model.mechanism, times, free, cycles, axes)
    for row, measures in zip(rows, measured, strict=False):
        row.update(measures)
    group = {key: trial.words.get(key, "") for key in ("subject", "task", *file.group_by)}
    slip = closure_step(solution, cycles)
    made = SolvedTrial(trial, tuple(motions), solution, cycles, rows, axes, group, slip, variants)
    for row, bands in zip(rows, band_columns(made.by_variant), strict=False):
        row.update(bands)
    return made


def _joined(solutions: list[xr.Dataset]) -> xr.Dataset:
    """The solutions of a trial's intervals, one after the other."""
    import xarray as xr

    if len(solutions) == 1:
        return solutions[0]
    joined = xr.concat(
        solutions, "time", data_vars="minimal", coords="minimal", compat="override",
        combine_attrs="override",
    )  # fmt: skip
    for name in ("warnings", "notices"):
        every = [entry for one in solutions for entry in json.loads(one.attrs[name])]
        joined.attrs[name] = json.dumps(every)
    return joined
