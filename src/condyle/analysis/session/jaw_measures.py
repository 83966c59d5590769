"""What clinicians read of a jaw's cycles: gape, excursions, speeds, condyles and their inclination.

Components are along a frame of the skull: forward and left in its plane of reference, up square to
it. Angles of condyles are those of the chord from closed to where they are about `TRAVEL` from
there, or as far as they go if that is at least `ENOUGH`; the transverse one while the jaw is on the
other side.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import InputError, did_you_mean, join
from ...markers.session_file import JAW_MEASURES, SkullPlane
from ...mechanism.coordinates import rotations
from .cycle_finding import CycleDetection
from .incisor import POINT, way_of

if TYPE_CHECKING:
    from ...mechanism.mechanism import Mechanism

TRAVEL, ENOUGH = 5e-3, 3e-3  # m
UNITS = {"m": ("mm", 1e3), "m/s": ("mm/s", 1e3), "rad": ("deg", 180 / np.pi)}
_NEAR = 0.2  # of the travel, within which places are taken for the chord
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
            f"plane: {join(plane.points)} are on one line, or in a plane that stands upright in "
            "{S}; the plane of reference is nearly that of X and Y"
        )
    forward = np.array([1.0, 0.0, 0.0]) - up[0] * up
    forward /= np.linalg.norm(forward)
    return np.array([forward, np.cross(up, forward), up])


def jaw_rows(
    mechanism: Mechanism, t: np.ndarray, pose: np.ndarray, cycles: CycleDetection, axes: np.ndarray
) -> list[dict[str, Any]]:
    """The measures of each cycle, SI; None where there is none; no rows where it is no jaw.

    Args: pose: as measured, without the contacts, whose slope the condyles would have, (N, 6).
    """
    if not (sides := condyles(mechanism)) or cycles.phases is None:
        return []
    incisor = way_of(mechanism.platform.points[POINT], pose, axes)
    ways = {side: way_of(point, pose, axes) for side, point in sides.items()}
    turn = np.arccos(np.clip((np.trace(rotations(pose[:, 3:]), axis1=1, axis2=2) - 1) / 2, -1, 1))
    speed = np.linalg.norm(np.gradient(incisor, t, axis=0), axis=1)
    rows = []
    for (start, end), phases in zip(cycles.spans, cycles.phases, strict=True):
        inside = (t >= start) & (t <= end)
        out = inside & (t <= start + phases[0])
        back = inside & ~out
        if not (out.any() and back.any()):
            rows.append(dict.fromkeys(JAW_MEASURES))
            continue
        forward, left, gape = incisor[inside].T
        row: dict[str, float | None] = dict.fromkeys(JAW_MEASURES)
        row |= {
            "gape": gape.max(), "protrusion": forward.max(),
            "lateral_left": left.max(), "lateral_right": -left.min(),
            "deviation": np.abs(incisor[out, 1]).max(), "deflection": left[gape.argmax()],
            "opening_speed": speed[out].max(), "closing_speed": speed[back].max(),
            "rotation": turn[inside].max(),
        }  # fmt: skip
        for side, way in ways.items():
            row[f"translation_{side}"] = np.linalg.norm(way[inside], axis=1).max()
            if (chord := _chord(way[inside])) is not None:
                row[f"sagittal_inclination_{side}"] = np.arctan2(chord[2], chord[0])
            inwards = -1.0 if side == "left" else 1.0
            balancing = inside & (inwards * incisor[:, 1] > ENOUGH / 2)
            if (chord := _chord(way[balancing])) is not None:
                row[f"transverse_inclination_{side}"] = np.arctan2(inwards * chord[1], chord[0])
        rows.append({name: None if v is None else float(v) for name, v in row.items()})
    return rows


def _chord(way: np.ndarray) -> np.ndarray | None:
    """The chord from closed to the places of the way near `TRAVEL`, or near the farthest, (3,).

    None if it does not go as far as `ENOUGH`, or not forwards.
    """
    size = np.linalg.norm(way, axis=1)
    if size.max(initial=0.0) < ENOUGH:
        return None
    aim = min(TRAVEL, size.max())
    near = np.abs(size - aim) <= _NEAR * aim
    chord = way[near].mean(axis=0) if near.any() else np.zeros(3)
    return chord if chord[0] > _NEAR * aim else None


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
