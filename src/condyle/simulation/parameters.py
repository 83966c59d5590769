"""Parameters: numbers of a law and of loads that may change while they run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..questions.law import Law
from ..questions.load import ActingLoad
from .plan import ClosedLoop, Plan

CONTROLLER = "controller"
WIDE = 4.0  # times its own value that a slider goes to,
MIN_RANGE = {"m": 0.01}  # or so far from 0,
ELSE = 10.0  # or so far


@dataclass(frozen=True)
class Parameter:
    """A number to change; of several, the largest: they are scaled together.

    owner: `CONTROLLER`, or the name of a load;  unit: SI;  value: to begin with;  low, high: ends.
    """

    owner: str
    field: str
    unit: str
    value: float
    low: float
    high: float


def parameters_of(plan: Plan) -> list[Parameter]:
    """All parameters of a plan, those of the controller first."""
    parameters = []
    if isinstance(plan.drive, ClosedLoop):
        parameters += _parameters(CONTROLLER, plan.drive.law, plan.drive.path.force)
    for load in plan.loads:
        parameters += _parameters(load.name, load, np.zeros(1))
    return parameters


def _parameters(owner: str, of: Law | ActingLoad, force: np.ndarray) -> list[Parameter]:
    params = []
    for field, unit in of.parameters.items():
        numbers = force if field == "force" else of.numbers[field]
        value = float(np.max(numbers))
        if not np.isfinite(value):
            continue
        high = WIDE * abs(value) or MIN_RANGE.get(unit, ELSE)
        params.append(Parameter(owner, field, unit, value, -high if field == "rest" else 0.0, high))
    return params


def with_values(plan: Plan, parameters: Sequence[Parameter], values: Sequence[float]) -> Plan:
    """The plan, in which the parameters were found, with other values."""
    drive, loads = plan.drive, list(plan.loads)
    for parameter, value in zip(parameters, values, strict=True):
        if value == parameter.value:
            continue
        if parameter.owner != CONTROLLER:
            loads = [_with(x, parameter, value) if x.name == parameter.owner else x for x in loads]
            continue
        assert isinstance(drive, ClosedLoop)
        if parameter.field == "force":
            path = replace(drive.path, force=_scaled(drive.path.force, value))
            drive = replace(drive, path=path)
        else:
            drive = replace(drive, law=_with(drive.law, parameter, value))
    return replace(plan, drive=drive, loads=tuple(loads))


def _with(of: Any, one: Parameter, value: float) -> Any:
    return replace(of, numbers=of.numbers | {one.field: _scaled(of.numbers[one.field], value)})


def _scaled(numbers: Any, value: float) -> Any:
    """The same, the largest of them `value`; all of them where they are 0."""
    most = float(np.max(numbers))
    return numbers * (value / most) if most else np.full_like(numbers, value)
