"""What a model returns: plain arrays of samples, complete, and why some could not be computed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..kinematics.causes import causes, owners, sample_error, unreachable_text
from ..kinematics.singularities import Singularity
from ..mechanism.mechanism import Mechanism


@dataclass(frozen=True)
class Configuration:
    """The mechanism's configuration at N poses.

    joint, beta, gamma: (N, n) [rad or m, rad, rad], principal values.
    cos_gamma:      (N, n); near 0 beta_i and gamma_i lose their meaning.
    discriminant:   (N, n), dimensionless; negative where a chain cannot reach its joint.
    contact_point:  (N, k, 3) [m], ball centres in {S}.
    contact_normal: (N, k, 3), unit normals of the surfaces there, in {S}.
    """

    joint: np.ndarray
    beta: np.ndarray
    gamma: np.ndarray
    cos_gamma: np.ndarray
    discriminant: np.ndarray
    contact_point: np.ndarray
    contact_normal: np.ndarray
    singularity: Singularity


@dataclass(frozen=True)
class Evaluation:
    """Everything about N samples; what could not be computed is no number.

    pose, pose_rate, pose_acceleration: X_EE and its derivatives, (N, 6).
    effort:        (N, n) [N m or N].
    share:         (parts, N, n): what each part needs of it.
    contact_force: (N, k) [N], along the unit normals, on the platform.
    joint_rate, joint_acceleration: (N, n).
    slip:          (N, k, 3) [m/s]: velocity of the platform where it touches, in {S}.
    friction_force: (N, k, 3) [N], on the platform there, in {S}.
    shortfall:     (N,): by how much all limits would have to be multiplied at least; 1 where
                   efforts within them were found, inf where no limits would do.
    status:        (N,), of `Status`.
    """

    pose: np.ndarray
    pose_rate: np.ndarray
    pose_acceleration: np.ndarray
    effort: np.ndarray
    share: np.ndarray
    contact_force: np.ndarray
    joint_rate: np.ndarray
    joint_acceleration: np.ndarray
    configuration: Configuration
    slip: np.ndarray
    friction_force: np.ndarray
    shortfall: np.ndarray
    status: np.ndarray


@dataclass(frozen=True)
class Efforts:
    """Efforts at N samples, (N, n) [N m or N], and what was asked for besides.

    others: by name: contact_force (N, k); share, gravity (parts, N, n); pose, pose_rate,
            pose_acceleration (N, 6); joint_rate, joint_acceleration (N, n); condition (N,).
    status: (N,), of `Status`; efforts of other samples than good ones are NaN.
    """

    effort: np.ndarray
    others: Mapping[str, np.ndarray]
    status: np.ndarray

    def __getitem__(self, name: str) -> np.ndarray:
        return self.others[name]


@dataclass(frozen=True)
class Accelerations:
    """What efforts do at N samples, and what was asked for besides.

    acceleration:  (N, m), q'' in the order of `independent` [m/s^2, rad/s^2].
    contact_force: (N, k) [N], along the unit normals, on the platform.
    others: by name: pose, pose_rate, pose_acceleration (N, 6); joint, joint_rate,
            joint_acceleration (N, n); slip, friction_force (N, k, 3).
    status: (N,), of `Status`; accelerations and forces of other samples than good ones are NaN.
    """

    acceleration: np.ndarray
    contact_force: np.ndarray
    others: Mapping[str, np.ndarray]
    status: np.ndarray

    def __getitem__(self, name: str) -> np.ndarray:
        return self.others[name]


def require_ok(
    mechanism: Mechanism,
    evaluation: Evaluation,
    t: np.ndarray | None = None,
    row_offset: int = 0,
) -> None:
    """Raise for samples that could not be computed, naming the first and its cause.

    Args: t: their times; without, they are rows of a file that start at `row_offset`.
    """
    configuration = evaluation.configuration
    error = sample_error(
        mechanism,
        evaluation.status,
        evaluation.pose,
        configuration.discriminant,
        configuration.singularity,
        t,
        row_offset,
        evaluation.shortfall,
    )
    if error is not None:
        raise error


def unreachable_cause(mechanism: Mechanism, evaluation: Evaluation, sample: int) -> str:
    """Which chain or contact cannot be where the sample wants it."""
    c = evaluation.configuration
    cause = causes(evaluation.status, evaluation.pose, c.discriminant, c.singularity)[sample]
    return unreachable_text(mechanism, owners(mechanism)[cause], evaluation.pose[sample])
