"""Small programs made by hand, and how to run them every way."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from benchmarks.casadi_function import casadi_function
from condyle.backends.kernel import results_of
from condyle.graph.graph import Graph, Value
from condyle.graph.program import Check, Numbers, Output, Port, Program

LANES = 3  # no whole number of vectors


def program(
    graph: Graph, roots: Sequence[Value], columns: int, checks: Sequence[Check] = ()
) -> Program:
    """Shared values of one port x as outputs 0, 1, ...; one group of `LANES` lanes."""
    outputs = tuple(Output(str(i), (), "", False, ((v,),)) for i, v in enumerate(roots))
    return Program(
        graph, (LANES,), columns, (Port("x", columns, "", False, 0),), outputs, tuple(checks)
    )


def no_numbers(lanes: int = LANES) -> Numbers:
    one = np.zeros((1, 1))
    return Numbers(one, (np.zeros((1, 1, lanes)),), (one,), tuple(range(lanes)))


def by_casadi(p: Program, numbers: Numbers, samples: np.ndarray) -> dict[str, np.ndarray]:
    """Results by name, samples last, by CasADi's interpreter; samples: (N, columns)."""
    *outputs, _ = casadi_function(p, numbers).map(len(samples))(samples.T)
    return results_of(p.interface, np.vstack([np.array(o) for o in outputs]), numbers.order)
