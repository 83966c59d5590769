"""What results derive from an evaluation: each piece once, and only where it is asked for."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from ..kinematics.causes import causes
from ..kinematics.singularity import NEAR_SINGULAR
from ..mechanism.mechanism import Mechanism
from ..status import Status
from .contacts import bound_margins, lift_off


@dataclass(frozen=True)
class Derived:
    """An evaluation of N samples, flat, and what follows from it.

    wrench: (N, 6), load on the platform [N, N m], where that is known.
    """

    mechanism: Mechanism
    evaluation: Any
    wrench: np.ndarray = field(default_factory=lambda: np.zeros((0, 6)))

    @cached_property
    def ok(self) -> np.ndarray:
        return self.evaluation.status == Status.ok

    @cached_property
    def all_ok(self) -> bool:
        return bool(self.ok.all())

    @cached_property
    def cause(self) -> np.ndarray:
        """Index into `owners` of what each sample fails by, (N,)."""
        e = self.evaluation
        c = e.configuration
        return causes(e.status, e.pose, c.discriminant, c.singularity)

    @cached_property
    def margin(self) -> np.ndarray:
        """Distance of contact points to their nearest bound, (N, k) [m]; inf without one."""
        return bound_margins(self.mechanism, self.evaluation.configuration.contact_point)

    @cached_property
    def lifted(self) -> np.ndarray:
        """Whether a one-sided contact would have to pull, (N, k)."""
        lifted = lift_off(self.mechanism, self.evaluation.contact_force)
        return lifted if self.all_ok else lifted & self.ok[:, None]

    @cached_property
    def inverse_ratio(self) -> np.ndarray:
        return self.evaluation.configuration.singularity.inverse_ratio

    @cached_property
    def direct_ratio(self) -> np.ndarray:
        return self.evaluation.configuration.singularity.direct_ratio

    @cached_property
    def ratio(self) -> np.ndarray:
        """Smallest over largest singular value of J_A or J_W, (N,)."""
        return np.minimum(self.inverse_ratio, self.direct_ratio)

    @cached_property
    def condition(self) -> np.ndarray:
        """Condition number of the dimensionless J_W, (N,)."""
        with np.errstate(divide="ignore"):
            return 1.0 / self.direct_ratio

    @cached_property
    def near(self) -> np.ndarray:
        """Index into `KINDS` of the singularity that is near, (N,) int8; 0 at failed samples."""
        kind = (self.inverse_ratio < NEAR_SINGULAR).astype(np.int8)
        kind += 2 * (self.direct_ratio < NEAR_SINGULAR).astype(np.int8)
        return kind if self.all_ok else np.where(self.ok, kind, 0).astype(np.int8)
