"""Every trial of a session: its motion, its solution, its cycles."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import InputError, ProblemsError, join
from ...markers import MarkerMotion, SessionFile, between_trials
from ...markers.session_file import Trial
from ...mechanism.mechanism import Mechanism
from ...mechanism.vocabulary import words_of
from ...model.model import Model, derive, model_for
from ...progress import stepping
from ..run_motion import study_for
from ..sweep.bands import VariantResults, banded
from .closures import ClosureStep, closure_step
from .cycle_finding import CycleDetection, find_cycles
from .cycle_measures import band_columns, complete_spans, cycle_rows, variant_measures
from .jaw_measures import jaw_rows
from .session_variants import (
    SessionVariants,
    distribution_of,
    session_variants,
    solutions_of,
)
from .subject import SessionRecordings, Subject, subject_of

if TYPE_CHECKING:
    import xarray as xr

ALL = "all"  # a group whose trials have no words


@dataclass(frozen=True, eq=False)
class SolvedTrial:
    """A trial: what was recorded, the solution with markers and EMG, and its cycles.

    motions: of each interval between gaps that are too long to fill; the solution is of all.
    rows: one a cycle, with the trial's name and words.
    variants: of the bands; None without any.
    measures: of a jaw's cycles by name, of moved registrations (R, C); none without any.
    axes: forward, left and up of the skull's plane of reference in {S}, (3, 3).
    group: subject, task and the labels that means tell apart: key -> word, "" where it has none.
    slip: the largest step between closures; None where there are too few.
    moved: distance of the fixed markers in {S} from where the subject's first trial has them, root
    mean square [m]: points that were registered elsewhere than the markers were; None of the first.
    """

    trial: Trial
    motions: tuple[MarkerMotion, ...]
    solution: xr.Dataset
    cycles: CycleDetection
    rows: list[dict[str, Any]]
    axes: np.ndarray
    group: dict[str, Any]
    slip: ClosureStep | None
    variants: VariantResults | None = None
    measures: dict[str, np.ndarray] = field(default_factory=dict)
    moved: float | None = None

    @property
    def motion(self) -> MarkerMotion:
        """The first interval's, whose residuals and gaps are of all."""
        return self.motions[0]

    @cached_property
    def complete_cycles(self) -> np.ndarray:
        """Start and end of the cycles that count for means: all their samples have a result."""
        return complete_spans(self.solution, self.cycles.spans)

    @cached_property
    def by_variant(self) -> dict[str, np.ndarray]:
        """Peaks and impulses of each cycle by column, (V, C), and measures that vary with the
        registration, (R, C); nothing without variants."""
        if self.variants is None:
            return {}
        return variant_measures(self.solution, self.variants, self.cycles.spans) | self.measures


@dataclass(frozen=True, eq=False)
class SolvedSession:
    """All trials of a session.

    warnings: each once.
    """

    file: SessionFile
    subject: Subject
    trials: tuple[SolvedTrial, ...]
    warnings: tuple[str, ...] = field(default=())

    @property
    def mechanism(self) -> Mechanism:
        """The subject's."""
        return self.subject.mechanism

    @cached_property
    def groups(self) -> dict[str, list[SolvedTrial]]:
        """Trials of one subject, task and labels, by those words; "all" where they have none."""
        groups: dict[str, list[SolvedTrial]] = {}
        for solved in self.trials:
            name = ", ".join(str(word) for word in solved.group.values() if word != "") or ALL
            groups.setdefault(name, []).append(solved)
        return groups


def solve_session(file: SessionFile) -> SolvedSession:
    """Motions, solutions and cycles of all trials.

    Raises: InputError: for recordings that cannot be used, named by the trial.
    """
    recordings, warnings = SessionRecordings(file), _Warnings()
    subject = subject_of(recordings)
    if subject.scaled is not None and subject.registered is not None:
        warnings.add((*subject.registered.warnings, *subject.scaled.warnings))
    machine, how = subject.mechanism, file.solve
    study = None if how.vary is None else study_for(how.vary, machine)
    model = derive(machine, distribution=distribution_of(file, None))
    variants = session_variants(recordings, subject, model, study)
    trials: list[SolvedTrial] = []
    for trial in stepping("solving trials", file.trials):
        try:
            solved = _solved(trial, subject, model, variants)
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
        if solved.cycles.phases is not None and not len(solved.cycles.spans):
            by = getattr(file.cycles_of(trial), "by", "")
            warnings.add([f"no cycles by {by} were found in it"], trial.name)
    texts = tuple(map(words_of(machine), warnings.texts(len(trials))))
    return SolvedSession(file, subject, tuple(trials), texts)


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
            f"{join(names)}: {text}" if names and (len(names) < count or count == 1) else text
            for text, names in self.trials.items()
        )


def _solved(
    trial: Trial, subject: Subject, model: Model, variants: SessionVariants | None
) -> SolvedTrial:
    file, motions = subject.recordings.file, subject.motions(trial)
    # Trials of a session are about as long as each other.
    samples = len(file.trials) * sum(len(motion.motion) for motion in motions)
    solution = _joined(solutions_of(model_for(model, samples), motions, file.solve.load_point))
    table, axes = file.cycles_of(trial), subject.axes(motions[0])
    cycles = find_cycles(table, solution, motions[0].recording, trial.task, axes)
    bands: VariantResults | None = None
    moved: dict[str, np.ndarray] = {}
    if variants is not None:
        bands, moved = variants.of_trial(trial, motions, solution, cycles, samples)
        solution = banded(solution, bands)
    texts = [*(text for motion in motions for text in motion.warnings), *solution.condyle.warnings]
    solution.attrs["warnings"] = json.dumps(list(dict.fromkeys(texts)))
    words = {"trial": trial.name, **{w: trial.words.get(w) for w in file.words}}
    by = None if table is None else table.by
    rows = [words | row for row in cycle_rows(solution, cycles, by)]
    free = np.concatenate([motion.free for motion in motions])
    times = solution["time"].values
    measured = jaw_rows(model.mechanism, times, free, cycles, axes)
    for row, measures in zip(rows, measured, strict=False):
        row.update(measures)
    group = {key: trial.words.get(key, "") for key in ("subject", "task", *file.group_by)}
    slip = closure_step(solution, cycles)
    made = SolvedTrial(
        trial, tuple(motions), solution, cycles, rows, axes, group, slip, bands, moved
    )
    for row, columns in zip(rows, band_columns(made.by_variant), strict=False):
        row.update(columns)
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
