"""Means of cycles: over normalised time by trial and group, and the mean cycle as a solution."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..sweep.bands import BANDS, QUANTILES, quantiles
from .cycle_measures import SAMPLES, normalised, over_cycles, phase

if TYPE_CHECKING:
    import xarray as xr

    from .solved_session import SolvedTrial

KEPT = ("pose", "effort", "activation", "contact_force", "load", "emg")


def mean_dataset(groups: Mapping[str, Sequence[SolvedTrial]]) -> xr.Dataset:
    """Mean and standard deviation over normalised time, by trial and by group.

    Of each variable of `KEPT` that all trials have `<variable>_mean` and `_sd` over (trial, phase,
    ...), and `<variable>_group_mean` and `_sd` over (group, phase, ...): over all cycles of the
    trial, or of the group's trials, n - 1 in the standard deviation. Cycles with a sample without a
    result do not count; where no cycle counts, NaN. With variants `<variable>_mean_quantile` and
    `_group_mean_quantile`, (trial, quantile, phase, ...): quantiles of the mean over variants.
    """
    import xarray as xr

    trials = [solved for of in groups.values() for solved in of]
    first, first_variants = trials[0].solution, trials[0].variants
    sets: dict[str, tuple[str, list[Sequence[SolvedTrial]]]] = {
        "": ("trial", [[solved] for solved in trials]),
        "_group": ("group", [*groups.values()]),
    }
    variables: dict[str, Any] = {}
    for name in [n for n in KEPT if all(n in solved.solution for solved in trials)]:
        array = first[name]
        cycles = {
            id(solved): normalised(solved.solution, solved.complete_cycles, name)
            for solved in trials
        }
        dims = [d for d in array.dims if d != "time"]
        for ending, (dimension, members) in sets.items():
            both = [_statistics(np.concatenate([cycles[id(t)] for t in of])) for of in members]
            for k, (word, meaning) in enumerate((("mean", "mean"), ("sd", "standard deviation"))):
                about = {"units": array.attrs["units"]}
                about["long_name"] = f"{meaning} over cycles of: {array.attrs['long_name']}"
                values = np.array([statistics[k] for statistics in both])
                variables[f"{name}{ending}_{word}"] = (dimension, "phase", *dims), values, about
            if first_variants is not None and name in first_variants.values:
                about = {"units": array.attrs["units"]}
                about["long_name"] = f"quantiles over variants of the mean of: {name}"
                values = np.array([variant_bands(of, name) for of in members])
                dims_of = (dimension, "quantile", "phase", *dims)
                variables[f"{name}{ending}_mean_quantile"] = dims_of, values, about
    for ending, (dimension, members) in sets.items():
        count = [sum(len(t.complete_cycles) for t in of) for of in members]
        about = {"units": "1", "long_name": "cycles that count"}
        variables[f"cycles{ending}"] = dimension, count, about
    coordinates: dict[str, Any] = {
        "trial": [solved.trial.name for solved in trials],
        "group": [*groups],
        "phase": ("phase", phase(), {"units": "1", "long_name": "normalised time"}),
    }
    for key in trials[0].group:
        coordinates[key] = "group", [str(of[0].group[key]) for of in groups.values()]
    used = {
        d for dims, *_ in variables.values() for d in ([dims] if isinstance(dims, str) else dims)
    }
    coordinates |= {
        d: first[d]
        for d in ("chain", "contact", "coordinate", "component", "quantile")
        if d in used
    }
    made = xr.Dataset(variables, coordinates)
    made.attrs = {
        "title": f"Mean cycles of {first.attrs['mechanism_name']}",
        **{name: first.attrs[name] for name in ("source", "condyle_version", "mechanism_name")},
    }
    return made


def variant_bands(trials: Sequence[SolvedTrial], name: str) -> np.ndarray:
    """Quantiles over variants of the mean over the cycles of trials, (Q, SAMPLES, ...)."""
    cycles = []
    for one in trials:
        assert one.variants is not None
        values = one.variants.values[name].swapaxes(0, 1)  # (N, V, ...)
        cycles.append(over_cycles(one.solution["time"].values, values, one.complete_cycles))
    every = np.concatenate(cycles)
    if not len(every):
        return np.full((len(QUANTILES), SAMPLES, every.shape[-1]), np.nan)
    return quantiles(every.mean(axis=0).swapaxes(0, 1))


def mean_solution(
    trials: Sequence[SolvedTrial], source: str, warnings: Sequence[str], group: str = ""
) -> xr.Dataset | None:
    """The mean of all whole cycles as a solution, with quantiles over cycles as its bands.

    With variants also `<variable>_variant_quantile`, of the mean over variants. Its time is
    normalised time times the mean duration. None if no cycle is whole.

    Args: group: whose cycles they are, for people.
    """
    spans = [solved.complete_cycles for solved in trials]
    count = sum(map(len, spans))
    if not count:
        return None
    used = [solved.solution for solved in trials if len(solved.complete_cycles)]
    spans = [solved.complete_cycles for solved in trials if len(solved.complete_cycles)]
    first = used[0]
    parts = list(dict.fromkeys(str(p) for s in used for p in s["part"].values))
    used = [s.reindex(part=parts, fill_value=0.0) for s in used]  # without a load it has no share
    shared = [
        str(name)
        for name, array in first.data_vars.items()
        if "time" in array.dims and "quantile" not in array.dims and "marker" not in array.dims
        and all(name in s for s in used)
    ]  # fmt: skip
    made = used[0][shared].isel(time=[0] * len(phase()))
    for name in shared:
        array = used[0][name]
        cycles = np.concatenate(
            [normalised(s, of, name) for s, of in zip(used, spans, strict=True)]
        )
        along = _merged(name, cycles, array.dtype)
        values = np.moveaxis(along, 0, array.dims.index("time"))
        made[name] = array.dims, values, array.attrs
        if name in BANDS:
            about = {"units": array.attrs["units"], "long_name": f"quantiles of {name} over cycles"}
            spread = np.quantile(cycles, QUANTILES, axis=0)
            made[f"{name}_quantile"] = ("quantile", *array.dims), spread, about
            if (variants := trials[0].variants) is not None and name in variants.values:
                about |= {"long_name": f"quantiles over variants of the mean of {name}"}
                values = variant_bands(trials, name)
                made[f"{name}_variant_quantile"] = ("quantile", *array.dims), values, about
    duration = float(np.mean(np.concatenate([np.diff(of, axis=1)[:, 0] for of in spans])))
    made = made.assign_coords(
        time=("time", duration * phase(), first["time"].attrs),
        quantile=(
            "quantile",
            list(QUANTILES),
            {"units": "1", "long_name": "share of cycles below"},
        ),
    )
    options = json.loads(first.attrs["options"])
    told = dict.fromkeys(("motion_sha256", "load_sha256", "contact_residual_of_given_pose"))
    of_group = f" of {group}" if group else ""
    options |= told | {"motion": f"{source}: mean of {count} cycles{of_group}"}
    if any(s["load"].values.any() for s in used):
        options["load"] = "recorded"
    options["solve_seconds"] = sum(s.condyle.options["solve_seconds"] for s in used)
    made.attrs = first.attrs | {
        "title": f"Mean of {count} cycles{of_group}, {first.attrs['mechanism_name']}",
        "options": json.dumps(options),
        "warnings": json.dumps(list(warnings)),
        "notices": "[]",
        "bands": json.dumps({"study": {}, "variants": count, "failed": 0, "of": "cycles"}),
    }
    if (variants := trials[0].variants) is not None:
        made.attrs["variant_bands"] = json.dumps(variants.about)
    return made


def _merged(name: str, cycles: np.ndarray, kind: Any) -> np.ndarray:
    """One value for all cycles, (C, SAMPLES, ...): of flags the worst, of numbers the mean."""
    if kind.kind == "f":
        return cycles.mean(axis=0)
    return (cycles.min(axis=0) if name == "rank" else np.ceil(cycles.max(axis=0))).astype(kind)


def _statistics(cycles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean and standard deviation of cycles (C, ...), NaN of too few."""
    count = len(cycles)
    nothing = np.full(cycles.shape[1:], np.nan)
    mean = cycles.mean(axis=0) if count else nothing
    return mean, cycles.std(axis=0, ddof=1) if count > 1 else nothing
