"""Models on samples of a motion: their numbers, and the seconds these took."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from time import process_time  # of the processor: what else a machine does does not count
from typing import TYPE_CHECKING, Any

import numpy as np

from ..kinematics.constraints import indices
from ..mechanism.mechanism import Mechanism
from ..model.distributing import Distribution
from ..model.model import Model
from ..motion import resolve_load_point
from ..results.solving import given_along
from .paper import Seconds

if TYPE_CHECKING:
    import xarray as xr


class TimedModel(Model):
    """A model run by numpy, so that its derivation and its numbers are timed apart.

    A compiled kernel would mix in the compiler's seconds, or none where the kernel is cached; the
    benchmark is the place for those.

    Attributes: symbolic: seconds of the derivation: the graph of the efforts.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        formulation: str,
        route: str,
        distribution: str | Distribution | None = None,
    ) -> None:
        how = {"formulation": formulation, "route": route, "distribution": distribution}
        with without_collection():
            start = process_time()
            super().__init__(mechanism, **how, backend="numpy")  # type: ignore[arg-type]
            self.kernel("inverse", ("contact",))
            self.symbolic = process_time() - start


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


def states_of(model: Model, solution: xr.Dataset) -> tuple[Any, ...]:
    """q, v, a of a model along a solution, the wrench on its platform, and where that acts."""
    wrench, name = solution["load"].values, solution.condyle.options["load_point"]
    if name is None and wrench.any():
        name = resolve_load_point(None, model.mechanism.platform.points)
    own = indices(model.independent)
    rates = ("pose", "pose_rate", "pose_acceleration")
    return *(solution[one].values[:, own] for one in rates), wrench, name


@dataclass(frozen=True)
class Run:
    """One model on the motion.

    contacts: whether they hold the platform, or it is free (the 6RSS).
    seconds:  of its derivation, and of its torques at all samples.
    effort:   (N, n) [N m or N];  share: (parts, N, n);  contact_force: (N, k) [N].
    """

    formulation: str
    route: str
    contacts: bool
    seconds: Seconds
    effort: np.ndarray
    share: np.ndarray
    contact_force: np.ndarray

    @property
    def label(self) -> str:
        return f"{self.formulation} {self.route}" + ("" if self.contacts else ", no contacts")


def run(model: TimedModel, solution: xr.Dataset) -> Run:
    """Compute a solution's samples by another model, and time its torques, without the shares."""
    states, given = states_of(model, solution), given_along(solution)
    if given:
        model.inverse_dynamics(*states, **given)  # its kernel is not yet there
    with without_collection():
        start = process_time()
        model.inverse_dynamics(*states, **given)
        numeric = process_time() - start
    found = model.inverse_dynamics(*states, **given, outputs=("share",))
    return Run(
        model.formulation,
        model.route,
        bool(model.mechanism.contacts),
        Seconds(model.symbolic, numeric),
        found.effort,
        np.moveaxis(found.share, 1, 0),
        found.contact_force,
    )
