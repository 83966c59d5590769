"""Channels measured with a motion, shown with the results: markers and EMG.

One table: `t`; of every marker `<marker>_x`, `_y`, `_z` [m] in {S}, and its distance from its place
in its body, `<marker>_residual_fixed` or `<marker>_residual_platform` [m]; of every chain with EMG
`emg_<chain>`, 1 at its greatest. Cells are empty where nothing was seen.
"""

from __future__ import annotations

import math
import os
from dataclasses import dataclass, field, replace

import numpy as np

from ..errors import InputError
from ..motion.column_names import columns_are
from ..motion.number_table import AXES
from ..motion.table_reader import read_table

BODIES = ("fixed", "platform")
EMG = "emg_"


@dataclass(frozen=True, eq=False)
class MeasuredChannels:
    """Markers and EMG with their own times.

    Attributes: t: (N,) [s], increasing.
                names: of the markers, (m,);  bodies: theirs, "fixed", "platform" or "" if unknown.
                points: (N, m, 3) [m] in {S};  residual: distance of each marker from its place in
                    its body, (N, m) [m]; NaN where not seen.
                emg: chain -> envelope, (N,), 1 at its maximum.
                source: where it came from, for messages.
    """

    t: np.ndarray
    names: tuple[str, ...] = ()
    bodies: tuple[str, ...] = ()
    points: np.ndarray = field(default_factory=lambda: np.empty((0, 0, 3)))
    residual: np.ndarray = field(default_factory=lambda: np.empty((0, 0)))
    emg: dict[str, np.ndarray] = field(default_factory=dict)
    source: str = "measured"

    def columns(self) -> dict[str, np.ndarray]:
        """The table."""
        table = {"t": self.t}
        for i, (name, body) in enumerate(zip(self.names, self.bodies, strict=True)):
            table |= {f"{name}_{axis}": self.points[:, i, k] for k, axis in enumerate(AXES)}
            if body:
                table[f"{name}_residual_{body}"] = self.residual[:, i]
        return table | {f"{EMG}{chain}": values for chain, values in self.emg.items()}

    def at(self, times: np.ndarray) -> MeasuredChannels:
        """The same at other times, linear between the samples; NaN beside a gap and outside."""

        def interpolated(values: np.ndarray) -> np.ndarray:
            columns = values.reshape(len(self.t), math.prod(values.shape[1:])).T
            found = np.array([np.interp(times, self.t, c, np.nan, np.nan) for c in columns])
            return found.T.reshape(len(times), *values.shape[1:])

        emg = {chain: interpolated(values) for chain, values in self.emg.items()}
        points, residual = interpolated(self.points), interpolated(self.residual)
        return replace(self, t=times, points=points, residual=residual, emg=emg)


def read_channels(source: MeasuredChannels | str | os.PathLike[str]) -> MeasuredChannels:
    """Read a table (CSV or Parquet) of channels measured with a motion.

    Raises: InputError: for a file without markers or EMG, or with other columns.
    """
    if isinstance(source, MeasuredChannels):
        return source
    table = read_table(source, gaps=True)
    where, columns = table.source, dict(table.columns)
    t = table.times()
    del columns["t"]
    names = [*table.points()]
    points, residual = np.empty((len(t), len(names), 3)), np.full((len(t), len(names)), np.nan)
    bodies = [next((b for b in BODIES if f"{n}_residual_{b}" in columns), "") for n in names]
    for i, (name, body) in enumerate(zip(names, bodies, strict=True)):
        points[:, i] = np.column_stack([columns.pop(f"{name}_{axis}") for axis in AXES])
        if body:
            residual[:, i] = columns.pop(f"{name}_residual_{body}")
    emg = {n[len(EMG) :]: columns.pop(n) for n in list(columns) if n.startswith(EMG)}
    if columns:
        raise InputError(
            f"{where}: {columns_are(columns)} neither of a marker (<marker>_x, _y, _z, "
            "_residual_fixed or _residual_platform) nor EMG (emg_<chain>)"
        )
    if not names and not emg:
        raise InputError(f"{where}: has no markers (<marker>_x, _y, _z) and no EMG (emg_<chain>)")
    return MeasuredChannels(t, tuple(names), tuple(bodies), points, residual, emg, where)
