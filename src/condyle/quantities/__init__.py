"""Quantities: one row each, which results, tables, exports, derivatives, figures and docs read."""

from .quantity import Quantity, named_columns, register, row, variables
from .quantity_rows import QUANTITIES

__all__ = ["QUANTITIES", "Quantity", "named_columns", "register", "row", "variables"]
