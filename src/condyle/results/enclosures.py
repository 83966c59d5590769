"""Digits of chosen samples that are proven: by intervals of 60 digits, from the same equations."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from ..backends.interval import UndecidedError, enclosed
from ..errors import InputError, UnsupportedError, brief
from ..model.model import Model
from ..progress import step
from ..questions import Question
from .solving import inputs_of, states_of


@dataclass(frozen=True)
class Proof:
    """What is proven of a sample.

    time: [s];  digits: of the largest effort and contact force that are right, 0 if none is proven;
    bound: the estimate beside its status.
    """

    time: float
    digits: float
    bound: float

    def __str__(self) -> str:
        estimate = f"its bound says {-math.log10(self.bound):.1f}"
        proven = f"{self.digits:.1f} digits" if self.digits else "nothing"
        return f"t = {self.time:g} s: {proven} proven, {estimate}"


def count_of(given: Any) -> int | None:
    """How many samples are to be proven; None: none.

    Raises: InputError: for what is no number of samples.
    """
    if given is None or (type(given) is int and given > 0):
        return given
    raise InputError(f"prove: expected a number of samples, at least 1, got {brief(given)}")


def prove(model: Model, solution: xr.Dataset, count: int) -> list[Proof]:
    """Efforts and contact forces of samples enclosed by intervals: half of those with the largest
    bounds, the others evenly along the motion.

    The equations are those of the kernel, its inputs and the mechanism's numbers as they are,
    doubles: errors of geometry in the file, and of constants computed from it, do not count.

    Raises: UnsupportedError: where efforts are not of least norm.
            MissingExtraError: without mpmath.
    """
    if not model.distributor.least_norm:
        raise UnsupportedError(
            f"--prove (prove=...) proves efforts of least norm, not those of "
            f'"{model.distribution.name}": take --distribution minimum_norm and --unilateral keep'
        )
    system = model.system.with_inputs(tuple(inputs_of(solution)))
    question = Question.about(system.structure, "inverse", ("contact",))
    program = question.variants().main
    proofs = []
    with step("proving", count) as advance:
        for i in _chosen(solution, count):
            proofs.append(_proof(program, system.numbers, solution, model, i))
            advance(1)
    return proofs


def _chosen(solution: xr.Dataset, count: int) -> list[int]:
    good = np.flatnonzero(solution["status"].values == 0)
    worst = good[np.argsort(-solution["bound"].values[good])][: (count + 1) // 2]
    even = good[np.linspace(0, len(good) - 1, count).astype(int)] if len(good) else good
    kept = dict.fromkeys([*worst.tolist(), *even.tolist()])
    return sorted(list(kept)[:count])


def _proof(program: Any, numbers: Any, solution: xr.Dataset, model: Model, i: int) -> Proof:
    here, states = solution.isel(time=i), states_of(model, solution)
    at = states.pop("at")
    point = np.zeros(3) if at is None else np.array(model.mechanism.platform.points[at])
    ports = {"v": "q1", "a": "q2"}
    inputs = {ports.get(name, name): a[i, None] for name, a in states.items()}
    load = inputs.pop("wrench")
    inputs |= {"force": load[:, :3], "moment": load[:, 3:], "point": point[None]}
    got = {name: here[name].values for name in ("effort", "contact_force")}
    try:
        intervals = enclosed(program, numbers, inputs)
        off = max((_off(got[name], intervals[name][..., 0]) for name in got), default=1.0)
    except (UndecidedError, ZeroDivisionError, ValueError):
        off = 1.0
    digits = max(0.0, -math.log10(max(off, 1e-300))) if math.isfinite(off) else 0.0
    return Proof(float(here["time"]), digits, float(here["bound"]))


def _off(got: np.ndarray, intervals: np.ndarray) -> float:
    """The largest distance of numbers from the far ends of intervals, over the largest number."""
    if not got.size or not (size := np.abs(got).max()):
        return 0.0
    far = [
        max(abs(x.a - float(y)), abs(x.b - float(y))).b for x, y in zip(intervals, got, strict=True)
    ]
    return float(max(far)) / float(size)
