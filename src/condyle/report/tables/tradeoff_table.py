"""Least effort against least load on the contacts, weight by weight."""

from __future__ import annotations

from pathlib import PurePath
from typing import Any

from ...analysis.weight_curve import Tradeoff
from .report_table import Table


def tradeoff_table(found: Tradeoff) -> Table:
    """A row a weight: effort, greatest activation, and the load on the contacts."""
    solution = found.solution
    names = solution.condyle.mechanism.contact_names
    records: list[dict[str, Any]] = []
    for p, weight in enumerate(found.weights):
        record = {
            "weight": float(weight),
            "effort": float(found.effort[p]),
            "greatest_activation": float(found.activation[p]),
            "contact_load": float(found.load[p]),
        }
        for k, name in enumerate(names):
            record[f"mean_{name}"] = float(found.mean[p, k])
            record[f"peak_{name}"] = float(found.peak[p, k])
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
        f"{PurePath(solution.condyle.options['motion']).name}, {found.samples} samples"
    )
    notes = [
        "Least is sum (effort/limit)^2 + W sum (force/N_ref)^2, W in the first column, N_ref = "
        f"{found.reference_force:.5g} N, the largest limit of the chains as a force.",
        "Effort: root mean square along the motion of sqrt(sum (effort/limit)^2); contact load: "
        "of sqrt(sum force^2). Greatest use: the largest effort over its limit.",
        "Of every contact the mean of |force| along the motion, and the largest in brackets.",
    ]
    return Table.of("tradeoff", title, records, cells, notes)
