"""A program traced in JAX, operation by operation: slower to compile and to run on processors than
our own C, but it runs wherever JAX does."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from ..backends.kernel import AGAIN, OK
from ..graph.operations import OPERATIONS, REDUCTIONS
from ..graph.program import Numbers, Program

Arrays = Mapping[str, Any]


def traced(program: Program, numbers: Numbers) -> Callable[[Arrays], dict[str, Any]]:
    """A function of arrays by port, (..., size) each with one leading shape, lanes in the callers'
    order; results are (..., *shape), lanes last, and `status` (...)."""
    order = np.array(numbers.order)
    groups = np.split(order, np.cumsum(program.counts)[:-1])

    def run(ports: Arrays) -> dict[str, Any]:
        import jax.numpy as jnp

        lead = next(iter(ports.values())).shape[:-1]
        columns = {}
        for port in program.ports:
            blocks = ports[port.name].reshape(*lead, port.size, -1) if port.lanes else None
            for i in range(port.size):
                if blocks is None:
                    columns[port.start + i] = ports[port.name][..., i]
                    continue
                first = port.start + i * len(order)
                for group in groups:
                    columns[first] = jnp.moveaxis(blocks[..., i, group], -1, 0)
                    first += len(group)
        values = _values(program, columns, numbers, len(lead))
        results = {}
        for o in program.outputs:
            rows = []
            for entry in o.entries:
                parts = [
                    jnp.broadcast_to(values[v], (count if o.lanes else 1, *lead))
                    for v, count in zip(entry, program.counts, strict=False)
                    if v is not None
                ]
                row = jnp.moveaxis(jnp.concatenate(parts), 0, -1)
                own = np.concatenate([groups[g] for g in o.groups()]) if o.lanes else [0]
                rows.append(row[..., np.argsort(own)])
            shape = (*o.shape, rows[0].shape[-1]) if o.lanes and rows else o.shape
            row = jnp.concatenate(rows, axis=-1) if rows else jnp.zeros((*lead, 0))
            results[o.name] = row.reshape(*lead, *shape)
        return results | {"status": _status(program, values, lead)}

    return run


def _values(
    program: Program, columns: Mapping[int, Any], numbers: Numbers, samples: int
) -> dict[int, Any]:
    """Shared values (...), those of lanes (lanes, ...)."""
    import jax.numpy as jnp

    g, values = program.graph, dict[int, Any]()
    functions = _functions()
    for v in program.order:
        node = g.nodes[v]
        if node.op == "const":
            values[v] = node.data[0]
        elif node.op in ("input", "lane_input"):
            values[v] = columns[node.data[-1]]  # type: ignore[index]
        elif node.op == "parameter":
            values[v] = numbers.parameters[0, node.data[0]]  # type: ignore[index]
        elif node.op == "lane":
            group, i = node.data
            own = numbers.lanes[group][0, i]  # type: ignore[call-overload,index]
            values[v] = own.reshape(-1, *[1] * samples)
        elif node.op in REDUCTIONS:
            join, sums = (jnp.sum, True) if node.op == "sum" else (jnp.min, False)
            total = None
            for a, count in zip(node.args, program.counts, strict=True):
                lanes = g.nodes[a].group is not None
                term = join(values[a], axis=0) if lanes else values[a] * (count if sums else 1)
                if total is not None:
                    term = total + term if sums else jnp.minimum(total, term)
                total = term
            values[v] = total
        else:
            values[v] = functions[node.op](*(values[a] for a in node.args))
    return values


def _functions() -> dict[str, Callable[..., Any]]:
    """The operations of graphs in JAX."""
    import jax
    import jax.numpy as jnp

    def truth(compare: Callable[..., Any]) -> Callable[..., Any]:
        return lambda a, b: compare(a, b).astype(float)

    functions = {
        name: getattr(jnp, op.numpy.__name__)
        for name, op in OPERATIONS.items()
        if isinstance(op.numpy, np.ufunc)
    }
    return functions | {
        "fma": lambda a, b, c: c + a * b,
        "fnma": lambda a, b, c: c - a * b,
        "fmin": lambda a, b: jnp.where(a < b, a, b),
        "fmax": lambda a, b: jnp.where(a > b, a, b),
        "le": truth(jnp.less_equal),
        "lt": truth(jnp.less),
        "eq": truth(jnp.equal),
        "ne": truth(jnp.not_equal),
        "and": truth(jnp.logical_and),
        "or": truth(jnp.logical_or),
        "not": lambda a: jnp.logical_not(a).astype(float),
        "where": lambda a, b: jnp.where(jnp.asarray(a) != 0, b, 0.0),
        "remainder": lambda a, b: a - b * jnp.rint(a / b),
        "erf": jax.scipy.special.erf,
    }


def _status(program: Program, values: Mapping[int, Any], lead: tuple[int, ...]) -> Any:
    """As of `Answer`."""
    import jax.numpy as jnp

    status = jnp.full(lead, OK, dtype=jnp.uint8)
    for check in program.checks:
        value, below = values[check.value], AGAIN if check.below is None else int(check.below)
        own = jnp.where(
            value >= check.tolerance, OK, jnp.where(jnp.asarray(value) < 0, below, AGAIN)
        )
        better = (status == OK) | ((status == AGAIN) & (own != OK) & (own != AGAIN))
        status = jnp.where(better, own, status).astype(jnp.uint8)
    return status
