"""What a residual follows that noise does not: terms that the model does not have.

The residual is tested against terms that a machine may have beside its model: gains and delays of
efforts, friction, springs and inertia of joints and of the platform's coordinates. Terms are added
one by one, that of the largest test value first, as long as chance does not explain it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import t as student

from ..kinematics.chain import FAMILIES
from .equations import EquationRows, LogEquations
from .residual_spectrum import RANK, in_band, spectra, stacked

CHANCE = 1e-3  # of a false alarm in one fit
NOISE_STEPS = 3  # to the noise that is left with all terms
MOST = 8  # terms
ENOUGH = 3.0  # entries of the residual for every number and term: fewer tell noise from nothing
OWN = 1e-3  # least part of a term's length that the fitted numbers do not have


@dataclass(frozen=True)
class MissingTerm:
    """A term that the residual has and the model does not.

    name: such as "gain.masseter_left";  value, deviation: of its coefficient, with its unit;
    ratio: value over deviation, above what chance explains;  words: what it is, and what to do.
    """

    name: str
    value: float
    deviation: float
    unit: str
    words: str

    @property
    def ratio(self) -> float:
        return self.value / self.deviation

    def __str__(self) -> str:
        return f"the residual follows {self.words} ({self.value:.3g} +- {self.deviation:.1g}" + (
            f" {self.unit})" if self.unit else ")"
        )

    @property
    def data(self) -> dict[str, Any]:
        """For programs."""
        found = {"value": self.value, "deviation": self.deviation, "unit": self.unit}
        return {**found, "words": str(self)}


def terms(
    log: LogEquations, x: np.ndarray, rows: int
) -> Iterator[tuple[str, str, str, np.ndarray]]:
    """Name, unit, words and column, (N, rows), of each term beside the model, at the samples."""
    machine, recorded = log.model.mechanism, log.log
    by = log.by_effort[:, :rows]
    U = len(log.unknowns.all)
    effort = log.predicted(x[:U], x[U:])
    rate = recorded.low_pass.spline(effort)(recorded.t, 1)
    late = np.einsum("trn,tn->tr", by, rate)
    yield "delay", "s", "the rate of all efforts: they are late; fit it by delay = true", late
    units = [FAMILIES[chain.kind].effort_unit for chain in machine.chains]
    motion = log.joint_motion
    for i, chain in enumerate(machine.chain_names):
        angle = "rad" if units[i] == "N m" else "m"
        own = by[:, :, i]

        def sentence(what: str, then: str, chain: str = chain) -> str:
            return f"{what} of {chain}: {then}"

        yield (
            f"gain.{chain}", "", sentence("the effort", "its gain is off; fit it by gain = true"),
            -own * effort[:, i, None],
        )  # fmt: skip
        yield (
            f"delay.{chain}", "s",
            sentence("the effort's rate", 'it is late; fit it by delay = "channel"'),
            own * rate[:, i, None],
        )  # fmt: skip
        place, speed, acceleration = motion[:, :, i]
        for name, values, per, then in (
            ("position", place, f"/{angle}", "a spring or a wrong length"),
            ("speed", speed, f" s/{angle}", "viscous friction"),
            ("acceleration", acceleration, f" s^2/{angle}", "inertia, such as a rotor's"),
            ("direction", _direction(speed), "", "dry friction"),
        ):
            words = sentence(f"the {name}", f"{then} is missing or wrong")
            yield f"{name}.{chain}", units[i] + per, words, -own * values[:, None]
    for j, name in enumerate(log.model.independent):
        row = np.zeros(by.shape[:2])
        states = recorded.q[:, j], recorded.v[:, j], recorded.a[:, j]
        for what, values, per in (
            ("position", states[0] - states[0].mean(), ""),
            ("speed", states[1], " s"),
            ("acceleration", states[2], " s^2"),
            ("direction", _direction(states[1]), ""),
        ):
            column = row.copy()
            column[:, j] = values
            force, angle = ("N", "m") if name in ("X", "Y", "Z") else ("N m", "rad")
            unit = force + (f"{per}/{angle}" if what != "direction" else "")
            words = f"the {what} of {name}: a force on the platform that the model does not have"
            yield f"{what}.{name}", unit, words, column


def _direction(speed: np.ndarray) -> np.ndarray:
    """The direction of dry friction, smooth about zero speed."""
    small = 0.1 * np.sqrt((speed**2).mean()) + np.finfo(float).tiny
    return np.asarray(speed / np.sqrt(speed**2 + small**2))


def lack_of_fit(
    logs: Sequence[LogEquations],
    x: np.ndarray,
    rows: Sequence[EquationRows],
    identified: np.ndarray,
    spectrum: Sequence[np.ndarray],
    priors: tuple[np.ndarray, np.ndarray],
) -> tuple[tuple[MissingTerm, ...], np.ndarray]:
    """Terms that the residual has, and by how much the fitted numbers would change with them, (U,).

    The noise is what is left with all terms, so that none hides in it. Logs of a few seconds are
    too short to tell, and nothing is said of them.

    Args: x: (U + E,), after the fit;  rows, spectrum: of each log;  told: numbers that are fitted;
          priors: their rows and residuals.
    """
    A, r, Z = [], [], []
    for log, row in zip(logs, rows, strict=True):
        names, units, words, columns = zip(*terms(log, x, row.r.shape[1]), strict=True)
        Z.append(in_band(row, log.log.smoothed(np.stack(columns, axis=2))))
        A.append(in_band(row, row.A[..., identified]))
        r.append(in_band(row, row.r))
    both = [np.concatenate(row, axis=2) for row in zip(A, Z, strict=True)]
    if sum(row.size for row in r) < ENOUGH * both[0].shape[2]:
        return (), np.zeros(A[0].shape[2])
    spectrum = list(spectrum)
    for _ in range(NOISE_STEPS):
        flat_r, flat_both = stacked(r, spectrum), stacked(both, spectrum)
        size = np.linalg.norm(flat_both, axis=0) + np.finfo(float).tiny
        c = np.linalg.lstsq(flat_both / size, flat_r[:, 0], rcond=RANK)[0] / size
        rest = [row - matrix @ c for row, matrix in zip(r, both, strict=True)]
        spectrum, freedom = spectra(both, rest, spectrum)
    a, z = (
        np.concatenate([stacked(A, spectrum), priors[0]]),
        stacked(Z, spectrum),
    )
    z = np.concatenate([z, np.zeros((len(priors[1]), z.shape[1]))])
    left = np.concatenate([stacked(r, spectrum)[:, 0], priors[1]])
    return missing_terms(a, left, z, list(zip(names, units, words, strict=True)), freedom)


def missing_terms(
    A: np.ndarray,
    r: np.ndarray,
    Z: np.ndarray,
    about: Sequence[tuple[str, str, str]],
    freedom: float,
) -> tuple[tuple[MissingTerm, ...], np.ndarray]:
    """As `lack_of_fit`.

    Args: A: (rows, U), of what is fitted;  r: the residual;  Z: (rows, C), of the terms, all of the
          noise's size;  about: name, unit and words of each;  freedom: degrees of it that the
          noise's size was found with.
    """
    basis = np.linalg.qr(A)[0]
    left, rest = Z - basis @ (basis.T @ Z), r - basis @ (basis.T @ r)
    sizes = np.linalg.norm(Z, axis=0)
    least = float(student.isf(CHANCE / 2 / max(1, Z.shape[1]), freedom))
    chosen: list[int] = []
    while len(chosen) < MOST:
        length = np.linalg.norm(left, axis=0)
        apart = length > OWN * sizes
        test = np.where(apart, np.abs(left.T @ rest) / np.where(apart, length, 1.0), 0.0)
        best = int(np.argmax(test))
        if test[best] <= least:
            break
        chosen.append(best)
        unit = left[:, best] / length[best]
        rest = rest - unit * (unit @ rest)
        left = left - np.outer(unit, unit @ left)
    U = A.shape[1]
    if not chosen:
        return (), np.zeros(U)
    both = np.concatenate([A, Z[:, chosen]], axis=1)
    scale = np.linalg.norm(both, axis=0)
    inverse = np.linalg.pinv(both / scale) / scale[:, None]
    value, deviation = -inverse @ r, np.linalg.norm(inverse, axis=1)
    missing = [
        MissingTerm(about[c][0], float(value[U + i]), float(deviation[U + i]), *about[c][1:])
        for i, c in enumerate(chosen)
    ]
    return tuple(missing), value[:U]
