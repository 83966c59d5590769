"""The main job: efforts and contact forces of a mechanism along a motion, under a load."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..backends.choose import BackendName
from ..distribution import ObjectiveName
from ..dynamics import FormulationName, Route
from ..errors import InputError
from ..mechanism import Mechanism, as_mechanism, load_mechanism
from ..model.distributing import Distribution
from ..model.model import Contacts, derive
from ..motion import motion_and_load, with_load_point
from ..results.accuracy import max_error_of, require_accuracy
from ..results.enclosures import count_of
from ..results.enclosures import prove as proven

if TYPE_CHECKING:
    import xarray as xr

    from .sweep import Study


def run(
    mechanism: Any = "masticatory",
    motion: Any = None,
    load: Any = None,
    *,
    load_point: str | None = None,
    formulation: FormulationName = "virtual_power",
    route: Route = "core",
    backend: BackendName = "auto",
    threads: int | None = None,
    distribution: ObjectiveName | Distribution | None = None,
    reactions: bool = False,
    flag: bool = False,
    max_error: float | None = None,
    prove: int | None = None,
    measured: str | Path | None = None,
    vary: Study | str | Path | None = None,
    contacts: Contacts = "kept",
    **reading: Any,
) -> xr.Dataset:
    """Inverse dynamics along a motion, as `condyle run` does it.

    Args:   mechanism: one, a model, the path of a file, or the name of a bundled one.
            motion, load: files or arrays; default: the bundled chewing path and bite force where
                they fit, else a trial motion without a load.
            load_point: platform point at which the load acts, as of `Model.solve`.
            formulation, route, backend, distribution: as of `derive`.
            reactions, flag, threads: as of `Model.solve`.
            max_error: largest bound of the relative error that is accepted; with it tables have a
                column bound.
            prove: number of samples whose digits are proven by interval arithmetic (takes mpmath).
            measured: markers and EMG to keep with the results, and for `emg`, `emg_assisted`.
            vary: study (TOML) whose numbers vary: also quantiles of efforts, contact forces and
            pressures.
            contacts: kept on their surfaces, or compliant: those with `compliance` yield to their
            forces, quasi-statically.
            reading: units, landmark, smooth, rate, trim: how the file of a motion is read; fit:
            whole poses are moved onto the contacts.
    Raises: CondyleError: for input that cannot be used, or samples that cannot be computed.
    """
    machine, load_point = with_load_point(as_mechanism(mechanism), load_point)
    max_error = max_error_of(max_error)
    prove = count_of(prove)
    study = None if vary is None else study_for(vary, machine)
    if contacts != "kept" and prove is not None:
        raise InputError('contacts: proofs (prove) are of contacts that are "kept"; leave them out')
    path, acting = motion_and_load(machine, motion, load, **reading)
    model = derive(
        machine, formulation=formulation, route=route, distribution=distribution, backend=backend
    )
    solution = model.solve(
        path,
        acting,
        load_point=load_point,
        flag=flag,
        reactions=reactions,
        threads=threads,
        measured=measured,
        contacts=contacts,
    )
    if max_error is not None:
        require_accuracy(solution["bound"].values, max_error, solution["time"].values)
        solution["bound"].attrs["max_error"] = max_error
    if prove is not None:
        solution.attrs["proof"] = json.dumps(
            [asdict(one) for one in proven(model, solution, prove)]
        )
    if study is not None:
        from .sweep import with_bands

        solution = with_bands(solution, study, path, acting, mechanism=machine, workers=threads)
    said = [*path.warnings, *acting.warnings, *solution.condyle.warnings]
    solution.attrs["warnings"] = json.dumps(said)
    return solution


def study_for(given: Study | str | Path, machine: Mechanism) -> Study:
    """The study whose numbers are to vary in a mechanism.

    Raises: InputError: for another file, or one that names another mechanism.
    """
    from .sweep import Study

    study = Study.read(given)
    if study.mechanism is not None and load_mechanism(study.mechanism) != machine:
        raise InputError(
            f'--vary (vary=...): the study is of "{study.mechanism}", the run of "{machine.name}"; '
            "name the same mechanism in both, or leave it out of the study"
        )
    return study
