"""What an objective is: the one place where a new one plugs in.

An objective names the unit in which efforts are weighed, whether limits bind it, and how to find
its least. It lives in a file of its own and registers an instance of itself.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

import numpy as np

from ..errors import InputError, did_you_mean
from .newton import Answer
from .problem import Problem
from .reduced import Reduced

OBJECTIVES: dict[str, Objective] = {}


class Objective(ABC):
    """One objective. Instances hold no data."""

    name: ClassVar[str]
    summary: ClassVar[str]  # one line for help and docs
    limits: ClassVar[bool] = True  # efforts have limits, one-sided contacts push
    mixes_units: ClassVar[bool] = False  # efforts may be of different units

    def check(self, problem: Problem) -> None:
        """Refuse what has no meaning under this objective."""
        if self.mixes_units and not np.isfinite(problem.scale).all():
            without = np.flatnonzero(~np.isfinite(problem.scale)).tolist()
            raise InputError(
                f"{self.name} divides each effort by its limit; efforts {without} have none. Give "
                "them limits, or use bounded"
            )

    def scale(self, problem: Problem) -> np.ndarray:
        """What efforts are divided by, (n,): 1, or the larger of their limits."""
        limit = problem.scale
        return np.where(limit > 0, limit, 1.0) if self.mixes_units else np.ones(problem.n)

    def weight(self, problem: Problem) -> float:
        """W of a half of the sum of squares of contact forces."""
        return 0.0

    def lower_bound(self, r: Reduced, u: np.ndarray) -> np.ndarray:
        """Below which no value is, (R,), from multipliers u of efforts without limits."""
        return np.full(r.count, -np.inf)

    @abstractmethod
    def solve(self, r: Reduced, start: np.ndarray, cutoff: np.ndarray) -> Answer:
        """Least of every sample; `found` only where it is certified.

        Args: start:  multipliers of the least norm without limits, (6, R).
              cutoff: value above which an answer is of no use, (R,).
        """

    @abstractmethod
    def values(self, r: Reduced, answer: Answer) -> np.ndarray:
        """What is least, (levels, R): the first of them first; a second only breaks ties."""


def register(objective: Objective) -> Objective:
    """Add an objective under its name."""
    OBJECTIVES[objective.name] = objective
    return objective


def named(name: str) -> Objective:
    """The objective of this name."""
    if name not in OBJECTIVES:
        raise InputError(f'unknown distribution "{name}".' + did_you_mean(name, OBJECTIVES))
    return OBJECTIVES[name]
