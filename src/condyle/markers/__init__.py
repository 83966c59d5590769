"""Measured motion as laboratories have it: markers of a C3D file, and the pose they give."""

from .emg import with_mvc
from .marker_file import MarkerFile
from .marker_gaps import Gap
from .marker_motion import (
    MAX_GAP,
    MAX_RESIDUAL,
    MarkerMotion,
    MarkerResidual,
    motion_from_c3d,
    motions_of,
    places_at_home,
    registered_places,
    with_moved_places,
)
from .marker_report import as_data, write_motion
from .measured_channels import MeasuredChannels, read_channels
from .recording import Recording, read_c3d
from .registration import Registration
from .session_file import SessionFile
from .trial_checks import between_trials

__all__ = [
    "MAX_GAP",
    "MAX_RESIDUAL",
    "Gap",
    "MarkerFile",
    "MarkerMotion",
    "MarkerResidual",
    "MeasuredChannels",
    "Recording",
    "Registration",
    "SessionFile",
    "as_data",
    "between_trials",
    "motion_from_c3d",
    "motions_of",
    "places_at_home",
    "read_c3d",
    "read_channels",
    "registered_places",
    "with_moved_places",
    "with_mvc",
    "write_motion",
]
