"""What clinicians read of a jaw's cycles: gape, excursions, speeds, condyles and their inclination.

Components are along a frame of the skull: forward and left in its plane of reference, up square to
it. Angles of condyles are those of the chord from closed to the place on the way out that is
`TRAVEL` from there, or as far as the condyle goes if that is at least `LEAST`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import InputError, did_you_mean, few
from ...markers.session_file import JAW_MEASURES, SkullPlane
from ...mechanism.coordinates import rotations
from .cycle_finding import CycleDetection, at_times
from .incisor import POINT, incisor_path

if TYPE_CHECKING:
    import xarray as xr

    from ...mechanism.mechanism import Mechanism

TRAVEL, LEAST = 5e-3, 3e-3  # m
UNITS = {"m": ("mm", 1e3), "m/s": ("mm/s", 1e3), "rad": ("deg", 180 / np.pi)}
_UPRIGHT = 0.5  # cosine between the plane's normal and Z of {S}


def condyles(mechanism: Mechanism) -> dict[str, np.ndarray]:
    """Centres of the left and the right condyle, (3,) [m]; none where it is no jaw."""
    sides = {("left" if c.point[1] > 0 else "right"): np.array(c.point) for c in mechanism.contacts}
    is_jaw = len(mechanism.contacts) == len(sides) == 2 and POINT in mechanism.platform.points
    return sides if is_jaw else {}


def skull_axes(
    plane: SkullPlane | None, mechanism: Mechanism, places: Mapping[str, Any]
) -> np.ndarray:
    """Forward, left and up in {S}, (3, 3), a row each; without a plane those of {S}.

    Args:   places: of the plane's own points in {S}, (3,) [m] each.
    Raises: InputError: for points that are not there, on one line, or in an upright plane.
    """
    if plane is None:
        return np.eye(3)
    known = {c.name: c.point for c in mechanism.contacts} | dict(mechanism.platform.points)
    known |= dict(places)
    if missing := [name for name in plane.points if name not in known]:
        raise InputError(
            f'plane: "{mechanism.name}" has no point or contact "{missing[0]}", and places gives '
            f"none.{did_you_mean(missing[0], known)}"
        )
    points = np.array([known[name] for name in plane.points], dtype=float)
    _, size, axes = np.linalg.svd(points - points.mean(axis=0))
    up = axes[2] * np.sign(axes[2, 2] or 1.0)
    if size[1] < 0.03 * size[0] or up[2] < _UPRIGHT:
        raise InputError(
            f"plane: {few(plane.points)} are on one line, or in a plane that stands upright in "
            "{S}; the plane of reference is nearly that of X and Y"
        )
    forward = np.array([1.0, 0.0, 0.0]) - up[0] * up
    forward /= np.linalg.norm(forward)
    return np.array([forward, np.cross(up, forward), up])


def jaw_rows(solution: xr.Dataset, found: CycleDetection, axes: np.ndarray) -> list[dict[str, Any]]:
    """The measures of each cycle, SI; None where there is none; no rows where it is no jaw."""
    mechanism = solution.condyle.mechanism
    if not (sides := condyles(mechanism)) or found.phases is None:
        return []
    t, pose = solution["time"].values, solution["pose"].values
    R = rotations(pose[:, 3:])
    incisor = incisor_path(solution, axes)
    ways = {
        side: (R @ point + pose[:, :3] - point) @ axes.T * [1.0, 1.0, -1.0]
        for side, point in sides.items()
    }
    turn = np.arccos(np.clip((np.trace(R, axis1=1, axis2=2) - 1) / 2, -1, 1))
    speed = np.linalg.norm(np.gradient(incisor, t, axis=0), axis=1)
    rows = []
    for (start, end), phases in zip(found.spans, found.phases, strict=True):
        inside = (t >= start) & (t <= end)
        if not np.isfinite(pose[inside]).all() or inside.sum() < 3:
            rows.append(dict.fromkeys(JAW_MEASURES))
            continue
        out = inside & (t <= start + phases[0])
        forward, left, gape = incisor[inside].T
        row: dict[str, float | None] = dict.fromkeys(JAW_MEASURES)
        row |= {
            "gape": gape.max(), "protrusion": forward.max(),
            "lateral_left": left.max(), "lateral_right": -left.min(),
            "deviation": np.abs(incisor[out, 1]).max(), "deflection": left[gape.argmax()],
            "opening_speed": speed[out].max(), "closing_speed": speed[inside & ~out].max(),
            "rotation": turn[inside].max(),
        }  # fmt: skip
        balancing = "left" if -left.min() > left.max() else "right"
        for side, way in ways.items():
            row[f"translation_{side}"] = np.linalg.norm(way[inside], axis=1).max()
            closed = at_times(t, way, np.array([start]))[0]
            chord = _chord(way[out] - closed)
            if chord is not None and chord[0] > 0:
                ahead, aside, down = chord
                row[f"sagittal_inclination_{side}"] = np.arctan2(down, ahead)
                if side == balancing and max(left.max(), -left.min()) > LEAST:
                    inward = -aside if side == "left" else aside
                    row[f"transverse_inclination_{side}"] = np.arctan2(inward, ahead)
        rows.append({name: None if v is None else float(v) for name, v in row.items()})
    return rows


def _chord(way: np.ndarray) -> np.ndarray | None:
    """From closed to the first place that is `TRAVEL` away, (3,), or the farthest; None if near."""
    size = np.linalg.norm(way, axis=1)
    if not len(size) or size.max() < LEAST:
        return None
    far = int(np.argmax(size >= min(TRAVEL, size.max())))
    return np.array(way[far])


def bonwill(mechanism: Mechanism, axes: np.ndarray) -> dict[str, float]:
    """Sides [m] of the triangle of condyles and incisor, and its angle with the plane [rad]."""
    sides, incisor = condyles(mechanism), np.array(mechanism.platform.points[POINT])
    left, right = sides["left"], sides["right"]
    normal = axes @ np.cross(left - incisor, right - incisor)
    tilt = np.arccos(abs(normal[2]) / np.linalg.norm(normal))
    return {
        "between_condyles": float(np.linalg.norm(left - right)),
        "left_to_incisor": float(np.linalg.norm(left - incisor)),
        "right_to_incisor": float(np.linalg.norm(right - incisor)),
        "angle": float(tilt),
    }
