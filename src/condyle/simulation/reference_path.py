"""What a controller follows over time: a path in q_EE, and a force."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from ..backends.kernel import KernelValues
from ..errors import InputError
from ..model.model import Model, model_for
from ..motion import Motion, read_table, reference_motion, trial_motion
from ..motion.gravity_and_base import Given, each
from ..motion.reference_case import fits_reference
from ..motion.spline import Spline


@dataclass(frozen=True)
class ReferencePath:
    """A spline through q at the motion's own times; before and after them it stays where it is.

    times: (N,) [s];  q: (N, m).
    force: (F,) times [s] and (F,) newtons, linear between; one of each where it stays.
    around: gravity and the base's motion at the times, linear between; before and after them
            gravity stays as it is, and the base stands still.
    """

    model: Model
    times: np.ndarray
    q: np.ndarray
    force_times: np.ndarray
    force: np.ndarray
    around: Given = field(default_factory=Given)

    def same_as(self, other: ReferencePath) -> bool:
        """Whether it is the same at all times."""
        arrays = ("times", "q", "force_times", "force")
        return self is other or (
            self.model is other.model
            and self.around is other.around
            and all(np.array_equal(getattr(self, n), getattr(other, n)) for n in arrays)
        )

    @cached_property
    def _spline(self) -> Spline:
        return Spline.through(self.times - self.times[0], self.q)

    def states(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """q, q' and q'' at times (K,), (K, m) each."""
        since = np.clip(t, self.times[0], self.times[-1]) - self.times[0]
        q, q1, q2 = (self._spline(since, nu) for nu in range(3))
        outside = (t < self.times[0]) | (t > self.times[-1])
        q1[outside] = q2[outside] = 0.0
        return q, q1, q2

    def at(self, t: np.ndarray) -> np.ndarray:
        """q, q', q'', joint, joint rate and force at times (K,) [s], (K, 3 m + 2 n + 1); then
        gravity and the base's motion, if they are given.

        Raises: InputError: where the mechanism cannot be there.
        """
        q, q1, q2 = self.states(t)
        answer = instants(self.model, q, q1)
        if answer.status.any():
            bad = int(np.argmax(answer.status != 0))
            raise InputError(
                f"controller.motion: the pose at t = {t[bad]:g} s cannot be reached: q = {q[bad]}"
            )
        joint, rate = answer.values["joint"].T, answer.values["joint_rate"].T
        around: Any = self.around_at(t).values()
        return np.hstack([q, q1, q2, joint, rate, self.force_at(t)[:, None], *around])

    def around_at(self, t: np.ndarray) -> Given:
        """Gravity and the base's motion at times (K,) [s]."""
        inside = ((t >= self.times[0]) & (t <= self.times[-1]))[:, None]
        given = each(
            self.around, lambda a: np.stack([np.interp(t, self.times, one) for one in a.T], axis=1)
        )
        if "base" in given:
            given["base"] = given["base"] * inside
        return given

    def force_at(self, t: np.ndarray) -> np.ndarray:
        """The force at times (K,) [s], (K,) [N]."""
        return np.interp(t, self.force_times, self.force)


def instants(model: Model, q: np.ndarray, q1: np.ndarray) -> KernelValues:
    """Poses and joints of states, (N, m) each: see `questions.instant`."""
    return model_for(model, len(q)).kernel("instant").run({"q": q, "q1": q1})


def path_of(model: Model, motion: Motion, force: float | None, file: str | None) -> ReferencePath:
    """The path of a motion on a model's mechanism.

    Args: force: f_d [N] at all times;  file: CSV of t, force instead.
    """
    q = model_for(model, len(motion.t)).poses.of_motion(motion)[0][0]
    if not np.isfinite(q).all():
        bad = int(np.argmin(np.isfinite(q).all(axis=1)))
        raise InputError(
            f"{motion.source}: the contacts cannot be met at t = {motion.t[bad]:g} s; the motion "
            "leads out of reach"
        )
    times, newtons = np.zeros(1), np.array([force or 0.0])
    if file is not None:
        table = read_table(file, known={"t": ("time", 0), "force": ("force", 0)})
        times, newtons = table.times(), table.require(["force"])[:, 0]
    return ReferencePath(model, motion.t - motion.t[0], q, times, newtons, motion.given)


def default_motion(model: Model) -> Motion:
    """The bundled chewing path where it fits; else a trial motion about home."""
    machine = model.mechanism
    return reference_motion() if fits_reference(machine) else trial_motion(machine)
