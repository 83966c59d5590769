"""Bands of a session: registered points moved by their error, other objectives, a study's numbers.

Moved points make a subject of their own: the mechanism is scaled to them, its eminence fitted, and
every motion found anew. Each subject has every objective, and with it all variants of the study.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr

from ...errors import InputError
from ...files.memory import require_memory
from ...markers import MarkerMotion, SessionFile
from ...markers.marker_motion import MovedPlaces
from ...markers.session_file import JAW_MEASURES, Trial
from ...model.distributing import Distribution
from ...model.model import Model, derive, model_for
from ...motion import as_load, with_load_point
from ...progress import stepping
from ...results.solving import solve
from ..sweep import Study
from ..sweep.bands import BANDS, VariantResults, variants_of
from ..sweep.sampling import Design
from .cycle_finding import CycleDetection
from .jaw_measures import jaw_rows
from .subject import SessionRecordings, Subject, subject_of


@dataclass(frozen=True, eq=False)
class SessionVariants:
    """The variants whose results the bands of a session are of.

    subject: as recorded.
    subjects: those of the bands; None where moved points give none.
    models: of each subject, one for each objective.
    study: whose variants each of them has; None: none.
    """

    subject: Subject
    subjects: Sequence[Subject | None]
    models: Sequence[Sequence[Model]]
    study: Study | None

    def of_trial(
        self,
        trial: Trial,
        own: Sequence[MarkerMotion],
        solution: xr.Dataset,
        cycles: CycleDetection,
        samples: int,
    ) -> tuple[VariantResults, dict[str, np.ndarray]]:
        """Results of a trial at its solution's samples, NaN where moved points have no motion;
        and measures of a jaw's cycles by moved points, by name (R, C).

        Args:   own: motions of the subject as recorded;  solution, cycles: theirs.
                samples: of the session, about.
        Raises: InputError: where no moved points give motions.
        """
        t, count = solution["time"].values, 1
        if self.study is not None:
            count = Design(self.study.vary, self.study.sampling, ()).count
        each = len(self.subjects), max(map(len, self.models)), count
        shapes = {name: solution[name].shape for name in BANDS if name in solution}
        require_memory(
            16 * math.prod(each) * sum(map(math.prod, shapes.values())),
            f"quantiles of {math.prod(each)} variants at {len(t)} samples take",
            "take fewer registrations, distributions or variants of the study",
        )
        values = {name: np.full((*each, *shape), np.nan) for name, shape in shapes.items()}
        places = len(self.subjects), len(cycles.spans)
        measures = {name: np.full(places, np.nan) for name in JAW_MEASURES}
        problem: InputError | None = None
        for r, (subject, models) in enumerate(zip(self.subjects, self.models, strict=True)):
            if subject is None:
                continue
            try:
                motions = own if subject is self.subject else subject.motions(trial)
                axes = subject.axes(motions[0])
            except InputError as error:
                problem = error
                continue
            times = np.concatenate([motion.motion.t for motion in motions])
            there = np.isin(times, t)
            at = np.searchsorted(t, times[there])
            for c, model in enumerate(models):
                found = self._results(model_for(model, samples), motions)
                for name, array in values.items():
                    array[r, c][:, at] = found.values[name][:, there]
            free = np.concatenate([motion.free for motion in motions])
            for k, row in enumerate(jaw_rows(subject.mechanism, times, free, cycles, axes)):
                for name, value in row.items():
                    measures[name][r, k] = np.nan if value is None else value
        if problem is not None and np.isnan(values["effort"]).all():
            raise problem
        bands = self.subject.recordings.file.bands
        results = VariantResults(
            {name: array.reshape(-1, *array.shape[3:]) for name, array in values.items()},
            {} if self.study is None else self.study.data(),
            {} if bands is None else bands.model_dump(mode="json"),
        )
        moved = bands is not None and bands.registrations > 0
        return results, measures if moved else {}

    def _results(self, model: Model, motions: Sequence[MarkerMotion]) -> VariantResults:
        """Results of a model along the intervals of a trial."""
        point, study = self.subject.recordings.file.solve.load_point, self.study
        solutions = solutions_of(model, motions, point)
        machine, _ = with_load_point(model.mechanism, point)
        if study is None:
            return VariantResults.joined([VariantResults.alone(one) for one in solutions])
        return VariantResults.joined(
            [
                variants_of(one, study, moved.motion, as_load(moved.load), machine)
                for one, moved in zip(solutions, motions, strict=True)
            ]
        )


def solutions_of(
    model: Model, motions: Sequence[MarkerMotion], load_point: str | None
) -> list[xr.Dataset]:
    """A solution of each interval of a trial, with its markers."""
    return [
        solve(model, one.motion, one.load, load_point=load_point, flag=True, measured=one.channels)
        for one in motions
    ]


def distribution_of(file: SessionFile, name: str | None) -> Distribution:
    """The session's, or with another objective, without the numbers that only its own has."""
    how, chosen = file.solve, name or file.solve.distribution
    weight = how.emg_weight if name in (None, "emg_assisted") else 1.0
    known: object = chosen
    return Distribution(known, how.preload, how.contact_weight, weight)  # type: ignore[arg-type]


def session_variants(
    recordings: SessionRecordings, subject: Subject, model: Model, study: Study | None
) -> SessionVariants | None:
    """What [solve]'s `vary` and [bands] ask for; None without either.

    Args:   model: of the subject as recorded, with the session's objective.
    Raises: InputError: for objectives that do not fit the mechanism, and where no moved points
            give a subject.
    """
    file, bands = recordings.file, recordings.file.bands
    if bands is None:
        return None if study is None else SessionVariants(subject, [subject], [[model]], study)
    chosen = [distribution_of(file, name) for name in bands.distributions or (None,)]
    subjects: list[Subject | None] = [subject]
    if bands.registrations:
        subjects, names = [], [*file.places]
        source = np.random.default_rng(bands.seed)
        offsets = source.normal(0.0, file.error, (bands.registrations, len(names), 3))
        turns = source.normal(0.0, 1.0, (bands.registrations, 3)) * file.turn_error
        problem: InputError | None = None
        draws = [*zip(offsets, turns, strict=True)]
        for rows, turn in stepping("registering moved points", draws):
            moved = MovedPlaces(dict(zip(names, rows, strict=True)), turn)
            try:
                subjects.append(subject_of(recordings, moved))
            except InputError as error:
                problem = error
                subjects.append(None)
        if problem is not None and not any(subjects):
            raise problem
    models = [
        [] if one is None else [derive(one.mechanism, distribution=how) for how in chosen]
        for one in subjects
    ]
    return SessionVariants(subject, subjects, models, study)
