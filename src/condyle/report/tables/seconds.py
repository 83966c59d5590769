"""Table 1: what the models cost."""

from __future__ import annotations

import platform
from collections.abc import Iterator
from typing import Any

from ...analysis import paper
from ...analysis.comparison import Comparison
from ...analysis.processor import processor
from ...analysis.runs import Run
from .table import NOTHING, Table, cell


def table_1(comparison: Comparison) -> Table:
    """Seconds of the symbolic and the numeric part of each model."""
    beside = paper.is_paper_class(comparison.mechanism)
    first = comparison.run("momentum", "direct")
    records = []
    runs = in_paper_order(comparison) if beside else [*comparison.runs, *comparison.free_runs]
    for run in runs:
        name, published = _published(run) if beside else (None, None)
        record: dict[str, Any] = {
            "model": run.label,
            "paper_name": name or NOTHING,
            "samples": comparison.samples,
        }
        for part in ("symbolic", "numeric", "total"):
            here, there = getattr(run.seconds, part), getattr(published, part, None)
            record[part] = here
            record[f"{part}_paper"] = there
            record[f"{part}_ratio"] = None if there is None else here / there
        record["of_gm1"] = None if first is None else run.seconds.total / first.seconds.total
        gm1 = paper.TABLE_1["momentum", "direct"].total
        record["of_gm1_paper"] = None if published is None else published.total / gm1
        records.append(record)
    columns = {
        "Model": ("model", "{}"),
        "In the paper": ("paper_name", "{}"),
        "Symbolic s": ("symbolic", "{:.3f}"),
        "paper": ("symbolic_paper", "{:.3f}"),
        "ratio": ("symbolic_ratio", "{:.4f}"),
        "Numeric s": ("numeric", "{:.3f}"),
        "paper ": ("numeric_paper", "{:.3f}"),
        "ratio ": ("numeric_ratio", "{:.4f}"),
        "Total s": ("total", "{:.3f}"),
        "paper  ": ("total_paper", "{:.3f}"),
        "ratio  ": ("total_ratio", "{:.4f}"),
        "of GM 1": ("of_gm1", "{:.0%}"),
        "paper   ": ("of_gm1_paper", "{:.0%}"),
    }
    if not beside:
        columns = {
            name: column
            for name, column in columns.items()
            if name.strip() not in ("paper", "ratio", "In the paper", "of GM 1")
        }
    rows = [[cell(r[key], form) for key, form in columns.values()] for r in records]
    names = tuple(name.strip() for name in columns)
    title = f"Table 1. Computational time, {comparison.samples} samples"
    notes = list(_notes_1(comparison, beside))
    return Table("table-1", title, names, rows, records, notes)


def in_paper_order(comparison: Comparison) -> list[Run]:
    """The paper's models first, as its Table 1 has them, then the others."""
    order = [(*key, True) for key in paper.TABLE_1]
    order += [(name, "core", False) for name in paper.TABLE_1_FREE]
    runs = [*comparison.runs, *comparison.free_runs]
    keys = [(run.formulation, run.route, run.contacts) for run in runs]
    known = [runs[keys.index(key)] for key in order if key in keys]
    return known + [run for run, key in zip(runs, keys, strict=True) if key not in order]


def _published(run: Run) -> tuple[str | None, paper.Seconds | None]:
    if run.contacts:
        key = (run.formulation, run.route)
        return paper.MODEL_NAMES.get(key), paper.TABLE_1.get(key)
    return paper.FREE_NAMES.get(run.formulation), paper.TABLE_1_FREE.get(run.formulation)


def _notes_1(comparison: Comparison, beside: bool) -> Iterator[str]:
    yield (
        f"Symbolic: deriving the model; numeric: torques of all {comparison.samples} samples, "
        f"without contact forces, by numpy on {processor()}, Python "
        f"{platform.python_version()}. Seconds are of processor time and vary from run to run; "
        "compiled kernels are faster by far."
    )
    yield (
        "Route core closes the contacts in its numeric part; route direct has that in its "
        "expressions; without contacts X_EE is given."
    )
    if not beside:
        yield "The paper's seconds are of another mechanism and are left out."
        return
    yield (
        "The paper used Matlab on an i7-8700K and does not state its number of samples, so the "
        "ratios to its seconds tell little; compare the columns 'of GM 1' (totals as part of GM "
        "1's). Its 6RSS shares the symbolic part with Model 2; here each model is derived alone."
    )
    for formulation, names in (("momentum", "GM 2 / GM 1"), ("lagrange", "L-D 2 / L-D 1")):
        one, two = (comparison.run(formulation, route) for route in ("direct", "core"))
        if one is None or two is None:
            continue
        published = [paper.TABLE_1[formulation, route].total for route in ("direct", "core")]
        yield (
            f"Total {names}: {two.seconds.total / one.seconds.total:.0%} here, "
            f"{published[1] / published[0]:.1%} by the paper's table "
            f"({paper.MODEL_2_IN_TEXT[formulation]} in its text)."
        )
    yield (
        "Here every model computes a shared subexpression once, which takes most of Model 1's "
        "disadvantage away."
    )
