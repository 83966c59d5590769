"""The motion to follow: samples in, one spline through them, clean derivatives out."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, TypedDict, Unpack

import numpy as np

from ..errors import InputError, brief, join, quoted
from ..files.memory import require_memory
from ..files.reading import digest
from ..mechanism.cells import curves, table
from .arrays import as_doubles, as_number, as_samples, as_text, check_rising
from .column_units import BASE, GRAVITY, LANDMARK, POSE, Units, parse_units, si_unit
from .frame import as_sampled, table_from_frame
from .gravity_and_base import Given, gravity_and_base_columns, gravity_and_base_of
from .number_table import NumberTable
from .smoothing import Smoothing, parse_cutoff, smoothing_spline
from .spline import Spline
from .table_reader import read_table
from .unit_checks import gravity_warnings, motion_warnings

Kind = Literal["coordinates", "pose", "landmark"]

KNOWN = ("t", *POSE, *LANDMARK, *GRAVITY, *BASE)
MIN_ROWS = 6
_SAMPLE_BYTES = 3000  # that a sample takes until its results are written
_SLACK = 1e-9  # [s], by which output times may miss the input's ends through rounding


class Options(TypedDict, total=False):
    """Options of `Motion.from_arrays`, which says what they are."""

    landmark: str | None
    cutoff: float | str | None
    rate: float | None
    times: Any
    trim: float


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
        landmark: name of the platform point that x, y, z displace from home; None for other kinds,
            or to leave the choice to the mechanism (`resolve_landmark`).
        t: (N,) [s], rising.
        value, rate, acceleration: (N, m), [m, rad], [m/s, rad/s], [m/s^2, rad/s^2].
        source: where the samples came from, for messages.
        smoothing: what was smoothed away, or None.
        sha256: hash of the file that was read, or None.
        warnings: implausible values, for the results.
        gravity: in {S}, (N, 3) [m/s^2]; None: the mechanism's.
        base: acceleration of the origin of {S} [m/s^2], angular velocity [rad/s] and angular
            acceleration [rad/s^2] of the base, components in {S}, (N, 9); None: it is at rest.
        contact_fit: how far each point was moved onto the contacts, and "all" of them: root mean
            square and largest [m]; None: see `fit_motion`.
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
    warnings: tuple[str, ...] = ()
    gravity: np.ndarray | None = None
    base: np.ndarray | None = None
    contact_fit: dict[str, list[float]] | None = None

    def __len__(self) -> int:
        return len(self.t)

    def __repr__(self) -> str:
        """Source, columns and span in one line."""
        span = f"{len(self)} samples from {self.t[0]:.6g} to {self.t[-1]:.6g} s"
        of = f" of {self.landmark}" if self.landmark else ""
        return f"Motion({self.source}: {', '.join(self.names)}{of}, {span})"

    def _repr_html_(self) -> str:
        """Its columns over time, and a table."""
        rows = [
            ("columns", ", ".join(self.names) + (f" of {self.landmark}" if self.landmark else "")),
            ("samples", f"{len(self)} from {self.t[0]:.6g} to {self.t[-1]:.6g} s"),
        ]
        return table("Motion", self.source, rows, curves(self.value, self.names))

    @property
    def given(self) -> Given:
        """Gravity and the base's motion, where the motion has them, as models take them."""
        inputs: Given = {}
        if self.gravity is not None:
            inputs["gravity"] = self.gravity
        if self.base is not None:
            inputs["base"] = self.base
        return inputs

    @property
    def columns(self) -> dict[str, np.ndarray]:
        """The columns of a motion file, in SI."""
        by_name = {"t": self.t, **dict(zip(self.names, self.value.T, strict=True))}
        for names, a in ((GRAVITY, self.gravity), (BASE, self.base)):
            if a is not None:
                by_name |= zip(names, a.T, strict=True)
        return by_name

    @classmethod
    def from_csv(
        cls,
        path: str | os.PathLike[str],
        *,
        units: str | Units | None = None,
        **options: Unpack[Options],
    ) -> Motion:
        """Read a motion file: `t` and pose coordinates, or `t,x,y,z`, and optionally gx, gy, gz
        and base_ax ... base_dwz; see `from_arrays`.

        CSV, or Parquet if the name ends in .parquet. Where the header names units, those hold.
        """
        table = read_table(path, known=KNOWN)
        return replace(cls._from_table(table, units, **options), sha256=digest(path))

    @classmethod
    def from_frame(
        cls,
        frame: Any,
        *,
        units: str | Units | None = None,
        source: str = "motion",
        **options: Unpack[Options],
    ) -> Motion:
        """The same from a pandas DataFrame; its index is the time if no column is."""
        table = table_from_frame(frame, KNOWN, source)
        return cls._from_table(table, units, **options)

    @classmethod
    def _from_table(
        cls, table: NumberTable, units: str | Units | None, **options: Unpack[Options]
    ) -> Motion:
        table.times()
        values = table.si(parse_units(units))
        t = values.pop("t")
        motion = cls.from_arrays(t, values, source=table.source, **options)
        return replace(motion, warnings=(*table.warnings, *motion.warnings))

    @classmethod
    def from_arrays(
        cls,
        t: Any,
        values: Mapping[str, Any] | np.ndarray,
        names: Sequence[str] | None = None,
        *,
        units: str | Units | None = None,
        landmark: str | None = None,
        cutoff: float | str | None = None,
        rate: float | None = None,
        times: Any = None,
        trim: float = 0.0,
        source: str = "motion",
    ) -> Motion:
        """Motion through samples, at least six, at strictly rising times.

        Args:
            t: (N,) [s].
            values: name -> (N,); or (N, m) with `names`, (m,). With gx, gy, gz gravity is given,
                with any of base_ax, base_ay ... base_dwz the base moves: the others are zero, but
                base_dwx ..., without any of which they are the rates of base_wx ...
            units: of times, lengths and angles where they are not SI, such as "ms,mm,deg".
            landmark: platform point whose displacement x, y, z are; by default the mechanism's
                incisor, or its only point.
            cutoff: smooth measured data at this frequency [Hz], or "auto" (10 Hz); None: do not.
            rate: output samples per second, from t[0] on; or
            times: output times within the input's, rising; default: the input's. Both in seconds.
            trim: time removed from either end of the output [s], where a smoothed motion is
                least accurate.
        Raises:
            InputError: for samples or options that cannot be used.
        """
        as_text(source, "source", "text")
        unit = parse_units(units)
        # What has a unit of its own has it once: `units` is of plain numbers.
        own = (lambda _: None) if unit.given else si_unit
        if not isinstance(values, Mapping):
            values = _by_name(values, names, source, own)
        as_text(landmark, "landmark", "the name of a platform point")
        t = as_samples(t, "t", source, unit=own("t")) * unit.time
        columns = {n: as_samples(v, n, source, len(t), own(n)) for n, v in values.items()}
        extra = gravity_and_base_columns(columns, source)
        kind, names = _kind({n: c for n, c in columns.items() if n not in extra}, source)
        if kind != "landmark" and landmark is not None:
            raise InputError(
                f'{source}: landmark "{landmark}" was given, but the columns are '
                f"{', '.join(names)}; a landmark's path has x, y, z"
            )
        if len(t) < MIN_ROWS:
            raise InputError(f"{source}: {len(t)} rows, expected at least {MIN_ROWS}")
        check_rising(t, f"{source}, sample {{}}".format)
        every = (*names, *extra)
        samples = np.column_stack([columns[name] * unit.scale(name) for name in every])

        since_start = t - t[0]  # keeps large times, such as those of a clock, exact
        smoothing = None
        if cutoff is None:
            spline = Spline.through(since_start, samples)
        else:
            frequency = parse_cutoff(cutoff)
            spline = smoothing_spline(since_start, samples, frequency)
            removed = (samples - spline(since_start))[:, : len(names)]
            rms, peak = np.sqrt((removed**2).mean(axis=0)), np.abs(removed).max(axis=0)
            smoothing = Smoothing(frequency, cutoff == "auto", names, rms, peak)
        out = _trimmed(_output_times(t, rate, times, source), t, trim, source)
        value, first, second = (spline(out - t[0], nu) for nu in range(3))
        as_given = smoothing is None and out is t  # to the last digit
        m = len(names)
        others = dict(zip(extra, (samples if as_given else value)[:, m:].T, strict=True))
        given = gravity_and_base_of(others, lambda name: first[:, m + extra.index(name)])
        value, first, second = (a[:, : len(names)] for a in (value, first, second))
        if not np.isfinite(second).all():
            raise InputError(f"{source}: times or values are too extreme to differentiate")
        warnings = motion_warnings(source, names, t, value, first)
        derivatives = value, first, second
        warnings += gravity_warnings(source, given.get("gravity"))
        return cls(
            kind, names, landmark, out, *derivatives, source, smoothing, None, warnings,
            given.get("gravity"), given.get("base"),
        )  # fmt: skip


def as_motion(motion: Any) -> Motion:
    """A motion from what people give for one: a Motion, the path of a file, a DataFrame.

    Raises: InputError: for anything else.
    """
    return as_sampled(motion, Motion, "t, values, names")


def _by_name(
    values: Any, names: Sequence[str] | None, source: str, unit: Callable[[str], str | None]
) -> dict[str, np.ndarray]:
    taken = (
        "expected a mapping name -> (samples,), or (samples, columns) with a different name for "
        f"each column: of {', '.join(POSE)}, or x, y, z"
    )
    if names is not None and not (
        isinstance(names, str | list | tuple | np.ndarray)
        and all(isinstance(name, str) for name in names)
    ):
        raise InputError(f"{source}: names: expected a list of column names, got {brief(names)}")
    own = () if names is None else tuple(names)
    units = [one for one in map(unit, own) if one is not None]
    array = as_doubles(values, f"{source}: values", units or None, own)
    if array.ndim != 2:
        raise InputError(f"{source}: got values of shape {array.shape}; {taken}")
    if names is None or len(set(names)) != len(names) or array.shape[1] != len(names):
        hint = "; give its transpose" if names is not None and len(names) == len(array) else ""
        raise InputError(
            f"{source}: got values of shape {array.shape} for names "
            f"{None if names is None else quoted(names)}{hint}; {taken}"
        )
    return dict(zip(names, array.T, strict=True))


def _kind(columns: Mapping[str, Any], source: str) -> tuple[Kind, tuple[str, ...]]:
    """What the columns describe, and their names in the order to keep them in."""
    rules = f"pose coordinates ({', '.join(POSE)}), or a landmark's path (x, y, z)"
    got = f"{source}: got columns {join(columns)}" if columns else f"{source}: got only t"
    if not columns or not set(columns) <= {*POSE, *LANDMARK}:
        raise InputError(f"{got}; expected {rules}")
    if set(columns) <= set(LANDMARK):
        if missing := [name for name in LANDMARK if name not in columns]:
            raise InputError(f"{got}; a landmark's path also needs {', '.join(missing)}")
        return "landmark", LANDMARK
    if not set(columns) <= set(POSE):
        raise InputError(f"{got}; expected {rules}, not both")
    return ("pose", POSE) if len(columns) == len(POSE) else ("coordinates", tuple(columns))


def _output_times(t: np.ndarray, rate: float | None, times: Any, source: str) -> np.ndarray:
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
    rate = as_number(rate, "rate", "samples per second, above 0", lambda r: r > 0)
    intervals = (t[-1] - t[0]) * rate
    require_memory(
        intervals * _SAMPLE_BYTES,
        f"{source}: rate {rate:g} Hz would give {intervals:.3g} samples, which take",
        "ask for fewer, or follow a part of the motion",
    )
    # i / rate is correctly rounded, so grids of different rates meet in the same bits.
    out: np.ndarray = t[0] + np.arange(math.floor(intervals + 1e-6) + 1) / rate
    out[-1] = min(out[-1], t[-1])
    return out


def _trimmed(out: np.ndarray, t: np.ndarray, trim: float, source: str) -> np.ndarray:
    if not as_number(trim, "trim", "seconds, at least 0", lambda s: s >= 0):
        return out
    inside = out[(out >= t[0] + trim - _SLACK) & (out <= t[-1] - trim + _SLACK)]
    if not len(inside):
        raise InputError(
            f"{source}: trim {trim:g} s at either end leaves nothing of {t[-1] - t[0]:.4g} s"
        )
    return inside
