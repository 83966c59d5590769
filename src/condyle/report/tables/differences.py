"""How far the models are from each other."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import PurePath

from ...analysis.comparison import Comparison, Difference
from ...analysis.runs import Run
from .report_table import NOTHING, Table


def differences(comparison: Comparison) -> Table:
    """How far each model is from the others; the CSV has every two."""
    rows, records = [], []
    for contacts, runs in ((True, comparison.runs), (False, comparison.free_runs)):
        pairs = comparison.differences(contacts)
        records += [
            {
                "first": pair.first.label,
                "second": pair.second.label,
                "torque": pair.torque,
                "contact_force": pair.contact_force if _has_forces(pair.first) else None,
            }
            for pair in pairs
        ]
        for run in runs:
            others = [pair for pair in pairs if run in (pair.first, pair.second)]
            if others:
                rows.append([run.label, *_largest(others, _has_forces(run))])
    notes = [
        "Each model against all others on the same motion: the largest difference of any torque "
        "and contact force, divided by the largest component along the motion.",
        *_not_available(comparison),
    ]
    title = f"Differences between models: {_what(comparison)}"
    return Table("differences", title, ("Model", "Torque", "Contact force"), rows, records, notes)


def _largest(pairs: Sequence[Difference], forces: bool) -> list[str]:
    torque = max(pair.torque for pair in pairs)
    contact = max(pair.contact_force for pair in pairs)
    return [f"{torque:.1e}", f"{contact:.1e}" if forces else NOTHING]


def _has_forces(run: Run) -> bool:
    return run.contact_force.shape[1] > 0


def _what(comparison: Comparison) -> str:
    options = comparison.solution.options
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
