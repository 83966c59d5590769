"""Maps of what a mechanism can do at rest, over its independent coordinates."""

from .compute import workspace_map
from .quantities import QUANTITIES

__all__ = ["QUANTITIES", "workspace_map"]
