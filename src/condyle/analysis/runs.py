"""Models on samples of a motion: their numbers, and the seconds these took."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from ..kernels.interpreted import Interpreted
from ..mechanism.mechanism import COORDINATES, Mechanism
from ..model import Model
from .paper import Seconds


class InterpretedModel(Model):
    """A model run by the interpreter, so that its derivation and its numbers are timed apart.

    A compiled kernel would mix in the compiler's seconds, or none where the kernel is cached; the
    benchmark is the place for those.

    Attributes: symbolic: seconds of the derivation.
    """

    kernel: Interpreted

    def __init__(self, mechanism: Mechanism, formulation: str, route: str) -> None:
        start = clock()
        super().__init__(mechanism, formulation, route, backend="interpreted")
        self.symbolic = clock() - start


def clock() -> float:
    """Seconds of processor time: what else a machine does does not count."""
    return time.process_time()


@dataclass(frozen=True)
class Samples:
    """A motion of the platform and the load on it.

    pose, rate, acceleration: X_EE and its derivatives, (N, 6).
    load: force, moment and the point they act at, (N, 9), as `Model.evaluate` takes it.
    """

    pose: np.ndarray
    rate: np.ndarray
    acceleration: np.ndarray
    load: np.ndarray


@dataclass(frozen=True)
class Run:
    """One model on the motion.

    contacts: whether they hold the platform, or it is free (the 6RSS).
    seconds:  of its derivation, and of its torques at all samples.
    torque:   (N, n) [N m or N];  share: (parts, N, n);  contact_force: (N, k) [N].
    """

    formulation: str
    route: str
    contacts: bool
    seconds: Seconds
    torque: np.ndarray
    share: np.ndarray
    contact_force: np.ndarray

    @property
    def label(self) -> str:
        return f"{self.formulation} {self.route}" + ("" if self.contacts else ", no contacts")


def run(model: InterpretedModel, samples: Samples) -> Run:
    """Compute the samples by a model, and time its torques."""
    columns = [COORDINATES.index(name) for name in model.independent]
    q, q1, q2 = (a[:, columns] for a in (samples.pose, samples.rate, samples.acceleration))
    numeric = numeric_seconds(model, q, q1, q2, samples.load)
    found = model.kernel.solve(q, q1, q2, samples.load)
    assert found.share is not None and found.contact_force is not None
    return Run(
        model.formulation,
        model.route,
        bool(model.mechanism.contacts),
        Seconds(model.symbolic, numeric),
        found.torque,
        found.share,
        found.contact_force,
    )


def numeric_seconds(
    model: InterpretedModel, q: np.ndarray, q1: np.ndarray, q2: np.ndarray, load: np.ndarray
) -> float:
    """Seconds of torques alone.

    Route `core` closes the contacts in a step of its own, which counts; without contacts the pose
    is given. Contact forces, postures and checks are not counted.
    """
    kernel = model.kernel
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        start = clock()
        poses = kernel.poses(q, q1, q2)
        closed = clock()
        kernel.torques(q, q1, q2, load, poses, contact_forces=False)
        end = clock()
    own_step = model.route == "core" and model.mechanism.contacts
    return end - (start if own_step else closed)
