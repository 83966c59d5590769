"""The tradeoff between effort and contact force: the curve of minima of

    sum (effort_i / max_i)^2 + W sum (lambda_k / N_ref)^2

for weights W >= 0. As W grows the efforts never decrease and the contact forces never increase, in
the root mean square over the motion.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import InputError, brief
from ..mechanism import as_mechanism
from ..mechanism.chain import limits, require_fixed_limits
from ..mechanism.vocabulary import words_of
from ..model.distributing import Distribution
from ..model.model import derive
from ..motion.arrays import as_doubles
from ..motion.motion_and_load import motion_and_load
from ..motion.points import with_load_point
from ..progress import step
from ..results.report_table import ReportTable
from ..results.solving import states_of
from ..results.study_answer import TablesAnswer
from ..status import Status

if TYPE_CHECKING:
    import xarray as xr


# Half decades by an exact root: powers differ in the last digit from processor to processor.
_DECADES = (0.01, 0.1, 1.0, 10.0, 100.0, 1e3)
WEIGHTS = (0.0, *(d * w for d in _DECADES for w in (1.0, math.sqrt(10))), 1e4)


@dataclass(frozen=True, eq=False)
class Tradeoff(TablesAnswer):
    """One motion at several weights W, (P,).

    solution:   with the first weight; its motion is that of all.
    reference_force: N_ref [N].
    effort:     root mean square over the samples of sqrt(sum (effort_i / max_i)^2), (P,).
    load:       the same of sqrt(sum lambda_k^2), (P,) [N].
    activation: greatest |effort_i| / max_i of the motion, (P,).
    mean, peak: of |lambda_k| along the motion, (P, k) [N].
    samples:    how many are in these: those with a result at every weight.
    """

    solution: xr.Dataset
    weights: np.ndarray
    reference_force: float
    effort: np.ndarray
    load: np.ndarray
    activation: np.ndarray
    mean: np.ndarray
    peak: np.ndarray
    samples: int

    @property
    def warnings(self) -> list[str]:
        return self.solution.condyle.warnings

    @cached_property
    def report_tables(self) -> list[ReportTable]:
        from ..report.tables import tradeoff_table

        return [tradeoff_table(self).in_words(words_of(self.solution.condyle.mechanism))]

    @property
    def data(self) -> dict[str, Any]:
        own = {"reference_force": self.reference_force, "samples": self.samples}
        return {"mechanism": self.solution.attrs["mechanism_name"]} | own | super().data


def tradeoff(
    mechanism: Any = "masticatory",
    motion: Any = None,
    load: Any = None,
    load_point: str | None = None,
    weights: Sequence[float] = WEIGHTS,
    preload: float = 0.0,
    **model: Any,
) -> Tradeoff:
    """Solve one motion by `weighted` at several weights.

    Args:   mechanism: a mechanism, a model, the path of a file, or the name of a bundled one.
            motion, load: files or arrays; default: as in `condyle.run`.
            load_point: platform point at which the load acts, as of `Model.solve`.
            weights: W, strictly increasing.
            preload: as of `Distribution` [N].
            model: formulation, route and backend of `derive`.
    Raises: InputError: without contacts, or with chains that have no limits.
            InfeasibleError and other errors of samples: as of `Model.solve`.
    """
    mechanism, load_point = with_load_point(as_mechanism(mechanism), load_point)
    motion, load = motion_and_load(mechanism, motion, load)
    if not mechanism.contacts:
        raise InputError(f'"{mechanism.name}" has no contacts whose forces could be weighed')
    checked = as_doubles(weights, "weights")
    if checked.ndim != 1 or not checked.size or not (np.diff(checked) > 0).all():
        raise InputError(f"weights must be strictly increasing numbers, got {brief(weights)}")
    require_fixed_limits(mechanism.chains, "tradeoff", mechanism.enabled_walls)
    first = derive(mechanism, distribution=Distribution("weighted", preload), **model)
    weighted = first.with_distribution(Distribution("weighted", preload, float(checked[0])))
    solution = weighted.solve(motion, load, load_point=load_point)
    states = states_of(weighted, solution)
    efforts, forces, good = [], [], np.ones(solution.sizes["time"], dtype=bool)
    with step("solving at every weight", len(checked)) as advance:
        for weight in checked:
            weighted = first.with_distribution(Distribution("weighted", preload, float(weight)))
            result = weighted.inverse_dynamics(**states)
            efforts.append(result.effort)
            forces.append(result.contact_force)
            good &= result.status == Status.ok
            advance(1)
    if not good.any():
        raise InputError("no sample has a result at every weight: leave out the largest weight")
    greatest = np.array([limits(chain).greatest for chain in mechanism.chains])
    use = np.array(efforts)[:, good] / np.where(greatest > 0, greatest, 1.0)
    force = np.abs(np.array(forces)[:, good])
    return Tradeoff(
        solution,
        checked,
        first.reference_force,
        np.sqrt((use**2).sum(axis=2).mean(axis=1)),
        np.sqrt((force**2).sum(axis=2).mean(axis=1)),
        np.abs(use).max(axis=(1, 2)),
        force.mean(axis=1),
        force.max(axis=1),
        int(good.sum()),
    )
