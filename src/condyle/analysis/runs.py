"""Models on samples of a motion: their numbers, and the seconds these took."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..mechanism.mechanism import COORDINATES
from ..model import Model
from .paper import Seconds

ROUNDS = 2  # the fastest counts: whatever else the machine does only adds


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


def run_all(models: Sequence[Model], samples: Samples) -> list[Run]:
    """Compute the samples by each model, and time their torques.

    The models take turns, so that a busy moment of the machine does not fall on one of them.
    """
    rounds = [[numeric_seconds(model, samples) for model in models] for _ in range(ROUNDS)]
    fastest = [min(seconds) for seconds in zip(*rounds, strict=True)]
    return [run(model, samples, s) for model, s in zip(models, fastest, strict=True)]


def numeric_seconds(model: Model, samples: Samples) -> float:
    """Seconds of torques alone.

    Route `core` closes the contacts in a step of its own, which counts; without contacts the pose
    is given. Contact forces, postures and checks are not counted.
    """
    states = independent_states(model, samples)
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        start = time.perf_counter()
        poses = model.kernel.poses(*states)
        closed = time.perf_counter()
        model.kernel.torques(*states, samples.load, poses, contact_forces=False)
        end = time.perf_counter()
    own_step = model.route == "core" and model.mechanism.contacts
    return end - (start if own_step else closed)


def run(model: Model, samples: Samples, numeric: float) -> Run:
    """The numbers of a model."""
    states = independent_states(model, samples)
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        torques = model.kernel.torques(*states, samples.load, model.kernel.poses(*states))
    assert torques.share is not None and torques.contact_force is not None
    return Run(
        model.formulation,
        model.route,
        bool(model.mechanism.contacts),
        Seconds(model.derivation_seconds, numeric),
        torques.torque,
        torques.share,
        torques.contact_force,
    )


def independent_states(model: Model, samples: Samples) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """q_EE and its rates, (N, m) each, as the model wants them."""
    columns = [COORDINATES.index(name) for name in model.independent]
    return (
        samples.pose[:, columns],
        samples.rate[:, columns],
        samples.acceleration[:, columns],
    )
