"""What several commands do first and last."""

from __future__ import annotations

import math
import re
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import InputError
from ..extras import require

if TYPE_CHECKING:
    from ..analysis.sweep import Study
    from ..mechanism import Mechanism
    from ..model.model import Model
    from ..motion import Load, Motion


def motion_and_load(
    machine: Mechanism,
    motion: Path | None,
    load: Path | None,
    units: str | None = None,
    landmark: str | None = None,
    smooth: str | None = None,
    rate: float | None = None,
    trim: float = 0.0,
) -> tuple[Motion, Load]:
    """The files named; without a motion the reference case, or a trial motion."""
    from ..mechanism.home import independent_coordinates
    from ..motion import Load, Motion, bundled_reference, resolve_landmark, trial_motion
    from ..motion.reference_case import fits_reference

    if motion is None and units is not None:
        raise InputError("--units is for a motion of your own; name it with --motion")
    reference_path, reference_load = bundled_reference()
    reference = motion is None and fits_reference(machine, landmark)
    if motion is None and landmark is not None and not reference:
        raise InputError(
            f"--landmark {landmark}: the bundled path is for two contacts; "
            f'"{machine.name}" has {len(machine.contacts)}. Name a motion of t, x, y, z with '
            "--motion"
        )
    if load is not None:
        acting = Load.from_csv(load)
    else:
        acting = Load.from_csv(reference_load) if reference else Load.zero()
    if motion is None and not reference:
        warn(
            [
                f'no --motion: "{machine.name}" is given a trial motion (synthetic) that sways '
                f"{', '.join(independent_coordinates(machine))} about home"
            ]
        )
        return trial_motion(machine, cutoff=smooth, rate=rate, trim=trim), acting
    path = Motion.from_csv(
        motion or reference_path,
        units=units,
        landmark=landmark,
        cutoff=smooth,
        rate=rate,
        trim=trim,
    )
    if path.kind == "landmark":
        path = replace(path, landmark=resolve_landmark(landmark, machine.platform.points))
    return path, acting


def chosen_model(
    machine: Mechanism,
    formulation: str,
    route: str,
    backend: str,
    distribution: str | None,
    preload: float,
    contact_weight: float,
) -> Model:
    """A model whose efforts are chosen as the options say.

    Args: contact_weight: W; the library takes W / N_ref^2.
    """
    import condyle

    weight = weight_of(machine, contact_weight)
    return condyle.derive(machine, formulation, route, backend, distribution, preload, weight)


def weight_of(machine: Mechanism, contact_weight: float) -> float:
    """W / N_ref^2 [1/N^2] of W.

    Raises: InputError: unless W is a number of at least 0.
    """
    from ..model.distributing import reference_force

    if not (math.isfinite(contact_weight) and contact_weight >= 0):
        raise InputError(
            f"--contact-weight: expected a number of at least 0, got {contact_weight:g}"
        )
    return contact_weight / reference_force(machine) ** 2


def study_for(path: Path, machine: Mechanism) -> Study:
    """The study of a file, whose numbers are to vary in a mechanism.

    Raises: InputError: for a file that is none, or that names another mechanism.
    """
    import condyle

    from ..analysis.sweep import read_study

    study = read_study(path)
    if study.mechanism is not None and condyle.load_mechanism(study.mechanism) != machine:
        raise InputError(
            f'--vary {path}: the study is of "{study.mechanism}", the run of "{machine.name}"; '
            "name one of them in both, or leave it out of the study"
        )
    return study


def output_folder(path: Path) -> Path:
    """Make the folder for results.

    Raises: InputError: if it cannot be one.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"--out {path}: cannot be made a folder for results ({error.strerror})"
        ) from error
    return path


def file_stem(name: str) -> str:
    """The name of a mechanism as the beginning of a file name: no way out of the folder."""
    return re.sub(r"[^\w.+-]+", "_", name)


def require_drawing(figures: bool, report: bool) -> None:
    """Raises MissingExtraError before minutes pass, if what draws them is not installed."""
    if figures:
        require("matplotlib", "figures")
    if report:
        require("plotly", "report")


def warn(warnings: list[str]) -> None:
    """Warnings on stderr, so that they never mix with results."""
    for warning in dict.fromkeys(warnings):
        print(f"condyle: warning: {warning}", file=sys.stderr)
