"""What holds for every pose of a map, and one block of its poses, evaluated on demand."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from ...kinematics.singularities import SINGULAR
from ...model.model import Contacts, Model
from ...model.model_result import ModelResult
from ...model.surveying import Survey
from ...results.contacts import bound_margins
from ...status import Status
from .load_capacity import LoadCapacity
from .reach import Reach


@dataclass(frozen=True)
class Setup:
    """What holds for every pose of a map.

    load:      force and moment in {S}, and the point they act at in {M}, (9,) [N, N m, m].
    direction: of the additional load whose limit is sought, a unit vector in {S}, (3,).
    stiffness: of the actuators, (n,) [N m/rad or N/m]; None if it was not given.
    contacts:  kept, or compliant: what is at rest there.
    """

    model: Model
    reach: Reach
    load: np.ndarray
    direction: np.ndarray | None = None
    stiffness: np.ndarray | None = None
    contacts: Contacts = "kept"

    @cached_property
    def load_capacity(self) -> LoadCapacity:
        return LoadCapacity.of(self.model)


@dataclass
class Block:
    """N poses of a map; everything is computed once, when it is first used.

    wanted: names of the survey's values that the quantities need.
    """

    setup: Setup
    q: np.ndarray
    wanted: frozenset[str] = field(default_factory=frozenset)

    @cached_property
    def _surveyed(self) -> tuple[Survey, np.ndarray]:
        return self.setup.reach.survey(self.q, self.wanted)

    @property
    def survey(self) -> Survey:
        return self._surveyed[0]

    @property
    def margin(self) -> np.ndarray:
        """The margin of each chain's reach, (n, N)."""
        return self._surveyed[1]

    def value(self, name: str) -> np.ndarray:
        """A value of the survey, samples last."""
        return self.survey.values[name]

    @cached_property
    def held(self) -> ModelResult:
        """Efforts and contact forces at rest under the load; NaN where a pose cannot be reached."""
        return self.holding(self.setup.model, self.setup.load[:6], self.setup.contacts)

    def holding(self, model: Model, wrench: np.ndarray, contacts: Contacts = "kept") -> ModelResult:
        """As `held`, by a model's distribution, under a wrench (6,) at the load's point."""
        still, good = np.zeros_like(self.q), self.survey.reached
        q = np.where(good[:, None], self.q, 0.0)
        at, threads = self.setup.load[6:], self.setup.reach.threads
        how: Any = {"threads": threads, "contacts": contacts}
        found = model.inverse_dynamics(q, still, still, wrench, at, **how)
        status = np.where(good, found.status, self.survey.status)
        bad = status != Status.ok
        effort, force = found.effort, found.contact_force
        effort[bad], force[bad] = np.nan, np.nan
        return ModelResult(effort=effort, contact_force=force, status=status)

    @cached_property
    def elastic(self) -> ModelResult:
        """Stiffness and compliance at rest under the load."""
        return self._loaded(self.setup.model.stiffness)

    @cached_property
    def modes(self) -> ModelResult:
        """Small vibrations about rest under the load."""
        return self._loaded(self.setup.model.modes)

    def _loaded(self, method: Callable[..., ModelResult]) -> ModelResult:
        """A method's result at each pose; NaN where it cannot be reached."""
        load = self.setup.load
        q = np.where(self.survey.reached[:, None], self.q, 0.0)
        result = method(q, None, load[:6], load[6:], contacts=self.setup.contacts)
        for value in vars(result).values():
            if value.dtype.kind == "f":
                value[~self.survey.reached] = np.nan
        return result

    @cached_property
    def bounds(self) -> np.ndarray:
        """How far each contact point is within its bounds, (N, k) [m]; infinite without bounds."""
        return bound_margins(self.setup.model.mechanism, np.moveaxis(self.value("points"), -1, 0))

    @property
    def pose(self) -> np.ndarray:
        """The platform's poses, (N, 6) [m, rad]."""
        return self.value("pose").T

    @property
    def cause(self) -> np.ndarray:
        """Index into `owners` of what forbids each pose, (N,) int16; 0 where nothing does."""
        n = len(self.margin)
        status, survey = self.survey.status, self.survey
        cause = np.zeros(len(status), dtype=np.int16)
        short = ~(self.margin >= 0)
        chain = 1 + short.argmax(axis=0)
        unreachable = status == Status.unreachable
        cause[unreachable] = np.where(survey.met, chain, 1 + n)[unreachable]
        cause[status == Status.overlap] = 1 + n
        singular = status == Status.singular
        if singular.any():
            cause[singular] = 2 + n
            if "transmission" in survey.values:
                locked = singular & (survey.inverse_ratio < SINGULAR)
                weakest = np.abs(self.value("transmission")[:, locked]).argmin(axis=0)
                cause[locked] = 1 + weakest
        return cause
