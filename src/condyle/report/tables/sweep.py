"""What a sweep tells, as tables: best rows, main effects, Sobol indices, the Pareto front."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np

from ...analysis.sweep.effects import (
    Sensitivity,
    best,
    directions,
    good,
    main_effects,
    pareto,
    sensitivities,
)
from ...errors import CondyleError
from .table import NOTHING, Table

if TYPE_CHECKING:
    import xarray as xr

MOST = 12  # rows of the front that people are shown


def sweep_tables(table: xr.Dataset) -> list[Table]:
    """All that a sweep has an answer to."""
    found = [outcome_table(table)]
    notes = found[0].notes
    if good(table).sizes["row"] == 0:
        return found
    found += [best_table(table), effect_table(table)]
    if json.loads(table.attrs["study"]).get("sampling", {}).get("kind") == "saltelli":
        try:
            found.append(sobol_table(sensitivities(table), table.attrs["parameters"]))
        except CondyleError as error:  # too few rows have a result, or SALib is not there
            notes.append(f"{error}.")
    if len(directions(table)) >= 2:
        found.append(front_table(table))
    return [one for one in found if one.records]


def outcome_table(table: xr.Dataset) -> Table:
    """How many rows came to what."""
    statuses, counts = np.unique(table["status"].values.astype(str), return_counts=True)
    records: list[dict[str, Any]] = []
    for status, count in sorted(zip(statuses, counts, strict=True), key=lambda pair: -pair[1]):
        first = table["reason"].values[np.argmax(table["status"].values == status)]
        records.append({"status": str(status), "rows": int(count), "first_reason": str(first)})
    rows = [[r["status"], str(r["rows"]), r["first_reason"] or NOTHING] for r in records]
    there, all_rows = table.sizes["row"], int(table.attrs["rows"])
    notes = (
        [] if there == all_rows else [f"{there} of {all_rows} rows are there; --resume goes on."]
    )
    return Table("outcomes", "Variants", ("Status", "Rows", "First reason"), rows, records, notes)


def best_table(table: xr.Dataset) -> Table:
    """The best row of every measure."""
    names = [*table.attrs["parameters"], *table.attrs["measures"]]
    known = directions(table)
    rows, records = [], []
    for measure in table.attrs["measures"]:
        row = best(table, measure, 1)
        if not row.sizes["row"]:
            continue
        which = f"{'most' if known.get(measure) == 'more' else 'least'} {measure}"
        values = {name: float(row[name].values[0]) for name in names}
        variant = int(row["variant"].values[0])
        records.append({"best": which, "variant": variant, **values})
        rows.append([which, str(variant), *(f"{values[name]:.5g}" for name in names)])
    notes = ["Parameters by their path in the mechanism file, SI."]
    return Table("best", "Best rows", ("Best", "Variant", *names), rows, records, notes)


def effect_table(table: xr.Dataset) -> Table:
    """How far each parameter alone moves each measure."""
    effects = main_effects(table)
    parameters = table.attrs["parameters"]
    measures = list(dict.fromkeys(one.measure for one in effects))
    by_pair = {(one.measure, one.parameter): one for one in effects}
    rows, records = [], []
    for measure in measures:
        own = [by_pair[measure, parameter] for parameter in parameters]
        rows.append([measure, *(f"{one.swing:.3g} ({_percent(one.share)})" for one in own)])
        records += [
            {
                "measure": measure,
                "parameter": one.parameter,
                "swing": one.swing,
                "share": None if np.isnan(one.share) else one.share,
            }
            for one in own
        ]
    notes = [
        "From the least to the largest mean of the measure over the parameter, all else as it "
        "comes; in brackets the share of the measure's variance that this explains."
    ]
    return Table("main-effects", "Main effects", ("Measure", *parameters), rows, records, notes)


def sobol_table(found: list[Sensitivity], parameters: list[str]) -> Table:
    """First-order and total indices."""
    rows, records = [], []
    for one in found:
        for name, first, total in zip(parameters, one.first, one.total, strict=True):
            rows.append([one.measure, name, _pair(first), _pair(total)])
            records.append(
                {
                    "measure": one.measure,
                    "parameter": name,
                    "first": float(first[0]),
                    "first_half_interval": float(first[1]),
                    "total": float(total[0]),
                    "total_half_interval": float(total[1]),
                }
            )
    notes = ["Shares of the variance, by SALib, with half the width of their 95 % interval."]
    if found:
        notes.append(
            f"From {found[0].blocks} base rows; {found[0].left_out} left out for failures."
        )
    columns = ("Measure", "Parameter", "First order", "Total")
    return Table("sobol", "Sobol indices", columns, rows, records, notes)


def front_table(table: xr.Dataset) -> Table:
    """The Pareto front; people see some of its rows, the CSV has all."""
    rows_of = pareto(table)
    known = list(directions(table))[:3]
    names = [*known, *table.attrs["parameters"]]
    records: list[dict[str, Any]] = [
        {"variant": int(rows_of["variant"].values[i])}
        | {name: float(rows_of[name].values[i]) for name in names}
        for i in range(rows_of.sizes["row"])
    ]
    shown = np.unique(np.linspace(0, len(records) - 1, min(MOST, len(records))).astype(int))
    rows = [
        [str(records[i]["variant"]), *(f"{records[i][name]:.5g}" for name in names)] for i in shown
    ]
    title = f"Pareto front of {' and '.join(known)}: {len(records)} rows"
    notes = [f"{n}: {directions(table)[n]} is better." for n in known]
    return Table("pareto", title, ("Variant", *names), rows, records, notes)


def _pair(value: np.ndarray) -> str:
    return f"{value[0]:.3f} ± {value[1]:.3f}"


def _percent(share: float) -> str:
    return NOTHING if np.isnan(share) else f"{share:.0%}"
