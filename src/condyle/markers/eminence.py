"""The eminence of a subject: slopes or profiles that condyles slid along, fitted to markers.

The measured pose of the platform carries each ball; in the sagittal plane its path is the line

    (z - z_0) = -tan(slope) (x - x_0),    x forward,

of least squares of distances from it, any x_0 and z_0: a ball that is registered off its place
still slides at the right slope, as long as the platform turns little. Or it is the cubic spline of
least squares of heights, moved so that it passes through the ball at home.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import tan
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field, model_validator
from scipy.interpolate import CubicSpline

from ..errors import InputError, join
from ..mechanism.coordinates import rotations
from ..mechanism.mechanism import Mechanism
from ..mechanism.study_file import Finite, Label, Text
from ..mechanism.table import Table
from .marker_report import MarkerMotion

LEAST_TRAVEL = 3e-3  # m forward and down, below which a path has no slope
KNOTS = 4e-3  # m between the knots of a profile, about
POINTS, ENDS = 2e-3, (5e-5, 2e-4)  # m between its points, about; and from either end
MOST_CONDITION = 1e6  # of heights of knots by points
MM = 1e-3

_Slope = Annotated[float, Field(strict=True, gt=-80, lt=80)]
_Profile = Annotated[tuple[tuple[Finite, Finite], ...], Field(min_length=3)]


class Eminence(Table):
    """Surfaces of this subject's joints in the place of the mechanism's: one of three keys."""

    slope: _Slope | dict[Label, _Slope] | None = Field(
        default=None, description="fall forward [degrees], of all contacts or by contact"
    )
    profile: dict[Label, _Profile] | None = Field(
        default=None, description="by contact: [[forward, down], ...] from the ball at home [mm]"
    )
    fit: Annotated[bool, Field(strict=True)] | Literal["profile"] = Field(
        default=False,
        description='fit the slope of each contact to the condyles\' paths, or its "profile"',
    )
    trials: tuple[Text, ...] = Field(
        default=(), description="names of the trials to fit, of protrusion or opening; default: all"
    )

    @model_validator(mode="after")
    def _one_way(self) -> Self:
        given = (self.slope is not None) + (self.profile is not None) + bool(self.fit)
        if given != 1:
            raise ValueError(f"expected one of slope, profile and fit = true, got {given} of them")
        if self.trials and not self.fit:
            raise ValueError('trials names recordings to fit: give "fit = true" with it')
        return self


@dataclass(frozen=True)
class FittedSlope:
    """The slope of a condyle's path.

    slope, deviation: [rad], falling forward; of the deviation the larger one of what is left of the
    paths, with its correlation over time, and of the spread between trials.
    by_trial: [rad].   travel: length of the path along the slope [m].   off: root mean square of
    the distances from the line [m].
    """

    slope: float
    deviation: float
    by_trial: dict[str, float]
    travel: float
    off: float


@dataclass(frozen=True, eq=False)
class FittedProfile(FittedSlope):
    """The curve of a condyle's path; its slope is that at home.

    forward, down: points of it, from the ball at home, (K,) [m].   deviations: of `down`, (K,) [m],
    from what is left and between trials as of the slope.   tilt: what `down` most likely is more
    by where the slope is more by its deviation, (K,) [m].
    """

    forward: np.ndarray
    down: np.ndarray
    deviations: np.ndarray
    tilt: np.ndarray


def ball_paths(motion: MarkerMotion, mechanism: Mechanism) -> dict[str, np.ndarray]:
    """Centres of the balls in {S} as the platform's markers have them, by contact, (N, 3) [m]."""
    turn, place = rotations(motion.free[:, 3:]), motion.free[:, :3]
    return {one.name: turn @ np.array(one.point) + place for one in mechanism.contacts}


def fitted_paths(
    mechanism: Mechanism, motions: Mapping[str, Sequence[MarkerMotion]], profile: bool = False
) -> dict[str, FittedSlope]:
    """Slopes or profiles of the condyles' paths, by contact.

    Args:   motions: of each trial, by its name.
    Raises: InputError: where a condyle moves too little for a slope.
    """
    paths = {name: [ball_paths(motion, mechanism) for motion in of] for name, of in motions.items()}
    fitted = {}
    for contact in mechanism.contacts:
        by_trial = {
            name: np.concatenate([path[contact.name][:, [0, 2]] for path in of])
            for name, of in paths.items()
        }
        every = np.concatenate([*by_trial.values()])
        travel = _travel(every, profile)
        if travel < LEAST_TRAVEL:
            raise InputError(
                f"eminence: {contact.name} moves {travel / MM:.2g} mm "
                f"{'forward' if profile else 'along its path'} in {join(by_trial)}; a "
                f"{'profile' if profile else 'slope'} needs {LEAST_TRAVEL / MM:g} mm. Name trials "
                "of protrusion or opening, or give slope"
            )
        long = {n: path for n, path in by_trial.items() if _travel(path, profile) >= LEAST_TRAVEL}
        fit_paths = _fitted_profile if profile else _fitted_slope
        fitted[contact.name] = fit_paths(every, long, travel, np.array(contact.point)[[0, 2]])
    return fitted


def _travel(path: np.ndarray, profile: bool) -> float:
    """The travel along the line nearest to a path, or forward."""
    if profile:
        return float(np.ptp(path[:, 0])) if len(path) else 0.0
    return _Line.through(path).travel


def _fitted_slope(
    every: np.ndarray, by_trial: Mapping[str, np.ndarray], travel: float, _home: np.ndarray
) -> FittedSlope:
    line = _Line.through(every)
    own = {name: _Line.through(path).slope for name, path in by_trial.items()}
    deviation = max(line.deviation, _spread([*own.values()]))
    return FittedSlope(line.slope, deviation, own, travel, line.off)


def _fitted_profile(
    every: np.ndarray, by_trial: Mapping[str, np.ndarray], travel: float, home: np.ndarray
) -> FittedProfile:
    curve = _Curve.through(every - home)
    alone = {name: _Curve.through(path - home) for name, path in by_trial.items()}
    own = {name: one.slope for name, one in alone.items()}
    tangent = curve.basis(0.0, 1)
    change = curve.covariance @ tangent
    steep = float(np.sqrt(tangent @ change))  # deviation of the tangent at home
    to_tangent = 1 / np.cos(curve.slope) ** 2
    deviation = max(steep / to_tangent, _spread([*own.values()]))
    low, high = curve.reach
    even = np.linspace(low, high, round((high - low) / POINTS) + 1)
    forward = np.sort(np.concatenate([even, low + np.array(ENDS), high - np.array(ENDS)]))
    rows = curve.from_home(forward)
    tilt = rows @ change * (deviation * to_tangent / steep**2 if steep else 0.0)
    apart = [
        _spread([float(c.down(x)) for c in alone.values() if c.reach[0] <= x <= c.reach[1]])
        for x in forward
    ]
    deviations = np.maximum(np.sqrt(np.diag(rows @ curve.covariance @ rows.T).clip(0)), apart)
    down = curve.down(forward)
    return FittedProfile(
        curve.slope, deviation, own, travel, curve.off, forward, down, deviations, tilt
    )


def _spread(values: Sequence[float]) -> float:
    """Standard deviation between trials; 0 of one."""
    return float(np.std(values, ddof=1)) if len(values) > 1 else 0.0


@dataclass(frozen=True)
class _Line:
    """The line nearest to points of a plane."""

    slope: float
    deviation: float
    travel: float
    off: float

    @staticmethod
    def through(points: np.ndarray) -> _Line:
        if len(points) < 3:
            return _Line(0.0, np.inf, 0.0, 0.0)
        centred = points - points.mean(axis=0)
        *_, (direction, across) = np.linalg.svd(centred, full_matrices=False)
        direction = direction if direction[0] >= 0 else -direction
        way, off = centred @ direction, centred @ across
        spread, rest = float(way.var()), float(off.var())
        deviation = float(np.sqrt(rest / spread / _count(off))) if spread else np.inf
        slope = float(np.arctan2(-direction[1], direction[0]))
        return _Line(slope, deviation, float(np.ptp(way)), float(np.sqrt(rest)))


def _count(off: np.ndarray) -> float:
    """How many residuals count as independent: samples in a row are not."""
    rest = float(off.var())
    again = float((off[1:] * off[:-1]).mean() / rest) if rest else 0.0
    again = min(max(again, 0.0), 0.999)
    return max(len(off) * (1 - again) / (1 + again), 2.0)


@dataclass(frozen=True, eq=False)
class _Curve:
    """The cubic spline nearest to points of a plane.

    reach: its ends [m].   basis: splines that are 1 at one of its knots and 0 at all others.
    heights: down at the knots, (K,) [m].   covariance: of them, (K, K).   off: root mean square of
    what is left [m].
    """

    reach: tuple[float, float]
    basis: CubicSpline
    heights: np.ndarray
    covariance: np.ndarray
    off: float

    @staticmethod
    def through(points: np.ndarray) -> _Curve:
        """Args: points: forward and up of the ball at home, (N, 2) [m]."""
        x, down = points[:, 0], -points[:, 1]
        low, high = min(x.min(), 0.0), max(x.max(), 0.0)
        for count in range(max(round((high - low) / KNOTS), 2) + 1, 2, -1):
            basis = CubicSpline(np.linspace(low, high, count), np.eye(count))
            A = basis(x)
            if np.linalg.cond(A) < MOST_CONDITION:  # else there are no points at some knots
                break
        inverse = np.linalg.inv(A.T @ A)
        heights = inverse @ (A.T @ down)
        rest = down - A @ heights
        covariance = rest.var() * len(x) / _count(rest) * inverse
        return _Curve((low, high), basis, heights, covariance, float(np.sqrt((rest**2).mean())))

    def from_home(self, forward: np.ndarray | float) -> np.ndarray:
        """Slopes, by heights of the knots, of how far the profile is below home, (..., K)."""
        return np.asarray(self.basis(forward) - self.basis(0.0))

    def down(self, forward: np.ndarray | float) -> np.ndarray:
        return self.from_home(forward) @ self.heights

    @property
    def slope(self) -> float:
        """The slope at home [rad]."""
        return float(np.arctan(self.basis(0.0, 1) @ self.heights))


def with_fitted(
    mechanism: Mechanism, fitted: Mapping[str, FittedSlope], off: float = 0.0
) -> Mechanism:
    """The mechanism with fitted slopes or profiles.

    Args: off: deviations of the slope by which they are steeper.
    """
    slopes, profiles = {}, {}
    for name, fit in fitted.items():
        if isinstance(fit, FittedProfile):
            down = fit.down + off * fit.tilt
            profiles[name] = (np.column_stack([fit.forward, down]) / MM).tolist()
        else:
            slopes[name] = fit.slope + off * fit.deviation
    return with_profiles(with_slopes(mechanism, slopes), profiles)


def with_slopes(mechanism: Mechanism, slopes: Mapping[str, float]) -> Mechanism:
    """The mechanism with planes that fall forward through the balls' centres at home.

    Args: slopes: [rad], by contact.
    """
    made = {}
    for contact in _named(mechanism, slopes):
        fall = tan(slopes[contact.name])
        offset = contact.point[2] + fall * contact.point[0]
        made[contact.name] = {"kind": "plane", "slope": [-fall, 0.0], "offset": offset}
    return _with_surfaces(mechanism, made)


def with_profiles(
    mechanism: Mechanism, profiles: Mapping[str, Sequence[Sequence[float]]]
) -> Mechanism:
    """The mechanism with curves, the same all across, through the balls' centres at home.

    Args: profiles: [forward, down] from there [mm], by contact.
    """
    made: dict[str, Any] = {}
    for contact in _named(mechanism, profiles):
        x, _, z = contact.point
        points = [[x + MM * forward, z - MM * down] for forward, down in profiles[contact.name]]
        made[contact.name] = {"kind": "profile", "direction": [1.0, 0.0], "points": points}
    return _with_surfaces(mechanism, made)


def _named(mechanism: Mechanism, by_contact: Mapping[str, Any]) -> list[Any]:
    if unknown := [name for name in by_contact if name not in mechanism.contact_names]:
        known = join(mechanism.contact_names) or "none"
        raise InputError(f"eminence: no contact is called {join(unknown)}; available: {known}")
    return [contact for contact in mechanism.contacts if contact.name in by_contact]


def _with_surfaces(mechanism: Mechanism, surfaces: Mapping[str, Any]) -> Mechanism:
    """The mechanism with other surfaces of some contacts; a ball's radius moves them along."""
    changes = {f"contact.{name}.surface": one for name, one in surfaces.items()}
    return mechanism.set(changes, keep="home")
