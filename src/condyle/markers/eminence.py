"""The eminence of a subject: slopes that condyles slid along, fitted to what markers saw.

The measured pose of the platform carries each ball; in the sagittal plane its path is the line

    (z - z_0) = -tan(slope) (x - x_0),    x forward,

of least squares of distances from it, any x_0 and z_0: a ball that is registered off its place
still slides at the right slope, as long as the platform turns little.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import tan
from typing import Annotated, Any, Self

import numpy as np
from pydantic import Field, model_validator

from ..errors import InputError, few
from ..mechanism.mechanism import Mechanism
from ..mechanism.study_file import Finite, Label, Text
from ..mechanism.table import Table
from .marker_report import MarkerMotion
from .rigid import fit

LEAST_TRAVEL = 3e-3  # m forward and down, below which a path has no slope
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
    fit: Annotated[bool, Field(strict=True)] = Field(
        default=False, description="fit the slope of each contact to the condyles' paths"
    )
    trials: tuple[Text, ...] = Field(
        default=(), description="names of the trials to fit, of protrusion or opening; default: all"
    )

    @model_validator(mode="after")
    def _one_way(self) -> Self:
        given = (self.slope is not None) + (self.profile is not None) + self.fit
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


def ball_paths(motion: MarkerMotion, mechanism: Mechanism) -> dict[str, np.ndarray]:
    """Centres of the balls in {S} as the platform's markers have them, by contact, (N, 3) [m].

    NaN where fewer than three markers were seen; contacts have no say in them.
    """
    home = motion.home_places["platform"]
    places = motion.markers
    found = fit(np.array([*home.values()]), np.stack([places[name] for name in home], axis=1))
    return {
        contact.name: found.rotation @ np.array(contact.point) + found.position
        for contact in mechanism.contacts
    }


def fitted_slopes(
    mechanism: Mechanism, motions: Mapping[str, Sequence[MarkerMotion]]
) -> dict[str, FittedSlope]:
    """Slopes of the condyles' paths, by contact.

    Args:   motions: of each trial, by its name.
    Raises: InputError: where a condyle moves too little for a slope.
    """
    paths = {name: [ball_paths(motion, mechanism) for motion in of] for name, of in motions.items()}
    found = {}
    for contact in mechanism.contacts:
        by_trial = {
            name: np.concatenate([_sagittal(path[contact.name]) for path in of])
            for name, of in paths.items()
        }
        every = np.concatenate([*by_trial.values()])
        line = _Line.through(every)
        if line.travel < LEAST_TRAVEL:
            raise InputError(
                f"eminence: {contact.name} moves {line.travel / MM:.2g} mm along its path in "
                f"{few(by_trial)}; a slope needs {LEAST_TRAVEL / MM:g} mm. Name trials of "
                "protrusion or opening, or give slope"
            )
        lines = {name: _Line.through(path) for name, path in by_trial.items()}
        own = {n: one.slope for n, one in lines.items() if one.travel >= LEAST_TRAVEL}
        spread = float(np.std([*own.values()], ddof=1)) if len(own) > 1 else 0.0
        found[contact.name] = FittedSlope(
            line.slope, max(line.deviation, spread), own, line.travel, line.off
        )
    return found


def _sagittal(path: np.ndarray) -> np.ndarray:
    """x and z where they are known, (N, 2)."""
    return path[np.isfinite(path).all(axis=1)][:, [0, 2]]


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
        *_, (along, across) = np.linalg.svd(centred, full_matrices=False)
        along = along if along[0] >= 0 else -along
        way, off = centred @ along, centred @ across
        spread, rest = float(way.var()), float(off.var())
        # Samples in a row are not independent: those that count as such.
        again = float((off[1:] * off[:-1]).mean() / rest) if rest else 0.0
        again = min(max(again, 0.0), 0.999)
        count = max(len(points) * (1 - again) / (1 + again), 2.0)
        deviation = float(np.sqrt(rest / spread / count)) if spread else np.inf
        slope = float(np.arctan2(-along[1], along[0]))
        return _Line(slope, deviation, float(np.ptp(way)), float(np.sqrt(rest)))


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
        known = few(mechanism.contact_names) or "none"
        raise InputError(f"eminence: no contact is called {few(unknown)}; available: {known}")
    return [contact for contact in mechanism.contacts if contact.name in by_contact]


def _with_surfaces(mechanism: Mechanism, surfaces: Mapping[str, Any]) -> Mechanism:
    """The mechanism with other surfaces of some contacts; a ball's radius moves them along."""
    changes = {f"contact.{name}.surface": one for name, one in surfaces.items()}
    return mechanism.set(changes, keep="home")
