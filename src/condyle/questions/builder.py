"""The builder of a question: ports, lanes, sums over lanes, symbols to differentiate by.

One expression serves every chain of a family, with the chain's numbers as inputs: a `lane` value
differs from chain to chain, a shared one does not, and `total` sums lanes.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property

import casadi as ca

from ..graph.graph import Graph, Value
from ..graph.program import Check, Output, Port, Program
from ..graph.read import read
from ..graph.transform import substituted, tangents
from ..kinematics.moving_base import MovingBase
from .numbers import Layout
from .structure import GIVEN, Structure

Lanes = list[ca.SX]  # one expression a group


class Builder:
    """Collects the graph of one question about mechanisms of one structure."""

    def __init__(self, structure: Structure, layout: Layout | None = None) -> None:
        self.structure = structure
        self.layout: Layout = layout or Layout.of(structure)
        self.graph: Graph = Graph()
        self._ports: list[Port] = []
        self._columns = 0
        self._unknowns = 0
        self._outputs: list[tuple[str, tuple[int, ...], str, bool, list[ca.SX | None]]] = []
        self._checks: list[tuple[ca.SX, float, int | None]] = []
        self._known: dict[str, Value] = {}

    # -- inputs ----------------------------------------------------------------------------

    def sample(self, name: str, size: int, unit: str = "") -> ca.SX:
        """An input of every sample, (size,)."""
        start = self._port(name, size, unit, lanes=False)
        return self.symbols(name, [self.graph.leaf("input", start + i) for i in range(size)])

    def lane_sample(self, name: str, size: int = 1, unit: str = "") -> Lanes:
        """An input of every sample and chain, (size,) a group."""
        start = self._port(name, size, unit, lanes=True)
        lanes = []
        before = 0
        for group, count in enumerate(self.structure.counts):
            firsts = [start + i * self.structure.n + before for i in range(size)]
            leaves = [self.graph.leaf("lane_input", group, c, group=group) for c in firsts]
            lanes.append(self.symbols(f"{name}_{group}", leaves))
            before += count
        return lanes

    def _port(self, name: str, size: int, unit: str, lanes: bool) -> int:
        start = self._columns
        self._ports.append(Port(name, size, unit, lanes, start))
        self._columns += size * (self.structure.n if lanes else 1)
        return start

    def parameter(self, name: str) -> ca.SX:
        """A shared number of the mechanism, or several, by the names of the layout."""
        start, count = self.layout.parameters[name]
        return self.symbols(name, [self._number(-1, start + i) for i in range(count)])

    @cached_property
    def gravity(self) -> ca.SX:
        """Gravity in {S}, (3,): of the sample where it is given, else the mechanism's."""
        given = "gravity" in self.structure.given
        return self._given("gravity") if given else self.parameter("gravity")

    @cached_property
    def base(self) -> MovingBase | None:
        """How the base moves; None where it stands still."""
        if "base" not in self.structure.given:
            return None
        return MovingBase(*ca.vertsplit(self._given("base"), 3))

    def _given(self, name: str) -> ca.SX:
        return self.sample(name, *GIVEN[name])

    def lane(self, group: int, name: str) -> ca.SX:
        """Constants of the chains of a group: `mask`, `joint` or `constants`."""
        start, count = self.layout.lanes[group][name]
        return self.symbols(
            f"{name}_{group}", [self._number(group, start + i) for i in range(count)]
        )

    def _number(self, group: int, i: int) -> Value:
        if (group, i) in self.structure.zeros:
            return self.graph.const(0.0)
        if group < 0:
            return self.graph.leaf("parameter", i)
        return self.graph.leaf("lane", group, i, group=group)

    def unknown(self, name: str, size: int, group: int | None = None) -> ca.SX:
        """Free symbols, to differentiate by and to be replaced: shared, or of a group's lanes."""
        self._unknowns += size
        columns = range(-self._unknowns, size - self._unknowns)
        if group is None:
            return self.symbols(name, [self.graph.leaf("input", i) for i in columns])
        leaves = [self.graph.leaf("lane_input", group, i, group=group) for i in columns]
        return self.symbols(name, leaves)

    # -- operations ------------------------------------------------------------------------

    def total(self, terms: Sequence[ca.SX]) -> ca.SX:
        """Sum over all chains, entry by entry; one term a group."""
        return self._reduced("sum", terms)

    def least(self, terms: Sequence[ca.SX]) -> ca.SX:
        """Minimum over all chains; one term a group."""
        return self._reduced("least", terms)

    def cut(self, expression: ca.SX) -> ca.SX:
        """Symbols for the value of an expression, to differentiate with respect to."""
        return self.symbols("cut", self.values([expression])[0])

    def waist(self, *parts: ca.SX) -> None:
        """Few values through which many others depend on the inputs: see `transform.jacobian`."""
        self.graph.waists.append(tuple(v for found in self.values(parts) for v in found))

    def tangent(self, expression: ca.SX, wrt: ca.SX, direction: Sequence[float]) -> ca.SX:
        """Derivative of an expression along a direction of cut or input symbols.

        Unlike CasADi's it goes through sums over lanes.
        """
        roots, leaves = self.values([expression, wrt])
        seeds = {v: self.graph.const(d) for v, d in zip(leaves, direction, strict=True)}
        return self.symbols("tangent", tangents(self.graph, roots, seeds))

    def jacobian(self, expression: ca.SX, wrt: ca.SX) -> ca.SX:
        """d expression / d wrt, through sums over lanes."""
        size = wrt.numel()
        unit = [[float(i == k) for i in range(size)] for k in range(size)]
        return ca.horzcat(*(self.tangent(expression, wrt, direction) for direction in unit))

    def at_zero(self, expression: ca.SX, *symbols: ca.SX) -> ca.SX:
        """An expression where some cut or input symbols vanish."""
        return self.substituted(expression, symbols, [ca.SX.zeros(x.shape) for x in symbols])

    def substituted(
        self, expression: ca.SX, symbols: Sequence[ca.SX], values: Sequence[ca.SX]
    ) -> ca.SX:
        """An expression with values in the place of cut, input or unknown symbols."""
        roots = self.values([expression])[0]
        pairs = zip(self.values(symbols), self.values(values), strict=True)
        replaced = {x: v for xs, vs in pairs for x, v in zip(xs, vs, strict=True)}
        new = self.symbols("substituted", substituted(self.graph, roots, replaced))
        return ca.reshape(new, expression.shape)

    def _reduced(self, op: str, terms: Sequence[ca.SX]) -> ca.SX:
        nodes = self.values(terms)
        return self.symbols(op, [self.graph.reduce(op, e) for e in zip(*nodes, strict=True)])

    def values(self, expressions: Sequence[ca.SX]) -> list[list[Value]]:
        """Values of expressions, entry by entry, column by column."""
        return read(self.graph, expressions, self._known)

    def symbols(self, name: str, values: Sequence[Value]) -> ca.SX:
        """Symbols for values."""
        made = [ca.SX.sym(f"{name}#{len(self._known) + i}") for i in range(len(values))]
        self._known |= {symbol.name(): value for symbol, value in zip(made, values, strict=True)}
        return ca.vertcat(*made) if made else ca.SX(0, 1)

    # -- outputs ---------------------------------------------------------------------------

    def output(
        self, name: str, value: ca.SX | Sequence[ca.SX | None], unit: str, *shape: int
    ) -> None:
        """A result; expressions one a group are a lane value, None where a group has none.

        Args: shape: by default () for one number, else (entries,).
        """
        lanes = not isinstance(value, ca.SX)
        parts: list[ca.SX | None] = [value] if isinstance(value, ca.SX) else list(value)
        size = next(p.numel() for p in parts if p is not None)
        self._outputs.append((name, shape or ((size,) if size != 1 else ()), unit, lanes, parts))

    def check(self, value: ca.SX, tolerance: float, below: int | None = None) -> None:
        """A condition on every sample: see `Check`."""
        self._checks.append((value, tolerance, below))

    def finish(self) -> Program:
        """The frozen question."""
        parts = [p for *_, parts in self._outputs for p in parts if p is not None]
        # All in one reading, since each goes through everything its expressions share.
        # Results are written row by row, CasADi's matrices stand column by column.
        rows = [ca.vec(p.T) for p in parts]
        values = iter(self.values([*rows, *(value for value, *_ in self._checks)]))
        outputs = []
        for name, shape, unit, lanes, own in self._outputs:
            entries = zip(*self._entries(own, values), strict=True)
            outputs.append(Output(name, shape, unit, lanes, tuple(entries)))
        checks = [Check(next(values)[0], tolerance, below) for _, tolerance, below in self._checks]
        return Program(
            self.graph,
            self.structure.counts,
            self._columns,
            tuple(self._ports),
            tuple(outputs),
            tuple(checks),
        )

    @staticmethod
    def _entries(
        parts: list[ca.SX | None], found: Iterator[list[Value]]
    ) -> list[list[Value] | list[None]]:
        size = next(p.numel() for p in parts if p is not None)
        return [[None] * size if p is None else next(found) for p in parts]
