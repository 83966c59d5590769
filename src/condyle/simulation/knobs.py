"""Knobs: numbers of a law and of loads that a hand may turn while they run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..questions.law import Law
from ..questions.load import Load
from .plan import ClosedLoop, Plan

CONTROLLER = "controller"
WIDE = 4.0  # times its own value that a knob goes to,
LEAST = {"m": 0.01}  # or so far from 0,
ELSE = 10.0  # or so far


@dataclass(frozen=True)
class Knob:
    """A number to turn; of several, one a coordinate or chain, the largest: they go together.

    owner: `CONTROLLER`, or the name of a load;  unit: SI;  value: to begin with;  low, high: ends.
    """

    owner: str
    field: str
    unit: str
    value: float
    low: float
    high: float


def knobs_of(plan: Plan) -> list[Knob]:
    """All knobs of a plan, those of the controller first."""
    found = []
    if isinstance(plan.drive, ClosedLoop):
        found += _knobs(CONTROLLER, plan.drive.law, plan.drive.path.force)
    for load in plan.loads:
        found += _knobs(load.name, load, np.zeros(1))
    return found


def _knobs(owner: str, of: Law | Load, force: np.ndarray) -> list[Knob]:
    found = []
    for field, unit in of.knobs.items():
        numbers = force if field == "force" else of.numbers[field]
        value = float(np.max(numbers))
        if not np.isfinite(value):
            continue
        high = WIDE * abs(value) or LEAST.get(unit, ELSE)
        found.append(Knob(owner, field, unit, value, -high if field == "rest" else 0.0, high))
    return found


def at(plan: Plan, knobs: Sequence[Knob], values: Sequence[float]) -> Plan:
    """The plan, in which the knobs were found, with them at values."""
    drive, loads = plan.drive, list(plan.loads)
    for knob, value in zip(knobs, values, strict=True):
        if value == knob.value:
            continue
        if knob.owner != CONTROLLER:
            loads = [_with(x, knob, value) if x.name == knob.owner else x for x in loads]
            continue
        assert isinstance(drive, ClosedLoop)
        if knob.field == "force":
            path = replace(drive.path, force=_scaled(drive.path.force, value))
            drive = replace(drive, path=path)
        else:
            drive = replace(drive, law=_with(drive.law, knob, value))
    return replace(plan, drive=drive, loads=tuple(loads))


def _with(of: Any, knob: Knob, value: float) -> Any:
    return replace(of, numbers=of.numbers | {knob.field: _scaled(of.numbers[knob.field], value)})


def _scaled(numbers: Any, value: float) -> Any:
    """The same, the largest of them `value`; all of them where they are 0."""
    most = float(np.max(numbers))
    return numbers * (value / most) if most else np.full_like(numbers, value)
