"""The load on the platform: a force and a moment over time, at a named point."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..errors import InputError
from ..files.reading import digest
from ..mechanism.cells import curves, table
from .arrays import as_doubles, as_samples, as_text, check_rising
from .column_units import FORCE, MOMENT, si_unit
from .frame import as_sampled, table_from_frame
from .number_table import NumberTable
from .table_reader import read_table
from .unit_checks import load_warnings

POINT = "the name of a platform point"
_SLACK = 1e-9  # [s], by which times may miss the load's ends through rounding


@dataclass(frozen=True, eq=False)
class Load:
    """Wrench on the platform, components in {S}, moment about the point it acts at.

    Attributes: t: (N,) [s], rising; (0,) for a load that does not change.
                wrench: Fx, Fy, Fz, Mx, My, Mz, (N, 6), [N, N m]; (1, 6) if it does not change.
                point: name of the platform point; None leaves the choice to the mechanism.
                source: where the load came from, for messages.
                sha256: hash of the file that was read, or None.
                warnings: implausible values, for the results.
    """

    t: np.ndarray
    wrench: np.ndarray
    point: str | None = None
    source: str = "load"
    sha256: str | None = None
    warnings: tuple[str, ...] = ()

    @classmethod
    def from_csv(cls, path: str | os.PathLike[str], point: str | None = None) -> Load:
        """Read a load file: `t` and some of `Fx,Fy,Fz,Mx,My,Mz`; missing columns are zero.

        CSV, or Parquet if the name ends in .parquet. SI, unless the header names units.
        """
        load = cls._from_table(read_table(path, known=("t", *FORCE, *MOMENT)), point)
        return replace(load, sha256=digest(path))

    @classmethod
    def from_frame(cls, frame: Any, point: str | None = None, source: str = "load") -> Load:
        """The same from a pandas DataFrame; its index is the time if no column is."""
        table = table_from_frame(frame, ("t", *FORCE, *MOMENT), source)
        return cls._from_table(table, point)

    @classmethod
    def _from_table(cls, table: NumberTable, point: str | None) -> Load:
        t = table.times()
        if not {*FORCE, *MOMENT} & {*table.columns}:
            table.require(FORCE)
        wrench = table.filled((*FORCE, *MOMENT))
        load = cls.from_arrays(t, wrench, point=point, source=table.source)
        return replace(load, warnings=(*table.warnings, *load.warnings))

    @classmethod
    def from_arrays(
        cls, t: Any, force: Any, moment: Any = None, point: str | None = None, source: str = "load"
    ) -> Load:
        """Load through samples.

        Args:   t: (N,) [s], rising.
                force: (N, 3) [N]; or (N, 6) with the moment in the last three columns.
                moment: (N, 3) [N m]; none by default.
        Raises: InputError: for arrays that cannot be used.
        """
        as_text(source, "source", "text")
        t = as_samples(t, "t", source, unit="s")
        if len(t) == 0:
            raise InputError(f"{source}: t: expected at least one sample, got none")
        check_rising(t, f"{source}, sample {{}}".format)
        wrench = np.zeros((len(t), 6))
        point = as_text(point, "point", POINT)
        both = moment is None and np.shape(force)[-1:] == (6,)
        names = (*FORCE, *MOMENT) if both else FORCE
        force = as_doubles(force, f"{source}: force", [*map(si_unit, names)], names)
        if moment is None and force.shape == wrench.shape:
            force, moment = force[:, :3], force[:, 3:]
        wrench[:, :3] = _vectors(force, "force", source, len(t))
        if moment is not None:
            wrench[:, 3:] = _vectors(moment, "moment", source, len(t))
        return cls(t, wrench, point, source, warnings=load_warnings(source, t, wrench))

    @classmethod
    def constant(cls, force: Any, moment: Any = (0, 0, 0), point: str | None = None) -> Load:
        """The same force [N] and moment [N m], (3,) each, at all times."""
        parts = [_vectors([v], n, "load", 1) for v, n in ((force, "force"), (moment, "moment"))]
        as_text(point, "point", POINT)
        return cls(np.empty(0), np.hstack(parts), point, "constant load")

    @classmethod
    def zero(cls) -> Load:
        """No load."""
        return cls(np.empty(0), np.zeros((1, 6)), None, "no load")

    def __repr__(self) -> str:
        """Source, span and greatest values in one line."""
        if not len(self.t):
            span = "constant"
        else:
            span = f"{len(self.t)} samples from {self.t[0]:.6g} to {self.t[-1]:.6g} s"
        force, moment = (np.linalg.norm(part, axis=1).max() for part in np.split(self.wrench, 2, 1))
        at = f" at {self.point}" if self.point else ""
        return f"Load({self.source}: {span}, up to {force:.4g} N and {moment:.4g} N m{at})"

    def _repr_html_(self) -> str:
        """Force and moment over time, and a table."""
        name, _, rest = repr(self)[5:-1].partition(": ")
        drawn = curves(self.wrench, ("Fx", "Fy", "Fz", "Mx", "My", "Mz")) if len(self.t) else ""
        return table("Load", name, [("wrench", rest)], drawn)

    def at(self, times: Any) -> np.ndarray:
        """Wrench at `times`, linear between the samples, (len(times), 6).

        Raises: InputError: if the load does not cover the times, naming the gaps.
        """
        times = as_samples(times, "times", self.source)
        if len(self.t) == 0:
            return np.repeat(self.wrench, len(times), axis=0)
        if len(times):
            self._check_cover(times.min(), times.max())
        return np.column_stack([np.interp(times, self.t, column) for column in self.wrench.T])

    def _check_cover(self, start: float, end: float) -> None:
        first, last = self.t[0], self.t[-1]
        gaps = []
        if start < first - _SLACK:
            gaps.append(f"{start:.9g} to {min(first, end):.9g} s")
        if end > last + _SLACK:
            gaps.append(f"{max(last, start):.9g} to {end:.9g} s")
        if gaps:
            raise InputError(
                f"{self.source}: runs from {first:.9g} to {last:.9g} s, but the motion from"
                f" {start:.9g} to {end:.9g} s; no load at {' and '.join(gaps)}."
                " Add rows there, of zeros if nothing acts. If one of them has its times in"
                ' milliseconds, name its column "t [ms]".'
            )


def as_load(load: Any) -> Load:
    """A load from what people give for one: a Load, a path, a DataFrame; None is no load.

    Raises: InputError: for anything else.
    """
    return Load.zero() if load is None else as_sampled(load, Load, "t, force, moment")


def _vectors(values: Any, name: str, source: str, rows: int) -> np.ndarray:
    names = FORCE if name == "force" else MOMENT
    array = as_doubles(values, f"{source}: {name}", si_unit(names[0]), names)
    if array.shape != (rows, 3):
        hint = "; give its transpose" if array.shape == (3, rows) else ""
        raise InputError(
            f"{source}: {name} has shape {array.shape}, "
            f"expected ({rows}, 3): {', '.join(names)}{hint}"
        )
    if not np.isfinite(array).all():
        i = np.flatnonzero(~np.isfinite(array).all(axis=1))[0]
        raise InputError(f"{source}, sample {i}: {name} has a number that is not finite")
    return array
