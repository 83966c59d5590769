"""A program in interval arithmetic of many digits: every value between two numbers, by mpmath."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, cast

import numpy as np

from ..extras import require
from ..graph.operations import REDUCTIONS
from ..graph.program import Numbers, Program
from .kernel import columns_of, results_of

DIGITS = 60


class UndecidedError(Exception):
    """A comparison of intervals that overlap, or an operation without a rule for intervals."""


def enclosed(
    program: Program, numbers: Numbers, inputs: Mapping[str, np.ndarray]
) -> dict[str, np.ndarray]:
    """Results of one sample by name, intervals of mpmath with shapes (..., 1), lanes as callers'.

    Inputs and numbers are the doubles that they are; every operation is rounded outwards.

    Args:   inputs: port -> (1, size), (1, lanes) or (1, size, lanes).
    Raises: UndecidedError: where the intervals do not say what the program does.
            MissingExtraError: without mpmath.
    """
    require("mpmath", "prove")
    from mpmath import iv

    iv.dps = DIGITS
    rules, unit = _rules(iv), iv.mpf(1)
    _, columns = columns_of(program.interface, inputs, numbers.order)
    nodes, counts, value = program.graph.nodes, program.counts, dict[int, list[Any]]()
    for v in program.order:
        node, data = nodes[v], cast("tuple[Any, ...]", nodes[v].data)
        if node.op == "const":
            value[v] = [iv.mpf(data[0])]
        elif node.op == "parameter":
            value[v] = [iv.mpf(float(numbers.parameters[0, data[0]]))]
        elif node.op == "lane":
            group, i = data
            value[v] = [iv.mpf(float(x)) for x in numbers.lanes[group][0, i]]
        elif node.op == "input":
            value[v] = [iv.mpf(float(columns[data[0]][0]))]
        elif node.op == "lane_input":
            group, first = data
            value[v] = [iv.mpf(float(columns[first + i][0])) for i in range(counts[group])]
        elif node.op in REDUCTIONS:
            terms = [
                x for a, n in zip(node.args, counts, strict=True) for x in _spread(value[a], n)
            ]
            join = rules["add" if node.op == "sum" else "fmin"]
            interval = terms[0]
            for x in terms[1:]:
                interval = join(interval, x)
            value[v] = [interval]
        else:
            if node.op not in rules:
                raise UndecidedError(node.op)
            lanes = max(len(value[a]) for a in node.args)
            given = (_spread(value[a], lanes) for a in node.args)
            value[v] = [rules[node.op](*row) * unit for row in zip(*given, strict=True)]
    width = sum(program.interface.width(r) for r in program.interface.results)
    interval = np.empty((width, 1), dtype=object)
    for at, v, lanes in program.stored():
        if at < width:
            interval[at : at + lanes, 0] = _spread(value[v], lanes)
    return results_of(program.interface, interval, numbers.order)


def _spread(values: list[Any], count: int) -> list[Any]:
    return values if len(values) == count else values * count


def _rules(iv: Any) -> dict[str, Any]:
    """The operations on intervals."""

    def decided(truth: bool | None) -> Any:
        if truth is None:
            raise UndecidedError("a comparison")
        return iv.mpf(int(truth))

    def least(a: Any, b: Any) -> Any:
        return iv.mpf([min(a.a, b.a), min(a.b, b.b)])

    return {
        "add": lambda a, b: a + b,
        "sub": lambda a, b: a - b,
        "mul": lambda a, b: a * b,
        "div": lambda a, b: a / b,
        "neg": lambda a: -a,
        "fma": lambda a, b, c: c + a * b,
        "fnma": lambda a, b, c: c - a * b,
        "sqrt": iv.sqrt,
        "sin": iv.sin,
        "cos": iv.cos,
        "atan2": iv.atan2,
        "fabs": abs,
        "fmin": least,
        "fmax": lambda a, b: -least(-a, -b),
        "le": lambda a, b: decided(a <= b),
        "lt": lambda a, b: decided(a < b),
        "eq": lambda a, b: decided(a == b),
        "ne": lambda a, b: decided(a != b),
        "and": lambda a, b: decided(bool(a.a != 0) and bool(b.a != 0)),
        "or": lambda a, b: decided(bool(a.a != 0) or bool(b.a != 0)),
        "not": lambda a: decided(bool(a.a == 0)),
        "where": lambda a, b: b if a.a != 0 else iv.mpf(0),
        "sign": lambda a: decided(a > 0) - decided(a < 0),
        "copysign": lambda a, b: abs(a) * (1 - 2 * decided(b < 0)),
    }
