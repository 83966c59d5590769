"""Objectives: how redundancy is resolved. A new one is an instance that is registered."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar, Literal

import numpy as np

from ..errors import InputError, did_you_mean
from .active_set import least
from .certificate import Optimum, certified
from .eliminated import Sample
from .problem import Problem
from .stretch import least_stretch

ROOM = 1e-10  # relative tolerance on the minimal maximum in the second stage of minimax


@dataclass(frozen=True)
class Objective:
    """Sum of squares of efforts over `scale`, plus W times those of contact forces over N_ref.

    summary:     one line for help and docs.
    limits:      effort limits and unilateral contacts apply.
    mixes_units: efforts may be of different units: each is divided by its limit.
    weighs:      contact forces may have a weight.
    follows:     measured activations are asked for.
    """

    term: ClassVar[str | None] = "square"  # of the question `allocation`; None: not separable

    name: str
    summary: str
    limits: bool = True
    mixes_units: bool = False
    weighs: bool = False
    follows: bool = False

    def check(self, problem: Problem) -> None:
        """Raise InputError where the objective is undefined for these limits."""
        if self.mixes_units and not np.isfinite(problem.scale).all():
            without = np.flatnonzero(~np.isfinite(problem.scale)).tolist()
            raise InputError(
                f"{self.name} divides each effort by its limit; efforts {without} have none. Give "
                "them limits, or use bounded"
            )

    def scale(self, problem: Problem) -> np.ndarray:
        """Scale of the efforts, (n,): 1, or the larger of their limits."""
        limit = problem.scale
        return np.where(limit > 0, limit, 1.0) if self.mixes_units else np.ones(problem.n)

    def weight(self, problem: Problem) -> float:
        """W / N_ref^2 of a half of the sum of squares of contact forces [1/N^2]."""
        return problem.force_weight if self.weighs else 0.0

    def ports(self, problem: Problem) -> dict[str, np.ndarray]:
        """Limits as ports of the questions `allocation` and `limited`; see `Limits`."""
        p, free = problem, np.full(problem.n, np.inf)
        low, high, push = (p.low, p.high, p.push) if self.limits else (-free, free, 0 * p.push)
        # Both signs of a bilateral contact with friction: all but what is between.
        both = (push == 0) & p.rubs & bool(self.limits and p.preload)
        ports = {
            "low": low,
            "high": high,
            "scale": self.scale(p),
            "contact_low": np.where((push > 0) | both, p.preload, -np.inf),
            "contact_high": np.where((push < 0) | both, -p.preload, np.inf),
        }
        weight = self.weight(p)
        return ports | ({"weight": np.array([weight])} if weight else {})

    def solve(self, s: Sample) -> Optimum | None:
        """The certified minimum of one sample; None where none was found."""
        return least(s, lambda x: x, np.ones_like, curved=False)

    def values(self, s: Sample, answer: Optimum) -> tuple[float, ...]:
        """Value of the objective; a second entry breaks ties."""
        square = answer.x @ answer.x + s.weight * answer.force @ answer.force
        return (0.5 * s.unit**2 * float(square),)


@dataclass(frozen=True)
class Cubic(Objective):
    """Sum of cubes of efforts over their limits, for efforts that only pull."""

    term: ClassVar[str | None] = "cube"

    def check(self, problem: Problem) -> None:
        super().check(problem)
        if (problem.low < 0).any():
            negative = np.flatnonzero(problem.low < 0).tolist()
            raise InputError(
                f"cubic is for efforts that only pull; efforts {negative} may be negative. Set "
                "their lower limit to 0, or use weighted"
            )

    def solve(self, s: Sample) -> Optimum | None:
        return least(s, lambda x: x * x, lambda x: 2 * x, curved=True)

    def values(self, s: Sample, answer: Optimum) -> tuple[float, ...]:
        return (float(np.sum((s.unit * answer.x) ** 3)) / 3,)


@dataclass(frozen=True)
class Minimax(Objective):
    """Maximum effort over its limit; ties are broken by the sum of squares."""

    term: ClassVar[str | None] = None

    def solve(self, s: Sample) -> Optimum | None:
        if s.contradictory:
            return None
        ones = np.ones(len(s.low))
        found = least_stretch(s, -ones, ones)
        if not np.isfinite(found.t):
            return None
        if np.isfinite(found.error):
            answer = certified(s, found.x, found.u, ones, found.error)
            if answer.proved:
                return answer
        # Second stage: t is known better than its x.
        most = found.t * (1 + ROOM)
        narrow = replace(s, low=np.maximum(s.low, -most), high=np.minimum(s.high, most))
        other = super().solve(narrow)
        if other is None:
            return None
        above = abs(np.abs(other.x).max() - found.t)
        slack = max(other.slack, above / found.t if above else 0.0)
        answer = certified(s, other.x, other.u, ones, slack)
        return answer if answer.proved else None

    def values(self, s: Sample, answer: Optimum) -> tuple[float, ...]:
        x = s.unit * answer.x
        return float(np.abs(x).max()), float(x @ x)


# For editors and type checkers; an objective from elsewhere is registered alone.
ObjectiveName = Literal[
    "bounded", "cubic", "emg", "emg_assisted", "minimax", "minimum_norm", "weighted"
]
OBJECTIVES: dict[str, Objective] = {}
# Minimises nothing, and balances nothing: efforts follow from measured activations.
EMG = Objective("emg", "activations as measured; what they do not balance is left", follows=True,
                mixes_units=True)  # fmt: skip


def register(objective: Objective) -> Objective:
    """Add an objective under its name."""
    OBJECTIVES[objective.name] = objective
    return objective


def named(name: str) -> Objective:
    """The objective of this name."""
    if name not in OBJECTIVES:
        raise InputError(f'unknown distribution "{name}".' + did_you_mean(name, OBJECTIVES))
    return OBJECTIVES[name]


for _objective in (
    Objective("bounded", "minimum norm within effort limits and unilateral contacts"),
    Cubic(
        "cubic",
        "minimum sum of cubed activations (muscle recruitment); efforts are >= 0",
        mixes_units=True,
    ),
    Objective(
        "emg_assisted",
        "least sum of squares of activations' deviations from measured ones",
        mixes_units=True,
        follows=True,
    ),
    Minimax("minimax", "minimum largest activation, then minimum norm", mixes_units=True),
    Objective("minimum_norm", "minimum norm; limits are ignored", limits=False),
    Objective(
        "weighted",
        "minimum norm of activations (effort / limit), with an optional contact-force weight",
        mixes_units=True,
        weighs=True,
    ),
):
    register(_objective)
