"""Where the numbers of a question stand in the arrays of a C function."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from ..graph.program import Interface


@dataclass(frozen=True)
class Places:
    """Arrays in the order of the mechanism file; a program's lanes stand family by family.

    columns: C for each input of the program.
    names:   result -> its array in C; what is not there is not wanted.
    order:   where each lane of the program stands in the mechanism file.
    """

    columns: tuple[str, ...]
    names: Mapping[str, str]
    order: tuple[int, ...]

    @staticmethod
    def of(
        interface: Interface,
        order: tuple[int, ...],
        ports: Mapping[str, str],
        results: Mapping[str, str],
    ) -> Places:
        """Args: ports, results: names there -> arrays in C."""
        n = interface.lanes
        columns = []
        for port in interface.ports:
            where = [(i, k) for i in range(port.size) for k in (order if port.lanes else (0,))]
            stride = n if port.lanes else 1
            columns += [f"{ports[port.name]}[{i * stride + k}]" for i, k in where]
        return Places(tuple(columns), results, order)

    def result(self, name: str, entry: int, lane: int | None) -> str:
        """C for one number of a result, of a lane if it has lanes."""
        at = entry if lane is None else entry * len(self.order) + self.order[lane]
        return f"{self.names[name]}[{at}]"
