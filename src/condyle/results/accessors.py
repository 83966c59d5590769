"""An older place, until every room has taken the new one."""

from ..accessors import extend, register

__all__ = ["extend", "register"]
