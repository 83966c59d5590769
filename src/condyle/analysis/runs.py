"""Models on samples of a motion: their numbers, and the seconds these took."""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property, partial
from time import process_time  # of the processor: what else a machine does does not count
from typing import TYPE_CHECKING

import numpy as np

from ..distribution import ObjectiveName
from ..dynamics import FormulationName, Route
from ..mechanism.mechanism import Mechanism
from ..model.distributing import Distribution
from ..model.dynamics import ALWAYS
from ..model.model import Model
from ..model.model_result import ModelResult
from ..questions.inverse import SETS
from ..results.solving import states_of
from .paper import Seconds

if TYPE_CHECKING:
    import xarray as xr


class TimedModel(Model):
    """A model run by numpy, so that its derivation and its numbers are timed apart.

    A compiled kernel would mix in the compiler's seconds, or none where the kernel is cached; the
    benchmark is the place for those.

    Attributes: symbolic: seconds of the derivation: the graph of what `inverse_dynamics` always
    answers.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        formulation: FormulationName,
        route: Route,
        distribution: ObjectiveName | Distribution | None = None,
    ) -> None:
        how = {"formulation": formulation, "route": route, "distribution": distribution}
        with without_collection():
            start = process_time()
            super().__init__(mechanism, **how, backend="numpy")  # type: ignore[arg-type]
            self.kernel("inverse", SETS.covering(ALWAYS)[0])
            self.symbolic: float = process_time() - start


@contextmanager
def without_collection() -> Iterator[None]:
    """Without collection of garbage, whose seconds would be counted for one model alone."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


@dataclass(frozen=True)
class Run:
    """One model on the motion.

    contacts: whether they hold the platform, or it is free (the 6RSS).
    seconds:  of its derivation, and of its torques at all samples.
    effort:   (N, n) [N m or N];  share: (parts, N, n);  contact_force: (N, k) [N].
    """

    model: TimedModel
    seconds: Seconds
    result: ModelResult
    compute: Callable[..., ModelResult]

    @property
    def formulation(self) -> str:
        return self.model.formulation

    @property
    def route(self) -> str:
        return self.model.route

    @property
    def contacts(self) -> bool:
        return bool(self.model.mechanism.contacts)

    @property
    def effort(self) -> np.ndarray:
        return self.result.effort

    @property
    def contact_force(self) -> np.ndarray:
        return self.result.contact_force

    @cached_property
    def share(self) -> np.ndarray:
        return np.moveaxis(self.compute(outputs=("share",)).share, 1, 0)

    @property
    def label(self) -> str:
        return f"{self.formulation} {self.route}" + ("" if self.contacts else ", no contacts")


def run(model: TimedModel, solution: xr.Dataset) -> Run:
    """Compute a solution's samples by another model, and time its torques."""
    states = states_of(model, solution)
    compute = partial(model.inverse_dynamics, **states)
    if {"gravity", "base"} & {*states} or model.chooses_efforts:
        compute()  # not all of its kernels are there yet
    with without_collection():
        start = process_time()
        result = compute()
        numeric = process_time() - start
    return Run(model, Seconds(model.symbolic, numeric), result, compute)
