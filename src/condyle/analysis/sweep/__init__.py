"""Sweeps: many variants of one mechanism, from a study file to a table with a row for each."""

from .bands import with_bands
from .study import Study, json_schema, read_study
from .study_folder import open_sweep
from .sweeping import sweep

__all__ = ["Study", "json_schema", "open_sweep", "read_study", "sweep", "with_bands"]
