"""Joint coordinates, one sample a row: a file in, poses out."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .errors import UnreachableError
from .kinematics.forward import ForwardKinematics
from .mechanism.mechanism import COORDINATES, Mechanism
from .model import check_home
from .motion import read_table, write_table
from .progress import step


@dataclass(frozen=True)
class PoseReport:
    """What forward kinematics found in a file.

    residual: largest difference of a joint from the given one [rad or m].
    condition: largest condition number of the dimensionless actuator Jacobian.
    """

    rows: int
    missing: int
    residual: float
    condition: float

    def __str__(self) -> str:
        found = self.rows - self.missing
        return (
            f"{found} of {self.rows} poses found; largest joint residual {self.residual:.3g}, "
            f"largest condition number {self.condition:.4g}"
        )


def pose_file(
    mechanism: Mechanism, joints: str | Path, out: str | Path, flag: bool = False
) -> PoseReport:
    """Poses for every row of a file of joint coordinates.

    Args:   joints: CSV with the columns joint_<chain> [rad or m, zero at home], optionally t.
            out:    CSV: t if given, X ... gamma, residual (largest of the row) and condition;
                    with `flag` also status.
            flag:   keep rows for which no pose is found, empty, with a status.
    Raises: UnreachableError: for such a row without `flag`; nothing is written then.
    """
    check_home(mechanism)
    names = [f"joint_{name}" for name in mechanism.chain_names]
    table = read_table(joints, known=("t", *names))
    with step("finding poses"):
        solution = ForwardKinematics(mechanism).solve(table.require(names))
    missing = np.flatnonzero(~solution.found)
    if missing.size and not flag:
        raise UnreachableError(
            f"{joints}: no pose has the joint coordinates of row {missing[0] + 1}"
            + (f" ({missing.size - 1} more rows fail too)" if missing.size > 1 else "")
            + ". Check units and zero positions (zero at home), or keep such rows with --flag",
            missing.tolist(),
        )
    worst = np.abs(solution.residual).max(axis=1)
    columns: dict[str, np.ndarray | list[str]] = {}
    if "t" in table.columns:
        columns["t"] = table.columns["t"]
    columns |= {name: solution.pose[:, i] for i, name in enumerate(COORDINATES)}
    columns |= {"residual": worst, "condition": solution.condition}
    if flag:
        columns["status"] = ["ok" if found else "unreachable" for found in solution.found]
    write_table(out, columns)
    some = solution.found.any()
    return PoseReport(
        table.rows,
        int(missing.size),
        float(np.nanmax(worst)) if some else float("nan"),
        float(np.nanmax(solution.condition)) if some else float("nan"),
    )
