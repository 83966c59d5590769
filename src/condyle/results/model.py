"""An older place, until every room has taken the new one."""

from ..model.model import Model, derive

__all__ = ["Model", "derive"]
