"""How far the models are from each other, Tables 1 and 2 of the paper, and the tradeoff."""

from __future__ import annotations

import platform
from collections.abc import Iterator, Sequence
from pathlib import Path, PurePath
from typing import Any

from ...analysis import paper
from ...analysis.comparison import Comparison
from ...analysis.runs import Run
from ...analysis.torque_indices import Indices
from ...analysis.weight_curve import Tradeoff
from ...results.report_table import NOTHING, ReportTable


def differences(comparison: Comparison) -> ReportTable:
    """How far each model is from the others; the CSV has every two."""
    rows, records = [], []
    for contacts, runs in ((True, comparison.runs), (False, comparison.free_runs)):
        pairs = comparison.differences(contacts)
        records += [
            {
                "first": pair.first.label,
                "second": pair.second.label,
                "effort": pair.effort,
                "contact_force": pair.contact_force if _has_forces(pair.first) else None,
            }
            for pair in pairs
        ]
        for run in runs:
            others = [pair for pair in pairs if run in (pair.first, pair.second)]
            if others:
                contact = f"{max(pair.contact_force for pair in others):.1e}"
                effort = f"{max(pair.effort for pair in others):.1e}"
                rows.append([run.label, effort, contact if _has_forces(run) else NOTHING])
    notes = [
        "Each model against all others on the same motion: the largest difference of any torque "
        "and contact force, divided by the largest component along the motion.",
        *_not_available(comparison),
    ]
    title = f"Differences between models: {_what(comparison)}"
    return ReportTable(
        "differences", title, ("Model", "Torque", "Contact force"), rows, records, notes
    )


def _has_forces(run: Run) -> bool:
    return run.contact_force.shape[1] > 0


def _what(comparison: Comparison) -> str:
    options = comparison.solution.condyle.options
    name = comparison.solution.attrs["mechanism_name"]
    motion = PurePath(options["motion"]).name
    return f"{name}, {motion}, {comparison.samples} samples"


def _not_available(comparison: Comparison) -> Iterator[str]:
    """Each reason once, with the models that it keeps away."""
    reasons: dict[str, list[str]] = {}
    for one in comparison.unavailable:
        reasons.setdefault(one.reason, []).append(one.label)
    for reason, labels in reasons.items():
        yield f"Not available: {', '.join(labels)}. Reason: {reason}."


def table_1(comparison: Comparison) -> ReportTable:
    """Seconds of the symbolic and the numeric part of each model."""
    quoted = paper.is_paper_class(comparison.mechanism)
    first = comparison.run("momentum", "direct")
    records = []
    runs = in_paper_order(comparison) if quoted else [*comparison.runs, *comparison.free_runs]
    for run in runs:
        name, published = _published(run) if quoted else (None, None)
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
    cells = {"Model": "model"} | ({"In the paper": "paper_name"} if quoted else {})
    for k, part in enumerate(("symbolic", "numeric", "total")):
        cells[f"{part.capitalize()} s"] = f"{part}:.3f"
        if quoted:  # headings that are equal for people
            cells["paper" + " " * k] = f"{part}_paper:.3f"
            cells["ratio" + " " * k] = f"{part}_ratio:.4f"
    if quoted:
        cells |= {"of GM 1": "of_gm1:.0%", "paper   ": "of_gm1_paper:.0%"}
    title = f"Table 1. Computational time, {comparison.samples} samples"
    return ReportTable.of("table-1", title, records, cells, list(_notes_1(comparison, quoted)))


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


def _notes_1(comparison: Comparison, quoted: bool) -> Iterator[str]:
    yield (
        f"Symbolic: deriving the model; numeric: torques and contact forces of all "
        f"{comparison.samples} samples, by numpy on {processor()}, Python "
        f"{platform.python_version()}. Seconds are of processor time and vary from run to run; "
        "compiled kernels are faster by far."
    )
    yield (
        "Route core closes the contacts in its numeric part; route direct has that in its "
        "expressions; without contacts X_EE is given."
    )
    if not quoted:
        yield "The paper's seconds are of another mechanism and are left out."
        return
    yield (
        "The paper used Matlab on an i7-8700K and does not state its number of samples, so the "
        "ratios to its seconds mean little; compare the columns 'of GM 1' (totals as part of GM "
        "1's). Its 6RSS shares the symbolic part with Model 2; here each model is derived alone."
    )
    for formulation, names in (("momentum", "GM 2 / GM 1"), ("lagrange", "L-D 2 / L-D 1")):
        direct, core = (comparison.run(formulation, route) for route in ("direct", "core"))
        if direct is None or core is None:
            continue
        published = [paper.TABLE_1[formulation, route].total for route in ("direct", "core")]
        yield (
            f"Total {names}: {core.seconds.total / direct.seconds.total:.0%} here, "
            f"{published[1] / published[0]:.1%} by the paper's table "
            f"({paper.MODEL_2_IN_TEXT[formulation]} in its text)."
        )
    yield (
        "Here every model computes a shared subexpression once, which takes most of Model 1's "
        "disadvantage away."
    )


def processor() -> str:
    """The processor's name, as far as the system names it."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        lines = []
    for line in lines:
        if line.startswith("model name"):
            return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def table_2(comparison: Comparison) -> ReportTable:
    """The indices of eq. (67) with and without the contacts, and what the contacts save."""
    quoted = paper.is_paper_class(comparison.mechanism)
    held, free = comparison.indices(True), comparison.indices(False)
    names = ("RAPM", "6RSS") if quoted else ("with contacts", "without contacts")
    if not comparison.mechanism.contacts:
        names = ("no contacts", "")
    known = (paper.TABLE_2, paper.TABLE_2_FREE) if quoted else ({}, {})
    form = "{:.4f}" if quoted else "{:.5g}"
    parts = list(dict.fromkeys(part for row in held for part in row.values))
    records, rows = [], []
    for k, row in enumerate(held):
        both = [row, *free[k : k + 1]]
        for name, published, row_values in zip(names, known, both, strict=False):
            entries = _entries(name, published, row_values)
            records += entries
            rows.append(_row(f"{name} [{row.unit}]", entries, parts, form))
        if free:
            entries = _savings(known, row, free[k])
            records += entries
            rows.append(_row("saved by contacts", entries, parts, "{:.2%}"))
    heads = [paper.INDEX_NAMES.get(part, f"F_{part}") for part in parts]
    title = "Table 2. Mean norm of the efforts, all without the load, and by part" + (
        ": here (paper, ratio)" if quoted else ""
    )
    notes = list(_notes_2(comparison, quoted))
    return ReportTable("table-2", title, ("Mechanism", *heads), rows, records, notes)


def _entries(name: str, published: dict[str, float], found: Indices) -> list[dict[str, Any]]:
    return [
        _entry(name, found.unit, part, v, published.get(part)) for part, v in found.values.items()
    ]


def _savings(
    known: tuple[dict[str, float], dict[str, float]], held: Indices, free: Indices
) -> list[dict[str, Any]]:
    """(6RSS - RAPM) / 6RSS, which the text of the paper calls an increase."""
    entries = []
    for part, value in held.values.items():
        published = 1 - known[0][part] / known[1][part] if part in known[0] else None
        without = free.values[part]
        saved = 1 - value / without if without else float("nan")
        entries.append(_entry("saved", "1", part, saved, published))
    return entries


def _entry(
    name: str, unit: str, part: str, value: float, published: float | None
) -> dict[str, Any]:
    return {
        "mechanism": name,
        "index": paper.INDEX_NAMES.get(part, f"F_{part}"),
        "part": part,
        "unit": unit,
        "value": value,
        "paper": published,
        "ratio": None if published is None else value / published,
    }


def _row(
    name: str, entries: Sequence[dict[str, Any]], parts: Sequence[str], form: str
) -> list[str]:
    by_part = {entry["part"]: entry for entry in entries}
    return [
        name,
        *(_with_paper(by_part[part], form) if part in by_part else NOTHING for part in parts),
    ]


def _with_paper(entry: dict[str, Any], form: str) -> str:
    value = form.format(entry["value"])
    if entry["paper"] is None:
        return value
    return f"{value} ({form.format(entry['paper'])}, {entry['ratio']:.2f})"


def _notes_2(comparison: Comparison, quoted: bool) -> Iterator[str]:
    options = comparison.solution.condyle.options
    formulation = comparison.runs[0].label
    yield (
        f"[Cheng2023] eq. (67): mean over {comparison.samples} samples of the 2-norm over the "
        f"chains, from {formulation}. F holds all parts; norms do not add up, so F is not their "
        "sum."
    )
    if comparison.free_runs:
        yield (
            "Saved by contacts: (without - with) / without, the platform moving identically."
            + (" The paper's text gives these for three parts as an increase." if quoted else "")
        )
        if quoted:
            yield (
                "The paper's four decimals leave its 9.09% for the cranks anywhere from 0 to 17%."
            )
        yield _condition_note(comparison, quoted)
    if paper.is_stand_in(comparison.mechanism):
        yield (
            "The mechanism stands in for the authors' robot, of which no geometry or inertia was "
            "published. It was calibrated to this very table, so agreement shows that the "
            "indices are computed right, nothing more."
        )
    if paper.is_synthetic(options["motion"]):
        yield "The motion is synthetic, not the paper's recording, which was never published."
    elif quoted:
        yield f"The motion is {PurePath(options['motion']).name}, not the paper's recording."


def _condition_note(comparison: Comparison, quoted: bool) -> str:
    note = (
        "Without contacts the condition number of the dimensionless J_W is at most "
        f"{comparison.free_condition:.4g}"
    )
    if not quoted:
        return note + "."
    return note + "; the paper calls its 6RSS at or near singular, which this one is not."


def tradeoff_table(tradeoff: Tradeoff) -> ReportTable:
    """A row a weight: effort, greatest activation, and the load on the contacts."""
    solution = tradeoff.solution
    names = solution.condyle.mechanism.contact_names
    records: list[dict[str, Any]] = []
    for p, weight in enumerate(tradeoff.weights):
        record = {
            "weight": float(weight),
            "effort": float(tradeoff.effort[p]),
            "greatest_activation": float(tradeoff.activation[p]),
            "contact_load": float(tradeoff.load[p]),
        }
        for k, name in enumerate(names):
            record[f"mean_{name}"] = float(tradeoff.mean[p, k])
            record[f"peak_{name}"] = float(tradeoff.peak[p, k])
        records.append(record)
    cells: dict[str, Any] = {
        "W": "weight:.3g",
        "Effort": "effort:.4g",
        "Greatest use": "greatest_activation:.4g",
        "Contact load [N]": "contact_load:.4g",
    }
    for name in names:
        cells[f"{name} [N]"] = lambda r, n=name: f"{r[f'mean_{n}']:.4g} ({r[f'peak_{n}']:.4g})"
    title = (
        f"Effort against load on the contacts: {solution.attrs['mechanism_name']}, "
        f"{PurePath(solution.condyle.options['motion']).name}, {tradeoff.samples} samples"
    )
    notes = [
        "Least is sum (effort/limit)^2 + W sum (force/N_ref)^2, W in the first column, N_ref = "
        f"{tradeoff.reference_force:.5g} N, the largest limit of the chains as a force.",
        "Effort: root mean square along the motion of sqrt(sum (effort/limit)^2); contact load: "
        "of sqrt(sum force^2). Greatest use: the largest effort over its limit.",
        "Of every contact the mean of |force| along the motion, and the largest in brackets.",
    ]
    return ReportTable.of("tradeoff", title, records, cells, notes)
