"""Objectives: how redundancy is resolved. A new one is an instance that is registered."""

from __future__ import annotations

from collections import ChainMap
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Literal

import numpy as np

from ..errors import InputError, did_you_mean
from .active_set import least
from .certificate import Optimum, certified
from .eliminated import Sample
from .problem import Problem
from .stretch import least_stretch

LEVEL = "level"  # term of the question `levelled`
ROOM = 1e-10  # relative tolerance on the minimal maximum in the second stage of minimax


@dataclass(frozen=True)
class Objective:
    """Sum of a cost of efforts over `scale`, plus W times squares of contact forces over N_ref.

    summary:     one line for help and docs;  chosen: how efforts are described that it chose.
    limits:      effort limits and unilateral contacts apply.
    mixes_units: efforts may be of different units: each is divided by its limit.
    weighs:      contact forces may have a weight.
    follows:     measured activations are asked for.
    by_work:     muscles' activations count by greatest force times optimal length.

    Half the square is the cost. Another one is a class with `cost`, `slope`, `curvature` and
    `curved`, and with `inverse` and `degree` if kernels are to minimise it; what is no sum has
    `solve`, `values` and `derivatives`.

    curved: whether the curvature varies.
    term:   of the question `allocation`: a name of its `TERMS`, the class whose cost it is, or
            `LEVEL`; None: each sample is solved alone, as it is by default where the class has no
            `inverse`.
    degree: of the slope, as 3 of x^3.
    pulls:  efforts have to be at least 0.
    peaks:  the largest efforts over their scales are held level.
    """

    curved: ClassVar[bool] = False
    term: ClassVar[str | type[Objective] | None] = "square"
    degree: ClassVar[int] = 1
    pulls: ClassVar[bool] = False
    peaks: ClassVar[bool] = False

    name: str
    summary: str
    limits: bool = True
    mixes_units: bool = False
    weighs: bool = False
    follows: bool = False
    by_work: bool = False
    chosen: str = ""

    def __init_subclass__(cls) -> None:
        if "term" not in vars(cls) and vars(cls).keys() & {"cost", "slope", "solve"}:
            cls.term = cls if "inverse" in vars(cls) else None

    @staticmethod
    def cost(x: np.ndarray) -> np.ndarray:
        """The cost of every effort over its scale, convex."""
        return 0.5 * x * x

    @staticmethod
    def slope(x: np.ndarray) -> np.ndarray:
        """First derivative of the cost."""
        return x

    @staticmethod
    def curvature(x: np.ndarray) -> np.ndarray:
        """Second derivative of the cost."""
        return np.ones_like(x)

    @staticmethod
    def inverse(slope: Any) -> Any:
        """The effort over its scale at which the cost has a slope.

        With it the cost is compiled. This gets symbols of CasADi, `cost` and `curvature` numbers or
        symbols; none of them branches on a value.
        """
        return slope

    def check(self, problem: Problem) -> None:
        """Raise InputError where the objective is undefined for these limits."""
        if self.mixes_units and not np.isfinite(problem.scale).all():
            without = np.flatnonzero(~np.isfinite(problem.scale)).tolist()
            raise InputError(
                f"{self.name} divides each effort by its limit; efforts {without} have none. Give "
                "them limits, or use bounded"
            )
        if self.pulls and (problem.low < 0).any():
            negative = np.flatnonzero(problem.low < 0).tolist()
            raise InputError(
                f"{self.name} is for efforts that only pull; efforts {negative} may be negative. "
                "Set their lower limit to 0, or use weighted"
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
        return least(s, self.slope, self.curvature, self.curved)

    def values(self, s: Sample, answer: Optimum) -> tuple[float, ...]:
        """Value of the objective; a second entry breaks ties."""
        forces = 0.5 * s.unit**2 * s.weight * float(answer.force @ answer.force)
        return (float(np.sum(self.cost(s.unit * answer.x))) + forces,)

    def derivatives(
        self, effort: np.ndarray, scale: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The first and second derivative by each effort, and the first's by its scale, (N, n)."""
        x = effort / scale
        slope, curvature = self.slope(x), self.curvature(x)
        return slope / scale, curvature / scale**2, -(slope + x * curvature) / scale**2


@dataclass(frozen=True)
class Cubic(Objective):
    """Sum of cubes of efforts over their limits, for efforts that only pull."""

    curved: ClassVar[bool] = True
    term: ClassVar[str | type[Objective] | None] = "cube"
    pulls: ClassVar[bool] = True

    @staticmethod
    def cost(x: np.ndarray) -> np.ndarray:
        return x**3 / 3

    @staticmethod
    def slope(x: np.ndarray) -> np.ndarray:
        return x * x

    @staticmethod
    def curvature(x: np.ndarray) -> np.ndarray:
        return 2 * x


@dataclass(frozen=True)
class Minimax(Objective):
    """Maximum effort over its limit; ties are broken by the sum of squares."""

    term: ClassVar[str | type[Objective] | None] = LEVEL
    peaks: ClassVar[bool] = True

    def solve(self, s: Sample) -> Optimum | None:
        if s.contradictory:
            return None
        ones = np.ones(len(s.low))
        stretch = least_stretch(s, -ones, ones)
        if not np.isfinite(stretch.t):
            return None
        if np.isfinite(stretch.error):
            answer = certified(s, stretch.x, stretch.u, ones, stretch.error)
            if answer.proved:
                return answer
        # Second stage: t is known better than its x.
        most = stretch.t * (1 + ROOM)
        narrow = replace(s, low=np.maximum(s.low, -most), high=np.minimum(s.high, most))
        other = super().solve(narrow)
        if other is None:
            return None
        above = abs(np.abs(other.x).max() - stretch.t)
        slack = max(other.slack, above / stretch.t if above else 0.0)
        answer = certified(s, other.x, other.u, ones, slack)
        return answer if answer.proved else None

    def values(self, s: Sample, answer: Optimum) -> tuple[float, ...]:
        x = s.unit * answer.x
        return float(np.abs(x).max()), float(x @ x)

    def derivatives(
        self, effort: np.ndarray, scale: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Derivatives of the squares' sum below the peaks, and of the peaks' level by its scale."""
        return effort, np.ones_like(effort), -effort / scale


# For editors and type checkers; an objective from elsewhere is registered alone.
ObjectiveName = Literal[
    "bounded", "cubic", "emg", "emg_assisted", "minimax", "minimum_norm", "weighted"
]
OBJECTIVES: dict[str, Objective] = {}
# Minimises nothing, and balances nothing: efforts follow from measured activations.
EMG = Objective("emg", "activations as measured; what they do not balance is left", follows=True,
                mixes_units=True)  # fmt: skip
# What a model's distribution may be called.
NAMED = ChainMap(OBJECTIVES, {EMG.name: EMG})


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
    Objective(
        "bounded",
        "minimum norm within effort limits and unilateral contacts",
        chosen="of least norm within limits",
    ),
    Cubic(
        "cubic",
        "minimum sum of cubed activations (muscle recruitment); efforts are >= 0",
        mixes_units=True,
        chosen="of least cubes over limits, within them",
    ),
    Objective(
        "emg_assisted",
        "least sum of squares of activations' deviations from measured ones",
        mixes_units=True,
        follows=True,
    ),
    Minimax(
        "minimax",
        "minimum largest activation, then minimum norm",
        mixes_units=True,
        chosen="of least maximum of |effort| over limit",
    ),
    Objective(
        "minimum_norm", "minimum norm; limits are ignored", limits=False, chosen="of least norm"
    ),
    Objective(
        "weighted",
        "minimum norm of activations (effort / limit), with an optional contact-force weight",
        mixes_units=True,
        weighs=True,
        by_work=True,
        chosen="of least squares over limits, within them",
    ),
):
    register(_objective)
