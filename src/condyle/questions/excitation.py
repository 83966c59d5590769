"""Activation of muscles as a state, and the tension that follows from it.

With excitation e and activation a, both 0 to 1, and s = tanh(10 (e - a)) / 2:

    a' = ((1/2 + s) / (t_a (1/2 + 3/2 a)) + (1/2 - s) (1/2 + 3/2 a) / t_d) (e - a)
    tension = (a f_L(l) f_V(v) + f_P(l)) max_force cos

[De Groote, Kinney, Rao and Fregly, Ann. Biomed. Eng. 44 (2016), eq. 1-2, after Winters (1995)],
with t_a = activation_time and t_d = deactivation_time. A command is an excitation, or the tension
wanted: then e is the activation that would bring it at that length and speed, within 0 and 1.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from ..kinematics.chain import FAMILIES
from ..kinematics.chain.muscle import GAUSSIANS, SPEED, STIFFENING, muscles
from ..kinematics.state import State
from .builder import Builder

SMOOTHING = 10.0
TINY = 1e-12  # N and lengths: what is divided by at the least
NUMBERS = (
    *("max_force", "optimal_length", "tendon_length", "pennation", "max_speed"),
    *("passive_strain", "activation_time", "deactivation_time"),
)


def muscle_numbers(chains: Sequence[Any]) -> np.ndarray:
    """Port `muscle`, (9, n): `NUMBERS`, and the length of the line up to its last fixed point
    [m]; 0 for chains that are no muscles."""
    numbers = np.zeros((len(NUMBERS) + 1, len(chains)))
    for i in muscles(chains):
        chain = chains[i]
        numbers[:-1, i] = [getattr(chain.muscle, name) for name in NUMBERS]
        numbers[-1, i] = chain.lengths["line"] - np.linalg.norm(
            np.subtract(chain.platform, chain.anchor)
        )
    return numbers


@dataclass(frozen=True)
class Contraction:
    """A muscle: its tension [N], its excitation, and the rate of its activation [1/s]."""

    tension: ca.SX
    excitation: ca.SX
    rate: ca.SX


def contraction(
    b: Builder,
    group: int,
    state: State,
    numbers: ca.SX,
    activation: ca.SX,
    command: ca.SX,
    excited: ca.SX,
) -> Contraction:
    """Muscles of a group.

    Args: numbers: of `muscle_numbers`, (9,);  command: excitation where `excited` is 1, else the
          tension wanted [N].
    """
    force, optimal, tendon, pennation, fastest, strain, rise, fall, fixed = ca.vertsplit(numbers)
    constants = FAMILIES[b.structure.families[group]].named(b.lane(group, "constants"))
    M = state.point(b.lane(group, "joint"))
    line = M.position - constants.B
    length = ca.sqrt(ca.dot(line, line))
    projected = (length + fixed - tendon) / optimal
    thick = ca.sin(pennation)
    l = ca.sqrt(projected * projected + thick * thick)
    taut = projected > 0
    cos = ca.if_else(taut, projected / ca.fmax(l, TINY), 0)
    v = cos * ca.dot(line, M.velocity) / (length * optimal * fastest)
    active = force * cos * _force_length(l) * _force_velocity(v)
    passive = force * cos * _passive_force(l, strain)
    wanted = taut * (command - passive) / ca.fmax(active, TINY)
    e = ca.fmin(ca.fmax(ca.if_else(excited, command, wanted), 0), 1)
    return Contraction(passive + activation * active, e, _rate(activation, e, rise, fall))


def _force_length(l: ca.SX) -> ca.SX:
    terms = (a * ca.exp(-(((l - b) / (c + d * l)) ** 2) / 2) for a, b, c, d in GAUSSIANS)
    return sum(terms, ca.SX(0))


def _force_velocity(v: ca.SX) -> ca.SX:
    a, b, c, d = SPEED
    return ca.fmax(a * ca.asinh(b * v + c) + d, 0)


def _passive_force(l: ca.SX, strain: ca.SX) -> ca.SX:
    none = strain == 0
    rise = ca.expm1(STIFFENING * ca.fmax(l - 1, 0) / ca.if_else(none, 1, strain))
    return ca.if_else(none, 0, rise / float(np.expm1(STIFFENING)))


def _rate(a: ca.SX, e: ca.SX, rise: ca.SX, fall: ca.SX) -> ca.SX:
    s = ca.tanh(SMOOTHING * (e - a)) / 2
    slower = 0.5 + 1.5 * a
    return ((0.5 + s) / (rise * slower) + (0.5 - s) * slower / fall) * (e - a)
