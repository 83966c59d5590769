"""Muscle: a cable whose limits follow from its length and speed.

With L the line's length and h = optimal_length sin(pennation), of a rigid tendon:

    l   = sqrt((L - tendon_length)^2 + h^2) / optimal_length     length of the fibres
    cos = (L - tendon_length) / (l optimal_length)
    v   = l' / max_speed                                         positive when they lengthen
    tension = (activation f_L(l) f_V(v) + f_P(l)) max_force cos

The curves are those of De Groote, Kinney, Rao and Fregly, Ann. Biomed. Eng. 44 (2016), cut off
where f_P and f_V are negative, by constants with three digits, as SymPy has them. Codes that cite
them have more: 0.814483478343008, 1.055033428970575, 0.162384573599574, 0.063303448465465 in the
first line; with these three digits f_L(1) is 0.994, with theirs 0.9994, and with
0.8150671134243542 in OpenSim 1. Where L <= tendon_length the muscle is slack, and its tension 0.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import Any

import numpy as np

from .cable import CableFamily

GAUSSIANS = (
    (0.814, 1.06, 0.162, 0.0633),
    (0.433, 0.717, -0.0299, 0.2),
    (0.1, 1.0, 0.354, 0.0),
)
SPEED = (-0.318, -8.149, -0.374, 0.886)
STIFFENING = 4.0  # k_PE


class MuscleFamily(CableFamily):
    kind = "muscle"
    idealised = "muscles are tendons whose motor gives the tension; their curves are left out"

    def file_numbers(self, chain: Any, paths: Iterable[str] | None = None) -> np.ndarray:
        """As of a cable from the last point that is fixed in {S}."""
        names = ["anchor" if path == "base" else path for path in paths or self.numbers]
        return super().file_numbers(chain, names)


def force_length(l: np.ndarray) -> np.ndarray:
    """f_L of active fibres of length l, relative to the optimal."""
    terms = (a * np.exp(-0.5 * ((l - b) / (c + d * l)) ** 2) for a, b, c, d in GAUSSIANS)
    return sum(terms, np.zeros_like(l))


def force_velocity(v: np.ndarray) -> np.ndarray:
    """f_V of active fibres of speed v, relative to the greatest; positive when they lengthen."""
    a, b, c, d = SPEED
    return np.maximum(a * np.arcsinh(b * v + c) + d, 0.0)


def passive_force(l: np.ndarray, strain: np.ndarray) -> np.ndarray:
    """f_P of fibres of length l; strain: where it is 1, 0 for no passive force."""
    none = strain == 0
    rise = np.expm1(STIFFENING * np.maximum(l - 1, 0.0) / np.where(none, 1.0, strain))
    return np.where(none, 0.0, rise / np.expm1(STIFFENING))


@dataclass(frozen=True)
class MuscleState:
    """Muscles of a machine at N samples, (N, n) each; NaN for chains that are none.

    length:  of the fibres, relative to the optimal.   speed: v.
    passive: f_P max_force cos [N].   active: f_L f_V max_force cos [N].
    slack:   whether the line is no longer than the tendon.
    """

    length: np.ndarray
    speed: np.ndarray
    passive: np.ndarray
    active: np.ndarray
    slack: np.ndarray

    @staticmethod
    def of(chains: Sequence[Any], joint: np.ndarray, rate: np.ndarray) -> MuscleState:
        """Args: joint, rate: coordinates of the chains and their rates, (N, n)."""
        columns = muscles(chains)
        length, speed, passive, active = np.full((4, *np.shape(joint)), np.nan)
        state = MuscleState(length, speed, passive, active, np.zeros(length.shape, dtype=bool))
        if not columns:
            return state
        own = [chains[i] for i in columns]
        force, optimal, tendon, pennation, fastest, strain = (
            np.array([getattr(chain.muscle, name) for chain in own])
            for name in (
                "max_force",
                "optimal_length",
                "tendon_length",
                "pennation",
                "max_speed",
                "passive_strain",
            )
        )
        home = np.array([chain.lengths["line"] for chain in own])
        projected = (home - joint[:, columns] - tendon) / optimal
        l = np.hypot(projected, np.sin(pennation))
        taut = projected > 0
        with np.errstate(invalid="ignore", divide="ignore"):
            cos = np.where(taut, projected / l, 0.0)
        v = -cos * rate[:, columns] / (optimal * fastest)
        pull = force * cos
        length[:, columns], speed[:, columns] = l, v
        passive[:, columns] = np.where(taut, passive_force(l, strain), 0.0) * pull
        active[:, columns] = np.where(taut, force_length(l) * force_velocity(v), 0.0) * pull
        state.slack[:, columns] = projected <= 0
        return state


def muscles(chains: Sequence[Any]) -> list[int]:
    """Which chains are muscles."""
    return [i for i, kind in enumerate(map(attrgetter("kind"), chains)) if kind == "muscle"]


def activated(excitation: np.ndarray, t: np.ndarray, rise: float, fall: float) -> np.ndarray:
    """Activation a of a muscle under an excitation u that is linear between samples, (N,).

        a' = (u - a) / rise  where u > a,    (u - a) / fall  elsewhere

    Exact, from a = u at the first sample.

    Args: excitation: (N,);  t: (N,) [s], increasing;  rise, fall: time constants [s], above 0.
    """
    a = np.array(excitation, dtype=float)
    step = np.diff(t)
    slope = np.diff(excitation) / step
    for i, (h, s) in enumerate(zip(step.tolist(), slope.tolist(), strict=True)):
        w = a[i] - excitation[i]  # w' = -w / time - s, which passes 0 once at most
        time = fall if w > 0 or (w == 0 and s < 0) else rise
        if w * s > 0:
            passes = time * np.log1p(w / (time * s))
            if passes < h:
                w, h, time = 0.0, h - passes, fall if s < 0 else rise
        a[i + 1] = excitation[i + 1] + w * np.exp(-h / time) + time * s * np.expm1(-h / time)
    return a
