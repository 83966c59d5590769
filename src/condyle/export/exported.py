"""An export in C, and its interface.

Other targets (MEX files, FMUs) build on this: they call `Function`s by their arguments and do not
depend on the source.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any, Literal

from ..graph.program import OutputShape, Port
from ..mechanism.home import independent_coordinates
from ..mechanism.mechanism import Mechanism
from ..quantities import Quantity, row
from ..quantities.entries import AXES
from ..questions.derivative import PREFIX
from .catalogue import Wish

Precision = Literal["double", "float"]


@dataclass(frozen=True)
class CArray:
    """An array of a C function, one dimension, in the order of `labels`.

    name:   in C.
    text:   what it is, in a few words.
    labels: name of each entry, as the mechanism file has it.
    units:  of each entry.
    given:  whether it is an input.
    port:   name of the input or result of the question, if it is one.
    """

    name: str
    text: str
    labels: tuple[str, ...]
    units: tuple[str, ...]
    given: bool
    port: str = ""

    @property
    def size(self) -> int:
        return len(self.labels)

    @property
    def unit(self) -> str:
        """One unit where all are alike, else one for each entry."""
        return self.units[0] if len(set(self.units)) == 1 else ", ".join(self.units)

    def declared(self, real: str) -> str:
        """As a parameter in C."""
        return f"{'const ' if self.given else ''}{real} {self.name}[{self.size}]"


@dataclass(frozen=True)
class Function:
    """One exported question.

    name:       in C.
    question:   in the catalogue (`inverse`, `motion` ..).
    text:       what it computes.
    iterations: maximum number of steps; 0 without iteration.
    operations: floating-point operations, sine and cosine as one.
    statuses:   that it may return besides ok: name -> reason.
    """

    name: str
    question: str
    text: str
    arguments: tuple[CArray, ...]
    iterations: int
    operations: int
    statuses: Mapping[str, str]

    @property
    def inputs(self) -> tuple[CArray, ...]:
        return tuple(a for a in self.arguments if a.given)

    @property
    def outputs(self) -> tuple[CArray, ...]:
        return tuple(a for a in self.arguments if not a.given)


@dataclass(frozen=True)
class Exported:
    """A mechanism in C.

    mechanism, wish: what was exported, and what `closure` starts from.
    prefix:    what every name begins with.
    source:    text of `prefix`.c, C99.
    header:    text of `prefix`.h, C99 and C++.
    names:     names of chains, contacts and points -> their identifiers in C.
    struct:    whether constants stand in a structure that is given to every function, in place of
               inside.
    lanes:     width of the vector types, 0 where there are none.
    symbols:   functions of the C library that the source may call.
    recipe:    how the model is made that these functions are of: keywords of `condyle.derive`.
    """

    mechanism: Mechanism
    wish: Wish
    prefix: str
    source: str
    header: str
    functions: tuple[Function, ...]
    precision: Precision
    names: Mapping[str, str]
    struct: bool
    lanes: int
    symbols: tuple[str, ...]
    recipe: Mapping[str, Any]

    def __getitem__(self, question: str) -> Function:
        return next(f for f in self.functions if f.question == question)

    @property
    def context(self) -> str:
        """The first parameter of every function, where constants are a structure."""
        return f"const {self.prefix}_constants *constants" if self.struct else ""

    def prototype(self, function: Function) -> str:
        """Declaration of a function, without the semicolon."""
        parts = [a.declared(self.precision) for a in function.arguments]
        return f"int {function.name}({', '.join([self.context] * self.struct + parts)})"


LETTERS = {"force": "F", "moment": "M"}  # of axes


class FunctionArguments:
    """Arguments about one mechanism, described by their quantities.

    given:    names of what `closure` starts from;  landmark: whose path that is, if it is one.
    """

    def __init__(
        self, mechanism: Mechanism, given: Sequence[str] = (), landmark: str | None = None
    ) -> None:
        self._mechanism, self._landmark = mechanism, landmark
        self._prescribed = tuple(given) if landmark is None else AXES

    def argument(
        self, name: str, port: Port | OutputShape, given: bool, described: tuple[str, str] | None
    ) -> CArray:
        """What a port or result is in C.

        Args: name: in C;  described: description, and unit where they are not its quantity's.
        """
        if "_by_" in name:
            return self._slopes(name, port.name)
        size = port.size if isinstance(port, Port) else math.prod(port.shape)
        known = name.removeprefix(PREFIX)
        quantity, unit = row(wanted := known.removesuffix("_d")), ""
        if quantity is not None and "mode" in quantity.along.split():
            quantity = None  # a law's `damping` is not that of a mode
        text = name.replace("_", " ") if quantity is None else quantity.meaning
        if quantity is not None and wanted != known:
            text = f"desired {text}"
        if known != name:
            text = f"{'direction in' if given else 'derivative of'} {text}"
        if described is not None:
            text, unit = described
        if name == "s" and self._landmark is not None:
            text = f'displacement of "{self._landmark}" from home, in {{S}}'
        labels, units = self._entries(quantity, port, size, known)
        labels = tuple(f"{LETTERS.get(name, '')}{label}" for label in labels)
        if quantity is None or unit:
            units = (unit or "1",) * len(labels)
        return CArray(name, text, labels, units, given, port.name)

    def _entries(
        self, quantity: Quantity | None, port: Port | OutputShape, size: int, name: str
    ) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Labels and units of the entries."""
        labels: tuple[str, ...] = ()
        if quantity is not None and quantity.entries == ("prescribed",):
            labels = self._prescribed
        elif quantity is not None and quantity.entries:
            labels = tuple("_".join(entry) for entry in quantity.labels(self._mechanism))
        elif port.lanes:
            labels = self._mechanism.chain_names
        elif quantity is None and size in (m := len(independent_coordinates(self._mechanism)), 3):
            labels = tuple(independent_coordinates(self._mechanism)) if size == m else AXES
        # What `closure` starts from may be less than its port.
        if not (port.lanes or size == len(labels) or (labels and labels == self._prescribed)):
            number = tuple(str(i + 1) for i in range(size))
            labels = number if size > 1 else ("relative" if name == "bound" else name,)
        units = ("1",) if quantity is None else quantity.units(self._mechanism, labels)
        return labels, units * len(labels) if len(units) == 1 else units

    def _slopes(self, name: str, port: str) -> CArray:
        """Derivatives `<of>_by_<in>`: of joints one column, of others one row after another."""
        m, (of, _, by) = self._mechanism, name.partition("_by_")
        (rows, columns) = ends = row(of), row(by)
        assert rows is not None and columns is not None
        pairs = [*product(*(zip(e.labels(m), e.units(m), strict=True) for e in ends if e))]
        if rows.entries == ("chain",):
            order = columns.labels(m)
            pairs.sort(key=lambda pair: order.index(pair[1][0]))
        labels = tuple(f"{row} by {column}" for ((row,), _), ((column,), _) in pairs)
        units = tuple(f"({unit})/({per})" for (_, unit), (_, per) in pairs)
        text = f"derivatives of the {rows.meaning} by the {columns.meaning}"
        return CArray(name, text, labels, units, False, port)
