"""Every trial of a session: its motion, its solution, its cycles."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import InputError, ProblemsError
from ...markers import (
    MarkerMotion,
    SessionFile,
    between_trials,
    motion_of,
    registered_places,
)
from ...markers.recorded_tables import read_recording
from ...markers.recording import Recording
from ...markers.session_file import Trial
from ...mechanism import load_mechanism
from ...mechanism.mechanism import Mechanism
from ...mechanism.scaling import ScaledMechanism, scaled_to
from ...model.distributing import Distribution
from ...model.model import Model, derive
from ...progress import stepping
from ...results.solving import solve
from ..run_motion import study_for
from ..sweep import Study, with_bands
from .cycle_finding import CycleDetection, find_cycles
from .cycle_measures import complete_spans, cycle_rows
from .subject_eminence import SubjectEminence, subject_eminence

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True, eq=False)
class SolvedTrial:
    """A trial: what was recorded, the solution with markers and EMG, and its cycles.

    rows: one a cycle, with the trial's name and words.
    moved: distance of the fixed markers in {S} from where the subject's first trial has them, root
    mean square [m]: points that were registered elsewhere than the markers were; None of the first.
    """

    trial: Trial
    motion: MarkerMotion
    solution: xr.Dataset
    found: CycleDetection
    rows: list[dict[str, Any]]
    moved: float | None = None

    @cached_property
    def whole(self) -> np.ndarray:
        """Start and end of the cycles that count for means: all their samples have a result."""
        return complete_spans(self.solution, self.found.spans)


@dataclass(frozen=True, eq=False)
class SolvedSession:
    """All trials of a session.

    mechanism: scaled to the subject, where `scaled` says so, and with its `eminence`.
    warnings: each once.
    """

    file: SessionFile
    mechanism: Mechanism
    scaled: ScaledMechanism | None
    trials: tuple[SolvedTrial, ...]
    warnings: tuple[str, ...] = field(default=())
    eminence: SubjectEminence | None = None


def solve_session(file: SessionFile) -> SolvedSession:
    """Motions, solutions and cycles of all trials.

    Raises: InputError: for recordings that cannot be used, named by the trial.
    """
    machine = load_mechanism(file.mechanism)
    named = [path for trial in file.trials for path in (trial.file, trial.channels) if path]
    named += [] if file.static is None else [file.static.file]
    if missing := [path for path in named if not os.path.isfile(path)]:
        raise ProblemsError("session", [f"{path}: no such file" for path in missing])
    static = None if file.static is None else read_recording(file.static.file, file.unit)
    scaled, warnings = None, list[str]()
    if file.scale is not None:
        scaled = _scaled(file, machine, static)
        machine = scaled.mechanism
        warnings += scaled.warnings
    eminence = subject_eminence(file, machine, lambda trial, on: [_motion(trial, on, file, static)])
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
            warnings += odd
        trials.append(solved)
        said = [
            *solved.motion.warnings,
            *(notice.text for notice in solved.solution.condyle.notices),
        ]
        warnings += [w if trial.name in w else f"{trial.name}: {w}" for w in said]
        if file.cycles is not None and not len(solved.found.spans):
            warnings.append(f"{trial.name}: no cycles by {file.cycles.by} were found in it")
    each = tuple(dict.fromkeys(warnings))
    return SolvedSession(file, machine, scaled, tuple(trials), each, eminence)


def _scaled(file: SessionFile, machine: Mechanism, static: Recording | None) -> ScaledMechanism:
    """The mechanism scaled to the places that the static trial, or else the first, gives."""
    assert file.scale is not None
    there = static or read_recording(file.trials[0].file, file.unit)
    places = registered_places(there, file, machine, static)
    wanted = {name: places[name] for name in file.scale.landmarks}
    return scaled_to(machine, wanted, file.scale.kind)


def _motion(
    trial: Trial, machine: Mechanism, file: SessionFile, static: Recording | None
) -> MarkerMotion:
    return motion_of(
        read_recording(trial.file, file.unit, trial.channels),
        file,
        machine,
        static=static,
        max_residual=file.filter.max_residual,
        max_gap=file.filter.max_gap,
        longest=file.filter.longest,
        cutoff=file.filter.cutoff,
    )


def _solved(
    trial: Trial, file: SessionFile, model: Model, static: Recording | None, study: Study | None
) -> SolvedTrial:
    found = _motion(trial, model.mechanism, file, static)
    load, point = found.load, file.solve.load_point
    channels = found.channels
    solution = solve(model, found.motion, load, load_point=point, flag=True, measured=channels)
    said = [*found.warnings, *solution.condyle.warnings]
    if study is not None:
        from ...motion import as_load

        acting = as_load(load)
        solution = with_bands(solution, study, found.motion, acting, mechanism=model.mechanism)
    solution.attrs["warnings"] = json.dumps(list(dict.fromkeys(said)))
    cycles = find_cycles(file.cycles, solution, found)
    words = {"trial": trial.name, **{w: trial.words.get(w) for w in file.words}}
    by = None if file.cycles is None else file.cycles.by
    rows = [words | row for row in cycle_rows(solution, cycles, by)]
    return SolvedTrial(trial, found, solution, cycles, rows)
