"""A force and a moment that are given: the same at all times, or by a table over time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, ClassVar, Literal

import casadi as ca
import numpy as np
from pydantic import Field

from ..entries import File, Machine, Vector
from .acting import WRENCH, ActingLoad, LoadPlace, LoadTable


class Constant(LoadTable):
    """The same force and moment at all times, in {S}."""

    ports: ClassVar[Mapping[str, int]] = {WRENCH: 6}
    divided: ClassVar[tuple[str, ...]] = (WRENCH,)

    kind: Literal["constant"]
    force: Vector = Field(default=(0.0, 0.0, 0.0), description="N, in {S}")
    moment: Vector = Field(default=(0.0, 0.0, 0.0), description="N m, in {S}")

    def given(self, machine: Machine) -> Mapping[str, Any]:
        return {WRENCH: (*self.force, *self.moment)}

    @staticmethod
    def wrench(at: LoadPlace) -> ca.SX:
        return at.numbers.wrench

    def bind(self, machine: Machine, name: str) -> ActingLoad:
        if any(self.force) or self.point is not None:
            return super().bind(machine, name)
        # A moment alone acts at no point.
        numbers = {WRENCH: np.array((*self.force, *self.moment))}
        return ActingLoad(type(self), name, np.zeros(3), None, numbers)


class Csv(LoadTable):
    """A table of t and some of Fx, Fy, Fz, Mx, My, Mz, as of `condyle run --load`.

    Linear between its rows; before the first and after the last there is no load.
    """

    ports: ClassVar[Mapping[str, int]] = {WRENCH: 6}
    divided: ClassVar[tuple[str, ...]] = (WRENCH,)

    kind: Literal["csv"]
    file: File = Field(description="t [s], Fx, Fy, Fz [N], Mx, My, Mz [N m], in {S}")

    def given(self, machine: Machine) -> Mapping[str, Any]:
        return {WRENCH: np.zeros(6)}

    @staticmethod
    def wrench(at: LoadPlace) -> ca.SX:
        return at.numbers.wrench

    def bind(self, machine: Machine, name: str) -> ActingLoad:
        times, rows = machine.tabled(self.file)
        return replace(super().bind(machine, name), times=times, rows=rows)
