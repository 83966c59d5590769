"""Maps of what a mechanism can do at rest, over its independent coordinates."""

from .compute import workspace_map
from .map_files import open_map
from .map_quantities import QUANTITIES
from .map_size import WorkspaceSize, workspace_size

__all__ = ["QUANTITIES", "WorkspaceSize", "open_map", "workspace_map", "workspace_size"]
