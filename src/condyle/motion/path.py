"""The motion to follow: samples in, one spline through them, clean derivatives out."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from condyle.errors import InputError
from condyle.motion.arrays import as_samples, check_rising
from condyle.motion.digest import digest
from condyle.motion.smoothing import Smoothing, parse_cutoff, smoothing_spline
from condyle.motion.table import read_table
from condyle.motion.units import LANDMARK, POSE, Units, parse_units

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

Kind = Literal["coordinates", "pose", "landmark"]

DEFAULT_LANDMARK = "incisor"
MIN_ROWS = 6
_MAX_SAMPLES = 10**8
_SLACK = 1e-9  # [s], by which output times may miss the input's ends through rounding


@dataclass(frozen=True, eq=False)
class Motion:
    """Coordinates over time with their first and second derivatives, in SI.

    One quintic spline goes through the input samples, or near them if they are smoothed; value,
    rate and acceleration are that spline and its exact derivatives. So they belong to the input
    alone: an output grid of 1 kHz and one of 200 Hz give the same numbers where they meet.

    Attributes:
        kind: "coordinates" (fewer than six of the pose), "pose" (all six), "landmark" (x, y, z).
        names: columns, (m,); in the order of the file for coordinates, else X, Y, Z, alpha, beta,
            gamma or x, y, z.
        landmark: name of the platform point that x, y, z displace from home; None for other kinds.
        t: (N,) [s], rising.
        value, rate, acceleration: (N, m), [m, rad], [m/s, rad/s], [m/s^2, rad/s^2].
        source: where the samples came from, for messages.
        smoothing: what was smoothed away, or None.
        sha256: hash of the file that was read, or None.
    """

    kind: Kind
    names: tuple[str, ...]
    landmark: str | None
    t: np.ndarray
    value: np.ndarray
    rate: np.ndarray
    acceleration: np.ndarray
    source: str
    smoothing: Smoothing | None = None
    sha256: str | None = None

    def __len__(self) -> int:
        return len(self.t)

    @classmethod
    def from_csv(
        cls,
        path: str | os.PathLike[str],
        *,
        units: str | Units = "m,rad",
        landmark: str | None = None,
        cutoff: float | str | None = None,
        rate: float | None = None,
        times: Any = None,
    ) -> Motion:
        """Read a motion file: `t` and pose coordinates, or `t,x,y,z`; see `from_arrays`."""
        table = read_table(path, known=("t", *POSE, *LANDMARK))
        t = table.require(["t"])[:, 0]
        values = {name: column for name, column in table.columns.items() if name != "t"}
        check_rising(t, table.where)
        motion = cls.from_arrays(
            t,
            values,
            units=units,
            landmark=landmark,
            cutoff=cutoff,
            rate=rate,
            times=times,
            source=table.source,
        )
        return replace(motion, sha256=digest(path))

    @classmethod
    def from_arrays(
        cls,
        t: Any,
        values: Mapping[str, Any] | np.ndarray,
        names: Sequence[str] | None = None,
        *,
        units: str | Units = "m,rad",
        landmark: str | None = None,
        cutoff: float | str | None = None,
        rate: float | None = None,
        times: Any = None,
        source: str = "motion",
    ) -> Motion:
        """Motion through samples, at least six, at strictly rising times.

        Args:
            t: (N,) [s].
            values: name -> (N,); or (N, m) with `names`, (m,).
            units: of lengths and angles, such as "mm,deg".
            landmark: platform point whose displacement x, y, z are; default "incisor".
            cutoff: smooth measured data at this frequency [Hz], or "auto" (10 Hz); None: do not.
            rate: output samples a second, from t[0] on; or
            times: output times within the input's, rising; default: the input's.
        Raises:
            InputError: for samples or options that cannot be used.
        """
        if not isinstance(values, Mapping):
            values = _by_name(np.asarray(values), names, source)
        t = as_samples(t, "t", source)
        columns = {name: as_samples(v, name, source, len(t)) for name, v in values.items()}
        kind, names = _kind(columns, source)
        landmark = _landmark(kind, landmark, names, source)
        if len(t) < MIN_ROWS:
            raise InputError(f"{source}: {len(t)} rows, expected at least {MIN_ROWS}")
        check_rising(t, f"{source}, sample {{}}".format)
        unit = parse_units(units)
        samples = np.column_stack([columns[name] * unit.scale(name) for name in names])

        since_start = t - t[0]  # keeps large times, such as those of a clock, exact
        smoothing = None
        if cutoff is None:
            spline = _interpolant(since_start, samples, source)
        else:
            frequency = parse_cutoff(cutoff)
            spline = smoothing_spline(since_start, samples, frequency)
            removed = samples - spline(since_start)
            rms, peak = np.sqrt((removed**2).mean(axis=0)), np.abs(removed).max(axis=0)
            smoothing = Smoothing(frequency, cutoff == "auto", names, rms, peak)
        out = _output_times(t, rate, times, source)
        value, first, second = (spline(out - t[0], nu) for nu in range(3))
        if not np.isfinite(second).all():
            raise InputError(f"{source}: times or values are too extreme to differentiate")
        return cls(kind, names, landmark, out, value, first, second, source, smoothing)


def _by_name(values: np.ndarray, names: Sequence[str] | None, source: str) -> dict[str, np.ndarray]:
    distinct = names is not None and len(set(names)) == len(names)
    if names is None or not distinct or values.shape[1:] != (len(names),):
        raise InputError(
            f"{source}: got values of shape {values.shape} for names {names},"
            " expected (samples, columns) and a different name for each column"
        )
    return dict(zip(names, values.T, strict=True))


def _landmark(kind: Kind, landmark: str | None, names: Sequence[str], source: str) -> str | None:
    if kind == "landmark":
        return landmark or DEFAULT_LANDMARK
    if landmark is not None:
        raise InputError(
            f'{source}: landmark "{landmark}" was given, but the columns are {", ".join(names)};'
            " a landmark's path has x, y, z"
        )
    return None


def _kind(columns: Mapping[str, Any], source: str) -> tuple[Kind, tuple[str, ...]]:
    """What the columns describe, and their names in the order to keep them in."""
    rules = f"pose coordinates ({', '.join(POSE)}), or a landmark's path (x, y, z)"
    got = f"{source}: got columns {', '.join(columns)}" if columns else f"{source}: got only t"
    if not columns or not set(columns) <= {*POSE, *LANDMARK}:
        raise InputError(f"{got}; expected {rules}")
    if set(columns) <= set(LANDMARK):
        if missing := [name for name in LANDMARK if name not in columns]:
            raise InputError(f"{got}; a landmark's path also needs {', '.join(missing)}")
        return "landmark", LANDMARK
    if not set(columns) <= set(POSE):
        raise InputError(f"{got}; expected {rules}, not both")
    return ("pose", POSE) if len(columns) == len(POSE) else ("coordinates", tuple(columns))


def _interpolant(t: np.ndarray, values: np.ndarray, source: str) -> BSpline:
    """Quintic spline through the samples."""
    from scipy.interpolate import make_interp_spline

    try:
        return make_interp_spline(t, values, k=5)
    except (ValueError, np.linalg.LinAlgError) as error:
        raise InputError(f"{source}: no spline goes through the samples ({error})") from error


def _output_times(
    t: np.ndarray,
    rate: float | None,
    times: Any,
    source: str,
) -> np.ndarray:
    if rate is not None and times is not None:
        raise InputError(f"{source}: both a rate and times were given; expected one of them")
    if times is not None:
        wanted = as_samples(times, "times", source)
        check_rising(wanted, "times, sample {}".format)
        if not len(wanted) or wanted[0] < t[0] - _SLACK or wanted[-1] > t[-1] + _SLACK:
            raise InputError(f"{source}: times must lie within {t[0]:g} to {t[-1]:g} s")
        return wanted
    if rate is None:
        return t
    if not (math.isfinite(rate) and rate > 0):
        raise InputError(f"{source}: rate: got {rate!r}, expected samples a second, above 0")
    intervals = (t[-1] - t[0]) * rate
    if intervals > _MAX_SAMPLES:
        raise InputError(f"{source}: rate {rate:g} Hz would give {intervals:.3g} samples")
    # i / rate is correctly rounded, so grids of different rates meet in the same bits.
    out: np.ndarray = t[0] + np.arange(math.floor(intervals + 1e-6) + 1) / rate
    out[-1] = min(out[-1], t[-1])
    return out
