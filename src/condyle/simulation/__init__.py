"""Forward in time: integrators, events, loads that answer, controllers, sensors."""

from .controllers import CONTROLLERS
from .events import Event
from .integrators import INTEGRATORS
from .loads import FOODS, LOADS
from .scenario import Scenario, load_scenario, scenario_schema
from .simulating import simulate, simulate_all

__all__ = [
    "CONTROLLERS",
    "FOODS",
    "INTEGRATORS",
    "LOADS",
    "Event",
    "Scenario",
    "load_scenario",
    "scenario_schema",
    "simulate",
    "simulate_all",
]
