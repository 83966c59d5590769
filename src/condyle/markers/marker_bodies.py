"""The two bodies of a recording: the base taken out, what is left is the platform's motion."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..errors import InputError, quoted
from .marker_file import MarkerFile
from .recording import Recording, find_label
from .rigid import FEWEST, FLATTEST, RigidFit, breadth, common_shape, fit

_STILL = 1e-3  # m, by which the platform may move while the mechanism is at home
_CLOSED = 2e-3  # m, by which it may differ between the homes of two trials


@dataclass(frozen=True, eq=False)
class MarkerBody:
    """Markers that move together.

    Attributes: what: "fixed" or "platform";  names: of the markers, as in the marker file.
                points: (F, m, 3) [m] in the laboratory;  shape: at home, (m, 3) [m].
                fit: where the body is: of the platform, with the base taken out.
    """

    what: str
    names: list[str]
    points: np.ndarray
    shape: np.ndarray
    fit: RigidFit


@dataclass(frozen=True, eq=False)
class Bodies:
    """Both bodies in a recording, and what was found about them.

    Attributes: recording: where they were seen.
                at_home: frames of its home stretch, (F,); none where home is the static trial's.
                static: both bodies in the static trial, whose home they are at.
    """

    recording: Recording
    fixed: MarkerBody
    platform: MarkerBody
    at_home: np.ndarray
    warnings: tuple[str, ...]
    static: Bodies | None = None

    @property
    def both(self) -> tuple[MarkerBody, MarkerBody]:
        return self.fixed, self.platform

    def off_static(self) -> float:
        """Distance of the platform's markers at this recording's home from the static's [m].

        Root mean square over markers; NaN where they are not seen, or there is no such home.
        """
        moved = self.platform.fit
        if not (moved.determined & self.at_home).any():
            return float("nan")
        places = self.platform.shape @ moved.rotation[self.at_home].transpose(0, 2, 1)
        places = np.nanmean(places + moved.position[self.at_home, None], axis=0)
        return float(np.sqrt(((places - self.platform.shape) ** 2).sum(axis=1).mean()))

    def head_moved(self) -> tuple[float, float]:
        """Largest way of the fixed markers' middle from the static's [m], and turn [rad]."""
        fixed = self.fixed.fit
        middle = self.fixed.shape.mean(axis=0)
        way = np.linalg.norm(fixed.rotation @ middle + fixed.position - middle, axis=1)
        turn = np.arccos(np.clip((np.trace(fixed.rotation, axis1=1, axis2=2) - 1) / 2, -1, 1))
        return float(np.nanmax(way)), float(np.nanmax(turn))

    @property
    def home(self) -> Bodies:
        """The bodies in the recording that home and registered points belong to."""
        return self.static or self

    def steadied(self, points: np.ndarray) -> np.ndarray:
        """Points of the laboratory, (F, n, 3), with the base's motion taken out."""
        return self.fixed.fit.back(points)


def find_bodies(recording: Recording, file: MarkerFile, static: Recording | None = None) -> Bodies:
    """Fit both bodies to their shapes at home, in the recording itself or in a static trial.

    Raises: InputError: for markers that are not there, or do not hold a body.
    """
    if static is not None and file.static is not None:
        return _carried(_at_home(static, file, file.static.home), recording, file)
    if file.home is None:
        raise InputError(f"{recording.source}: its static trial (static) was not given")
    return _at_home(recording, file, file.home)


def _at_home(recording: Recording, file: MarkerFile, stretch: tuple[float, float]) -> Bodies:
    home = home_frames(recording, stretch)
    warnings: list[str] = []
    fixed = _body(recording, "fixed", file.fixed, home, lambda points: points, warnings)
    platform = _body(recording, "platform", file.platform, home, fixed.fit.back, warnings)
    centre = _centre(platform)[home]
    apart = float(np.nanmax(np.linalg.norm(centre - np.nanmean(centre, axis=0), axis=1)))
    if apart > _STILL:
        warnings.append(
            f"{recording.source}: the platform moves by {apart * 1e3:.3g} mm while it is said to "
            f"be at home ({stretch[0]:g} to {stretch[1]:g} s); their mean is taken for home"
        )
    return Bodies(recording, fixed, platform, home, tuple(warnings))


def _carried(static: Bodies, recording: Recording, file: MarkerFile) -> Bodies:
    """The bodies of a static trial in another recording."""
    warnings = list(static.warnings)

    def body(old: MarkerBody, steadied: Callable[[np.ndarray], np.ndarray]) -> MarkerBody:
        places = [find_label(name, recording.labels, recording.source) for name in old.names]
        points = recording.points[:, places]
        return MarkerBody(old.what, old.names, points, old.shape, fit(old.shape, steadied(points)))

    fixed = body(static.fixed, lambda points: points)
    platform = body(static.platform, fixed.fit.back)
    bodies = Bodies(recording, fixed, platform, np.zeros(len(recording.t), bool), (), static)
    if file.home is not None:
        bodies = replace(bodies, at_home=home_frames(recording, file.home))
        off = bodies.off_static()
        if off > _CLOSED:
            warnings.append(
                f"{recording.source}: at its home the platform is {off * 1e3:.3g} mm from where "
                f"it is in the static trial {static.recording.source}; did markers move on their "
                "body, or were the teeth not closed?"
            )
    return replace(bodies, warnings=tuple(warnings))


def _centre(platform: MarkerBody) -> np.ndarray:
    """Middle of the platform's markers with the base's motion taken out, (F, 3)."""
    return platform.fit.rotation @ platform.shape.mean(axis=0) + platform.fit.position


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
) -> MarkerBody:
    """The body of the markers that are seen at home, fitted to its shape there."""
    source = recording.source
    places = [find_label(name, recording.labels, source) for name in wanted]
    if len(set(places)) < len(places):
        raise InputError(f"{source}: {quoted(wanted)} do not name different markers")
    points = recording.points[:, places]
    shape = common_shape(steadied(points)[home])
    there = np.isfinite(shape).all(axis=1)
    names, unseen = ([n for n, t in zip(wanted, there, strict=True) if t == k] for k in (1, 0))
    if len(names) < FEWEST:
        raise InputError(
            f"{source}: {len(names)} of {len(wanted)} {what} markers are seen while the "
            f"mechanism is at home, expected {FEWEST} or more; not seen: {quoted(unseen)}. Choose "
            "another stretch for home"
        )
    if unseen:
        warnings.append(f"{source}: {quoted(unseen)} ({what}) not seen at home and left out")
    shape, points = shape[there], points[:, there]
    if breadth(shape - shape.mean(axis=0)) <= FLATTEST:
        raise InputError(
            f"{source}: the {what} markers {quoted(names)} are on one line, so rotation "
            "about it is not determined; add a marker off the line"
        )
    body = MarkerBody(what, names, points, shape, fit(shape, steadied(points)))
    if not body.fit.determined[home].any():
        raise InputError(
            f"{source}: at no time of home are {FEWEST} of the {what} markers "
            f"{quoted(names)} seen together. Choose another stretch for home"
        )
    return body
