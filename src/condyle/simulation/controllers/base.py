"""What a controller of a scenario is: a table of the file, and the law it becomes.

A law is a pure function of arrays,

    effort, memory = law(measured, reference, memory),

so that another implementation, such as one in C, can stand in its place and be tested against it.
All that lasts from one period to the next is in `memory`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from pydantic import Field

from ...errors import InputError
from ...model.evaluator import Evaluator
from ..table import Count, File, Frequency, Name, Table


@dataclass(frozen=True)
class Measured:
    """What a controller sees at a tick.

    q, q1:  estimated state, (m,) each;  joint, joint_rate: (n,) each, as encoders have it.
    force:  of the loads on the platform at the controller's point, (3,) [N] in {S}.
    """

    t: float
    q: np.ndarray
    q1: np.ndarray
    joint: np.ndarray
    joint_rate: np.ndarray
    force: np.ndarray


@dataclass(frozen=True)
class Reference:
    """What it should be there: q, q1, q2 (m,), joint, joint_rate (n,), force [N]."""

    q: np.ndarray
    q1: np.ndarray
    q2: np.ndarray
    joint: np.ndarray
    joint_rate: np.ndarray
    force: float = 0.0

    @property
    def state(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """q, q1, q2."""
        return self.q, self.q1, self.q2


Memory = np.ndarray
NOTHING = np.zeros(0)


@dataclass(frozen=True)
class Law(ABC):
    """A controller on one mechanism: its law, with all numbers that it needs.

    model: the mechanism as the controller takes it to be.
    point: where it measures force, in {M}, or None.
    knobs: numbers that a hand may turn while it runs, with their units (see `condyle.simulation.
           knobs`); `force` is that of the path.
    """

    knobs: ClassVar[Mapping[str, str]] = {}

    model: Evaluator
    point: np.ndarray | None = field(default=None, kw_only=True)
    place: str | None = field(default=None, kw_only=True)

    def begin(self) -> Memory:
        """Memory to begin with."""
        return NOTHING

    @abstractmethod
    def __call__(self, now: Measured, aim: Reference, memory: Memory) -> tuple[np.ndarray, Memory]:
        """Efforts (n,) [N m or N], before any limit, and the memory of the next period."""


class ControllerTable(Table):
    """The `[controller]`; its `kind` says which."""

    # Whether the law can do without periods: it has no memory.
    continuous: ClassVar[bool] = True

    kind: Any
    motion: File | None = Field(
        default=None, description="CSV to follow; default: the bundled or a trial motion"
    )
    units: str | None = Field(default=None, description='of the motion, such as "mm,deg"')
    landmark: Name | None = Field(default=None, description="whose path the motion gives")
    rate: Frequency | None = Field(
        default=1000.0, description="Hz; efforts are held between samples"
    )
    ideal: bool = Field(
        default=False, description="at all times: no rate, no delay, and the state itself"
    )
    delay: Count = Field(default=0, description="whole periods between a sample and its efforts")
    model: File | None = Field(
        default=None, description="mechanism file it computes with, if it is not the plant"
    )
    distribution: str | None = Field(default=None, description="how it chooses efforts")
    preload: float = Field(default=0.0, ge=0, allow_inf_nan=False, description="N")

    @abstractmethod
    def bind(self, model: Evaluator) -> Law:
        """The law with its numbers.

        Raises: InputError: where it does not fit the mechanism.
        """


def each(given: float | Sequence[float], count: int, what: str, names: Sequence[str]) -> np.ndarray:
    """One number for all, or one each, (count,).

    Raises: InputError: for another count.
    """
    values = np.atleast_1d(np.asarray(given, dtype=float))
    if values.size not in (1, count):
        raise InputError(
            f"controller.{what}: expected one number, or {count}: one for each of "
            f"{', '.join(names)}; got {values.size}"
        )
    return np.broadcast_to(values, count).copy()
