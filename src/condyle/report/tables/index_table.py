"""Table 2: how large the torques are, by part, with and without the contacts."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import PurePath
from typing import Any

from ...analysis import paper
from ...analysis.comparison import Comparison
from ...analysis.torque_indices import Indices
from .report_table import NOTHING, Table


def table_2(comparison: Comparison) -> Table:
    """The indices of eq. (67) with and without the contacts, and what the contacts save."""
    beside = paper.is_paper_class(comparison.mechanism)
    held, free = comparison.indices(True), comparison.indices(False)
    names = ("RAPM", "6RSS") if beside else ("with contacts", "without contacts")
    if not comparison.mechanism.contacts:
        names = ("no contacts", "")
    known = (paper.TABLE_2, paper.TABLE_2_FREE) if beside else ({}, {})
    form = "{:.4f}" if beside else "{:.5g}"
    parts = list(dict.fromkeys(part for one in held for part in one.values))
    records, rows = [], []
    for k, one in enumerate(held):
        both = [one, *free[k : k + 1]]
        for name, published, found in zip(names, known, both, strict=False):
            entries = _entries(name, published, found)
            records += entries
            rows.append(_row(f"{name} [{one.unit}]", entries, parts, form))
        if free:
            entries = _savings(known, one, free[k])
            records += entries
            rows.append(_row("saved by contacts", entries, parts, "{:.2%}"))
    heads = [paper.INDEX_NAMES.get(part, f"F_{part}") for part in parts]
    title = "Table 2. Mean norm of the efforts, all without the load, and by part" + (
        ": here (paper, ratio)" if beside else ""
    )
    notes = list(_notes_2(comparison, beside))
    return Table("table-2", title, ("Mechanism", *heads), rows, records, notes)


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
    return [name, *(_beside(by_part[part], form) if part in by_part else NOTHING for part in parts)]


def _beside(entry: dict[str, Any], form: str) -> str:
    value = form.format(entry["value"])
    if entry["paper"] is None:
        return value
    return f"{value} ({form.format(entry['paper'])}, {entry['ratio']:.2f})"


def _notes_2(comparison: Comparison, beside: bool) -> Iterator[str]:
    options = comparison.solution.options
    formulation = comparison.runs[0].label
    yield (
        f"[Cheng2023] eq. (67): mean over {comparison.samples} samples of the 2-norm over the "
        f"chains, from {formulation}. F holds all parts; norms do not add up, so F is not their "
        "sum."
    )
    if comparison.free_runs:
        yield (
            "Saved by contacts: (without - with) / without, the platform moving identically."
            + (" The paper's text gives these for three parts as an increase." if beside else "")
        )
        if beside:
            yield (
                "The paper's four decimals leave its 9.09% for the cranks anywhere from 0 to 17%."
            )
        yield _condition_note(comparison, beside)
    if paper.is_stand_in(comparison.mechanism):
        yield (
            "The mechanism stands in for the authors' robot, of which no geometry or inertia was "
            "published. It was calibrated to this very table, so agreement shows that the "
            "indices are computed right, nothing more."
        )
    if paper.is_synthetic(options["motion"]):
        yield "The motion is synthetic, not the paper's recording, which was never published."
    elif beside:
        yield f"The motion is {PurePath(options['motion']).name}, not the paper's recording."


def _condition_note(comparison: Comparison, beside: bool) -> str:
    note = (
        "Without contacts the condition number of the dimensionless J_W is at most "
        f"{comparison.free_condition:.4g}"
    )
    if not beside:
        return note + "."
    return note + "; the paper calls its 6RSS at or near singular, which this one is not."
