"""Measured markers and EMG as variables of a solution, at its samples."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from ..errors import InputError, did_you_mean
from ..markers import MeasuredChannels, read_channels
from ..mechanism.coordinates import rotations
from ..quantities import QUANTITIES

if TYPE_CHECKING:
    import xarray as xr

S = TypeVar("S", bound="xr.Dataset")


def with_measured(solution: S, measured: MeasuredChannels | str | os.PathLike[str]) -> S:
    """A copy with the markers and the EMG, as far as they were measured.

    They are linear between the samples of the measurement, NaN in its gaps and outside. An offset
    contains the effect of smoothing, of the projection onto the contacts, and the residual.

    Raises: InputError: for chains that are not there, or times that do not meet the solution's.
    """
    table = read_channels(measured)
    time, chains = solution["time"].values, [str(name) for name in solution["chain"].values]
    if table.t[-1] < time[0] or table.t[0] > time[-1]:
        raise InputError(
            f"{table.source}: runs from {table.t[0]:.6g} to {table.t[-1]:.6g} s, and the solution "
            f"from {time[0]:.6g} to {time[-1]:.6g} s; they have no time in common"
        )
    for chain in table.emg:
        if chain not in chains:
            raise InputError(
                f'{table.source}: column "emg_{chain}": "{solution.attrs["mechanism_name"]}" has '
                f'no chain "{chain}".{did_you_mean(chain, chains)}'
            )
    here = table.at(time)
    result = solution.drop_dims("marker", errors="ignore").drop_vars("emg", errors="ignore")
    if table.names:
        result = result.assign_coords(
            marker=list(table.names), marker_body=("marker", list(table.bodies))
        )
        made = {"marker_place": here.points, "marker_residual": here.residual}
        made["marker_offset"] = _offset(here, solution["pose"].values)
        for name, values in made.items():
            result[name] = QUANTITIES[name].labelled(values)
    if table.emg:
        nothing = np.full(len(time), np.nan)
        envelope = np.column_stack([here.emg.get(chain, nothing) for chain in chains])
        result["emg"] = QUANTITIES["emg"].labelled(envelope)
    return result


def _offset(here: MeasuredChannels, pose: np.ndarray) -> np.ndarray:
    """Distance of each marker from its mean place on its body, carried along, (N, m) [m]."""
    R, p = rotations(pose[:, 3:]), pose[:, :3]
    distance = np.full(here.points.shape[:2], np.nan)
    for i, body in enumerate(here.bodies):
        # A rigid motion keeps distances, so that they may be taken in the body.
        x = here.points[:, i]
        own = x if body == "fixed" else np.einsum("nji,nj->ni", R, x - p)
        known = np.isfinite(own).all(axis=1)
        if body and known.any():
            distance[known, i] = np.linalg.norm(own[known] - own[known].mean(axis=0), axis=1)
    return distance
