"""The table of what does not change from sample to sample, by numpy."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...graph.operations import OPERATIONS, REDUCTIONS
from ...graph.program import Numbers
from .printer import Printer


def constants_table(printer: Printer, numbers: Numbers) -> np.ndarray:
    """The numbers that a body reads as `table`, (size,), of a single mechanism."""
    g, padded = printer.g, printer.padded
    lanes = [
        np.hstack([own, np.repeat(pad[:, None], width - own.shape[1], axis=1)])
        for (own,), (pad,), width in zip(numbers.lanes, numbers.padding, padded, strict=True)
    ]
    values: dict[int, Any] = {}
    with np.errstate(all="ignore"):
        for v in printer.fixed:
            op, args, data = g.nodes[v].op, g.nodes[v].args, g.nodes[v].data
            if op == "const":
                values[v] = np.float64(data[0])  # type: ignore[arg-type]
            elif op == "parameter":
                values[v] = numbers.parameters[0, int(data[0])]  # type: ignore[call-overload,index]
            elif op == "lane":
                values[v] = lanes[int(data[0])][int(data[1])]  # type: ignore[call-overload]
            elif op in REDUCTIONS:
                values[v] = _reduced(printer, v, values)
            else:
                values[v] = OPERATIONS[op].numpy(*(values[a] for a in args))
    table = np.zeros(printer.table_size)
    for v, slot in printer.table.shared.items():
        table[slot] = values[v]
    for group, slots in enumerate(printer.table.lanes):
        for v, slot in slots.items():
            start = printer.starts[group] + slot * padded[group]
            table[start : start + padded[group]] = values[v]
    return table


def _reduced(printer: Printer, v: int, values: dict[int, Any]) -> float:
    own = [values[t][: printer.counts[g]] for g, t in printer.lane_terms(v)]
    shared = [(count, values[t]) for count, t in printer.shared_terms(v)]
    if printer.g.nodes[v].op == "sum":
        return sum(a.sum() for a in own) + sum(count * a for count, a in shared)
    return min([a.min() for a in own] + [a for _, a in shared])
