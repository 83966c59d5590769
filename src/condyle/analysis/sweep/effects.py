"""Results of a sweep: main effects, Sobol indices, best rows, Pareto front."""

from __future__ import annotations

import json
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
import xarray as xr

from ...errors import InputError
from ...extras import require
from .part import OK
from .study import Study

BINS = 10  # of equal counts, over which a main effect is averaged
FEWEST = 4  # good rows for any statement


@dataclass(frozen=True)
class Effect:
    """The mean of a measure by one parameter, averaged over the others.

    place, mean: of each level or bin, (B,).
    share: of the measure's variance that these means explain, 0 to 1; NaN if it does not vary.
    """

    parameter: str
    measure: str
    place: np.ndarray
    mean: np.ndarray
    share: float

    @property
    def swing(self) -> float:
        """The range from the least to the largest mean."""
        return float(np.ptp(self.mean))


@dataclass(frozen=True)
class Sensitivity:
    """Sobol indices of a measure: of each parameter alone, and with all its interactions.

    first, total: with half the width of their 95 % interval, (D, 2) each.
    blocks: base rows they are from;  left_out: those with a row that has no result.
    """

    measure: str
    first: np.ndarray
    total: np.ndarray
    blocks: int
    left_out: int


def good(table: xr.Dataset) -> xr.Dataset:
    """The rows that have a result."""
    return table.isel(row=np.flatnonzero(table["status"].values == OK))


def main_effects(table: xr.Dataset) -> list[Effect]:
    """The effect of every parameter on every measure."""
    rows, effects = good(table), []
    if rows.sizes["row"] < FEWEST:
        return []
    for measure, parameter in product(_finite(rows), table.attrs["parameters"]):
        x, y = rows[parameter].values, rows[measure].values
        levels, which = np.unique(x, return_inverse=True)
        if len(levels) > 2 * BINS:
            which = np.argsort(np.argsort(x, kind="stable"), kind="stable") * BINS // len(x)
        counts = np.bincount(which)
        place, mean = (np.bincount(which, a) / counts for a in (x, y))
        between, variance = np.sum(counts * (mean - y.mean()) ** 2) / len(y), np.var(y)
        share = float(between / variance) if variance else np.nan
        effects.append(Effect(parameter, measure, place, mean, share))
    return effects


def sensitivities(table: xr.Dataset) -> list[Sensitivity]:
    """Sobol indices of every measure, of a study whose sampling is saltelli.

    Raises: InputError: for another sampling, or too few rows;  MissingExtraError: without SALib.
    """
    study = Study.checked(json.loads(table.attrs["study"]), "study")
    if study.sampling.kind != "saltelli":
        raise InputError(
            f'Sobol indices need sampling kind "saltelli"; this study has "{study.sampling.kind}"'
        )
    if "motion" in table:
        raise InputError("Sobol indices need one motion; this study has several")
    size = len(table.attrs["parameters"]) + 2
    complete = table.isel(row=slice(0, table.sizes["row"] // size * size))
    usable = (complete["status"].values == OK).reshape(-1, size).all(axis=1)
    if (count := int(usable.sum())) < FEWEST:
        raise InputError(
            f"Sobol indices need {FEWEST} base rows whose variants all have results; "
            f"there are {count}"
        )
    indices = []
    for measure in _finite(good(complete)):
        both = sobol_indices(complete[measure].values.reshape(-1, size)[usable])
        indices.append(Sensitivity(measure, *both, count, len(usable) - count))
    return indices


def sobol_indices(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """First-order and total indices with half their 95 % intervals, (D, 2) each, by SALib.

    Args: values: (base rows, D + 2): of A, of A with each column of B, of B.
    """
    require("SALib", "study")
    from SALib.analyze.sobol import analyze

    d = values.shape[1] - 2
    names = [str(i) for i in range(d)]
    problem = {"num_vars": d, "names": names, "bounds": [[0.0, 1.0]] * d}
    with np.errstate(all="ignore"):
        found: Any = analyze(problem, values.ravel(), calc_second_order=False, seed=0)
    return tuple(np.column_stack([found[k], found[f"{k}_conf"]]) for k in ("S1", "ST"))  # type: ignore[return-value]


def directions(table: xr.Dataset) -> dict[str, str]:
    """Measure -> less or more, for measures with `better` in the study."""
    return json.loads(table.attrs["better"])


def best(table: xr.Dataset, measure: str, count: int = 5) -> xr.Dataset:
    """The best rows of a measure, by its `better` in the study; default: the least."""
    rows = good(table)
    rows = rows.isel(row=np.flatnonzero(np.isfinite(rows[measure].values)))
    sign = -1.0 if directions(table).get(measure) == "more" else 1.0
    order = np.argsort(sign * rows[measure].values, kind="stable")
    return rows.isel(row=order[:count])


def pareto(table: xr.Dataset) -> xr.Dataset:
    """The Pareto front of the first three measures with `better`: rows that none dominates.

    Raises: InputError: for fewer than two such measures.
    """
    known = directions(table)
    names = list(known)[:3]
    if len(names) < 2:
        raise InputError(
            'a Pareto front needs two or three measures with better = "less" or "more"; '
            f"the study has {', '.join(known) or 'none'}"
        )
    rows = good(table)
    cost = np.column_stack([rows[n].values * (-1.0 if known[n] == "more" else 1.0) for n in names])
    return rows.isel(row=front(cost))


def front(cost: np.ndarray) -> np.ndarray:
    """Indices of the points (N, m) that none dominates, in the order of their first coordinate."""
    efficient: list[int] = []
    for i in np.lexsort(cost.T[::-1]):
        # Those before it are no worse in the first coordinate, so that only they can dominate it.
        if np.isfinite(cost[i]).all() and not (cost[efficient] <= cost[i]).all(axis=1).any():
            efficient.append(int(i))
    return np.array(efficient, dtype=int)


def _finite(rows: xr.Dataset) -> list[str]:
    """Measures that are numbers in all good rows."""
    return [m for m in rows.attrs["measures"] if np.isfinite(rows[m].values).all()]
