"""Efforts and contact forces of N samples, with their certificates."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

CERTIFIED = 1e-9  # bound on the three parts of a certificate


class Outcome(IntEnum):
    """Outcome of a sample."""

    ok = 0
    unreachable = 1  # its inputs are not finite
    singular = 2  # the equations do not determine efforts and contact forces
    infeasible = 3  # no solution within effort limits and unilateral contacts
    jammed = 4  # Coulomb friction has no consistent solution, even without limits
    uncertified = 5  # no solver met the certificate
    indeterminate = 6  # efforts are determined, and forces of dependent contacts are of least norm


@dataclass(frozen=True)
class Result:
    """Efforts at N samples; NaN where the status is neither ok nor indeterminate.

    effort:        (N, n), offsets included.
    contact_force: lambda, (N, k) [N].
    status:        `Outcome`, (N,).
    shortfall:     smallest common factor on all limits that makes the sample feasible, (N,): 1
                   where they suffice, inf where no limits would.
    pattern:       signs sigma of the contact forces with friction, 0 for others, (N, k).
    residual, primal, dual: the certificate, (N,) each, relative to the largest effort: residual
                   of the equations, violation of the bounds, violation of stationarity.
    """

    effort: np.ndarray
    contact_force: np.ndarray
    status: np.ndarray
    shortfall: np.ndarray
    pattern: np.ndarray
    residual: np.ndarray
    primal: np.ndarray
    dual: np.ndarray

    @classmethod
    def empty(cls, count: int, n: int, k: int) -> Result:
        """NaN everywhere, with status uncertified."""
        effort, contact_force = np.full((count, n), np.nan), np.full((count, k), np.nan)
        status, pattern = np.full(count, int(Outcome.uncertified)), np.zeros((count, k), int)
        numbers = [np.full(count, np.nan) for _ in range(4)]
        return cls(effort, contact_force, status, numbers[0], pattern, *numbers[1:])

    def refuse(self, row: int, status: Outcome, shortfall: float) -> None:
        """Mark a sample as failed."""
        for array in (self.effort, self.contact_force, self.residual, self.primal, self.dual):
            array[row] = np.nan
        self.pattern[row] = 0
        self.status[row], self.shortfall[row] = status, shortfall
