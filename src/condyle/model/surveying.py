"""Many poses at rest, each judged: can it be reached, and if not, what forbids it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from ..backends.kernel import AGAIN, KernelValues
from ..kinematics.singularities import SINGULAR, ratio
from ..questions.platform import CERTAIN
from ..status import Status

Arrays = dict[str, np.ndarray]


@dataclass(frozen=True)
class Survey:
    """What N poses are like.

    values:  by name of `SURVEYED`, samples last, lanes before them; no number where the pose
             cannot be reached. Of "ratio": J_W_sigma (m, N) and J_A_extremes (2, N).
    met:     whether the contacts can be met, (N,).
    discriminant: of the chains' assembly, (n, N), negative out of reach; no number where the
             contacts are not met.
    closing: discriminant of the contacts' closing in closed form, (N,), negative where they are not
             met; otherwise 1 or no number.
    status:  (N,): ok, unreachable, overlap or, where the ratio is known, singular.
    """

    values: Mapping[str, np.ndarray]
    met: np.ndarray
    discriminant: np.ndarray
    closing: np.ndarray
    status: np.ndarray

    @property
    def reached(self) -> np.ndarray:
        """Whether contacts are met, their balls fit and every chain reaches, (N,)."""
        return ~np.isin(self.status, (Status.unreachable, Status.overlap))

    @property
    def inverse_ratio(self) -> np.ndarray:
        """Smallest over largest |transmission|, (N,)."""
        least, most = self.values["J_A_extremes"]
        return ratio(least, most)

    @property
    def direct_ratio(self) -> np.ndarray:
        """Smallest over largest singular value of J_W, (N,)."""
        sigma = self.values["J_W_sigma"]
        return ratio(sigma[-1], sigma[0])


def judged(
    answer: KernelValues, q: np.ndarray, iterated: bool, robust: Callable[[np.ndarray], Arrays]
) -> Survey:
    """Judge a kernel's answer at q, and look again at samples that it is not certain of.

    Args: iterated: whether contacts are closed in a fixed number of steps.
          robust: all values of some q, samples last, by numpy; `met` among them.
    """
    values, again = dict(answer.values), answer.status == AGAIN
    met, reach = values.pop("met"), values["discriminant"]
    known = met >= (CERTAIN if iterated else 0.0)
    if iterated and (doubtful := np.flatnonzero(~known)).size:
        better = robust(q[doubtful])
        known[doubtful] = better["met"]
        for name, value in values.items():
            value[..., doubtful] = better[name]
    reach[:, ~known] = np.nan
    reached = known & (reach >= 0).all(axis=0)
    if "J_W_sigma" in values and (doubtful := np.flatnonzero(again & reached)).size:
        values["J_W_sigma"][:, doubtful] = robust(q[doubtful])["J_W_sigma"]
    status = np.where(reached, Status.ok, Status.unreachable).astype(np.int8)
    del values["discriminant"]
    if not reached.all():
        for value in values.values():
            value[..., ~reached] = np.nan
    closing = np.where(known, 1.0, np.nan) if iterated else met
    survey = Survey(values, known, reach, closing, status)
    if "J_W_sigma" in values:
        near = np.minimum(survey.inverse_ratio, survey.direct_ratio) < SINGULAR
        status[reached & near] = Status.singular
    return survey
