"""Many variants of one mechanism: studies, from their file to a table with a row for each."""

from .bands import with_bands
from .study import Study, json_schema, read_study
from .study_folder import read as read_sweep
from .sweeping import sweep

__all__ = ["Study", "json_schema", "read_study", "read_sweep", "sweep", "with_bands"]
