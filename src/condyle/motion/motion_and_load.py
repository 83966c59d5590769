"""Which motion a run follows under which load: the files given, or bundled ones that fit."""

from __future__ import annotations

import os
from dataclasses import replace
from typing import Any

from ..errors import InputError
from ..mechanism.home import independent_coordinates
from ..mechanism.mechanism import Mechanism
from .path import Motion, as_motion
from .platform_load import Load, as_load
from .points import resolve_landmark
from .reference_case import bundled_reference, fits_load, fits_reference, trial_motion


def motion_and_load(
    mechanism: Mechanism,
    motion: Any = None,
    load: Any = None,
    *,
    units: str | None = None,
    landmark: str | None = None,
    smooth: float | str | None = None,
    rate: float | None = None,
    trim: float = 0.0,
    fit: bool = False,
) -> tuple[Motion, Load]:
    """A motion and a load: those given, else the bundled ones, else a trial motion and no load.

    The bundled chewing path and bite force go together, and fit two contacts and a landmark.

    Args:   motion: a file, or a `Motion`;  load: likewise.
            units, landmark, smooth, rate, trim: how the file of a motion is read, as of
            `Motion.from_csv`; of another motion none can be given.
            fit: whole poses are moved onto the contacts, as of `fit_motion`.
    Raises: InputError: for options that do not fit the motion.
    """
    if motion is None and units is not None:
        raise InputError("--units (units=...) requires --motion: the bundled motion has its units")
    if motion is None and fit:
        raise InputError("--fit (fit=True) requires --motion: a motion of whole poses")
    bundled = motion is None and fits_reference(mechanism, landmark)
    if motion is None and landmark is not None and not bundled:
        raise InputError(
            f"--landmark {landmark}: the bundled path is for two contacts; "
            f'"{mechanism.name}" has {len(mechanism.contacts)}. Name a motion of t, x, y, z with '
            "--motion"
        )
    path, force = bundled_reference()
    acting = as_load(force if load is None and bundled and fits_load(mechanism) else load)
    how: dict[str, Any] = {"cutoff": smooth, "rate": rate, "trim": trim}
    if motion is None and not bundled:
        swaying = ", ".join(independent_coordinates(mechanism))
        said = f'no --motion: "{mechanism.name}" follows a trial motion (synthetic) that sways '
        return replace(
            trial_motion(mechanism, **how), warnings=(f"{said}{swaying} about home",)
        ), acting
    given = path if motion is None else motion
    if not isinstance(given, str | os.PathLike):
        if units or landmark or any(how.values()):
            raise InputError(
                "units, landmark, smooth, rate and trim are for the file of a motion; give them to "
                "Motion.from_arrays"
            )
        record = as_motion(given)
        return (_fitted(mechanism, record) if fit else record), acting
    if fit:
        measured = Motion.from_csv(given, units=units, landmark=landmark)
        return _fitted(mechanism, measured, **how), acting
    record = Motion.from_csv(given, units=units, landmark=landmark, **how)
    if record.kind == "landmark":
        record = replace(record, landmark=resolve_landmark(landmark, mechanism.platform.points))
    return record, acting


def _fitted(mechanism: Mechanism, motion: Motion, **how: Any) -> Motion:
    from .nearest_pose import fit_motion  # kernels: most runs need none of it

    return fit_motion(mechanism, motion, **how)
