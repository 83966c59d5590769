"""Standard deviations of efforts from those of the states that they are computed for."""

from __future__ import annotations

import numpy as np

from ..errors import InputError
from ..model.model import Model
from ..model.poses import States
from ..motion.written_values import Values, values_of
from ..status import Status
from .derived import Derived
from .state_rows import Columns

RATES = ("", "d", "dd")


def deviations_of(model: Model, noise: Values) -> np.ndarray:
    """Standard deviations of q, q', q'', (3 m,) [SI], from "X=0.01 mm,dX=1 mm/s" or by name.

    Raises: InputError: for unknown columns, and for anything but positive numbers.
    """
    names = [prefix + name for prefix in RATES for name in model.independent]
    given = values_of(noise, names, "noise")
    if not given:
        raise InputError(f"noise: expected at least one of {', '.join(names)}, as in X=0.01 mm")
    for name, value in given.items():
        if value <= 0:
            raise InputError(f"noise: {name}: expected a positive number, got {value:g}")
    return np.array([given.get(name, 0.0) for name in names])


def deviation_columns(
    model: Model,
    derived: Derived,
    deviations: np.ndarray,
    state: States,
    wrench: np.ndarray,
    at: str | None,
) -> Columns:
    """Columns sd_tau_<chain>: sqrt(sum (d tau / d x_i)^2 s_i^2).

    NaN where a row has no efforts, or these have a kink.
    """
    found = np.full((len(derived.ok), len(model.mechanism.chains)), np.nan)
    if (good := np.flatnonzero(derived.ok)).size:
        q, v, a = (x[good] for x in state)
        d = model.derivatives("effort", ("q", "v", "a"), q=q, v=v, a=a, wrench=wrench[good], at=at)
        by = np.concatenate([d["effort", name] for name in ("q", "v", "a")], axis=2)
        by[d.status != Status.ok] = np.nan
        found[good] = np.sqrt(((by * deviations) ** 2).sum(axis=-1))
    return {f"sd_tau_{c}": found[:, i] for i, c in enumerate(model.mechanism.chain_names)}
