"""Paths and loads: from files and arrays to clean samples, and tables back to files."""

from condyle.motion.columns import Table
from condyle.motion.load import Load, as_load
from condyle.motion.markers import Beside, MarkerMotion, from_c3d, read_beside
from condyle.motion.path import Motion, as_motion
from condyle.motion.points import resolve_landmark, resolve_load_point
from condyle.motion.reference import (
    bundled_reference,
    reference_load,
    reference_motion,
    write_reference,
)
from condyle.motion.smoothing import AUTO_CUTOFF, Smoothing
from condyle.motion.table import iter_table, read_table
from condyle.motion.table_writer import TableWriter, write_table
from condyle.motion.trial import trial_motion
from condyle.motion.units import FORCE, LANDMARK, MOMENT, POSE, Units, parse_units

__all__ = [
    "AUTO_CUTOFF",
    "FORCE",
    "LANDMARK",
    "MOMENT",
    "POSE",
    "Beside",
    "Load",
    "MarkerMotion",
    "Motion",
    "Smoothing",
    "Table",
    "TableWriter",
    "Units",
    "as_load",
    "as_motion",
    "bundled_reference",
    "from_c3d",
    "iter_table",
    "parse_units",
    "read_beside",
    "read_table",
    "reference_load",
    "reference_motion",
    "resolve_landmark",
    "resolve_load_point",
    "trial_motion",
    "write_reference",
    "write_table",
]
