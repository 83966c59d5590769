"""Every model on one motion: their differences and their cost.

The formulations and routes come from `condyle.dynamics`. The same mechanism without its contacts
(the paper's 6RSS), whose platform makes the identical motion, is computed too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations, product
from typing import TYPE_CHECKING, Any

import numpy as np

from ..distribution import ObjectiveName
from ..dynamics import FORMULATIONS, ROUTES, FormulationName
from ..dynamics import formulation as formulation_named
from ..errors import InputError, UnsupportedError, texts_of
from ..mechanism import as_mechanism
from ..mechanism.mechanism import Mechanism
from ..mechanism.vocabulary import words_of
from ..model.distributing import Distribution
from ..model.model import derive
from ..motion.motion_and_load import motion_and_load
from ..motion.points import with_load_point
from ..progress import step
from ..results.report_table import ReportTable
from ..results.study_answer import TablesAnswer
from .runs import Run, TimedModel, run
from .torque_indices import Indices, indices

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True)
class Unavailable:
    """A model that this mechanism does not have, and the reason."""

    label: str
    reason: str


@dataclass(frozen=True)
class Difference:
    """Largest difference of two runs, relative to the largest component along the motion."""

    first: Run
    second: Run
    effort: float
    contact_force: float


@dataclass(frozen=True, eq=False)
class Comparison(TablesAnswer):
    """All models of a mechanism on one motion.

    solution:       by the first model; its motion is that of all.
    runs:           with the contacts, in the order of the registries;  free_runs: without them.
    unavailable:    models that the mechanism does not have.
    free_condition: largest condition number of the dimensionless J_W without the contacts; nan
                    where there are no free runs.
    """

    solution: xr.Dataset
    runs: tuple[Run, ...]
    free_runs: tuple[Run, ...]
    unavailable: tuple[Unavailable, ...]
    free_condition: float

    @property
    def mechanism(self) -> Mechanism:
        return self.solution.condyle.mechanism

    @property
    def samples(self) -> int:
        return self.solution.sizes["time"]

    @property
    def units(self) -> list[str]:
        """Effort units of the chains, (n,)."""
        return [str(unit) for unit in self.solution["effort_unit"].values]

    def run(self, formulation: str, route: str, contacts: bool = True) -> Run | None:
        """The run of that model, or None."""
        runs, wanted = self.runs if contacts else self.free_runs, (formulation, route)
        return next((one for one in runs if (one.formulation, one.route) == wanted), None)

    def differences(self, contacts: bool = True) -> list[Difference]:
        """Every two runs against each other."""
        differences = []
        for a, b in combinations(self.runs if contacts else self.free_runs, 2):
            effort = relative_difference(a.effort, b.effort, self.units)
            force = relative_difference(a.contact_force, b.contact_force)
            differences.append(Difference(a, b, effort, force))
        return differences

    def indices(self, contacts: bool = True) -> list[Indices]:
        """The indices of eq. (67), from the first run; one entry for each effort unit."""
        runs = self.runs if contacts else self.free_runs
        parts = [str(part) for part in self.solution["part"].values]
        return indices(runs[0].share, parts, self.units) if runs else []

    @property
    def warnings(self) -> list[str]:
        return self.solution.condyle.warnings

    @cached_property
    def report_tables(self) -> list[ReportTable]:
        from ..report.tables import differences, table_1, table_2

        say = words_of(self.mechanism)
        return [made(self).in_words(say) for made in (differences, table_1, table_2)]

    @property
    def data(self) -> dict[str, Any]:
        missing = {one.label: one.reason for one in self.unavailable}
        own = {"mechanism": self.mechanism.name, "samples": self.samples, "unavailable": missing}
        return own | super().data


def compare(
    mechanism: Any = "masticatory",
    motion: Any = None,
    load: Any = None,
    load_point: str | None = None,
    formulations: FormulationName | Sequence[FormulationName] | None = None,
    distribution: ObjectiveName | Distribution | None = None,
) -> Comparison:
    """Compute one motion by every formulation and route, with and without the contacts.

    Args:   mechanism: a mechanism, a model, the path of a file, or the name of a bundled one.
            motion, load: files or arrays; default: as in `condyle.run`.
            load_point: platform point at which the load acts, as of `Model.solve`.
            formulations: names; default: all.
            distribution: how redundancy is resolved, as in `derive`.
    Raises: UnreachableError, SingularError: for samples that cannot be computed.
            InputError: for an unknown formulation, or a motion or load that does not fit.
    """
    mechanism, load_point = with_load_point(as_mechanism(mechanism), load_point)
    motion, load = motion_and_load(mechanism, motion, load)
    asked = texts_of("formulations", list(FORMULATIONS) if formulations is None else formulations)
    names: list[Any] = [formulation_named(name).name for name in asked]
    if not names:
        raise InputError("formulations: expected at least one")
    # The first derivation also pays for imports, so it is not one of those that are timed.
    first = derive(mechanism, formulation=names[0], distribution=distribution, backend="numpy")
    solution = first.solve(motion, load, load_point=load_point)
    models, unavailable = [], []
    kinds = list(product(names, ROUTES))
    with step("deriving every model", len(kinds)) as advance:
        for name, route in kinds:
            try:
                models.append(TimedModel(mechanism, name, route, distribution))
            except UnsupportedError as error:
                unavailable.append(Unavailable(f"{name} {route}", str(error)))
            advance(1)

    condition = float("nan")
    if reason := why_not_free(mechanism):
        unavailable.append(Unavailable("without contacts", reason))
    else:
        free = mechanism.replace(contacts=(), dependent=None)
        models += [TimedModel(free, name, "core", distribution) for name in names]
        measures = models[-1].poses.configuration(solution["pose"].values).singularity
        condition = float(measures.condition.max())
    runs = []
    with step("running every model", len(models)) as advance:
        for model in models:
            runs.append(run(model, solution))
            advance(1)
    held = bool(mechanism.contacts)
    return Comparison(
        solution,
        tuple(entry for entry in runs if entry.contacts == held),
        tuple(entry for entry in runs if entry.contacts != held),
        tuple(unavailable),
        condition,
    )


def why_not_free(mechanism: Mechanism) -> str | None:
    """Why there are no models without the contacts, or None."""
    if not mechanism.contacts:
        return "the mechanism has no contacts to remove"
    few = "a platform without contacts has 6 degrees of freedom, and {} chains cannot drive them"
    return few.format(len(mechanism.chains)) if len(mechanism.chains) < 6 else None


def relative_difference(a: np.ndarray, b: np.ndarray, units: Sequence[str] | None = None) -> float:
    """max |a - b| over the largest component of either, both (N, n); the worst of the units.

    Samples that are not finite in both (at a singularity) are left out.
    """
    good = np.isfinite(a).all(axis=1) & np.isfinite(b).all(axis=1)
    kinds = np.array(units if units is not None else [""] * a.shape[1])
    worst = 0.0
    for unit in set(kinds):
        x, y = a[good][:, kinds == unit], b[good][:, kinds == unit]
        size = max(np.abs(x).max(initial=0.0), np.abs(y).max(initial=0.0))
        if size > 0:
            worst = max(worst, float(np.abs(x - y).max() / size))
    return worst
