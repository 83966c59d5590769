"""What a machine would have recorded of a simulation: the log that `identify` reads."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
import xarray as xr

from ..errors import InputError, brief
from ..files.atomic import LOGS, check_writable, replacing
from ..motion.arrays import as_number
from ..motion.mcap_file import McapRows, is_mcap, require_mcap
from ..motion.table_writer import write_table
from ..quantities import QUANTITIES
from ..results.solution import as_kind
from ..results.solving import inputs_of


def write_log(
    solution: xr.Dataset,
    path: str | os.PathLike[str],
    *,
    encoder_noise: float = 0.0,
    effort_noise: float = 0.0,
    seed: int = 1,
) -> None:
    """Write a solution as a log: t, readings joint_<chain>, efforts tau_<chain>, contact_<contact>.

    With a load Fx .. Mz too, about O_M: `load_point = "O_M"` in the study that reads it. With
    gravity and the base's motion, gx .. gz and base_ax .., where the solution was given them.

    Args:   solution: of `simulate`, or of `Model.solve`;  path: CSV, Parquet or MCAP.
            encoder_noise, effort_noise: standard deviations of white noise [rad or m, N m or N].
    Raises: InputError: for anything else, or samples without results.
    """
    if not isinstance(seed, int) or isinstance(seed, bool) or seed < 0:
        raise InputError(f"seed: expected a whole number of at least 0, got {brief(seed)}")
    dataset = as_kind(solution, "solution", "solution")
    sizes = [
        as_number(x, name, "a standard deviation of at least 0", lambda x: x >= 0)
        for name, x in (("encoder_noise", encoder_noise), ("effort_noise", effort_noise))
    ]
    if dataset["status"].values.any():
        raise InputError("solution: has samples without results; a log has none")
    machine, rng = dataset.condyle.mechanism, np.random.default_rng(seed)
    columns = {"t": dataset["time"].values}
    made = {
        name: dataset[name].values + size * rng.normal(size=dataset[name].shape)
        for name, size in zip(("joint", "effort"), sizes, strict=True)
    }
    made["joint"] += machine.zeros
    if dataset["load"].values.any():
        made["wrench"] = dataset["load"].values
    made |= dict[str, Any](inputs_of(dataset)) | {"contact_force": dataset["contact_force"].values}
    for name, values in made.items():
        columns |= dict(zip(QUANTITIES[name].columns(machine), values.T, strict=True))
    if not is_mcap(check_writable(path, LOGS)):
        write_table(path, columns)
        return
    require_mcap()
    with replacing(path) as temporary, open(temporary, "wb") as file:
        rows = McapRows(file, list(columns))
        for row in np.column_stack(list(columns.values())).tolist():
            rows.write(row)
        rows.finish()
