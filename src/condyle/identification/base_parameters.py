"""Base parameters: the combinations of a mechanism's numbers that a motion identifies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.linalg

from ..errors import join
from ..model.model import Model
from ..motion import Motion
from ..motion.path import as_motion

THRESHOLD = 1e-8  # of a column's part beyond the others, over its size
SHOWN = 6  # terms of a combination
SMALL = 1e-6  # coefficients of a combination, over the largest, that are rounding


@dataclass(frozen=True)
class Combination:
    """A combination of numbers: their weighted sum is identifiable, none of them alone.

    terms: names and coefficients; the first is 1.
    """

    terms: tuple[tuple[str, float], ...]

    def __str__(self) -> str:
        parts = [self.terms[0][0]]
        for name, factor in self.terms[1:]:
            size = "" if abs(abs(factor) - 1) < SMALL else f"{abs(factor):.4g} "
            parts.append(f"{'-' if factor < 0 else '+'} {size}{name}")
        return " ".join(parts)


@dataclass(frozen=True)
class BaseParameters:
    """The identifiable combinations of numbers in the equations of motion.

    names: (P,), of the standard numbers;  rank: how many combinations can be known;
    condition: of their columns, each of length 1;  known: the combinations;
    unknown: name -> why it cannot be known.
    """

    names: tuple[str, ...]
    rank: int
    condition: float
    known: tuple[Combination, ...]
    unknown: dict[str, str]

    def __str__(self) -> str:
        lines = [f"{self.rank} of {len(self.names)} can be known; condition {self.condition:.3g}"]
        lines += [f"  {one}" for one in self.known]
        if self.unknown:
            lines += ["not by themselves, or not at all:"]
            lines += [f"  {name}: {why}" for name, why in self.unknown.items()]
        return "\n".join(lines)


@dataclass(frozen=True)
class IdentifiableColumns:
    """Linearly independent columns, and the others as combinations of them.

    known, rest: columns, by number;  follow: (known, rest), column rest = known @ follow;
    condition: of the known columns, each of length 1.
    """

    known: np.ndarray
    rest: np.ndarray
    follow: np.ndarray
    condition: float


def identifiable_columns(A: np.ndarray, least: float, relative: bool = True) -> IdentifiableColumns:
    """The independent columns of a matrix, by QR with pivots.

    Args: A: (rows, P);  least: of a column's part beyond the others, to be told apart: over its
          own length if relative.
    """
    sizes = np.linalg.norm(A, axis=0)
    scale = np.where(sizes > 0, sizes, 1.0) if relative else np.ones(A.shape[1])
    R, order = scipy.linalg.qr(A / scale, mode="r", pivoting=True)[:2]
    own = np.abs(np.diag(R))
    apart = own > least * (own[0] if relative and own.size else 1.0)
    rank = int(apart.sum()) if apart.all() else int(np.argmin(apart))
    first, rest = order[:rank], order[rank:]
    follow = scipy.linalg.solve_triangular(R[:rank, :rank], R[:rank, rank:])
    follow = follow / scale[first][:, None] * scale[rest]
    condition = float(np.linalg.cond(R[:rank, :rank])) if rank else np.nan
    return IdentifiableColumns(first, rest, follow, condition)


def base_parameters(model: Model, motion: Motion | Any) -> BaseParameters:
    """As `Model.base_parameters`."""
    q, v, a = model.poses.of_motion(as_motion(motion))[0]
    found = model.regressor(q, v, a)
    good = found.status == 0
    return of_matrix(found.Y[good].reshape(-1, len(found.names)), found.names)


def of_matrix(Y: np.ndarray, names: Sequence[str]) -> BaseParameters:
    """The base parameters that rows of the regressor, (rows, P), identify, by these names."""
    identified = identifiable_columns(Y, THRESHOLD)
    mute = set(np.flatnonzero(~Y.any(axis=0)))
    known = []
    for row, first in zip(identified.follow, identified.known, strict=True):
        size = np.abs(row).max(initial=0)
        with_it = [
            (names[j], float(factor))
            for j, factor in zip(identified.rest, row, strict=True)
            if abs(factor) > max(SMALL * size, 1e-12)
        ]
        known.append(Combination(((names[first], 1.0), *with_it)))
    unknown = {}
    for column, j in zip(identified.follow.T, identified.rest, strict=True):
        size = np.abs(column).max(initial=0)
        stands = [
            names[i] for i, f in zip(identified.known, column, strict=True) if abs(f) > SMALL * size
        ]
        why = "has no effect on the efforts" if j in mute else f"stands with {join(stands)}"
        unknown[names[j]] = why
    return BaseParameters(
        tuple(names), len(identified.known), identified.condition, tuple(known), unknown
    )
