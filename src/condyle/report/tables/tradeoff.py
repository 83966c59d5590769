"""Least effort against least load on the contacts, weight by weight."""

from __future__ import annotations

from pathlib import PurePath
from typing import Any

from ...analysis.weight_curve import Tradeoff
from .table import Table


def tradeoff_table(found: Tradeoff) -> Table:
    """A row a weight: effort, greatest activation, and the load on the contacts."""
    names = found.solution.mechanism.contact_names
    rows, records = [], []
    for p, weight in enumerate(found.weights):
        record: dict[str, Any] = {
            "weight": float(weight),
            "effort": float(found.effort[p]),
            "greatest_activation": float(found.activation[p]),
            "contact_load": float(found.load[p]),
        }
        row = [f"{weight:.3g}", f"{found.effort[p]:.4g}", f"{found.activation[p]:.4g}"]
        row.append(f"{found.load[p]:.4g}")
        for k, name in enumerate(names):
            record |= {
                f"mean_{name}": float(found.mean[p, k]),
                f"peak_{name}": float(found.peak[p, k]),
            }
            row.append(f"{found.mean[p, k]:.4g} ({found.peak[p, k]:.4g})")
        rows.append(row)
        records.append(record)
    solution = found.solution
    title = (
        f"Effort against load on the contacts: {solution.attrs['mechanism_name']}, "
        f"{PurePath(solution.options['motion']).name}, {found.samples} samples"
    )
    notes = [
        "Least is sum (effort/limit)^2 + W sum (force/N_ref)^2, W in the first column, N_ref = "
        f"{found.reference_force:.5g} N, the largest limit of the chains as a force.",
        "Effort: root mean square along the motion of sqrt(sum (effort/limit)^2); contact load: "
        "of sqrt(sum force^2). Greatest use: the largest effort over its limit.",
        "Of every contact the mean of |force| along the motion, and the largest in brackets.",
    ]
    heads = ("W", "Effort", "Greatest use", "Contact load [N]", *(f"{n} [N]" for n in names))
    return Table("tradeoff", title, heads, rows, records, notes)
