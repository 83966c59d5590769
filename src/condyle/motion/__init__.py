"""Paths and loads: from files and arrays to clean samples, and tables back to files."""

from .column_units import FORCE, LANDMARK, MOMENT, POSE, Units, parse_units
from .motion_and_load import motion_and_load
from .number_table import NumberTable
from .path import Motion, as_motion
from .platform_load import Load, as_load
from .points import load_place, resolve_landmark, resolve_load_point, with_load_point
from .reference_case import (
    bundled_reference,
    reference_load,
    reference_motion,
    trial_motion,
    write_reference,
)
from .smoothing import AUTO_CUTOFF, Smoothing
from .table_reader import iter_table, read_table
from .table_writer import TableWriter, write_table

__all__ = [
    "AUTO_CUTOFF",
    "FORCE",
    "LANDMARK",
    "MOMENT",
    "POSE",
    "Load",
    "Motion",
    "NumberTable",
    "Smoothing",
    "TableWriter",
    "Units",
    "as_load",
    "as_motion",
    "bundled_reference",
    "iter_table",
    "load_place",
    "motion_and_load",
    "parse_units",
    "read_table",
    "reference_load",
    "reference_motion",
    "resolve_landmark",
    "resolve_load_point",
    "trial_motion",
    "with_load_point",
    "write_reference",
    "write_table",
]
