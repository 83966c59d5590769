"""Measured motion as laboratories have it: markers of a C3D file, and the pose they give."""

from condyle.motion.markers.beside import Beside, read_beside
from condyle.motion.markers.gaps import Gap
from condyle.motion.markers.marker_file import MarkerFile, read_markers
from condyle.motion.markers.measured import (
    MAX_GAP,
    MAX_RESIDUAL,
    MarkerMotion,
    MarkerResidual,
    from_c3d,
)
from condyle.motion.markers.recording import Recording, read_c3d
from condyle.motion.markers.registration import Registration
from condyle.motion.markers.summary import as_data
from condyle.motion.markers.writing import write_motion

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
