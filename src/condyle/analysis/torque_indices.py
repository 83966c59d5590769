"""The indices of [Cheng2023] eq. (67): how large the torques are that each part needs.

    F = 1/N sum_k |tau(t_k)|,   F_part = 1/N sum_k |tau_part(t_k)|

without the load, |.| the 2-norm over the chains. Since norms of sums are not sums of norms,
F is not F_EE + F_SM + F_GS.

Differs from the paper: any parts; chains of different effort units have indices of their own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..questions.equations import LOAD

LOAD_PARTS = (LOAD, "bite")  # as older solutions call it
ALL = "all"


@dataclass(frozen=True)
class Indices:
    """Mean norms of one unit's efforts.

    values:  part -> index [unit]; "all" is F, without the load.
    samples: how many entered; empty ones do not.
    """

    unit: str
    values: dict[str, float]
    samples: int


def indices(share: np.ndarray, parts: Sequence[str], units: Sequence[str]) -> list[Indices]:
    """The indices of eq. (67), once for each effort unit.

    Args: share: (parts, N, n): what each part needs of each effort.
          parts: names, the load's among them or not;  units: of the chains' efforts, (n,).
    """
    own = [i for i, part in enumerate(parts) if part not in LOAD_PARTS]
    good = np.isfinite(share).all(axis=(0, 2))
    count = int(good.sum())
    by_unit = []
    for unit in dict.fromkeys(units):
        efforts = share[:, good][:, :, [i for i, u in enumerate(units) if u == unit]]
        values = {ALL: mean_norm(efforts[own].sum(axis=0))}
        values |= {str(parts[i]): mean_norm(efforts[i]) for i in own}
        by_unit.append(Indices(str(unit), values, count))
    return by_unit


def mean_norm(efforts: np.ndarray) -> float:
    """Mean over samples of the 2-norm over chains of efforts, (N, n); nan without samples."""
    return float(np.linalg.norm(efforts, axis=1).mean()) if len(efforts) else float("nan")
