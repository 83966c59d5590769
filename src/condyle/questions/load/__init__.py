"""Loads of a scenario by kind. A new one is a file that registers its table here."""

from .acting import ActingLoad, Jump, LoadTable
from .food import FOODS, FoodTable
from .given import Constant, Csv
from .spring import Spring
from .unloading import Unloading

LOADS: dict[str, type[LoadTable]] = {
    "constant": Constant,
    "csv": Csv,
    "spring": Spring,
    "food": FoodTable,
    "unloading": Unloading,
}

__all__ = ["FOODS", "LOADS", "ActingLoad", "Jump", "LoadTable"]
