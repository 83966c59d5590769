"""Simulations: a controller at 1 kHz on a plant in steps of 0.1 ms, in compiled code."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

import numpy as np

from condyle.mechanism.mechanism import Mechanism
from condyle.model.model import Model
from condyle.simulation import simulate
from condyle.simulation.bind import bind
from condyle.simulation.plan import Plan
from condyle.simulation.running import run
from condyle.simulation.scenario import Scenario

from .rows import Probe

LOOP = "a second of computed torque at 1 kHz, plant at 10 kHz"
CHEW = "five seconds of it with food, to a solution"
FOOD = {"kind": "food", "food": "bolus", "point": "right_molar"}


def simulation_probes(mechanism: Mechanism) -> Iterator[Probe]:
    """Seconds a second of motion; errors are those of the last state, against half the step."""
    model = Model(mechanism, backend="compiled")

    def plan(step: float = 1e-4, **told: Any) -> Plan:
        return bind(model, Scenario.read(_scenario(step, 1.0, **told)))

    cases: dict[str, dict[str, Any]] = {LOOP: {}, f"{LOOP}, with food": {"load": [FOOD]}}
    for label, told in cases.items():
        coarse, fine = plan(**told), plan(5e-5, **told)
        off = float(np.abs(run(coarse).state[-1] - run(fine).state[-1]).max())

        def timed(own: Plan = coarse) -> float:
            start = time.perf_counter()
            run(own)
            return time.perf_counter() - start

        yield Probe(f"{mechanism.name}: {label}", timed, off)

    def chewed() -> float:
        start = time.perf_counter()
        simulate(model, _scenario(1e-4, 5.0, load=[FOOD]))
        return time.perf_counter() - start

    yield Probe(f"{mechanism.name}: {CHEW}", chewed, 0.0)


def _scenario(step: float, duration: float, **told: Any) -> dict[str, Any]:
    controller = {"kind": "computed_torque", "stiffness": 400.0, "rate": 1000.0}
    base = {"duration": duration, "rate": 1000.0, "method": "rk4", "step": step}
    return {**base, "controller": controller, **told}
