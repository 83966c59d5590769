"""One moment of a mechanism: where it is, what its numbers are, and what is wrong with them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..mechanism import Mechanism
from ..report.scene import Scene

Level = Literal["calm", "warning", "unreachable"]


@dataclass(frozen=True)
class Snapshot:
    """What the page draws and says.

    mechanism:      of which.
    pose:           X_EE that is drawn, (6,) [m, rad]; the last good one where none can be met.
    wanted:         X_EE that was asked for and cannot be met, (6,), or None.
    scene:          points at `pose`, of one sample.
    broken:         chains that cannot reach the platform.
    joint, rate, torque: (n,) [rad or m; per s; N m or N];  reach: (n,), negative out of reach, or
                    None.
    contact_force:  (k,) [N];  force_vector: (k, 3) [N] in {S};  margin: (k,) [m], inf unbounded.
    load, load_at:  force in {S} [N] and its point in {M} [m], (3,) each.
    ratio, condition: of the singularity measures;  near: its kind, or "none".
    level, messages: what a reader should know, the worst first.
    time:           of a solution that is played [s], or None.
    stale:          there is no result, and `pose` is that of another time.
    over:           chains whose effort is outside its limits.
    pushes, pushes_at: forces besides, (l, 3) in {S} [N], and their points, (l, 3) in {M} [m];
                    the last is a hand's.
    markers:        of a solution with measured ones, (m, 3) [m] in {S}, NaN where not seen.
    """

    mechanism: Mechanism
    pose: np.ndarray
    wanted: np.ndarray | None
    scene: Scene
    broken: tuple[str, ...]
    joint: np.ndarray
    rate: np.ndarray | None
    torque: np.ndarray
    reach: np.ndarray | None
    contact_force: np.ndarray
    force_vector: np.ndarray
    margin: np.ndarray
    load: np.ndarray
    load_at: np.ndarray
    ratio: float
    condition: float
    near: str
    level: Level
    messages: tuple[str, ...]
    time: float | None = None
    stale: bool = False
    over: tuple[str, ...] = ()
    pushes: np.ndarray | None = None
    pushes_at: np.ndarray | None = None
    markers: np.ndarray | None = None
