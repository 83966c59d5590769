"""JSON schemas of the files that people write."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from ..errors import InputError, did_you_mean, shown

KINDS = {
    "mechanism": "mechanism:json_schema",
    "scenario": "simulation:scenario_schema",
    "session": "markers.session_file:json_schema",
    "study": "analysis.sweep:json_schema",
    "design": "analysis.design:json_schema",
    "optimise": "optimisation.optimal_motion:json_schema",
    "path": "optimisation.path_study:json_schema",
    "fit": "identification.fit_study:json_schema",
    "excitation": "identification.excite:json_schema",
    "calibration": "identification.calibration_study:json_schema",
}


def schema(of: str = "mechanism") -> dict[str, Any]:
    """The JSON schema of a kind of file, for editors.

    Args:   of: mechanism, scenario, session, study (of a sweep), design, optimise, path, fit,
            excitation or calibration.
    Raises: InputError: for another kind of file.
    """
    if not isinstance(of, str) or of not in KINDS:
        raise InputError(f"of: expected a kind of file, got {shown(of)}.{did_you_mean(of, KINDS)}")
    module, _, made = KINDS[of].partition(":")
    return getattr(import_module(f"..{module}", __package__), made)()
