"""Sweeps: many variants of one mechanism, from a study file to a table with a row for each."""

from .bands import with_bands
from .study import Study
from .study_folder import open_sweep
from .sweeping import sweep

__all__ = ["Study", "open_sweep", "sweep", "with_bands"]
