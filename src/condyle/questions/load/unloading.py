"""A spring between the teeth that breaks: what is bitten on in an unloading test."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, ClassVar, Literal, Self

import casadi as ca
import numpy as np
from pydantic import Field, model_validator

from ...mechanism.quantities import Direction, Length
from ..entries import Gain, Machine, Positive, unit
from .acting import WRENCH, ActingLoad, Jump, LoadPlace, LoadTable

WHOLE, BROKEN = 0, 1
LONGEST = 1e4  # s: beyond any simulation


class Unloading(LoadTable):
    """force = -max(0, stiffness (x - rest) + damping x') u,   x = u . (p - p_home),

    with u the direction in which the point bites, until it breaks, at a force or at a time, and
    for good: it only pushes.
    """

    # WRENCH is fed with the time that is left, as a number below zero.
    ports: ClassVar[Mapping[str, int]] = {
        **dict.fromkeys(("stiffness", "damping", "rest", "break_force"), 1),
        "direction": 3,
        WRENCH: 6,
    }
    divided: ClassVar[tuple[str, ...]] = ("stiffness", "damping", "break_force")
    bears: ClassVar[int | None] = WHOLE
    parameters: ClassVar[Mapping[str, str]] = {
        "stiffness": "N/m",
        "damping": "N s/m",
        "rest": "m",
        "break_force": "N",
    }

    kind: Literal["unloading"]
    direction: Direction = Field(
        default=(0.0, 0.0, 1.0), description="in which the point bites, in {S}"
    )
    stiffness: Positive = Field(description="N/m")
    damping: Gain = Field(default=0.0, description="N s/m")
    rest: Length = Field(default=0.0, description="x at which it does nothing; at home x is 0")
    break_force: Positive | None = Field(default=None, description="at which it breaks, N")
    break_time: Positive | None = Field(default=None, description="at which it breaks, s")

    @model_validator(mode="after")
    def _breaks(self) -> Self:
        if self.break_force is None and self.break_time is None:
            raise ValueError("unloading: give break_force [N], break_time [s] or both")
        return self

    def given(self, machine: Machine) -> Mapping[str, Any]:
        force = float("inf") if self.break_force is None else self.break_force
        own = {name: getattr(self, name) for name in ("stiffness", "damping", "rest")}
        return {**own, "direction": unit(self.direction), "break_force": force, WRENCH: np.zeros(6)}

    def bind(self, machine: Machine, name: str) -> ActingLoad:
        end = LONGEST if self.break_time is None else self.break_time
        times = np.unique([0.0, end, 2 * LONGEST])
        rows = np.zeros((len(times), 6))
        rows[:, 0] = times - end
        return replace(super().bind(machine, name), times=times, rows=rows)

    @staticmethod
    def begin(at: LoadPlace) -> Any:
        """Beyond its force it is broken already."""
        return ca.if_else(_push(at) > at.numbers.break_force, BROKEN, WHOLE)

    @staticmethod
    def wrench(at: LoadPlace) -> ca.SX:
        return -ca.if_else(at.mode == WHOLE, _push(at), 0) * at.numbers.direction

    @staticmethod
    def guards(at: LoadPlace) -> Sequence[tuple[int, ca.SX]]:
        return (
            (WHOLE, _push(at) - at.numbers.break_force),
            (WHOLE, at.numbers.wrench[0]),
        )

    @staticmethod
    def jumps(numbers: Any) -> Sequence[Jump]:
        text = f"what is bitten on breaks at {numbers.break_force:g} N"
        return (
            Jump(BROKEN, "broken", text),
            Jump(BROKEN, "broken", "what is bitten on breaks, at {force}"),
        )


def _push(at: LoadPlace) -> ca.SX:
    """Force on the tooth, against `direction` [N]."""
    n = at.numbers
    x, rate = ca.dot(n.direction, at.s), ca.dot(n.direction, at.v)
    return ca.fmax(n.stiffness * (x - n.rest) + n.damping * rate, 0)
