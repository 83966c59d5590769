"""An older name of the model, until every room has taken the new one."""

from __future__ import annotations

from .model import Model, with_point
from .model import Model as Evaluator
from .system import check_home

__all__ = ["Evaluator", "Model", "check_home", "with_point"]
