"""Why samples could not be computed, in words."""

from __future__ import annotations

import numpy as np

from ..errors import SingularError, UnreachableError
from ..kinematics.chain import FAMILIES
from ..kinematics.singularity import SINGULAR
from ..mechanism.mechanism import Mechanism
from ..status import Status
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
    bad = np.flatnonzero(evaluation.status != Status.OK)
    if not bad.size:
        return
    first = int(bad[0])
    row = f"row {row_offset + first + 1}"
    where = row if t is None else f"t = {t[first]:g} s (sample {first})"
    more = f" {bad.size - 1} more samples fail too." if bad.size > 1 else ""
    status = evaluation.status[first]
    if status == Status.OVERFLOW:
        raise SingularError(
            f"the torques at {where} are not finite: its rates, accelerations or load are "
            f"too large for numbers.{more}",
            bad.tolist(),
        )
    if status == Status.SINGULAR:
        ratio = evaluation.configuration.singularity.ratio[first]
        raise SingularError(
            f"the mechanism is singular at {where}: dimensionless ratio {ratio:.2g}, "
            f"must be above {SINGULAR:g}. The torques are not determined there; avoid the "
            f"pose, or keep such samples with --flag (flag=True).{more}",
            bad.tolist(),
        )
    cause = unreachable_cause(mechanism, evaluation, first)
    raise UnreachableError(
        f"{cause} at {where}. The motion goes too far for this mechanism; scale it down, or keep "
        f"such samples with --flag (flag=True).{more}",
        bad.tolist(),
    )


def unreachable_cause(mechanism: Mechanism, evaluation: Evaluation, sample: int) -> str:
    """Which chain or contact cannot be where the sample wants it."""
    pose = evaluation.pose[sample]
    if not np.isfinite(pose).all():
        names = ", ".join(f'"{name}"' for name in mechanism.contact_names)
        return f"no pose with the given coordinates has the contacts {names} on their surfaces"
    for i, chain in enumerate(mechanism.chains):
        if not evaluation.configuration.discriminant[sample, i] >= 0:
            with np.errstate(all="ignore"):
                return FAMILIES[chain.kind].explain(chain, pose)
    return "the pose cannot be reached"
