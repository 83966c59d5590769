"""Why samples could not be computed."""

from __future__ import annotations

import numpy as np

from ..kinematics.causes import causes, owners, sample_error, unreachable_text
from ..mechanism.mechanism import Mechanism
from .data import Evaluation


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
