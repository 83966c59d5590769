"""The public functions: a model and a scenario in, datasets or a report on the loop out."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeAlias, overload

import xarray as xr

from ..errors import ScenarioError
from ..mechanism.mechanism import Mechanism
from ..model.given import as_model
from ..model.model import Model
from ..model.variants import Variants
from ..motion import Motion
from .bind import bind
from .first_scenario import default_scenario
from .gains import GainReport, report
from .plan import Plan, Trace
from .running import ROUNDING, run_all
from .scenario import Scenario
from .simulated import solved

ModelLike: TypeAlias = Model | Mechanism | str | os.PathLike[str]
ScenarioLike: TypeAlias = Scenario | Mapping[str, Any] | str | os.PathLike[str]


@overload
def simulate(
    model: ModelLike,
    scenario: ScenarioLike | None = None,
    *,
    controller: Callable[..., Any] | None = None,
    loads: Sequence[Any] = (),
    motion: Motion | None = None,
    stop_at_bounds: bool = False,
    threads: int | None = None,
) -> xr.Dataset: ...


@overload
def simulate(
    model: ModelLike,
    scenario: list[Any] | tuple[Any, ...],
    *,
    controller: Callable[..., Any] | None = None,
    loads: Sequence[Any] = (),
    motion: Motion | None = None,
    stop_at_bounds: bool = False,
    threads: int | None = None,
) -> list[xr.Dataset]: ...


def simulate(
    model: ModelLike,
    scenario: Any = None,
    *,
    controller: Callable[..., Any] | None = None,
    loads: Sequence[Any] = (),
    motion: Motion | None = None,
    stop_at_bounds: bool = False,
    threads: int | None = None,
) -> xr.Dataset | list[xr.Dataset]:
    """Simulate a mechanism under efforts or a controller, and under loads.

    Scenarios of method `rk4` that differ in numbers alone (gains, starts, loads, paths, limits,
    files) run in lockstep as compiled code, which shares the processors; others take turns.

    Args:   model: a model, a mechanism, or one by its file or name.
            scenario: a `Scenario`, its file, or its tables in SI, or a list of these; default:
            5 s of computed torque along the path that fits the mechanism.
            controller: (measured, reference) -> efforts (n,), instead of the scenario's law.
            loads: functions (t, s, v) -> force (3,) or force and moment (6,) in {S} at O_M, or
            pairs (function, name of a point), besides those of the scenario; s is the point's
            displacement from home and v its velocity, (3,) each.
            motion: to follow, instead of the controller's.
            stop_at_bounds: end where a contact reaches the end of its surface.
            threads: maximum number; default: the processors at hand. Results do not depend on it.
    Returns: a dataset at `rate`, up to the end of the run; `.condyle.events` lists events.
            For a list of scenarios a list.
    Raises: ScenarioError: for problems of any scenario, before the first run, and for one that
            ends where it starts, as in a gimbal lock.
    """
    start = time.perf_counter()
    several = isinstance(scenario, list | tuple)
    given = scenario if several else [scenario]
    own = {"controller": controller, "loads": loads, "motion": motion}
    plans = planned(model, given, stop_at_bounds=stop_at_bounds, **own)
    traces = run_all(plans, threads)
    _require_begun(plans, traces)
    samples = sum(len(trace.t) for trace in traces)
    solutions = [solved(*pair, start, samples) for pair in zip(plans, traces, strict=True)]
    return solutions if several else solutions[0]


def _require_begun(plans: Sequence[Plan], traces: Sequence[Trace]) -> None:
    """Raises ScenarioError for a run that ends where it starts: it has no motion to show."""
    for plan, trace in zip(plans, traces, strict=True):
        last = trace.events[-1] if trace.events else None
        if last is None or not last.ends or last.time > ROUNDING:
            continue
        owner = f' "{last.owner}"' if last.owner else ""
        state = ", ".join(f"{name} = {x:g}" for name, x in last.state.items() if x) or "home"
        problem = f"start: nothing moves from {state}: {last.kind}{owner}: {last.text}"
        raise ScenarioError(plan.source, [f"{problem}; begin elsewhere"])


def of_variants(
    variants: Variants, scenario: ScenarioLike | None, threads: int | None
) -> list[Any]:
    """As `Variants.simulate`."""
    start, asked, shared = time.perf_counter(), as_scenario(scenario), dict[Any, Any]()
    good = [i for i in range(len(variants)) if not variants.status[i]]
    plans = [bind(variants.alone(i), asked, source=f"variant {i}", shared=shared) for i in good]
    solutions: list[Any] = [None] * len(variants)
    traces = run_all(plans, threads) if plans else []
    _require_begun(plans, traces)
    samples = sum(len(trace.t) for trace in traces)
    for i, plan, trace in zip(good, plans, traces, strict=True):
        solutions[i] = solved(plan, trace, start, samples)
    return solutions


def check_gains(
    model: ModelLike,
    scenario: ScenarioLike | None = None,
    *,
    controller: Callable[..., Any] | None = None,
    loads: Sequence[Any] = (),
    motion: Motion | None = None,
) -> GainReport:
    """Stability, damping and phase margin of the control loop for small deviations: at home, along
    its path, and on loads that the path meets.

    `stable` is True, False, or None where a part was not judged. Touchdown is not covered. With
    sensors the brake of an exported controller's safe stop is judged too.
    Derivatives of plant and law are exact; those of a `controller` in Python are differences.

    Args:   as of `simulate`.
    Raises: UnsupportedError: in open loop;  ScenarioError: as of `simulate`.
    """
    own = {"controller": controller, "loads": loads, "motion": motion}
    return report(planned(model, [scenario], **own)[0])


def planned(model: ModelLike, scenarios: Sequence[Any], **given: Any) -> list[Plan]:
    """Plans of scenarios for one model, which share paths and models; `given`: as of `bind`."""
    derived = as_model(model)
    shared: dict[Any, Any] = {}
    single = len(scenarios) == 1
    sources = [_source(one) if single else f"scenario {i + 1}" for i, one in enumerate(scenarios)]
    return [
        bind(derived, as_scenario(one), source=source, shared=shared, **given)
        for one, source in zip(scenarios, sources, strict=True)
    ]


def as_scenario(given: Any) -> Scenario:
    """A scenario from what people give for one.

    Raises: InputError: for anything else;  ScenarioError: for one with anything wrong.
    """
    return default_scenario() if given is None else Scenario.read(given)


def _source(given: Any) -> str:
    """What messages call a scenario."""
    if given is None:
        return "the default scenario"
    return os.fspath(given) if isinstance(given, str | os.PathLike) else "scenario"
