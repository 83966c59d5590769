"""The public function: a model and a scenario in, a solution out."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import xarray as xr

from ..errors import InputError
from ..mechanism.mechanism import Mechanism
from ..model.model import Model, derive
from ..motion import Motion
from .bind import bind
from .running import run, run_all
from .scenario import Scenario, load_scenario, scenario_from
from .simulated import solved


def simulate(
    model: Model | Mechanism | str | os.PathLike[str],
    scenario: Scenario | Mapping[str, Any] | str | os.PathLike[str] | None = None,
    *,
    controller: Callable[..., Any] | None = None,
    loads: Sequence[Any] = (),
    motion: Motion | None = None,
    stop_at_bounds: bool = False,
    source: str | None = None,
) -> xr.Dataset:
    """Forward in time: what a mechanism does under efforts or a controller, and under loads.

    Args:   model: a model, a mechanism, or one by its file or name.
            scenario: a `Scenario`, its file, or its tables in SI; default: 1 s without efforts.
            controller: (measured, reference) -> efforts (n,), in the place of the scenario's law.
            loads: functions (t, s, v) -> force (3,) or force and moment (6,) in {S} at O_M, or
            pairs (function, name of a point), besides those of the scenario; s is the point's
            displacement from home and v its velocity, (3,) each.
            motion: to follow, in the place of the controller's.
            stop_at_bounds: end where a contact reaches the end of its surface.
            source: what messages call the scenario; default: its file.
    Returns: a solution at `rate`, up to what ended the run; `events` says what happened.
    Raises: ScenarioError: for a scenario with anything wrong, or that does not fit.
    """
    start = time.perf_counter()
    if source is None:
        source = os.fspath(scenario) if isinstance(scenario, str | os.PathLike) else "scenario"
    told = as_scenario(scenario)
    if not isinstance(model, Model):
        model = derive(model)
    plan = bind(
        model,
        told,
        controller=controller,
        loads=loads,
        motion=motion,
        stop_at_bounds=stop_at_bounds,
        source=source,
    )
    trace = run(plan)
    return solved(plan, trace, told, source, start)


def simulate_all(
    model: Model | Mechanism | str | os.PathLike[str],
    scenarios: Iterable[Scenario | Mapping[str, Any] | str | os.PathLike[str]],
    threads: int | None = None,
) -> list[xr.Dataset]:
    """Simulations of one model, side by side; see `simulate`.

    Runs of method `rk4` that differ in numbers alone (gains, starts, loads, paths, limits, files)
    are compiled code in lockstep, which share the processors; others take turns.

    Args:   threads: at most so many; default: the processors at hand. Results do not depend on it.
    Returns: solutions in the scenarios' order.
    Raises: ScenarioError: for a scenario with anything wrong, before any of them runs.
    """
    start = time.perf_counter()
    if not isinstance(model, Model):
        model = derive(model)
    told = [as_scenario(scenario) for scenario in scenarios]
    plans = [bind(model, one, source=f"scenario {i + 1}") for i, one in enumerate(told)]
    traces = run_all(plans, threads)
    return [
        solved(plan, trace, one, f"scenario {i + 1}", start)
        for i, (plan, trace, one) in enumerate(zip(plans, traces, told, strict=True))
    ]


def as_scenario(given: Any) -> Scenario:
    """A scenario from what people give for one.

    Raises: InputError: for anything else;  ScenarioError: for one with anything wrong.
    """
    if isinstance(given, Scenario):
        return given
    if given is None:
        return Scenario()
    if isinstance(given, str | os.PathLike):
        return load_scenario(given)
    if isinstance(given, Mapping):
        return scenario_from(given)
    raise InputError(
        f"scenario: got a {type(given).__name__}, expected a condyle.Scenario, the path of a file, "
        "or its tables"
    )
