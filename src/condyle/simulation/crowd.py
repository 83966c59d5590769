"""Runs in lockstep: alike but for their numbers, step by step through the batches of two kernels.

A run that has an event, or a state that a kernel cannot vouch for, leaves the crowd before that
step and goes on alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import numpy as np

from ..backends.threads import workers
from .control import Controller
from .plan import ClosedLoop, OpenLoop, Plan, Trace
from .plant import Plant
from .running import Run, run
from .steps import DONE, PAUSE, steps_of

TOGETHER = 128  # runs of a crowd: what they work on stays in a cache


def run_all(plans: Sequence[Plan], threads: int | None = None) -> list[Trace]:
    """What happens in each, those alike in lockstep; results do not depend on the threads."""
    alike: dict[Any, list[int]] = {}
    for i, plan in enumerate(plans):
        alike.setdefault(_shape(plan), []).append(i)
    parts = [
        part[start : start + TOGETHER]
        for part in alike.values()
        for start in range(0, len(part), TOGETHER)
    ]
    found: list[Trace | None] = [None] * len(plans)

    def together(part: list[int]) -> None:
        traces = crowd([plans[i] for i in part])
        for i, trace in zip(part, traces, strict=True):
            found[i] = trace

    for part in parts:
        Run(plans[part[0]])  # kernels are there before threads ask for them
    with ThreadPoolExecutor(workers(threads)) as pool:
        list(pool.map(together, parts))
    return [trace for trace in found if trace is not None]


def _shape(plan: Plan) -> Any:
    """What runs in lockstep have in common."""
    drive = plan.drive
    if isinstance(drive, OpenLoop):
        own: tuple[Any, ...] = (drive.times.tobytes(),)
    else:
        sensing = None if drive.sensing is None else drive.sensing.velocity
        own = (id(drive.model), drive.law.table, drive.law.choices, drive.period, drive.delay)
        own += (sensing, drive.law.place, drive.function)
    loads = tuple((load.law, load.place, load.times.tobytes()) for load in plan.loads)
    limits = np.isfinite(plan.speed).tobytes()
    time = (plan.duration, plan.times.tobytes(), plan.method, plan.settings.step)
    return id(plan.model), own, loads, limits, time, tuple(plan.functions)


def crowd(plans: Sequence[Plan]) -> list[Trace]:
    """What happens in runs of one shape."""
    first, runs = plans[0], len(plans)
    if runs == 1:
        return [run(first)]
    plant = Plant(first, runs)
    control = Controller(first, runs) if isinstance(first.drive, ClosedLoop) else None
    y = np.zeros((first.size, plant.columns.stride))
    for i, plan in enumerate(plans):
        plant.fill(plan, i)
        plant.set_modes(list(plan.modes), i)
        y[: 2 * len(plan.q), i] = np.concatenate([plan.q, plan.q1])
        if control is not None:
            control.fill(plan, i)
            control.begin(plan, i)
    guards = plant.guards(first)
    past, alive = np.zeros((len(guards), runs), dtype=bool), np.ones(runs, dtype=np.uint8)
    kept = np.empty((len(first.times), first.size, plant.columns.stride))
    tables = [plant.fed(plan) for plan in plans]
    fed = [
        replace(one, rows=np.stack([own[i].rows for own in tables], axis=2))
        for i, one in enumerate(tables[0])
    ]
    steps = steps_of(plant, control, guards, fed, y, past, alive, kept)
    if steps is None:
        return [run(plan) for plan in plans]
    found: list[Trace | None] = [None] * runs
    while alive.any():
        code = steps.advance()
        gone = {DONE: alive, PAUSE: 0 * alive}.get(code, steps.gone)
        for i in np.flatnonzero(gone).tolist():
            alone = Run(plans[i], compiled=code != DONE)
            alone.take_over(steps, y[:, i], kept[..., i], control, plant, i)
            found[i], alive[i] = alone.trace(), False
        steps.run.seen = 0
    return [trace for trace in found if trace is not None]
