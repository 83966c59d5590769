"""Efforts that came from elsewhere, and limits."""

from __future__ import annotations

import numpy as np

from .problem import Problem


def within(problem: Problem, effort: np.ndarray, contact_force: np.ndarray) -> np.ndarray:
    """Samples whose efforts keep the limits and whose one-sided contacts push enough, (N,).

    Where efforts of least norm do, they are what `bounded` would give: only the others have to be
    distributed. Friction's signs are not looked at.

    Args: effort: (N, n).   contact_force: (N, k) [N].
    """
    low, high = problem.limits
    kept = ((effort >= low) & (effort <= high)).all(axis=1)
    pushing = contact_force * problem.pushes >= problem.preload
    return kept & (pushing | (problem.pushes == 0)).all(axis=1)
