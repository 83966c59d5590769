"""Why a sample has no answer: limits too tight, friction that jams, or a solver that failed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from .program import Sample
from .reduced import Reduced
from .result import CERTIFIED, Status
from .stretch import least_stretch


def explain(
    programs: Sequence[Reduced], signs: np.ndarray, unknown: np.ndarray, answered: bool
) -> tuple[Status, float]:
    """Status and shortfall of one sample that some patterns of friction gave no answer to.

    Args: programs: of every pattern, one sample each.   signs: their patterns, (P, k).
          unknown:  patterns, (P,), with neither an answer nor a proof that they have none.
          answered: whether another pattern has an answer, which is the least if the unknown ones
                    turn out to be empty.
    """
    needed = np.full(len(programs), np.inf)
    for p, r in enumerate(programs):
        if unknown[p] or not answered:
            needed[p] = _needed(r)
    # Nearer to 1, what fits is a point to rounding: then a solver that finds nothing may be right.
    if (unknown & (needed < 1 - CERTIFIED)).any():
        return Status.uncertified, np.nan
    if answered:
        return Status.ok, 1.0
    shortfall = float(needed.min())
    if not np.isfinite(shortfall) and signs.any():
        bare = [_signs_only(r, sign) for r, sign in zip(programs, signs, strict=True)]
        if not any(np.isfinite(_needed(r)) for r in bare):
            return Status.jammed, np.nan
    return Status.infeasible, shortfall


def _needed(r: Reduced) -> float:
    """The least number by which the limits of one sample must be multiplied, inf if none does."""
    if (r.contact_low > r.contact_high).any():
        return np.inf
    sample = Sample.of(r, 0)
    unbound = replace(sample, low=np.full(r.n, -np.inf), high=np.full(r.n, np.inf))
    return least_stretch(unbound, r.low[:, 0], r.high[:, 0]).t


def _signs_only(r: Reduced, sign: np.ndarray) -> Reduced:
    """Without limits and one-sided contacts."""
    return replace(
        r,
        low=np.full_like(r.low, -np.inf),
        high=np.full_like(r.high, np.inf),
        contact_low=np.where(sign > 0, 0.0, -np.inf)[:, None],
        contact_high=np.where(sign < 0, 0.0, np.inf)[:, None],
    )
