"""`identify`: numbers of a mechanism's file from logs of the machine. Check, fit, judge."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..accessors import extend
from ..errors import InputError, as_path, few
from ..mechanism import as_mechanism
from ..mechanism.mechanism import Mechanism
from ..model.model import derive
from .equations import Extras, LogEquations
from .fit_study import FitStudy
from .fitted_file import write_fitted
from .fitting import Fit, UnsettledFitError, fit
from .lack_of_fit import MissingTerm
from .log import Log, read_log
from .unknowns import ROUGH, Unknowns, changes

ORIGIN = "O_M"  # of the platform, for a load


@dataclass(frozen=True)
class Number:
    """A number after the fit. SI; deviation is NaN where the data do not tell it."""

    name: str
    unit: str
    value: float
    deviation: float
    before: float
    told: bool
    why: str = ""

    def line(self, wide: int) -> str:
        """In words. Args: wide: of the name."""
        said = f"+- {self.deviation:<8.2g} {self.unit}" if self.told else f"{self.unit} "
        why = "" if self.told else f"(not identified: {self.why})"
        return f"{self.name:{wide}}  {self.value:12.6g} {said}{why}".rstrip()

    @property
    def data(self) -> dict[str, Any]:
        """For programs."""
        return {
            "value": self.value,
            "deviation": self.deviation if self.told else None,
            "unit": self.unit,
            "before": self.before,
            "identified": self.told,
            **({"why": self.why} if self.why else {}),
        }


@dataclass(frozen=True)
class Judged:
    """How well equations hold on some of the logs.

    spread: mean square of the residual over what noise makes of it: 1 where nothing is missing.
    effort: root of the mean square of the residual as efforts, (n,) [N m or N].
    """

    spread: float
    effort: np.ndarray


@dataclass(frozen=True, eq=False)
class Identified:
    """What `identify` found.

    mechanism: with the numbers fitted;  numbers: one a number;  correlation: (U, U), of those
    told;  fitted, validated: residuals;  held: what the rules of the file hold at a border;
    logs, fit: what stands behind them.
    """

    mechanism: Mechanism
    numbers: tuple[Number, ...]
    correlation: np.ndarray
    fitted: Judged
    validated: Judged | None
    held: tuple[str, ...]
    chains: tuple[str, ...]
    logs: tuple[LogEquations, ...]
    fit: Fit
    source: Mechanism | str | os.PathLike[str]
    tried: str = ""

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the reader should know."""
        untold = [one.name for one in self.numbers if not one.told]
        found = [f"the logs cannot tell {few(untold)}: they stay as they were"] if untold else []
        found += [self.tried] if self.tried else []
        found += map(str, self.lack_of_fit)
        return (*found, *(f"held by the rules of the file: {one}" for one in self.held))

    @property
    def lack_of_fit(self) -> tuple[MissingTerm, ...]:
        """Terms that the residual follows and the model does not have; deviations are widened by
        what they could do to the numbers."""
        return self.fit.missing

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the mechanism's file with the fitted numbers, its comments kept.

        Raises: InputError: if it cannot be written.  MissingExtraError: without tomlkit.
        """
        units = {one.name: one.unit for one in self.unknowns.of_file()}
        read = ", ".join(dict.fromkeys(log.log.source for log in self.logs))
        told = sum(one.told for one in self.numbers)
        header = f"{told} of {len(self.numbers)} numbers identified from {read}"
        write_fitted(self.source, self.mechanism, units, path, header)

    def write_report(self, path: str | os.PathLike[str]) -> None:
        """Write a page with residuals over time and frequency, numbers and correlations.

        Raises: InputError: if it cannot be written.  MissingExtraError: without matplotlib.
        """
        extend("identified.report", self, path)

    @property
    def unknowns(self) -> Unknowns:
        return self.logs[0].unknowns

    def __str__(self) -> str:
        wide = max(len(one.name) for one in self.numbers)
        lines = [one.line(wide) for one in self.numbers]
        lines.append(f"residual over noise: fitted {np.sqrt(self.fitted.spread):.3g}")
        if self.validated is not None:
            lines[-1] += f", validated {np.sqrt(self.validated.spread):.3g}"
        return "\n".join([*lines, *(f"held by the rules of the file: {one}" for one in self.held)])

    @property
    def data(self) -> dict[str, Any]:
        """The same for programs."""
        numbers = {one.name: one.data for one in self.numbers}
        judged = {"fitted": self.fitted, "validated": self.validated}
        residuals = {
            name: {
                "over_noise": float(np.sqrt(one.spread)),
                "effort_rms": dict(zip(self.chains, map(float, one.effort), strict=True)),
            }
            for name, one in judged.items()
            if one is not None
        }
        return {
            "mechanism": self.mechanism.name,
            "numbers": numbers,
            "residuals": residuals,
            "lack_of_fit": {one.name: one.data for one in self.lack_of_fit},
            "held": list(self.held),
            "warnings": list(self.warnings),
        }


def identify(
    mechanism: Mechanism | str | os.PathLike[str],
    logs: Any,
    study: FitStudy | Mapping[str, Any] | str | os.PathLike[str],
    *,
    backend: str = "auto",
) -> Identified:
    """Numbers of a mechanism's file from logs of the machine.

    Weighted least squares of the equations of motion, which are linear in masses, moments and
    friction; every body is one that can be. Its covariance counts noise of efforts and of encoders,
    as smoothing leaves it. Numbers that the logs cannot tell stay as they are, and are named.

    Args:   mechanism: to start from;  logs: one file or several (CSV, Parquet): t, joint_<chain>
            or q, tau_<chain>, if any Fx .. Mz and contact_<contact>.
            study: what is unknown: see the guide on identification.
    Raises: InputError: for files that do not fit, or a fit that does not settle.
    """
    machine = as_mechanism(mechanism)
    asked = FitStudy.read(study)
    rough = _coefficients(machine, asked.numbers)
    # With a coefficient of 1 where it is unknown: columns are by it.
    unit = machine._set(dict.fromkeys(rough, 1.0), "all") if rough else machine
    model = derive(unit, backend=backend, distribution="minimum_norm")
    options = asked.options
    files = [logs] if not isinstance(logs, list | tuple) else list(logs)
    if not files:
        raise InputError("logs: expected one file or several, got none")
    files = [as_path(one, "logs", "the path of a log, or several") for one in files]
    read = [read_log(model, path, options.smooth, options.trim, options.robust) for path in files]
    unknowns = Unknowns(model.regression.standard, asked, rough)
    share = options.validate_
    kept: list[Log] = []
    apart: list[Log] = []
    if isinstance(share, str):
        kept, apart = read, [read_log(model, share, options.smooth, options.trim, options.robust)]
    else:
        kept = [log.part(0.0, 1.0 - share) for log in read]
        apart = [log.part(1.0 - share, 1.0) for log in read] if share else []
    noise = asked.noise.effort, asked.noise.encoder
    point = _load_point(machine, options.load_point, read)

    def equations(some: Sequence[Log], extras: Extras) -> list[LogEquations]:
        return [LogEquations(model, log, unknowns, extras, noise, point) for log in some]

    def fitted(extras: Extras) -> tuple[list[tuple[str, str]], list[LogEquations], Fit]:
        own = extras.names(machine)
        on = equations(kept, extras)
        return own, on, fit(on, unknowns, [one.name for one in unknowns.all] + [n for n, _ in own])

    extras, tried = Extras(options.bias, options.delay, options.gain), ""
    try:
        own, on, found = fitted(extras)
    except UnsettledFitError:
        if options.delay:
            raise
        extras = replace(extras, delay=True)
        own, on, found = fitted(extras)
        late = found.x[-1] * 1e3
        tried = f"the fit settles only with a delay, {late:.3g} ms: set delay = true in [options]"
    names = [one.name for one in unknowns.all] + [name for name, _ in own]
    units = [one.unit for one in unknowns.all] + [unit for _, unit in own]
    U = len(unknowns.all)
    before = np.concatenate([unknowns.nominal, np.zeros(len(own))])
    numbers = []
    for i, name in enumerate(names):
        told = bool(found.told[i])
        deviation = float(np.sqrt(found.covariance[i, i])) if told else float("nan")
        numbers.append(
            Number(
                name,
                units[i],
                float(found.x[i]),
                deviation,
                float(before[i]),
                told,
                found.why.get(i, ""),
            )
        )
    validated = None
    if apart:
        rows = [one.rows(found.x[:U], found.x[U:]) for one in equations(apart, extras)]
        validated = _judged(rows)
    deviations = np.sqrt(np.diag(found.covariance))
    safe = np.where(deviations > 0, deviations, 1.0)
    return Identified(
        machine._set(changes(unknowns, found.x[:U]), "all"),
        tuple(numbers),
        found.covariance / np.outer(safe, safe),
        _judged(found.rows),
        validated,
        found.held,
        machine.chain_names,
        tuple(on),
        found,
        mechanism,
        tried,
    )


def _coefficients(machine: Mechanism, numbers: Sequence[str]) -> dict[str, float]:
    """Coefficients of friction at contacts that are unknown, by path, as in the file."""
    found = {}
    for contact in machine.contacts:
        if {f"contact.{name}.{ROUGH}" for name in (contact.name, "*")} & {*numbers}:
            found[f"contact.{contact.name}.{ROUGH}"] = contact.friction.coefficient
    return found


def _judged(rows: Sequence[Any]) -> Judged:
    squares = [
        np.einsum("tr,tr->t", one.r, np.linalg.solve(one.V, one.r[..., None])[..., 0])
        for one in rows
    ]
    count = sum(one.r.size for one in rows)
    effort = np.concatenate([one.effort for one in rows])
    return Judged(float(sum(s.sum() for s in squares) / count), np.sqrt((effort**2).mean(axis=0)))


def _load_point(machine: Mechanism, asked: str | None, logs: Sequence[Log]) -> str | None:
    """Where the load acts, if there is one."""
    if asked is None and not any(log.wrench.any() for log in logs):
        return None
    if asked == ORIGIN:
        return None
    name = asked or "right_molar"
    if name not in machine.platform.points:
        raise InputError(
            f'load_point: the logs have a load, and the mechanism no point "{name}"; give one of '
            f"{few([*machine.platform.points, ORIGIN])} in [options]"
        )
    return name
