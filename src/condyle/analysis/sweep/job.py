"""A study that was checked against its mechanism: everything that a worker needs."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from ...errors import InputError
from ...mechanism import as_mechanism
from ...mechanism.home import independent_coordinates
from ...mechanism.mechanism import Mechanism
from ...mechanism.study_file import NONE, REFERENCE, TRIAL
from ...model.distributing import Distribution
from ...model.inverse_dynamics import SOLVED
from ...model.model import Model
from ...model.variants import MANY
from ...motion import (
    Load,
    Motion,
    reference_load,
    reference_motion,
    resolve_load_point,
    trial_motion,
    with_load_point,
)
from ...motion.gravity_and_base import each
from ...motion.reference_case import bundled_reference, fits_load, fits_reference
from ...results.variant_solutions import outputs_of
from .measure import Reading, reading
from .sampling import Design
from .study import MotionFile, Study

VARIANT, MOTION, STATUS, REASON, SECONDS = "variant", "motion", "status", "reason", "seconds"
DEFAULT = "masticatory"  # mechanism
OWN = (VARIANT, MOTION, STATUS, REASON, SECONDS)  # columns beside parameters and measures
# Keys of contacts that nothing but a simulation depends on.
OF_SIMULATIONS = ("clearance", "restitution", "static_coefficient")
PARTS = 128  # of a study with enough variants
LEAST_PART, LARGEST_PART = 4, 4096  # variants


@dataclass(frozen=True)
class Job:
    """A study with its mechanism, motions and load, checked.

    wrenches: on the platform, (N, 6) [N, N m], of each motion.
    point: the platform's point that the load acts at, by name; None without a load.
    outputs: of inverse dynamics, which the readings are of.
    """

    study: Study
    mechanism: Mechanism
    motions: tuple[Motion, ...]
    load: Load
    wrenches: tuple[np.ndarray, ...]
    point: str | None
    design: Design
    readings: tuple[Reading, ...] = ()
    outputs: tuple[str, ...] = ()

    @property
    def rows(self) -> int:
        """One for each variant and motion."""
        return self.design.count * len(self.motions)

    @cached_property
    def part(self) -> int:
        """Variants of a part: it depends on the study alone, not on the scheduler."""
        return min(max(LEAST_PART, -(-self.design.count // PARTS)), LARGEST_PART)

    @property
    def parts(self) -> int:
        return -(-self.design.count // self.part)

    def numbers(self, part: int) -> range:
        """Numbers of the variants of a part."""
        return range(part * self.part, min((part + 1) * self.part, self.design.count))

    @property
    def parameters(self) -> tuple[str, ...]:
        return tuple(one.what for one in self.study.vary)

    @property
    def measures(self) -> tuple[str, ...]:
        return tuple(name for one in self.readings for name in one.names)

    def columns(self, rows: np.ndarray) -> dict[str, np.ndarray]:
        """Path -> values, of rows of the design."""
        columns: dict[str, np.ndarray] = {}
        for one, values in zip(self.study.vary, rows.T, strict=True):
            columns[one.what] = values
            columns |= {f.what: f.times * values + f.plus for f in one.mirror}
        return columns

    @cached_property
    def model(self) -> Model:
        """The model of the mechanism itself, whose kernels variants share.

        Raises: as of `condyle.derive`.
        """
        s = self.study
        how: Any = {"formulation": s.formulation, "route": s.route, "backend": s.backend}
        name: Any = s.distribution
        chosen = Distribution(name, s.preload, s.contact_weight)
        return Model(self.mechanism, **how, distribution=chosen)


def prepared(
    study: Study,
    mechanism: Mechanism | str | os.PathLike[str] | None = None,
    motions: tuple[Motion, ...] | None = None,
    load: Load | None = None,
) -> Job:
    """Check a study against its mechanism, read its files, build its kernels.

    Args:   mechanism, motions, load: instead of those that the study names.
    Raises: InputError and others of the library, before any variant is solved.
    """
    machine = as_mechanism(study.mechanism or DEFAULT if mechanism is None else mechanism)
    acting = load or _load(study.load, machine)
    machine, name = with_load_point(machine, study.load_point or acting.point)
    base = tuple(_numbers(study, machine))
    design = Design(study.vary, study.sampling, base)
    design.check()
    paths = _alike(motions or tuple(_motion(file, machine) for file in study.motion))
    if np.any(acting.wrench) or name is not None:
        name = resolve_load_point(name, machine.platform.points)
    wrenches = tuple(acting.at(path.t) for path in paths)
    job = Job(study, machine, paths, acting, wrenches, name, design)
    model = job.model
    given = tuple(dict.fromkeys(name for path in paths for name in path.given))
    readings = tuple(reading(name, entry, model, given) for name, entry in study.measure.items())
    job = replace(job, readings=readings)
    taken = [*OWN, *job.parameters, *job.measures]
    if twice := [n for n in dict.fromkeys(taken) if taken.count(n) > 1]:
        raise InputError(f'study: two columns would be called "{twice[0]}"; rename the measure')
    for path in paths:  # what does not fit the mechanism shows here, and kernels are built
        first_two: Any = {k: getattr(path, k)[:2] for k in ("t", "value", "rate", "acceleration")}
        (q, q1, q2), _ = model.poses.of_motion(replace(path, **first_two))
        around = each(path.given, lambda a: a[:2])
        model.inverse_dynamics(
            q, q1, q2, **around, outputs=SOLVED, threads=1, contacts=study.contacts
        )
    if design.count >= MANY:
        model.variants(job.columns(design.rows(0, MANY)))  # as are those of numbers
    reads = (entry.values for entry in readings)
    needed = SOLVED if study.solutions else outputs_of(model, reads, given)
    return replace(job, outputs=needed)


def _alike(paths: tuple[Motion, ...]) -> tuple[Motion, ...]:
    """Motions whose efforts have the same parts: where one has a moving base, all have."""
    if not any("base" in path.given for path in paths):
        return paths
    return tuple(
        replace(path, base=np.zeros((len(path), 9))) if path.base is None else path
        for path in paths
    )


def _numbers(study: Study, machine: Mechanism) -> Iterator[float]:
    """The mechanism's own numbers at the paths of a study; all of its paths are looked up."""
    seen: set[str] = set()
    for parameter in study.vary:
        for path in (parameter.what, *(follower.what for follower in parameter.mirror)):
            value = machine.get(path)
            if isinstance(value, bool) or not isinstance(value, int | float):
                what = "not set in this mechanism" if value is None else "not a single number"
                hint = f"; name one, such as {path}[0]" if isinstance(value, tuple) else ""
                raise InputError(f"vary {path}: {what}{hint}")
            if path in seen:
                raise InputError(f"vary {path}: is given twice")
            if path.rpartition(".")[2] in OF_SIMULATIONS:
                raise InputError(
                    f"vary {path}: changes simulations alone, of which a sweep has none; simulate "
                    f'the machine at each value, mechanism.set({{"{path}": value}})'
                )
            seen.add(path)
        yield float(machine.get(parameter.what))


def _motion(given: MotionFile, machine: Mechanism) -> Motion:
    options: dict[str, Any] = {"cutoff": given.smooth, "rate": given.rate, "trim": given.trim}
    if given.file in (TRIAL, REFERENCE) and given.units:
        raise InputError(f'motion: "{given.file}" has its own units; leave units out')
    if given.file == TRIAL:
        if given.landmark:
            raise InputError('motion: "trial" has no landmark')
        return trial_motion(machine, **options)
    path, landmark = given.file, given.landmark
    if path == REFERENCE:
        if not fits_reference(machine, landmark):
            names = ", ".join(independent_coordinates(machine))
            raise InputError(
                'motion: "reference" is the path of an incisor for two contacts; '
                f'"{machine.name}" needs a file of t, {names}, or motion = "trial"'
            )
        if not any(options.values()) and landmark is None:
            return reference_motion()
        path, landmark = str(bundled_reference()[0]), landmark or "incisor"
    return Motion.from_csv(path, units=given.units, landmark=landmark, **options)


def _load(given: str | None, machine: Mechanism) -> Load:
    given = given or (REFERENCE if fits_load(machine) else NONE)
    words = {NONE: Load.zero, REFERENCE: reference_load}
    return words[given]() if given in words else Load.from_csv(given)
