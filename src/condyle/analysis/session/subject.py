"""The subject of a session: what was recorded, and the mechanism that it makes this person's."""

from __future__ import annotations

import os
from dataclasses import dataclass
from functools import partial

import numpy as np

from ...errors import InputError, ProblemsError
from ...markers import (
    MarkerMotion,
    Recording,
    Registration,
    SessionFile,
    motions_of,
    places_at_home,
    registered_places,
    with_moved_places,
    with_mvc,
)
from ...markers.marker_motion import MovedPlaces
from ...markers.recorded_tables import read_recording
from ...markers.session_file import Trial
from ...mechanism import load_mechanism
from ...mechanism.mechanism import Mechanism
from ...mechanism.scaling import ScaledMechanism, scaled_to
from .jaw_measures import skull_axes
from .subject_eminence import SubjectEminence, subject_eminence


class SessionRecordings:
    """Recordings of a session, each read once.

    static: the static trial; None where trials are at home themselves.
    """

    def __init__(self, file: SessionFile) -> None:
        """Raises: InputError: for files that are not there, and maximal contractions that cannot
        be used."""
        named = [path for trial in file.trials for path in (trial.file, trial.channels) if path]
        named += [] if file.static is None else [file.static.file]
        named += [] if file.emg is None else file.emg.mvc_files
        if missing := [path for path in named if not os.path.isfile(path)]:
            raise ProblemsError("session", [f"{path}: no such file" for path in missing])
        self.file = file
        self._by_subject = {
            subject: with_mvc(file, subject)
            for subject in dict.fromkeys(trial.subject for trial in file.trials)
        }
        self.static: Recording | None = None
        if file.static is not None:
            self.static = read_recording(file.static.file, file.unit)
        self._read: dict[str, Recording] = {}

    def of(self, trial: Trial) -> Recording:
        if trial.name not in self._read:
            self._read[trial.name] = read_recording(trial.file, self.file.unit, trial.channels)
        return self._read[trial.name]

    def file_of(self, trial: Trial, moved: MovedPlaces | None) -> SessionFile:
        """The session file with what counts as 1 of this trial's EMG, and registered points moved
        in the laboratory at home (3,) [m]."""
        file = self._by_subject[trial.subject]
        if moved is None:
            return file
        return with_moved_places(file, self.of(trial), self.static, moved)


@dataclass(frozen=True, eq=False)
class Subject:
    """The mechanism as the recordings have it.

    mechanism: scaled to the subject, where `scaled` says so, and with its `eminence`.
    registered: on the mechanism before it was scaled; None where it was not.
    moved: errors of the registered points; None as recorded.
    """

    recordings: SessionRecordings
    mechanism: Mechanism
    scaled: ScaledMechanism | None = None
    registered: Registration | None = None
    eminence: SubjectEminence | None = None
    moved: MovedPlaces | None = None

    def motions(self, trial: Trial, on_contacts: bool = True) -> list[MarkerMotion]:
        """One of each interval between gaps."""
        file = self.recordings.file_of(trial, self.moved)
        return motions_of(
            self.recordings.of(trial),
            file,
            self.mechanism,
            static=self.recordings.static,
            max_residual=file.filter.max_residual,
            max_gap=file.filter.max_gap,
            keep="longest" if file.filter.longest else "all",
            cutoff=file.filter.cutoff,
            trim=file.trim,
            on_contacts=on_contacts,
        )

    def axes(self, motion: MarkerMotion) -> np.ndarray:
        """Forward, left and up of the skull's plane of reference in {S}, (3, 3)."""
        file = self.recordings.file
        if file.plane is None:
            return np.eye(3)
        places = places_at_home(file.plane.places, motion, file, self.recordings.static)
        return skull_axes(file.plane, self.mechanism, places)


def subject_of(recordings: SessionRecordings, moved: MovedPlaces | None = None) -> Subject:
    """The subject by the places that were recorded, or by others near them.

    Raises: InputError: for recordings that cannot be used, or that no such subject fits.
    """
    file = recordings.file
    machine, scaled, registered = load_mechanism(file.mechanism), None, None
    if file.scale is not None:
        scaled, registered = _scaled(recordings, machine, moved)
        machine = scaled.mechanism
    plain = Subject(recordings, machine, scaled, registered, None, moved)
    eminence = subject_eminence(file, machine, partial(plain.motions, on_contacts=False))
    machine = machine if eminence is None else eminence.mechanism
    return Subject(recordings, machine, scaled, registered, eminence, moved)


def _scaled(
    recordings: SessionRecordings, machine: Mechanism, moved: MovedPlaces | None
) -> tuple[ScaledMechanism, Registration]:
    """The mechanism scaled to the places that the static trial, or else the first, gives."""
    first, static = recordings.file.trials[0], recordings.static
    file, scale = recordings.file_of(first, moved), recordings.file.scale
    assert scale is not None
    there = static or recordings.of(first)
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
