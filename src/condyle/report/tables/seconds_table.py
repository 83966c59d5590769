"""Table 1: what the models cost."""

from __future__ import annotations

import platform
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from ...analysis import paper
from ...analysis.comparison import Comparison
from ...analysis.runs import Run
from .report_table import NOTHING, Table


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
    cells = {"Model": "model"} | ({"In the paper": "paper_name"} if beside else {})
    for k, part in enumerate(("symbolic", "numeric", "total")):
        cells[f"{part.capitalize()} s"] = f"{part}:.3f"
        if beside:  # headings that are equal for people
            cells["paper" + " " * k] = f"{part}_paper:.3f"
            cells["ratio" + " " * k] = f"{part}_ratio:.4f"
    if beside:
        cells |= {"of GM 1": "of_gm1:.0%", "paper   ": "of_gm1_paper:.0%"}
    title = f"Table 1. Computational time, {comparison.samples} samples"
    return Table.of("table-1", title, records, cells, list(_notes_1(comparison, beside)))


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


def processor() -> str:
    """The processor's name, as good as the system tells it."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        lines = []
    for line in lines:
        if line.startswith("model name"):
            return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()
