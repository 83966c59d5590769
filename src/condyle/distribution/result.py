"""What comes back: efforts and contact forces of N samples, and how well they are known."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

CERTIFIED = 1e-9  # what the three parts of a certificate must not exceed


class Status(IntEnum):
    """How a sample came out."""

    ok = 0
    unreachable = 1  # its numbers are not finite
    singular = 2  # the equations do not determine efforts and contact forces
    infeasible = 3  # limits or one-sided contacts leave no solution
    jammed = 4  # no pattern of friction is consistent, even without limits
    uncertified = 5  # no solver met the certificate


@dataclass(frozen=True)
class Result:
    """Answers at N samples; NaN where the status is not ok.

    effort:        (N, n), offsets included.
    contact_force: lambda, (N, k) [N].
    status:        `Status`, (N,).
    shortfall:     the least number by which all limits would have to be multiplied, (N,): 1 where
                   they suffice, inf where no limits would do.
    pattern:       sigma of the contacts with friction, 0 for others, (N, k).
    residual, primal, dual: the certificate, (N,) each, relative to the largest effort: how far
                   the equations are from met, constraints exceeded, and the gradient of the
                   objective not explained by multipliers of the right sign.
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
        """No answer yet: NaN, and status uncertified."""
        effort, contact_force = np.full((count, n), np.nan), np.full((count, k), np.nan)
        status, pattern = np.full(count, int(Status.uncertified)), np.zeros((count, k), int)
        numbers = [np.full(count, np.nan) for _ in range(4)]
        return cls(effort, contact_force, status, numbers[0], pattern, *numbers[1:])

    def refuse(self, row: int, status: Status, shortfall: float) -> None:
        """A sample without an answer."""
        for array in (self.effort, self.contact_force, self.residual, self.primal, self.dual):
            array[row] = np.nan
        self.pattern[row] = 0
        self.status[row], self.shortfall[row] = status, shortfall
