"""Standard deviations of efforts from those of states and numbers."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from ..errors import InputError
from ..model.model import Model
from ..motion.written_values import Values, values_of
from ..quantities import QUANTITIES, named_columns
from ..status import Status


def deviations_of(model: Model, noise: Values) -> dict[str, np.ndarray]:
    """Standard deviations [SI] by what efforts are differentiated by: q, v and a, (m,), and numbers
    of the file, of every entry; from "X=0.01 mm,dX=1 mm/s,platform.mass=0.01" or by name.

    Raises: InputError: for unknown columns, and for anything but positive numbers.
    """
    states = {by: QUANTITIES[by].columns(model.mechanism) for by in ("q", "v", "a")}
    names = [name for columns in states.values() for name in columns]
    text = noise.split(",") if isinstance(noise, str) else noise
    text = text if isinstance(text, Iterable) else ()  # refused below
    paths = [one.split("=")[0].strip() for one in text if isinstance(one, str) and "." in one]
    numbers = [p for p in paths if p.partition(".")[0] in ("platform", "chain", "contact")]
    given = values_of(noise, [*names, "gravity", *numbers], "noise")
    if not given:
        raise InputError(f"noise: expected at least one of {', '.join(names)}, as in X=0.01 mm")
    for name, value in given.items():
        if value <= 0:
            raise InputError(f"noise: {name}: expected a positive number, got {value:g}")
    deviations = {name: np.array([given[name]]) for name in given if name not in names}
    for by, columns in states.items():
        deviations[by] = np.array([given.get(name, 0.0) for name in columns])
    return {by: a for by, a in deviations.items() if a.any()}


def deviation_columns(
    model: Model, ok: np.ndarray, deviations: Mapping[str, np.ndarray], state: Mapping[str, Any]
) -> dict[str, np.ndarray]:
    """Columns sd_tau_<chain>: sqrt(sum (d tau / d x_i)^2 s_i^2).

    NaN where a row has no efforts, or these have a kink.

    Args: ok: which rows have efforts, (N,);  state: as `Model.derivatives` takes it, rows first.
    """
    columns = QUANTITIES["effort"].columns(model.mechanism)
    deviation = np.full((len(ok), len(columns)), np.nan)
    if (good := np.flatnonzero(ok)).size:
        rows: Any = {n: x[good] if isinstance(x, np.ndarray) else x for n, x in state.items()}
        d = model.derivatives("effort", tuple(deviations), **rows)
        shape = len(good), len(columns), -1
        parts = [(d["effort", by].reshape(shape) * s) ** 2 for by, s in deviations.items()]
        square = np.concatenate(parts, axis=2).sum(axis=2)
        deviation[good] = np.sqrt(np.where(d.status[:, None] == Status.ok, square, np.nan))
    return named_columns("sd_", columns, deviation)
