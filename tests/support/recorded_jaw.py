"""A jaw before cameras, with all that is to be found known: SYNTHETIC.

Four markers on a brace at the upper teeth, four at the lower, four on the face; a laboratory with
axes of its own; a head that moves meanwhile. All in metres. Shared with the library: where a
mechanism's file puts its named points, and the dependent coordinates of its contacts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w
from oracles.c3d_file import c3d_bytes
from scipy.spatial.transform import Rotation

import condyle

UPPER = {
    "Upper_FL": [0.080, 0.030, 0.020],
    "Upper_BL": [0.050, 0.045, 0.025],
    "Upper_FR": [0.082, -0.028, 0.022],
    "Upper_BR": [0.048, -0.044, 0.035],
}
LOWER = {
    "Lower_FL": [0.085, 0.025, -0.020],
    "Lower_BL": [0.055, 0.042, -0.030],
    "Lower_FR": [0.083, -0.027, -0.018],
    "Lower_BR": [0.052, -0.043, -0.035],
}
FIXED, PLATFORM = list(UPPER), list(LOWER)


@dataclass
class Jaw:
    """What happened, and the markers that saw it.

    pose: X_EE in {S}, (F, 6);  points: (F, L, 3) in the laboratory [m], to be spoiled.
    A, b: x = A s + b, from {S} to the laboratory;  home: the head's mean motion at home.
    """

    t: np.ndarray
    pose: np.ndarray
    labels: list[str]
    points: np.ndarray
    A: np.ndarray
    b: np.ndarray
    register: dict[str, Any] = field(default_factory=dict)
    home: tuple[np.ndarray, np.ndarray] = (np.eye(3), np.zeros(3))

    def laboratory(self, point: Any, unit: float = 1e3) -> list[float]:
        """Where a point of {S} is on the mean of home, as a number of the marker file."""
        turn, shift = self.home
        found: list[float] = ((turn @ (self.A @ point + self.b) + shift) * unit).tolist()
        return found

    def at(self, name: str) -> np.ndarray:
        """(F, 3), a view of where a marker was seen."""
        return self.points[:, self.labels.index(name)]

    def tables(self, **changes: Any) -> dict[str, Any]:
        """The marker file."""
        tables = {"fixed": FIXED, "platform": PLATFORM, "home": [0.0, 0.5]}
        vertical = {"up": self.A[:, 2].tolist()}
        return tables | {"register": self.register, "vertical": vertical} | changes

    def write(self, path: Path, unit: float = 1e3, **options: Any) -> Path:
        path.write_bytes(c3d_bytes(self.labels, self.points * unit, **options))
        return path

    def write_tables(self, path: Path, **changes: Any) -> Path:
        path.write_text(tomli_w.dumps(self.tables(**changes)))
        return path


def record(
    seconds: float = 4.0,
    rate: float = 100.0,
    noise: float = 0.0,
    head: float = 1.0,
    seed: int = 0,
    push: float = 0.0,
    mechanism: str = "masticatory",
    points: Sequence[str] = ("incisor", "left_condyle", "right_condyle"),
    unit: float = 1e3,
    path: np.ndarray | None = None,
) -> Jaw:
    """A recording of a jaw that rests for half a second and then opens three times in two seconds.

    Args: noise: standard deviation of each coordinate [m];  head: how much the head moves, 0 to 1;
          push: how far the condyles leave their planes downwards [m], by which the jaw opens more;
          unit: lengths of the file in a metre, for numbers of the marker file;
          path: other movements, X, Y [m] and beta [rad], (F, 3), from home.
    """
    rng = np.random.default_rng(seed)
    t = np.arange(round(seconds * rate) if path is None else len(path)) / rate
    since = np.clip(t - 0.6, 0, None)
    rise = np.clip(since / 0.4, 0, 1)
    rise = rise**3 * (10 - 15 * rise + 6 * rise**2)
    w = 2 * np.pi * 1.5
    open_ = rise * (1 - np.cos(w * since)) / 2
    side = rise * np.sin(w * since)
    pose = np.column_stack(
        [0.003 * open_, 0.001 * side, -0.012 * open_, 0.01 * side, 0.12 * open_, 0.01 * side]
    )
    if path is not None:
        pose = np.zeros((len(t), 6))
        pose[:, [0, 1, 4]] = path
        open_ = np.zeros(len(t))
    machine = condyle.load_mechanism(mechanism)
    pose = on_contacts(mechanism, pose)
    pose[:, 2] -= push * open_
    R = Rotation.from_euler("XYZ", pose[:, 3:]).as_matrix()
    H, h = head_at(t, head)
    A = Rotation.from_rotvec(rng.normal(0, 1.5, 3)).as_matrix()
    b = np.array([-0.45, 0.2, 1.1])
    upper = np.array(list(UPPER.values()))[None]
    lower = np.array(list(LOWER.values())) @ R.transpose(0, 2, 1) + pose[:, None, :3]
    face = np.array([[0.1, 0, 0.1], [0.09, 0.05, 0.06], [0.09, -0.05, 0.06], [-0.02, 0.075, 0.04]])
    base = np.concatenate([np.broadcast_to(upper, lower.shape), lower], axis=1)
    base = np.concatenate([base, np.broadcast_to(face, (len(t), 4, 3))], axis=1)
    lab = (base @ A.T + b) @ H.transpose(0, 2, 1) + h[:, None]
    lab += rng.normal(0, noise, lab.shape) if noise else 0.0
    there = {c.name: c.point for c in machine.contacts} | dict(machine.platform.points)
    # Numbers are where the point is on the mean of home, as the fixed markers are.
    home = t <= 0.5
    made = Jaw(t, pose, [*FIXED, *PLATFORM, "Nasion", "Cheek_L", "Cheek_R", "TMJ_L"], lab, A, b)
    made.home = mean_motion(H[home], h[home], upper[0] @ A.T + b)
    made.register = {n: made.laboratory(there[n], unit) for n in points}
    return made


def head_at(t: np.ndarray, head: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """The head's turn and way in the laboratory, (F, 3, 3) and (F, 3) [m]: never at rest."""
    turns = head * 0.2 * np.column_stack([np.sin(0.9 * t), np.sin(0.6 * t), np.sin(0.4 * t)])
    way = head * 0.05 * np.column_stack([np.sin(0.5 * t), 1 - np.cos(0.8 * t), np.sin(0.7 * t)])
    return Rotation.from_rotvec(turns).as_matrix(), way


@cache
def _model(mechanism: str) -> condyle.Model:
    return condyle.Model(condyle.load_mechanism(mechanism), backend="numpy")


def on_contacts(mechanism: str, pose: np.ndarray) -> np.ndarray:
    """Poses (F, 6) with the dependent coordinates of the contacts."""
    model = _model(mechanism)
    q = pose[:, [condyle.mechanism.COORDINATES.index(name) for name in model.independent]]
    return np.array(model.inverse_kinematics(q).pose)


def mean_motion(H: np.ndarray, h: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The rigid motion nearest to where points are on the mean of several motions."""
    mean = (points @ H.transpose(0, 2, 1) + h[:, None]).mean(axis=0)
    c, m = points.mean(axis=0), mean.mean(axis=0)
    turn, _ = Rotation.align_vectors(mean - m, points - c)
    R = turn.as_matrix()
    return R, m - R @ c
