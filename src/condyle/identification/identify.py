"""`identify`: numbers of a mechanism's file from logs of the machine. Check, fit, judge."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..backends.choose import BackendName
from ..errors import InputError, as_path, join
from ..mechanism import as_mechanism
from ..mechanism.mechanism import Mechanism
from ..model.model import derive
from ..motion import with_load_point
from .equations import Extras, LogEquations
from .fit_study import FitStudy
from .fitted_file import FittedNumbers, fitted_numbers
from .fitting import Fit, UnsettledFitError, fit
from .lack_of_fit import MissingTerm
from .log import Log, read_log
from .unknowns import ROUGH, Unknowns, changes

ORIGIN = "O_M"  # of the platform, for a load


@dataclass(frozen=True)
class Judged:
    """How well equations hold on some of the logs.

    spread: mean square of the residual over what noise makes of it: 1 where nothing is missing.
    effort: root of the mean square of the residual as efforts, (n,) [N m or N].
    """

    spread: float
    effort: np.ndarray


@dataclass(frozen=True, eq=False)
class Identified(FittedNumbers):
    """What `identify` found.

    correlation: (U, U), of those told;  fitted, validated: residuals;
    held: what the rules of the file hold at a border;  logs, fit: what stands behind them.
    """

    kind = "fit"
    correlation: np.ndarray
    fitted: Judged
    validated: Judged | None
    held: tuple[str, ...]
    chains: tuple[str, ...]
    logs: tuple[LogEquations, ...]
    fit: Fit
    tried: str = ""

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the reader should know."""
        untold = self.untold
        found = [f"the logs do not identify {untold}: they keep their values"] if untold else []
        found += [self.tried] if self.tried else []
        found += dict.fromkeys(note for log in self.logs for note in log.log.notes)
        return (*found, *map(str, self.lack_of_fit), *self._held)

    @property
    def _held(self) -> list[str]:
        return [f"held by the rules of the file: {one}" for one in self.held]

    @property
    def lack_of_fit(self) -> tuple[MissingTerm, ...]:
        """Terms that the residual follows and the model does not have; deviations are widened by
        what they could do to the numbers."""
        return self.fit.missing

    @property
    def units(self) -> dict[str, str]:
        return {one.name: one.unit for one in self.unknowns.of_file()}

    @property
    def header(self) -> str:
        read = ", ".join(dict.fromkeys(log.log.source for log in self.logs))
        identified = sum(one.identified for one in self.numbers)
        return f"{identified} of {len(self.numbers)} numbers identified from {read}"

    @property
    def unknowns(self) -> Unknowns:
        return self.logs[0].unknowns

    @property
    def judged(self) -> dict[str, Judged]:
        """Residuals by what they are of."""
        both = {"fitted": self.fitted, "validated": self.validated}
        return {name: one for name, one in both.items() if one is not None}

    def __str__(self) -> str:
        said = ", ".join(f"{n} {np.sqrt(one.spread):.3g}" for n, one in self.judged.items())
        return "\n".join([*self.number_lines, f"residual over noise: {said}", *self._held])

    @property
    def data(self) -> dict[str, Any]:
        residuals = {
            name: {
                "over_noise": float(np.sqrt(judgement.spread)),
                "effort_rms": dict(zip(self.chains, map(float, judgement.effort), strict=True)),
            }
            for name, judgement in self.judged.items()
        }
        lack = {test.name: test.data for test in self.lack_of_fit}
        return super().data | {
            "residuals": residuals,
            "lack_of_fit": lack,
            "held": list(self.held),
        }


def identify(
    mechanism: Mechanism | str | os.PathLike[str],
    logs: Any,
    study: FitStudy | Mapping[str, Any] | str | os.PathLike[str],
    *,
    backend: BackendName = "auto",
) -> Identified:
    """Numbers of a mechanism's file from logs of the machine.

    Weighted least squares of the equations of motion, which are linear in masses, moments and
    friction; every body is one that can be. Its covariance counts noise of efforts and of encoders,
    as smoothing leaves it. Parameters that the logs do not identify keep their values, and are
    named.

    Args:   mechanism: to start from;  logs: one file or several (CSV, Parquet): t, joint_<chain>
            or q, tau_<chain>, if any Fx .. Mz and contact_<contact>.
            study: a fit study (TOML), or its tables: unknown numbers, what is known, the noise.
    Raises: InputError: for files that do not fit, or a fit that does not converge.
    """
    checked = FitStudy.read(study)
    plain = as_mechanism(mechanism)
    machine, at = with_load_point(plain, checked.options.load_point)
    rough = _coefficients(machine, checked.numbers)
    # With a coefficient of 1 where it is unknown: columns are by it.
    unit = machine._set(dict.fromkeys(rough, 1.0), "all") if rough else machine
    model = derive(unit, backend=backend, distribution="minimum_norm")
    options = checked.options
    files = [logs] if not isinstance(logs, list | tuple) else list(logs)
    if not files:
        raise InputError("logs: expected one file or several, got none")
    files = [as_path(item, "logs", "the path of a log, or several") for item in files]
    if double := [item for item in files if files.count(item) > 1]:
        raise InputError(f"logs: {double[0]} is given twice, and would count as two logs")
    read = [read_log(model, path, options.smooth, options.trim, options.robust) for path in files]
    unknowns = Unknowns(model.regression.standard, checked, rough)
    share = options.validate_
    used: list[Log] = []
    apart: list[Log] = []
    if isinstance(share, str):
        used, apart = read, [read_log(model, share, options.smooth, options.trim, options.robust)]
    else:
        used = [log.part(0.0, 1.0 - share) for log in read]
        apart = [log.part(1.0 - share, 1.0) for log in read] if share else []
    noise = checked.noise.effort, checked.noise.encoder
    point = _load_point(machine, at, read)

    def equations(some: Sequence[Log], extras: Extras) -> list[LogEquations]:
        return [LogEquations(model, log, unknowns, extras, noise, point) for log in some]

    def fitted(extras: Extras) -> tuple[list[tuple[str, str]], list[LogEquations], Fit]:
        own = extras.names(machine)
        on = equations(used, extras)
        return (
            own,
            on,
            fit(on, unknowns, [item.name for item in unknowns.all] + [n for n, _ in own]),
        )

    extras, tried = Extras(options.bias, options.delay, options.gain), ""
    try:
        own, on, best = fitted(extras)
    except UnsettledFitError:
        if options.delay:
            raise
        extras = replace(extras, delay=True)
        own, on, best = fitted(extras)
        late = best.x[-1] * 1e3
        tried = f"the fit settles only with a delay, {late:.3g} ms: set delay = true in [options]"
    about = [(item.name, item.unit) for item in unknowns.all] + own
    U = len(unknowns.all)
    before = np.concatenate([unknowns.nominal, np.zeros(len(own))])
    validated = None
    if apart:
        rows = [item.rows(best.x[:U], best.x[U:]) for item in equations(apart, extras)]
        validated = _judged(rows)
    deviations = np.sqrt(np.diag(best.covariance))
    safe = np.where(deviations > 0, deviations, 1.0)
    return Identified(
        plain._set(changes(unknowns, best.x[:U]), "all"),
        fitted_numbers(about, best.x, best.covariance, before, best.identified.tolist(), best.why),
        mechanism,
        best.covariance / np.outer(safe, safe),
        _judged(best.rows),
        validated,
        best.held,
        machine.chain_names,
        tuple(on),
        best,
        tried,
    )


def _coefficients(machine: Mechanism, numbers: Sequence[str]) -> dict[str, float]:
    """Coefficients of friction at contacts that are unknown, by path, as in the file."""
    coefficients = {}
    for contact in machine.contacts:
        if {f"contact.{name}.{ROUGH}" for name in (contact.name, "*")} & {*numbers}:
            coefficients[f"contact.{contact.name}.{ROUGH}"] = contact.friction.coefficient
    return coefficients


def _judged(rows: Sequence[Any]) -> Judged:
    squares = [
        np.einsum("tr,tr->t", row.r, np.linalg.solve(row.V, row.r[..., None])[..., 0])
        for row in rows
    ]
    count = sum(row.r.size for row in rows)
    effort = np.concatenate([row.effort for row in rows])
    return Judged(float(sum(s.sum() for s in squares) / count), np.sqrt((effort**2).mean(axis=0)))


def _load_point(machine: Mechanism, wanted: str | None, logs: Sequence[Log]) -> str | None:
    """Where the load acts, if there is one."""
    if wanted is None and not any(log.wrench.any() for log in logs):
        return None
    if wanted == ORIGIN:
        return None
    name = wanted or "right_molar"
    if name not in machine.platform.points:
        raise InputError(
            f'load_point: the logs have a load, and the mechanism no point "{name}"; give one of '
            f"{join([*machine.platform.points, ORIGIN])} in [options]"
        )
    return name
