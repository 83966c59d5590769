"""The two bodies of a recording: the base taken out, what is left is the platform's motion."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from ..motion.file_words import listed
from .marker_file import MarkerFile
from .recording import Recording, find_label
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
    fixed = _body(recording, "fixed", file.fixed, home, lambda points: points, warnings)
    platform = _body(recording, "platform", file.platform, home, fixed.fit.back, warnings)
    moved, shape = platform.fit, platform.shape
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
        number = recording.first_frame
        first = f"; its first frame is number {number}, and frame 1 is at 0 s" * (number > 1)
        raise InputError(
            f"home: {start:g} to {end:g} s is not within {recording.source}, which runs from "
            f"{t[0]:.6g} to {t[-1]:.6g} s{first}"
        )
    within = (t >= start - 1e-6 * half) & (t <= end + 1e-6 * half)
    if not within.any():
        within[np.argmin(np.abs(t - 0.5 * (start + end)))] = True
    return within


def _body(
    recording: Recording,
    what: str,
    wanted: Sequence[str],
    home: np.ndarray,
    steadied: Callable[[np.ndarray], np.ndarray],
    warnings: list[str],
) -> Body:
    """The body of the markers that are seen at home, fitted to its shape there."""
    source = recording.source
    places = [find_label(name, recording.labels, source) for name in wanted]
    if len(set(places)) < len(places):
        raise InputError(f"{source}: {listed(wanted)} do not name different markers")
    points = recording.points[:, places]
    shape = common_shape(steadied(points)[home])
    there = np.isfinite(shape).all(axis=1)
    names, unseen = ([n for n, t in zip(wanted, there, strict=True) if t == k] for k in (1, 0))
    if len(names) < FEWEST:
        raise InputError(
            f"{source}: {len(names)} of {len(wanted)} {what} markers are seen while the "
            f"mechanism is at home, expected {FEWEST} or more; not seen: {listed(unseen)}. Choose "
            "another stretch for home"
        )
    if unseen:
        warnings.append(f"{source}: {listed(unseen)} ({what}) not seen at home and left out")
    shape, points = shape[there], points[:, there]
    if breadth(shape - shape.mean(axis=0)) <= FLATTEST:
        raise InputError(
            f"{source}: the {what} markers {listed(names)} are on one line, so rotation "
            "about it is not determined; add a marker off the line"
        )
    body = Body(what, names, points, shape, fit(shape, steadied(points)))
    if not body.fit.found[home].any():
        raise InputError(
            f"{source}: at no time of home are {FEWEST} of the {what} markers "
            f"{listed(names)} seen together. Choose another stretch for home"
        )
    return body
