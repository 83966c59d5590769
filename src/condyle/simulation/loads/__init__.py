"""Loads of a scenario by kind. A new one is a file that registers its table here."""

from .base import BoundLoad, Jump, LoadTable
from .constant import Constant
from .csv import Csv
from .food import FOODS, FoodTable
from .function import BoundFunction
from .spring import Spring

LOADS: dict[str, type[LoadTable]] = {
    "constant": Constant,
    "csv": Csv,
    "spring": Spring,
    "food": FoodTable,
}

__all__ = ["FOODS", "LOADS", "BoundFunction", "BoundLoad", "Jump", "LoadTable"]
