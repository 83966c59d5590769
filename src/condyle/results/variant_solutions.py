"""Solutions of many variants of a mechanism along one motion, in one dataset."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Sequence
from functools import partial
from typing import Any

import numpy as np
import xarray as xr

from ..errors import InputError, did_you_mean
from ..model.inverse_dynamics import SOLVED
from ..model.model import Model, parts_with_inputs
from ..model.model_result import ModelResult
from ..model.variants import FREQUENCY, VariantGroup, Variants
from ..motion import Load, Motion, as_load, as_motion, load_place, resolve_load_point
from ..quantities import QUANTITIES, Quantity, variables
from .derived import Derived
from .solving import coordinates

Measure = Callable[[Derived, int], np.ndarray]  # of as many solutions, (count, ...)


def solve(
    variants: Variants,
    motion: Motion,
    load: Load | None,
    keep: Sequence[str],
    load_point: str | None,
    threads: int | None,
) -> xr.Dataset:
    """As `Variants.solve`."""
    motion, load = as_motion(motion), as_load(load)
    model, wrench = variants.model, load.at(motion.t)
    name = load.point if load_point is None else load_point
    if np.any(wrench) or name is not None:
        points = model.mechanism.platform.points
        several = isinstance(name, str) and name not in points and {*",;"} & {*name}
        if several:
            load_place(name, points)
        else:
            name = resolve_load_point(name, points)
    chosen = _variables(model, [keep] if isinstance(keep, str) else keep)
    needed = outputs_of(model, [partial(by_solution, v) for v in chosen])
    arrays: dict[str, np.ndarray] = {}
    status = np.repeat(variants.status[:, None], len(motion.t), axis=1)
    for group in variants.groups:
        answer = group.inverse_dynamics(motion, wrench, name, needed, threads)
        own = answer.status.reshape(len(group.rows), -1)
        status[group.rows] = own
        for v in chosen:
            values = measured(group, answer, wrench, model.limited, partial(by_solution, v))
            if values.dtype.kind == "f" and own.any():
                values = values.copy()
                values[_failed(v, ~v.known(own), values)] = np.nan
            if v.variable not in arrays:
                fill = np.nan if values.dtype.kind == "f" else 0
                arrays[v.variable] = np.full((len(variants), *values.shape[1:]), fill, values.dtype)
            arrays[v.variable][group.rows] = values
    machine = variants.base
    made: dict[str, Any] = {
        v.variable: (("variant", *v.dims), arrays[v.variable], v.attributes(machine))
        for v in chosen
        if v.variable in arrays
    }
    about = QUANTITIES["status"].attributes(machine)
    made["status"] = ("variant", "time"), status.astype(np.int8), about
    reasons = [variants.reason(i) if variants.status[i] else "" for i in range(len(variants))]
    made["reason"] = "variant", np.array(reasons, dtype=object)
    used = {dim for dims, *_ in made.values() for dim in np.atleast_1d(dims)}
    known = coordinates(model, motion.t, parts_with_inputs(model, motion.given))
    axes = {k: v for k, v in known.items() if k in used or (k.endswith("unit") and "chain" in used)}
    return xr.Dataset(made, {**axes, "variant": np.arange(len(variants))})


def _variables(model: Model, names: Iterable[str]) -> list[Quantity]:
    about = Derived(model.mechanism, None, limited=model.limited)
    there = {n: v for n, v in variables().items() if not v.simulated and about.has(v)}
    for name in names:
        if name not in there:
            raise InputError(f'keep: no variable "{name!s:.80}".{did_you_mean(str(name), there)}')
    return [there[name] for name in names]


def _failed(variable: Quantity, bad: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Where samples failed, (V, N), as an index of values (V, *dims)."""
    shape = [1] * values.ndim
    shape[0], shape[1 + variable.dims.index("time")] = bad.shape
    return np.broadcast_to(bad.reshape(shape), values.shape)


def by_solution(variable: Quantity, derived: Derived, count: int) -> np.ndarray:
    """A variable of `count` solutions, one after the other in time: (count, *dims)."""
    values, time = derived.values(variable), variable.dims.index("time")
    values = values.reshape(*values.shape[:time], count, -1, *values.shape[time + 1 :])
    return np.moveaxis(values, time, 0)


def measured(
    group: VariantGroup, result: ModelResult, wrench: np.ndarray, limited: bool, read: Measure
) -> np.ndarray:
    """What is read of the solutions of a group of variants, (V, ...).

    Args: result: flat;  wrench: of one variant, (N, 6).
    """
    V, N, batch = len(group.rows), len(wrench), group.variants
    if not batch.measured_apart:
        return read(Derived(batch.base, result, np.tile(wrench, (V, 1)), limited), V)
    parts = [
        read(Derived(batch.mechanism(i), result.rows(v * N, (v + 1) * N), wrench, limited), 1)
        for v, i in enumerate(group.rows.tolist())
    ]
    return np.concatenate(parts)


def outputs_of(
    model: Model, reads: Iterable[Measure], given: Collection[str] = ()
) -> tuple[str, ...]:
    """Outputs of inverse dynamics that something is read of.

    Args: given: gravity or base, if motions give them.
    """
    home = np.zeros((1, len(model.independent)))
    base = np.zeros(9) if "base" in given else None
    found = model.inverse_dynamics(home, home, home, base=base, outputs=SOLVED)
    found.frequency = home  # which not every mechanism has
    seen = _Seen(found)
    for read in reads:
        read(Derived(model.mechanism, seen, np.zeros((1, 6)), model.limited), 1)
    return tuple(name for name in (*SOLVED, FREQUENCY) if name in seen.names)


class _Seen:
    """Results that note which of them are asked for."""

    def __init__(self, found: ModelResult) -> None:
        self._found, self.names = found, set[str]()

    def __getattr__(self, name: str) -> Any:
        self.names.add(name)
        return getattr(self._found, name)
