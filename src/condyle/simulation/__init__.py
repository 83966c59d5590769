"""Forward in time: integrators, events, loads that answer, controllers, sensors."""

from ..questions.law import CONTROLLERS
from ..questions.load import FOODS, LOADS
from .events import Event
from .integrators import INTEGRATORS
from .scenario import Scenario, load_scenario
from .simulating import check_gains, simulate

__all__ = [
    "CONTROLLERS",
    "FOODS",
    "INTEGRATORS",
    "LOADS",
    "Event",
    "Scenario",
    "check_gains",
    "load_scenario",
    "simulate",
]
