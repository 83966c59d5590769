"""This subject's eminences in a session: the mechanism that has them, and what they change."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...errors import InputError, did_you_mean
from ...markers import MarkerMotion, SessionFile
from ...markers.eminence import (
    FittedSlope,
    fitted_paths,
    with_fitted,
    with_profiles,
    with_slopes,
)
from ...markers.session_file import Trial
from ...mechanism.mechanism import Mechanism
from ...model.distributing import Distribution
from ...model.model import derive
from ...results.contacts import joint_loads

BITE = 100.0  # N, of the bite at rest that shows the effect
POINTS = ("right_molar", "left_molar", "incisor")  # where; the first that there is

Motions = Callable[[Trial], Sequence[MarkerMotion]]


@dataclass(frozen=True)
class SubjectEminence:
    """Surfaces in the place of the mechanism's.

    mechanism: with them.   before: without.
    fitted:    slopes or profiles by contact, where they were fitted, else None.
    """

    mechanism: Mechanism
    before: Mechanism
    fitted: dict[str, FittedSlope] | None

    def loads(self, distribution: Distribution) -> tuple[str, dict[str, np.ndarray]]:
        """Joint loads (k,) [N] of a bite of `BITE` at rest, and the point where it is.

        By "the mechanism's", "used" and, of what was fitted, "used - SD" and "used + SD"; NaN where
        the mechanism cannot hold the bite. Nothing without such a point.
        """
        point = next((p for p in POINTS if p in self.before.platform.points), "")
        if not point:
            return "", {}
        machines = {"the mechanism's": self.before, "used": self.mechanism}
        if self.fitted is not None:
            for sign, word in ((-1, "used - SD"), (1, "used + SD")):
                machines[word] = with_fitted(self.before, self.fitted, sign)
        wrench, loads = [0.0, 0.0, -BITE, 0.0, 0.0, 0.0], {}
        for word, machine in machines.items():
            model = derive(machine, distribution=distribution, backend="numpy")
            still = np.zeros(len(model.independent))
            answer = model.inverse_dynamics(still, still, still, wrench, at=point)
            loads[word] = joint_loads(machine, answer.contact_force)
        return point, loads


def subject_eminence(
    file: SessionFile, mechanism: Mechanism, motions: Motions
) -> SubjectEminence | None:
    """What [eminence] asks for; None without it.

    Args:   motions: of a trial, as the markers have them.
    Raises: InputError: for contacts or trials that there are not, and condyles that stay.
    """
    table = file.eminence
    if table is None:
        return None
    if not mechanism.contacts:
        raise InputError(f"eminence: {mechanism.name} has no contacts")
    if table.profile is not None:
        return SubjectEminence(with_profiles(mechanism, table.profile), mechanism, None)
    if table.slope is not None:
        given = table.slope
        each = given if isinstance(given, dict) else dict.fromkeys(mechanism.contact_names, given)
        slopes = {name: float(np.radians(value)) for name, value in each.items()}
        return SubjectEminence(with_slopes(mechanism, slopes), mechanism, None)
    names = [trial.name for trial in file.trials]
    for name in table.trials:
        if name not in names:
            raise InputError(
                f'eminence: trials: there is no trial "{name}".{did_you_mean(name, names)}'
            )
    used: list[Any] = [t for t in file.trials if not table.trials or t.name in table.trials]
    fitted = fitted_paths(mechanism, {t.name: motions(t) for t in used}, table.fit == "profile")
    return SubjectEminence(with_fitted(mechanism, fitted), mechanism, fitted)
