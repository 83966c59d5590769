"""Joint coordinates, one sample a row: a file in, poses out."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..errors import UnreachableError
from ..kinematics.chain import FAMILIES
from ..kinematics.forward import ForwardKinematics
from ..mechanism.mechanism import COORDINATES, Mechanism
from ..model.evaluator import check_home
from ..motion import read_table, write_table
from ..progress import step


@dataclass(frozen=True)
class PoseReport:
    """What forward kinematics found in a file.

    residual: largest difference of a joint from the given one, by unit; empty without a pose.
    condition: largest condition number of the dimensionless actuator Jacobian.
    """

    rows: int
    missing: int
    residual: dict[str, float]
    condition: float

    def __str__(self) -> str:
        found = f"{self.rows - self.missing} of {self.rows} poses found"
        if self.missing == self.rows:
            return found
        worst = ", ".join(f"{value:.3g} {unit}" for unit, value in self.residual.items())
        return (
            f"{found}; largest joint residual {worst}, "
            f"largest condition number {self.condition:.4g}"
        )


def pose_file(
    mechanism: Mechanism, joints: str | Path, out: str | Path, flag: bool = False
) -> PoseReport:
    """Poses for every row of a file of joint coordinates.

    Args:   joints: CSV with the columns joint_<chain> [rad or m, zero at home], optionally t.
            out:    CSV: t if given, X ... gamma, residual (largest of the row, in the unit of the
                    joints; where chains slide and turn, residual_m and residual_rad) and
                    condition; with `flag` also status.
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
    units = np.array([FAMILIES[chain.kind].joint_unit for chain in mechanism.chains])
    worst = {
        str(unit): np.abs(solution.residual[:, units == unit]).max(axis=1)
        for unit in np.unique(units)
    }
    columns: dict[str, np.ndarray | list[str]] = {}
    if "t" in table.columns:
        columns["t"] = table.columns["t"]
    columns |= {name: solution.pose[:, i] for i, name in enumerate(COORDINATES)}
    for unit, residual in worst.items():
        columns["residual" if len(worst) == 1 else f"residual_{unit}"] = residual
    columns["condition"] = solution.condition
    if flag:
        columns["status"] = ["ok" if found else "unreachable" for found in solution.found]
    write_table(out, columns)
    some = solution.found.any()
    return PoseReport(
        table.rows,
        int(missing.size),
        {unit: float(np.nanmax(residual)) for unit, residual in worst.items()} if some else {},
        float(np.nanmax(solution.condition)) if some else float("nan"),
    )
