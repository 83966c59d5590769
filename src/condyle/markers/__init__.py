"""Measured motion as laboratories have it: markers of a C3D file, and the pose they give."""

from .marker_file import MarkerFile, read_markers
from .marker_gaps import Gap
from .marker_motion import (
    MAX_GAP,
    MAX_RESIDUAL,
    MarkerMotion,
    MarkerResidual,
    from_c3d,
)
from .marker_report import as_data, write_motion
from .measured_channels import Beside, read_beside
from .recording import Recording, read_c3d
from .registration import Registration

__all__ = [
    "MAX_GAP",
    "MAX_RESIDUAL",
    "Beside",
    "Gap",
    "MarkerFile",
    "MarkerMotion",
    "MarkerResidual",
    "Recording",
    "Registration",
    "as_data",
    "from_c3d",
    "read_beside",
    "read_c3d",
    "read_markers",
    "write_motion",
]
