"""`calibrate`: geometric numbers of a mechanism's file from encoders and measured poses.

All rows are fitted at once; the coordinates of each row are eliminated from the normal equations.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from .. import progress
from ..errors import CondyleError, InputError, as_path, join
from ..mechanism import as_mechanism
from ..mechanism.mechanism import Mechanism
from .base_parameters import identifiable_columns
from .calibration_problem import CalibrationProblem, MeasuredPoses, read_poses
from .calibration_study import CalibrationStudy
from .fitted_file import FittedNumbers, fitted_numbers

STEPS, SETTLED = 30, 1e-4  # steps at most; the last one's size in standard deviations
LARGEST = 0.02  # of the characteristic length or of a radian: a standard deviation of no use
CULPRITS = 4  # at most, that a number is said not to be told apart from
OPEN = 1e8  # condition number of the frames' columns, beyond which the rows leave them open
LIKELY = 0.999  # share of fits whose residual is within what chance makes
APART = 1.0  # rad or m, that readings may contradict the file by


@dataclass(frozen=True)
class Misfit:
    """Distances of measured places from the machine's, and angles, over some rows.

    place: root of the mean square, and largest [m];  angle: likewise [rad], None of points alone.
    """

    place: tuple[float, float]
    angle: tuple[float, float] | None

    def __str__(self) -> str:
        rms, most = (1e3 * x for x in self.place)
        text = f"{rms:.3g} mm rms, {most:.3g} mm at most"
        if self.angle is not None:
            rms, most = np.degrees(self.angle)
            text += f"; {rms:.3g} degrees rms, {most:.3g} at most"
        return text

    @property
    def data(self) -> dict[str, Any]:
        """For programs."""
        found = {"place": self.place, "angle": self.angle or (None, None)}
        return {
            f"{n}_{what}": x
            for n, two in found.items()
            for what, x in zip(("rms", "max"), two, strict=True)
        }


@dataclass(frozen=True, eq=False)
class Calibrated(FittedNumbers):
    """What `calibrate` found.

    frames: the measuring frame's and the target's six numbers, and points on the platform, by name;
    before, after: by the file's numbers and by the fitted ones, on rows held back where there are
    any; the readings alone say where the machine is;
    spread: mean square of the residual over its noise, on fitted rows: 1 where nothing is missing;
    likely: the greatest that noise as stated makes in 999 of 1,000 fits. Beyond it deviations are
    widened by the root of `spread`, and a warning says so.
    """

    kind = "calibration"
    frames: dict[str, tuple[float, ...]]
    before: Misfit
    after: Misfit
    spread: float
    likely: float
    rows: tuple[int, int]
    notes: tuple[str, ...] = ()

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the reader should know."""
        sentences = list(self.notes)
        if self.untold:
            sentences.append(f"the poses do not identify {self.untold}: they keep their values")
        if self.spread > self.likely:
            sentences.append(
                f"the residual is {np.sqrt(self.spread):.3g} times the stated noise, more than "
                f"chance makes ({np.sqrt(self.likely):.3g}): the noise is larger, or a number that "
                "is not fitted is off, and the fitted ones make up for it. Deviations are widened "
                "as much, and may still be too small: fit more numbers, or check [noise]"
            )
        return tuple(sentences)

    def __str__(self) -> str:
        fitted, held = self.rows
        noise = f"residual over noise: {np.sqrt(self.spread):.3g} ({fitted} rows)"
        on = f"{held} rows held back" if held else "the rows themselves"
        before, after = f"on {on}: before {self.before}", f"  after {self.after}"
        return "\n".join([*self.number_lines, noise, before, after])

    @property
    def data(self) -> dict[str, Any]:
        return super().data | {
            "frames": {name: list(values) for name, values in self.frames.items()},
            "residual_over_noise": float(np.sqrt(self.spread)),
            "before": self.before.data,
            "after": self.after.data,
        }

    @property
    def units(self) -> dict[str, str]:
        units = super().units
        for chain in self.mechanism.chains:
            own = f"chain.{chain.name}"
            if chain.kind == "RSS" and {f"{own}.base[0]", f"{own}.crank_tip[0]"} & {*units}:
                units.setdefault(f"{own}.axis", "")
        for contact in self.mechanism.contacts:  # what keeps home may have moved
            units |= _followed(contact.name, self.source, self.mechanism)
        return units

    @property
    def header(self) -> str:
        return f"calibrated from {self.rows[0]} rows; {self.after}"


def _followed(contact: str, source: Any, fitted: Mechanism) -> dict[str, str]:
    """Numbers of a contact's surface that differ from the file's."""
    before, units = as_mechanism(source), {}
    for key, value in fitted.get(f"contact.{contact}.surface").entries().items():
        path = f"contact.{contact}.surface.{key}"
        if isinstance(value, float | tuple) and value != before.get(path):
            units[path] = "m"
    return units


def calibrate(
    mechanism: Mechanism | str | os.PathLike[str],
    poses: str | os.PathLike[str],
    study: CalibrationStudy | Mapping[str, Any] | str | os.PathLike[str],
) -> Calibrated:
    """Geometric numbers of a mechanism's file from encoders and measured poses.

    Weighted least squares over numbers, the measuring frame, the target's and the coordinates of
    every row. Parameters that the poses do not identify, such as a common motion of all base points
    where the measuring frame is unknown, keep their values, and are named.

    Args:   poses: table (CSV, Parquet), one pose per row: joint_<chain>, and X .. gamma of a target
            (m, rad), or NAME_x, NAME_y, NAME_z of points on the platform (m), in the measuring
            frame; or t (s) where the study names a recording of markers.
            study: a calibration study (TOML), or its tables: unknown numbers, tolerances, noise.
    Raises: InputError: for files that do not fit, or a fit that does not converge.
    """
    machine = as_mechanism(mechanism)
    checked = CalibrationStudy.read(study)
    measured = read_poses(machine, as_path(poses, "poses"), checked.markers)
    count = len(measured.joint)
    held = np.zeros(count, dtype=bool)
    order = np.random.default_rng(checked.options.seed).permutation(count)
    held[order[: int(checked.options.validate_ * count)]] = True
    problem = CalibrationProblem(machine, checked, measured.rows(~held))
    with progress.step("fitting"):
        bare, *_ = _solve(problem, frames_alone=True)
        x, covariance, why, spread, likely = _solve(problem)
    U = len(problem.names)
    about = list(zip(problem.names, problem.units, strict=True))
    identified = [i not in why for i in range(U)]
    rest = measured.rows(held if held.any() else ~held)
    return Calibrated(
        problem.machine(x),
        fitted_numbers(about, x, covariance, problem.nominal, identified, why),
        mechanism,
        {
            name: tuple(map(float, x[own]))
            for name, own in problem.columns.items()
            if own.start >= U
        },
        _misfit(problem, rest, bare),
        _misfit(problem, rest, x),
        spread,
        likely,
        (int((~held).sum()), int(held.sum())),
        measured.notes,
    )


def _solve(
    problem: CalibrationProblem, frames_alone: bool = False
) -> tuple[np.ndarray, np.ndarray, dict[int, str], float, float]:
    """Unknowns, their covariance, numbers that stay and why, the residual's mean square over its
    noise, and the greatest one that is likely.

    Args: frames_alone: all numbers of the file stay.
    """
    U = len(problem.names)
    mean, known = problem.prior
    model = problem.model(mean)
    solution = model.forward_kinematics(problem.measured.joint, tolerance=APART)
    if solution.status.any():
        row = int(np.argmax(solution.status != 0))
        raise InputError(
            f"{problem.measured.source}: the joints of row {row + 1} lead to no pose; are they "
            "readings of this mechanism, from home, in rad and m?"
        )
    q, x = solution.q, problem.first_guess(solution.pose)
    why: dict[int, str] = {}
    identified: np.ndarray | None = None
    for _ in range(STEPS):
        linear = problem.linear(model, x, q)
        J, r = linear.reduced()
        prior = np.flatnonzero(np.isfinite(known))
        J = np.concatenate([J, np.eye(problem.size)[prior] / known[prior, None]])
        r = np.concatenate([r, (x[:U] - mean)[prior] / known[prior]])
        if identified is None:
            identified, why = _identifiable(J, problem, frames_alone)
            _require_frames(J[:, U:], problem)
        step = np.zeros(problem.size)
        step[identified] = -np.linalg.lstsq(J[:, identified], r, rcond=None)[0]
        each = linear.r + linear.J @ step
        move = np.stack(
            [np.linalg.lstsq(L, -e, rcond=None)[0] for L, e in zip(linear.L, each, strict=True)]
        )
        x, q = x + step, q + move
        try:
            model = problem.model(x)
        except CondyleError as error:
            raise InputError(
                f"the fit reached a mechanism that cannot exist ({error}): give a tolerance"
            ) from None
        if np.linalg.norm(J @ step) < SETTLED * max(1, identified.sum()) ** 0.5:
            break
    else:
        raise InputError("the fit does not converge: give tolerances, or rows with larger motions")
    covariance = np.zeros((problem.size, problem.size))
    covariance[np.ix_(identified, identified)] = np.linalg.inv(
        J[:, identified].T @ J[:, identified]
    )
    linear = problem.linear(model, x, q)
    rest = linear.reduced()[1]
    from scipy.stats import chi2  # which takes a while

    freedom = max(1, rest.size - problem.measured.unseen - int(identified.sum()))
    spread, likely = float(rest @ rest) / freedom, float(chi2.ppf(LIKELY, freedom)) / freedom
    return x, covariance * (spread if spread > likely else 1.0), why, spread, likely


def _require_frames(J: np.ndarray, problem: CalibrationProblem) -> None:
    """Raises InputError where the rows leave the frames open, whatever the numbers are."""
    size = np.linalg.norm(J, axis=0)
    if J.size and not (size.all() and np.linalg.cond(J / size) < OPEN):
        raise InputError(
            f"{problem.measured.source}: the rows do not determine the frames: poses that turn the "
            "platform about two axes do; or give frames.measuring or frames.target"
        )


def _identifiable(
    J: np.ndarray, problem: CalibrationProblem, frames_alone: bool
) -> tuple[np.ndarray, dict[int, str]]:
    """Unknowns to fit: frames, then zeros of encoders, then all else that stands apart."""
    U = len(problem.names)
    identified = np.zeros(problem.size, dtype=bool)
    identified[U:] = True
    if frames_alone:
        return identified, dict.fromkeys(range(U), "held")
    length = problem.model(problem.nominal).characteristic_length
    size = np.array([LARGEST * (length if unit == "m" else 1.0) for unit in problem.units])
    why: dict[int, str] = {}
    zeros = [i for i, name in enumerate(problem.names) if name.endswith(".zero")]
    rest = [i for i in range(U) if i not in zeros]
    for group in (zeros, rest):
        if not group:
            continue
        basis = J[:, identified]
        own = J[:, group]
        if basis.shape[1]:
            Q = np.linalg.qr(basis)[0]
            own = own - Q @ (Q.T @ own)
        split = identifiable_columns(own * size[group], 1.0, relative=False)
        identified[[group[i] for i in split.known]] = True
        for column, k in zip(split.follow.T, split.rest, strict=True):
            share = np.abs(column)
            nearest = np.argsort(-share)[:CULPRITS]
            names = [
                problem.names[group[split.known[i]]]
                for i in nearest
                if share[i] > 0.1 * share.max()
            ]
            lost = np.linalg.norm(own[:, k]) * size[group[k]] <= 1.0
            why[group[k]] = (
                "the rows say nothing of it beyond the frames and zeros"
                if lost
                else f"not told apart from {join(names)}"
            )
    return identified, why


def _misfit(problem: CalibrationProblem, measured: MeasuredPoses, x: np.ndarray) -> Misfit:
    """The misfit of rows, by what their readings say where the machine is."""
    model = problem.model(x)
    solution = model.forward_kinematics(measured.joint, tolerance=APART)
    place, angle = problem.off(measured, solution.pose, x)
    place, angle = place[np.isfinite(place)], angle[np.isfinite(angle)]

    def two(values: np.ndarray) -> tuple[float, float]:
        return float(np.sqrt((values**2).mean())), float(values.max())

    return Misfit(two(place), two(angle) if angle.size else None)
