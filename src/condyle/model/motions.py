"""Motions and loads, as files and people give them, in the coordinates of the equations."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..kinematics.constraints import indices
from ..motion import Motion, resolve_landmark, resolve_load_point
from .derivation import Derivation

States = tuple[np.ndarray, np.ndarray, np.ndarray]


class Motions(Derivation):
    """From motions of any kind to q, q' and q''."""

    def load_point(self, name: str | None) -> np.ndarray:
        """Where a load acts, (3,) [m] in {M}: a named point; else right_molar, or the only one.

        Raises: InputError: if the mechanism has no such point.
        """
        points = self.mechanism.platform.points
        return np.array(points[resolve_load_point(name, points)])

    def independent_motion(self, motion: Motion) -> tuple[States, float | None]:
        """q_EE and its rates, (N, m) each, from a motion of any kind.

        Also returns the largest distance of a given whole pose from the contacts [m], which the
        projection removes; None for other kinds.
        """
        given = (motion.value, motion.rate, motion.acceleration)
        if motion.kind == "pose":
            columns = indices(self.independent)
            q, q1, q2 = (a[:, columns] for a in given)
            return (q, q1, q2), self.contact_residual(motion.value)
        landmark = None
        if motion.kind == "landmark":
            landmark = resolve_landmark(motion.landmark, self.mechanism.platform.points)
        return self.independent_states(motion.names, *given, landmark), None

    def contact_residual(self, pose: np.ndarray) -> float:
        """Largest |phi| of the contacts over poses, (N, 6) [m]."""
        if not self.mechanism.contacts:
            return 0.0
        phi = self.kernel("encoders").run({"pose": pose}).values["phi"]
        return float(np.nanmax(np.abs(phi)))

    def independent_states(
        self,
        names: Sequence[str],
        value: np.ndarray,
        rate: np.ndarray,
        acceleration: np.ndarray,
        landmark: str | None = None,
        threads: int | None = None,
    ) -> States:
        """q_EE and its rates from another set of coordinates or a landmark's displacement.

        Samples that the contacts cannot meet come back as NaN.
        """
        given = (value, rate, acceleration)
        if landmark is None and sorted(names) == sorted(self.independent):
            if tuple(names) == self.independent:
                return given
            order = [list(names).index(name) for name in self.independent]
            q, q1, q2 = (a[:, order] for a in given)
            return q, q1, q2
        closure = self._closure(tuple(names), landmark)
        if landmark is None:
            order = [list(names).index(name) for name in closure.names]
            s, s1, s2 = (a[:, order] for a in given)
        else:
            # The fourth condition prescribes zero: the midpoint of the contacts stays put.
            s, s1, s2 = (np.column_stack([a, np.zeros(len(a))]) for a in given)
        found = closure.solve(s, s1, s2, threads)
        columns = indices(self.independent)
        q, q1, q2 = (a[:, columns] for a in (found.pose, found.rate, found.acceleration))
        return q, q1, q2


def with_point(wrench: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Wrenches (N, 6) and the point they act at, (3,), as loads (N, 9)."""
    return np.hstack([wrench, np.broadcast_to(point, (len(wrench), 3))])
