"""What a quantity is: its row. Those that there are stand in `quantity_rows`, in one table."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from ..errors import InputError
from ..mechanism.mechanism import COORDINATES, Mechanism
from ..motion.column_units import Dimension
from ..status import POSED, Status
from .entries import DIMENSIONS, chain_units, labels_of

# What units go by, where no mechanism is given: of chains there is one kind or the other.
_ANY = {"effort": ("N m", "N"), "joint": ("rad", "m")}
_KINDS = {"N m": "moment", "N": "force", "rad": "angle", "m": "length"}


@dataclass(frozen=True)
class Quantity:
    """A quantity of a mechanism, as all results and files have it.

    name:     of the attribute of results, and of the result or port of questions.
    along:    its dimensions, of `DIMENSIONS`, parted by blanks; without time it is an argument or
              a number.
    unit:     SI; "{}": of each entry of its last dimension, "{effort}", "{joint}": of each chain.
    meaning:  what it is, as a phrase.
    where:    which solutions have it: a condition of `condyle.results.derived`, such as "solution"
              (all) or "simulation"; "": none.
    column:   what the names of its columns in tables begin with, before that of the entry; None:
              it has none there.
    flags:    what its integers mean, parted by blanks, or a rule for that.
    called:   the name of the variable of solutions, where it is another one.
    needs:    what a sample must have for a value: "efforts" that balance it, a "pose", or "".
    sizes:    whether sizes of vectors along the last dimension stand in tables.
    equation: its values from a `condyle.results.derived.Derived`, or where they are in it; "": by
              its name, there or in the results of the model.
    figure:   the section of the page in which it has a panel of its own; "": none.
    symbol:   what axes of figures call it; "": by its name.
    """

    name: str
    along: str
    unit: str
    meaning: str
    where: str = "solution"
    column: str | None = None
    flags: str | Callable[[Mechanism], str] = ""
    called: str = ""
    needs: str = "efforts"
    sizes: bool = False
    equation: Callable[[Any], np.ndarray] | str = ""
    figure: str = ""
    symbol: str = ""

    @property
    def variable(self) -> str:
        """Its name in solutions."""
        return self.called or self.name

    @property
    def title(self) -> str:
        """What it is, as a heading."""
        return self.meaning[:1].upper() + self.meaning[1:]

    @property
    def dims(self) -> tuple[str, ...]:
        return tuple(self.along.split())

    def known(self, status: np.ndarray) -> np.ndarray:
        """Where samples of these statuses have a value, of their shape."""
        if not self.needs:
            return np.ones(np.shape(status), dtype=bool)
        return np.isin(status, POSED if self.needs == "pose" else Status.ok)

    @property
    def simulated(self) -> bool:
        """Whether only a simulation has it."""
        return self.where == "simulation"

    @property
    def entries(self) -> tuple[str, ...]:
        """Its dimensions without time."""
        return tuple(dim for dim in self.dims if dim != "time")

    def labels(self, mechanism: Mechanism) -> list[tuple[str, ...]]:
        """Labels of each entry, along all dimensions but time."""
        return [*product(*(labels_of(mechanism, dim)[dim] for dim in self.entries))]

    def shape(self, mechanism: Mechanism) -> tuple[int, ...]:
        """The shape of one sample."""
        return tuple(len(labels_of(mechanism, dim)[dim]) for dim in self.entries)

    def columns(self, mechanism: Mechanism) -> list[str]:
        """Names of the entries in tables."""
        if not self.entries:
            return [self.column or self.name]
        return [f"{self.column or ''}{'_'.join(entry)}" for entry in self.labels(mechanism)]

    def dimensions(self, mechanism: Mechanism) -> dict[str, Dimension]:
        """Dimensions of efforts or joints: columns, and what each measures, as tables are read."""
        pairs = zip(self.columns(mechanism), self.units(mechanism), strict=True)
        return {column: (_KINDS[unit], 0) for column, unit in pairs}

    def units(self, mechanism: Any, labels: Sequence[str] | None = None) -> tuple[str, ...]:
        """Units of the entries along the dimension that they go by, or of all.

        Args: mechanism: None: every one that there may be.
              labels: along its last dimension, where a mechanism does not determine them.
        """
        if kind := next((kind for kind in _ANY if f"{{{kind}}}" in self.unit), ""):
            own = chain_units(mechanism, kind) if mechanism else _ANY[kind]
            return tuple(self.unit.format(**{kind: unit}) for unit in own)
        if "{}" not in self.unit:
            return (self.unit,)
        last = DIMENSIONS[self.entries[-1]]
        if labels is None:
            free = mechanism is None and self.entries[-1] == "independent"
            labels = COORDINATES if free or last.labels is None else last.labels(mechanism)
        assert last.unit is not None
        return tuple(self.unit.format(last.unit(label)) for label in labels)

    def any_unit(self) -> str:
        """The unit without a mechanism: "N m or N", "m/s, rad/s"."""
        between = ", " if "{}" in self.unit else " or "
        return between.join(dict.fromkeys(self.units(None)))

    def attributes(self, mechanism: Any) -> dict[str, str]:
        """`units`, `long_name` and, where there are flags, `flag_meanings`."""
        units = self.units(mechanism)
        flags = self.flags if isinstance(self.flags, str) else self.flags(mechanism)
        about = {"units": joined(units), "long_name": self.meaning}
        return about | ({"flag_meanings": flags} if flags else {})

    def labelled(self, values: np.ndarray) -> tuple[tuple[str, ...], np.ndarray, dict[str, str]]:
        """As datasets take it, where its unit goes by no mechanism."""
        return self.dims, values, self.attributes(None)

    def table(
        self, values: np.ndarray, labels: Mapping[str, Sequence[str]]
    ) -> dict[str, np.ndarray]:
        """Its columns in tables, of values (N, ...); none where it has none.

        Args: labels: along its dimensions.
        """
        if self.column is None or len(self.dims) > 2 + self.sizes:
            return {}
        if len(self.dims) == 1:
            return {self.column: values}
        values = np.linalg.norm(values, axis=-1) if self.sizes else values
        return named_columns(self.column, labels[self.dims[1]], values)


def joined(units: Sequence[str]) -> str:
    """The unit that all entries have, or one an entry."""
    return units[0] if len({*units}) == 1 else ", ".join(units)


def named_columns(prefix: str, names: Iterable[str], values: np.ndarray) -> dict[str, np.ndarray]:
    """Columns (N, entries) by their names."""
    return {f"{prefix}{name}": values[:, i] for i, name in enumerate(names)}


QUANTITIES: dict[str, Quantity] = {}


def register(new: Quantity) -> Quantity:
    """Add a quantity, from this package or from elsewhere.

    Raises: InputError: for a name that there is, or an unknown dimension.
    """
    if new.name in QUANTITIES or (new.where and new.variable in variables()):
        raise InputError(f'there is a quantity "{new.name}" already; choose another name')
    if unknown := [dim for dim in new.dims if dim not in DIMENSIONS]:
        raise InputError(
            f'quantity "{new.name}": there is no dimension "{unknown[0]}"; available: '
            f"{', '.join(DIMENSIONS)}"
        )
    QUANTITIES[new.name] = new
    return new


# What arguments and ports are called, where it is another name.
ALIASES = {"q1": "v", "q2": "a", "point": "at", "reading": "joint"}


def row(name: str) -> Quantity | None:
    """A quantity by its name, by that of a port, or that of an argument for its desired value."""
    return QUANTITIES.get(ALIASES.get(name, name))


def variables() -> dict[str, Quantity]:
    """The variables of solutions, by name, in the order of columns."""
    return {one.variable: one for one in QUANTITIES.values() if one.where}
