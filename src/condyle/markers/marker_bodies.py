"""The two bodies of a recording: the base taken out, what is left is the platform's motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from ..motion.file_words import listed
from .marker_file import MarkerFile
from .marker_labels import find_label
from .recording import Recording
from .rigid import FEWEST, FLATTEST, Fit, breadth, common_shape, fit

_STILL = 1e-3  # m, by which the platform may move while the mechanism is at home


@dataclass(frozen=True, eq=False)
class Body:
    """Markers that move together.

    Attributes: what: "fixed" or "platform";  names: of the markers, as in the marker file.
                points: (F, m, 3) [m] in the laboratory;  shape: at home, (m, 3) [m].
                fit: where the body is: of the platform, with the base taken out.
    """

    what: str
    names: list[str]
    points: np.ndarray
    shape: np.ndarray
    fit: Fit


@dataclass(frozen=True, eq=False)
class Bodies:
    """Both bodies, and what was found about them.

    Attributes: at_home: frames of the home stretch, (F,).
    """

    fixed: Body
    platform: Body
    at_home: np.ndarray
    warnings: tuple[str, ...]

    @property
    def both(self) -> tuple[Body, Body]:
        return self.fixed, self.platform

    def steadied(self, points: np.ndarray) -> np.ndarray:
        """Points of the laboratory, (F, n, 3), with the base's motion taken out."""
        return self.fixed.fit.back(points)


def find_bodies(recording: Recording, file: MarkerFile) -> Bodies:
    """Fit both bodies to their shapes at home.

    Raises: InputError: for markers that are not there, or do not hold a body.
    """
    home = home_frames(recording, file.home)
    warnings: list[str] = []
    names, points = _taken(recording, file.fixed)
    shape, names, points = _shape(recording, "fixed", names, points, points[home], warnings)
    base = fit(shape, points)
    fixed = Body("fixed", names, points, shape, base)
    names, points = _taken(recording, file.platform)
    steady = base.back(points)
    shape, names, points = _shape(recording, "platform", names, points, steady[home], warnings)
    moved = fit(shape, base.back(points))
    platform = Body("platform", names, points, shape, moved)
    centre = moved.rotation[home] @ shape.mean(axis=0) + moved.position[home]
    apart = float(np.nanmax(np.linalg.norm(centre - np.nanmean(centre, axis=0), axis=1)))
    if apart > _STILL:
        warnings.append(
            f"{recording.source}: the platform moves by {apart * 1e3:.3g} mm while it is said to "
            f"be at home ({file.home[0]:g} to {file.home[1]:g} s); their mean is taken for home"
        )
    return Bodies(fixed, platform, home, tuple(warnings))


def home_frames(recording: Recording, home: tuple[float, float]) -> np.ndarray:
    """The frames of the home stretch, (F,): those within, or the one nearest to one time.

    Raises: InputError: if the recording does not cover it.
    """
    t, half = recording.t, 0.5 / recording.rate
    start, end = home
    if start < t[0] - half or end > t[-1] + half:
        first = (
            f"; its first frame is number {recording.first_frame}, and frame 1 is at 0 s"
            if recording.first_frame > 1
            else ""
        )
        raise InputError(
            f"home: {start:g} to {end:g} s is not within {recording.source}, which runs from "
            f"{t[0]:.6g} to {t[-1]:.6g} s{first}"
        )
    within = (t >= start - 1e-6 * half) & (t <= end + 1e-6 * half)
    if not within.any():
        within[np.argmin(np.abs(t - 0.5 * (start + end)))] = True
    return within


def _taken(recording: Recording, names: tuple[str, ...]) -> tuple[list[str], np.ndarray]:
    places = [find_label(name, recording.labels, recording.source) for name in names]
    if len(set(places)) < len(places):
        raise InputError(f"{recording.source}: {listed(names)} do not name different markers")
    return list(names), recording.points[:, places]


def _shape(
    recording: Recording,
    what: str,
    names: list[str],
    points: np.ndarray,
    home: np.ndarray,
    warnings: list[str],
) -> tuple[np.ndarray, list[str], np.ndarray]:
    """The shape at home, of the markers seen there; those, and where they were seen."""
    shape = common_shape(home)
    there = np.isfinite(shape).all(axis=1)
    unseen = [name for name, seen in zip(names, there, strict=True) if not seen]
    if there.sum() < FEWEST:
        raise InputError(
            f"{recording.source}: {there.sum()} of {len(names)} {what} markers are seen while the "
            f"mechanism is at home, expected {FEWEST} or more; not seen: {listed(unseen)}. Choose "
            "another stretch for home"
        )
    if unseen:
        warnings.append(
            f"{recording.source}: {listed(unseen)} ({what}) not seen at home and left out"
        )
    names, shape, points = [n for n in names if n not in unseen], shape[there], points[:, there]
    if breadth(shape - shape.mean(axis=0)) <= FLATTEST:
        raise InputError(
            f"{recording.source}: the {what} markers {listed(names)} are on one line, so a turn "
            "about it cannot be told; use one that stands off it"
        )
    if not fit(shape, home[:, there]).found.any():
        raise InputError(
            f"{recording.source}: at no time of home are {FEWEST} of the {what} markers "
            f"{listed(names)} seen together. Choose another stretch for home"
        )
    return shape, names, points
