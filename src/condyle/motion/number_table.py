"""Columns of numbers, and where in their file each row stands."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from ..errors import InputError, did_you_mean
from .arrays import check_rising
from .column_names import Header, columns_are
from .column_units import Dimension, Units, dimension

AXES = "xyz"
Known = Collection[str] | Mapping[str, Dimension]


@dataclass(frozen=True, eq=False)
class NumberTable:
    """Finite numbers by column name, in the order of the file.

    Attributes: source: what to call the table in messages, usually the path as given.
                columns: name -> (rows,), in SI where the header names a unit.
                lines: on which line of the file (from 1) each row stands, (rows,); or the rows'
                    numbers where the file has no lines.
                scale: name -> factor to SI that was applied, where the header names a unit.
                ignored: columns that were not asked for.
                counted: what `lines` counts.
                facts: what else the head of the file says, by key, as it stands there.
                notes: what was read otherwise than it stands.
    """

    source: str
    columns: dict[str, np.ndarray]
    lines: np.ndarray
    scale: dict[str, float] = field(default_factory=dict)
    ignored: tuple[str, ...] = ()
    counted: str = "line"
    facts: Mapping[str, str] = field(default_factory=dict)
    notes: Sequence[str] = ()

    @property
    def rows(self) -> int:
        return len(self.lines)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the reader of the results should know about the file."""
        unused = [f"{self.source}: {columns_are(self.ignored)} not used"] if self.ignored else []
        return (*self.notes, *unused)

    def where(self, row: int) -> str:
        """'motion.csv, line 57' for a row counted from 0."""
        return f"{self.source}, {self.counted} {self.lines[row]}"

    def require(self, names: Iterable[str]) -> np.ndarray:
        """The columns `names` side by side, (rows, number of names).

        Raises: InputError: naming those that are missing.
        """
        names = list(names)
        if missing := [name for name in names if name not in self.columns]:
            hint = did_you_mean(missing[0], [*self.columns, *self.ignored])
            raise InputError(f"{self.source}: {columns_are(missing)} missing.{hint}")
        return np.column_stack([self.columns[name] for name in names])

    def times(self, name: str = "t") -> np.ndarray:
        """The column of times, (rows,), which rise.

        Raises: InputError: where they do not, or are missing.
        """
        t = self.require([name])[:, 0]
        self._check(name, ~np.isfinite(t))
        check_rising(t, self.where)
        return t

    def filled(self, names: Iterable[str]) -> np.ndarray:
        """The columns `names` side by side, zero where there is none, (rows, number of names)."""
        zero = np.zeros(self.rows)
        return np.column_stack([self.columns.get(name, zero) for name in names])

    def points(self) -> dict[str, tuple[str, ...]]:
        """Name of each point with all of its columns <name>_x, _y and _z -> these."""
        stems = [name.removesuffix("_x") for name in self.columns if name.endswith("_x")]
        found = {stem: tuple(f"{stem}_{axis}" for axis in AXES) for stem in stems}
        return {stem: names for stem, names in found.items() if {*names} <= {*self.columns}}

    def si(self, units: Units) -> dict[str, np.ndarray]:
        """The columns in SI: by their header where that names a unit, else by `units`.

        Raises: InputError: where both are given and differ.
        """
        for name, scale in self.scale.items():
            kind = (dimension(name) or ("", 0))[0]
            if kind in units.given and not np.isclose(scale, units.scale(name), rtol=1e-12, atol=0):
                raise InputError(
                    f'{self.source}: the header of column "{name}" and the units asked for differ;'
                    f" leave out the unit of {kind} from one of them"
                )
        return {
            name: column if name in self.scale else column * units.scale(name)
            for name, column in self.columns.items()
        }

    def _check(self, name: str, bad: np.ndarray) -> None:
        """Raises InputError for the first bad row of a column."""
        if bad.any():
            row = int(np.argmax(bad))
            raise InputError(
                f'{self.where(row)}, column "{name}": got {self.columns[name][row]}, expected a '
                "finite number. Fill the gap or leave the row out."
            )


def table_of(
    source: str,
    header: Header,
    values: Iterable[np.ndarray],
    lines: np.ndarray,
    counted: str = "line",
    gaps: bool = False,
) -> NumberTable:
    """The table of the columns that a header names, in its order, as they stand in the file.

    Args:   gaps: NaN is an empty cell, and no error.
    Raises: InputError: for the first number that is not finite.
    """
    columns = {
        name: column * header.scale[name] if name in header.scale else column
        for name, column in zip(header.index, values, strict=True)
    }
    table = NumberTable(source, columns, lines, header.scale, header.ignored, counted)
    for name, column in columns.items():
        if not np.isfinite(column).all():
            table._check(name, np.isinf(column) if gaps else ~np.isfinite(column))
    return table
