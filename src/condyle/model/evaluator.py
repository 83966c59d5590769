"""A mechanism, a formulation and a route, ready to compute: numbers in, numbers out.

Every question is run by a kernel of the backend, which `derivation` holds; samples that it cannot
vouch for go the robust path. Efforts are found in `inverse`, what belongs to poses in `poses`;
`motions` leads to the coordinates of the equations. `condyle.derive` returns an evaluator that also
labels what it finds, `condyle.results.model.Model`.
"""

from __future__ import annotations

from collections.abc import Collection
from functools import cached_property

import numpy as np

from .accelerating import Accelerator
from .data import Accelerations
from .derivation import check_home
from .inverse import RESULTS, InverseDynamics
from .motions import Motions, with_point
from .poses import Poses

__all__ = ["RESULTS", "Evaluator", "check_home", "with_point"]


class Evaluator(InverseDynamics, Poses, Motions):
    """Inverse dynamics of a mechanism by one formulation and route, and what belongs to it."""

    @cached_property
    def _accelerator(self) -> Accelerator:
        return Accelerator(self.mechanism, self.kernel, lambda: self._robust)

    def forward(
        self,
        q: np.ndarray,
        q1: np.ndarray,
        effort: np.ndarray,
        load: np.ndarray,
        outputs: Collection[str] = (),
        threads: int | None = None,
    ) -> Accelerations:
        """Forward dynamics: the accelerations that efforts and loads make.

        Limits of efforts, and that cables cannot push, are the caller's concern.

        Args:    q, q1: (N, m) each, in the order of `independent` [m, rad; per s].
                 effort: (N, n) [N m or N], in the order of the chains.
                 load: (N, 9), as of `evaluate`.
                 outputs: what is wanted besides, of motion, joint and sliding; threads: at most so
                 many.
        Raises:  InputError: for an output that is none of these, or arrays that do not fit.
        """
        return self._accelerator(q, q1, effort, load, outputs, threads)

    def forward_one(
        self, q: np.ndarray, q1: np.ndarray, effort: np.ndarray, load: np.ndarray
    ) -> np.ndarray:
        """Accelerations of one sample, (m,), at least latency; NaN where there are none.

        Args: q, q1: (m,) each;  effort: (n,);  load: (9,); as of `forward`. Arrays of doubles go
              fastest.
        Returns: a new array.
        Raises:  InputError: for arrays that do not fit.
        """
        return self._accelerator.one(q, q1, effort, load)

    def linearised(
        self, q: np.ndarray, q1: np.ndarray, effort: np.ndarray, load: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """x' = A x + B effort about states x = (q, q'), exact; arguments as of `forward`.

        The load stays as it is in {S}. Returns: A, (N, 2 m, 2 m), and B, (N, 2 m, n); NaN where
        there are no accelerations.
        """
        return self._accelerator.linearised(q, q1, effort, load)
