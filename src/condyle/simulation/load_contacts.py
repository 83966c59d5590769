"""Where a path meets loads, and where they bear given forces: the plant at rest, by its kernel."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from ..mechanism.home import characteristic_length
from .integrators import NoRateError
from .plan import Plan
from .plant import Plant

SHORT = 1e-3  # of the mechanism's size, first step of a search
SWEEPS = 20  # over the directions, which turn with the pose
SAME = 1e-6  # of the forces, and of the mechanism's size from a sweep to the next


class LoadContacts:
    """Loads of a plan by their numbers; a load that is not named is as before it is touched."""

    def __init__(self, plan: Plan, plant: Plant) -> None:
        self._plan, self._plant = plan, plant
        self.bearing: list[int] = [i for i, x in enumerate(plan.loads) if x.law.bears is not None]

    def modes(self, q: np.ndarray, loads: Sequence[int] = ()) -> list[int]:
        """Modes of all loads at q, (m,), while `loads` bear."""
        plan, plant = self._plan, self._plant
        if not plan.loads:
            return []
        plant.set_modes([0] * len(plan.loads))
        self._evaluate(q)
        places = plant["load_place"].reshape(-1, 6)
        modes = [load.begin(at[:3]) for load, at in zip(plan.loads, places, strict=True)]
        for i in loads:
            modes[i] = plan.loads[i].law.bears or 0
        return modes

    def touched(self, q: np.ndarray) -> np.ndarray:
        """Which of the loads push or pull at poses (K, m), where each can bear: (K, loads)."""
        plan, plant = self._plan, self._plant
        plant.set_modes([load.law.bears or 0 for load in plan.loads])
        touched = np.zeros((len(q), len(plan.loads)), dtype=bool)
        for k, pose in enumerate(q):
            try:
                self._evaluate(pose)
            except NoRateError:
                continue
            pushes = plant["load_force"].reshape(-1, 3)
            touched[k, self.bearing] = pushes[self.bearing].any(axis=1)
        return touched

    def pressed(
        self,
        loads: Sequence[int],
        q: np.ndarray,
        directions: np.ndarray,
        forces: np.ndarray,
        slopes: Callable[[], dict[str, np.ndarray]],
    ) -> tuple[np.ndarray, list[int]] | None:
        """The pose, (m,), from q at which loads bear the forces and the platform rests, as forces
        along the directions would push it (in the metric of the inertia matrix).

        A force of 0 is there wherever nothing resists it.

        Args:    directions, forces: (r, 3) in {S} and (r,) [N], on what is touched, at the law's
                 point;  slopes: derivatives of the question `rate`, where the plant stands.
        Returns: it, and which of the loads bear; None: out of reach, or too soft for it.
        """
        plan, plant, m = self._plan, self._plant, len(self._plan.q)
        modes = [0] * len(plan.loads)
        for i in loads:
            modes[i] = plan.loads[i].law.bears or 0
        place = plan.drive.law.place  # type: ignore[union-attr]
        here = next(i for i in loads if plan.loads[i].place == place)
        plant.set_modes(modes)
        amounts, at = np.zeros(len(forces)), q
        size = characteristic_length(plan.model.mechanism)
        most = SAME * max(1.0, float(np.abs(forces).max()))
        try:
            for _ in range(SWEEPS):
                self._evaluate(at)
                found, before = slopes(), at
                J = directions @ found["load_place"].reshape(len(modes), 6, -1)[here, :3, :m]
                by_effort, joints = found["rate"][m : 2 * m, 2 * m :], found["joint_rate"]
                # M^-1 J^T, since efforts give M^-1 J_A^T: all else then is at rest too.
                along = by_effort @ np.linalg.pinv(joints[:, m : 2 * m].T) @ J.T
                steps = np.linalg.solve((J @ along).T, along.T)
                for i, (direction, force) in enumerate(zip(directions, forces, strict=True)):
                    at = q + amounts @ steps
                    if abs(self._beyond(at, direction, force)) > most:
                        amounts[i] += self._way(at, steps[i], direction, force)
                at = q + amounts @ steps
                off = [self._beyond(at, d, f) for d, f in zip(directions, forces, strict=True)]
                if np.abs(off).max() <= most and np.abs(at - before).max() <= SAME * size:
                    pushes = plant["load_force"].reshape(-1, 3)
                    return at, [i for i in loads if pushes[i].any()]
        except (NoRateError, ValueError):  # `np.linalg.LinAlgError` is one
            pass
        return None

    def _way(self, q: np.ndarray, step: np.ndarray, direction: np.ndarray, force: float) -> float:
        """How many steps from q the force along the direction is as given.

        Raises: ValueError, NoRateError: where there is no such place.
        """
        from scipy.optimize import brentq

        def beyond(way: float) -> float:
            return self._beyond(q + way * step, direction, force)

        size = characteristic_length(self._plan.model.mechanism)
        ends = [SHORT * size, SHORT * size]
        for i, sign in enumerate((1, -1)):
            while sign * beyond(sign * ends[i]) < 0 and ends[i] < size:
                ends[i] *= 2
        return float(brentq(beyond, -ends[1], ends[0]))

    def _beyond(self, q: np.ndarray, direction: np.ndarray, force: float) -> float:
        self._evaluate(q)
        return float(-direction @ self._plant["measured_force"]) - force

    def _evaluate(self, q: np.ndarray) -> None:
        y = np.zeros(self._plan.size)
        y[: len(q)] = q
        self._plant.evaluate(0.0, y)


def spans(touched: np.ndarray) -> Iterator[tuple[int, int]]:
    """First and last sample of every stretch of True in (K,)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], touched, [False]]).astype(int)))
    for first, end in edges.reshape(-1, 2).tolist():
        yield first, end - 1
