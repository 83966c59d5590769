"""Loads of a scenario by kind. A new one is a file that registers its table here."""

from ...mechanism.kinds import Kinds
from .acting import ActingLoad, Jump, LoadTable
from .food import FOODS, FoodTable
from .given import Constant, Csv
from .spring import Spring
from .unloading import Unloading

LOADS = Kinds[LoadTable]("condyle.loads", Constant, Csv, Spring, FoodTable, Unloading)

__all__ = ["FOODS", "LOADS", "ActingLoad", "Jump", "LoadTable"]
