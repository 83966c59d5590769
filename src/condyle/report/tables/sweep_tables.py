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
from ...results.report_table import NOTHING, Cell, ReportTable

if TYPE_CHECKING:
    import xarray as xr

MOST = 12  # rows of the front that people are shown


def sweep_tables(table: xr.Dataset) -> list[ReportTable]:
    """All that a sweep has an answer to."""
    tables = [outcome_table(table)]
    if good(table).sizes["row"] == 0:
        return tables
    tables += [best_table(table), effect_table(table)]
    if json.loads(table.attrs["study"]).get("sampling", {}).get("kind") == "saltelli":
        try:
            tables.append(sobol_table(sensitivities(table), table.attrs["parameters"]))
        except CondyleError as error:  # too few rows have a result, or SALib is not there
            tables[0].notes.append(f"{error}.")
    if len(directions(table)) >= 2:
        tables.append(front_table(table))
    return [made for made in tables if made.records]


def sweep_text(table: xr.Dataset) -> str:
    """The tables as plain text."""
    return "\n".join(one.text() for one in sweep_tables(table))


def outcome_table(table: xr.Dataset) -> ReportTable:
    """How many rows came to what."""
    status, reason = (table[name].values.astype(str) for name in ("status", "reason"))
    found, first, counts = np.unique(status, return_index=True, return_counts=True)
    records = [
        {"status": str(found[i]), "rows": int(counts[i]), "first_reason": str(reason[first[i]])}
        for i in np.argsort(-counts, kind="stable")
    ]
    there, all_rows = table.sizes["row"], int(table.attrs["rows"])
    left = table.attrs.get("missing", "")
    notes = [f"{there} of {all_rows} rows are there, files {left} are missing; --resume goes on."]
    notes *= there != all_rows
    cells = {"Status": "status", "Rows": "rows", "First reason": "first_reason"}
    return ReportTable.of("outcomes", "Variants", records, cells, notes)


def best_table(table: xr.Dataset) -> ReportTable:
    """The best row of every measure."""
    names, known = [*table.attrs["parameters"], *table.attrs["measures"]], directions(table)
    records: list[dict[str, Any]] = []
    for measure in table.attrs["measures"]:
        row = best(table, measure, 1)
        if row.sizes["row"]:
            which = f"{'most' if known.get(measure) == 'more' else 'least'} {measure}"
            values = {name: float(row[name].values[0]) for name in names}
            records.append({"best": which, "variant": int(row["variant"].values[0]), **values})
    cells = {"Best": "best", "Variant": "variant"} | {name: f"{name}:.5g" for name in names}
    notes = ["Parameters by their path in the mechanism file, SI."]
    return ReportTable.of("best", "Best rows", records, cells, notes)


def effect_table(table: xr.Dataset) -> ReportTable:
    """How far each parameter alone moves each measure."""
    records: list[dict[str, Any]] = []
    rows: dict[str, dict[str, str]] = {}
    for effect in main_effects(table):
        share = None if np.isnan(effect.share) else effect.share
        percent = NOTHING if share is None else f"{share:.0%}"
        rows.setdefault(effect.measure, {})[effect.parameter] = f"{effect.swing:.3g} ({percent})"
        known = {"measure": effect.measure, "parameter": effect.parameter}
        records.append(known | {"swing": effect.swing, "share": share})
    parameters = table.attrs["parameters"]
    order = [(measure, parameter) for measure in rows for parameter in parameters]
    records.sort(key=lambda record: order.index((record["measure"], record["parameter"])))
    notes = [
        "From the least to the largest mean of the measure over the parameter, all else as it "
        "comes; in brackets the share of the measure's variance that this explains."
    ]
    cells = [[measure, *(row[name] for name in parameters)] for measure, row in rows.items()]
    heads = ("Measure", *parameters)
    return ReportTable("main-effects", "Main effects", heads, cells, records, notes)


def sobol_table(indices: list[Sensitivity], parameters: list[str]) -> ReportTable:
    """First-order and total indices."""
    records = [
        {
            "measure": row.measure,
            "parameter": name,
            "first": float(first[0]),
            "first_half_interval": float(first[1]),
            "total": float(total[0]),
            "total_half_interval": float(total[1]),
        }
        for row in indices
        for name, first, total in zip(parameters, row.first, row.total, strict=True)
    ]
    cells: dict[str, Cell] = {
        "Measure": "measure",
        "Parameter": "parameter",
        "First order": lambda r: f"{r['first']:.3f} ± {r['first_half_interval']:.3f}",
        "Total": lambda r: f"{r['total']:.3f} ± {r['total_half_interval']:.3f}",
    }
    notes = ["Shares of the variance, by SALib, with half the width of their 95 % interval."]
    notes += [
        f"From {row.blocks} base rows; {row.left_out} left out for failures." for row in indices[:1]
    ]
    return ReportTable.of("sobol", "Sobol indices", records, cells, notes)


def front_table(table: xr.Dataset) -> ReportTable:
    """The Pareto front; people see some of its rows, the CSV has all."""
    front, known = pareto(table), list(directions(table))[:3]
    names = [*known, *table.attrs["parameters"]]
    records: list[dict[str, Any]] = [
        {"variant": int(front["variant"].values[i])}
        | {name: float(front[name].values[i]) for name in names}
        for i in range(front.sizes["row"])
    ]
    printed = np.unique(np.linspace(0, len(records) - 1, min(MOST, len(records))).astype(int))
    title = f"Pareto front of {' and '.join(known)}: {len(records)} rows"
    notes = [f"{name}: {directions(table)[name]} is better." for name in known]
    cells = {"Variant": "variant"} | {name: f"{name}:.5g" for name in names}
    return ReportTable.of("pareto", title, records, cells, notes, printed.tolist())
