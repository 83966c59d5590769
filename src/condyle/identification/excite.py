"""`excite`: the periodic path that tells most about some numbers, as far as the machine can go.

Fourier series of q, whose coefficients maximise the logarithm of the determinant of the
information: rows of the equations as noise of the efforts weighs them. What limits the machine is
a penalty; in the end the path is drawn in until all is kept. All gradients are exact: reverse
through the regressor, the contacts and the results that are limited.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from .. import progress
from ..backends.choose import BackendName
from ..backends.kernel import Kernel
from ..errors import InputError
from ..files.limits import HARMONICS, sample_count
from ..mechanism import as_mechanism
from ..mechanism.chain import limits
from ..mechanism.mechanism import Mechanism
from ..mechanism.study_file import BelowOne, Count, Positive, Seed, Share, StudyFile, require_known
from ..model.model import Model, derive
from ..motion import Motion
from ..results.study_answer import StudyAnswer, named_lines
from .equations import Extras, LogEquations
from .fit_study import FitStudy, Noise
from .fitting import predicted_covariance
from .log import make_log
from .unknowns import Unknowns

OF_PLATFORM = ("platform.mass", "platform.com", "platform.inertia")
OF_DRIVES = ("chain.*.actuator.viscous", "chain.*.actuator.coulomb")
POSES = ("pose", "pose_rate", "pose_acceleration")
STATES = ("q", "q1", "q2")
SAMPLES = 16  # of the period, to a harmonic
FIRST = 0.02  # amplitude of a start, in characteristic lengths or radians
PENALTIES = (1e2, 1e3, 1e4)
OUTSIDE = 1e6  # the cost where the machine cannot be
DRAWN_IN = 0.98  # amplitudes at a time
PERIODS = 3  # on which the deviations are judged


class ExcitationStudy(StudyFile):
    """What a path is to tell, and how far the machine may go."""

    numbers: tuple[str, ...] = Field(
        default=(),
        min_length=1,
        description="unknown numbers by path; default: the platform's, and friction",
    )
    wanted: dict[str, Positive] = Field(
        default={}, description="number -> standard deviation that is wanted"
    )
    noise: Noise = Noise()
    period: Positive = Field(default=5.0, description="[s]")
    harmonics: Annotated[int, Field(strict=True, ge=1, le=HARMONICS.most)] = Field(
        default=5, description="of the Fourier series"
    )
    rate: Positive = Field(default=1000.0, description="samples a second of the log [Hz]")
    smooth: Positive = Field(default=10.0, description="cut-off of the identification [Hz]")
    margin: Share = Field(
        default=0.9,
        description="share of limits of efforts and speeds that is used; least efforts stay",
    )
    singularity: BelowOne = Field(default=0.02, description="least singularity ratio")
    contact_force: Positive | None = Field(
        default=None, description="largest force of a contact [N]; default: none"
    )
    starts: Count = Field(default=2, description="random starts")
    steps: Count = Field(default=120, description="of the search, for each of three penalties")
    seed: Seed = 1


@dataclass(frozen=True, eq=False)
class Excitation(StudyAnswer):
    """A path, and what a log of it tells.

    motion: one period;  deviations: name -> standard deviation after one period;
    repetitions: of the period until all that is wanted is reached, 1 if nothing is;
    closest: limit -> the largest share of it that is used.
    """

    kind = "excitation"
    motion: Motion
    deviations: dict[str, float]
    repetitions: int
    closest: dict[str, float]
    wanted: dict[str, float]

    def __str__(self) -> str:
        lines = named_lines({name: f"+- {size:.2g}" for name, size in self.deviations.items()})
        used = ", ".join(f"{name} {share:.0%}" for name, share in self.closest.items())
        lines.append(f"deviations after one period; uses of its limits: {used or 'none'}")
        if self.wanted:
            lines.append(f"{self.repetitions} repetitions reach the wanted deviations")
        return "\n".join(lines)

    @property
    def data(self) -> dict[str, Any]:
        return {
            "deviations": self.deviations,
            "repetitions": self.repetitions,
            "limits": self.closest,
            "period": float(self.motion.t[-1]),
        }


def excite(
    mechanism: Mechanism | str | os.PathLike[str],
    study: ExcitationStudy | Mapping[str, Any] | str | os.PathLike[str] | None = None,
    *,
    backend: BackendName = "auto",
) -> Excitation:
    """The periodic path that tells most about some numbers of the file.

    Within reach, bounds of contacts, limits of speed and effort and a margin to singularities.

    Args:   study: an excitation study (TOML), or its tables: numbers, noise, period, limits.
            Default: the platform's numbers, and friction of the actuators.
    Raises: InputError: where a study does not fit, or the machine cannot move from home.
    """
    machine = as_mechanism(mechanism)
    checked = ExcitationStudy.read({} if study is None else study)
    model = derive(machine, backend=backend, distribution="minimum_norm")
    names = checked.numbers or (*OF_PLATFORM, *OF_DRIVES)
    path = _Path(model, checked, names)
    require_known(checked.wanted, [one.name for one in path.unknowns.all], "wanted")
    if not checked.smooth < checked.rate / 2:
        raise InputError(
            f"smooth: expected a cut-off below half the rate, {checked.rate / 2:g} Hz, got "
            f"{checked.smooth:g}"
        )
    rng = np.random.default_rng(checked.seed)
    best: np.ndarray | None = None
    with progress.step("looking for a path", checked.starts) as advance:
        for _ in range(checked.starts):
            found = path.drawn_in(path.best_from(rng))
            if found is not None and (best is None or path.worth(found) > path.worth(best)):
                best = found
            advance(1)
    if best is None:
        raise InputError(
            "no path within the limits was found: the machine can hardly move from home; lower "
            "singularity, or raise period"
        )
    deviations = path.deviations(best)
    ratios = [(deviations[name] / size) ** 2 for name, size in checked.wanted.items()]
    repetitions = int(np.ceil(max(ratios, default=1.0)))
    return Excitation(
        path.motion(best), deviations, max(1, repetitions), path.closest(best), dict(checked.wanted)
    )


class _Path:
    """A Fourier series of q, (m, 2 K + 1) coefficients: what it tells and what it takes."""

    def __init__(self, model: Model, spec: ExcitationStudy, names: tuple[str, ...]) -> None:
        self.model, self.spec = model, spec
        study = FitStudy.checked({"numbers": list(names), "noise": spec.noise.entries()}, "study")
        self.unknowns = Unknowns(model.regression.standard, study)
        x = self.unknowns.nominal
        sizes = np.abs(x)
        sizes[sizes == 0] = np.max(sizes[sizes > 0], initial=1e-3)
        self.slope = self.unknowns.slope(x) * sizes
        self.n, self.m = len(model.mechanism.chains), len(model.independent)
        sample_count(PERIODS * spec.period, spec.rate)  # of the log
        count = SAMPLES * spec.harmonics
        self.t = np.arange(count) * spec.period / count
        self.basis = [self._basis(self.t, nu) for nu in range(3)]
        own = [limits(chain).part(spec.margin) for chain in model.mechanism.chains]
        self.low, self.high, self.speed = np.array(own).T

    def _basis(self, t: np.ndarray, nu: int) -> np.ndarray:
        """Values or derivatives of 1, cos, sin, .. at times, (N, 2 K + 1)."""
        w = 2 * np.pi / self.spec.period
        columns = [np.full(len(t), float(nu == 0))]
        for k in range(1, self.spec.harmonics + 1):
            for shift in (0.0, -np.pi / 2):
                columns.append((k * w) ** nu * np.cos(k * w * t + shift + nu * np.pi / 2))
        return np.column_stack(columns)

    @cached_property
    def _scale(self) -> np.ndarray:
        """The scale of coordinates: characteristic length, or a radian, (m,)."""
        length = self.model.characteristic_length
        return np.array([length if n in ("X", "Y", "Z") else 1.0 for n in self.model.independent])

    # -- the search --------------------------------------------------------------------------

    def best_from(self, rng: np.random.Generator) -> np.ndarray:
        """Coefficients, (m, 2 K + 1), from a random start."""
        from scipy.optimize import minimize

        shape = self.m, self.basis[0].shape[1]
        falling = np.array([0.0, *(1 / k for k in range(1, shape[1] // 2 + 1) for _ in "cs")])
        c = FIRST * rng.normal(size=shape) * falling
        for penalty in PENALTIES:

            def cost(flat: np.ndarray, penalty: float = penalty) -> tuple[float, np.ndarray]:
                return self._cost(flat.reshape(shape), penalty)

            options = {"maxiter": self.spec.steps}
            found = minimize(  # type: ignore[call-overload]  # arrays are what it takes
                cost, c.ravel(), jac=True, method="L-BFGS-B", options=options
            )
            c = found.x.reshape(shape)
        return c * self._scale[:, None]

    def _cost(self, c: np.ndarray, penalty: float) -> tuple[float, np.ndarray]:
        """Less the worth, and the limits' penalty, with the gradient by scaled coefficients."""
        c = c * self._scale[:, None]
        states = [basis @ c.T for basis in self.basis]
        worth = self._information(states)
        if worth is None:
            return OUTSIDE, np.zeros(c.size)
        value, slopes = worth
        over, of_over = self._over(states)
        if not np.isfinite(over):
            return OUTSIDE, np.zeros(c.size)
        grad = sum(
            (penalty * o - s).T @ basis
            for o, s, basis in zip(of_over, slopes, self.basis, strict=True)
        )
        return penalty * over - value, (grad * self._scale[:, None]).ravel()

    def _kernels(self) -> tuple[Kernel, Kernel]:
        """Reverse through the regressor, and through the contacts."""
        wide = self.model.system.unreduced
        rows = ("platform", "row", *(f"chain_{g}" for g in range(len(wide.structure.chains))))
        return (
            wide.derivative("gradient", "regressor", POSES, rows),
            self.model.system.derivative("gradient", "motion", STATES, POSES),
        )

    def _information(self, states: list[np.ndarray]) -> tuple[float, list[np.ndarray]] | None:
        """log det (F + 1) and its slopes by q, q', q''; None where the machine cannot be."""
        found = self.model.regressor(*states)
        if found.status.any():
            return None
        Y, J = found.Y @ self.slope, found.J
        noise = self.spec.noise.effort or 0.01
        V = J.swapaxes(1, 2) @ J * noise**2
        W = np.linalg.inv(V) * (self.spec.rate * self.spec.period / len(self.t))
        WY = W @ Y
        F = np.einsum("tmu,tmw->uw", Y, WY) + np.eye(Y.shape[2])
        sign, value = np.linalg.slogdet(F)
        if sign <= 0 or not np.isfinite(value):
            return None
        C = np.linalg.inv(F)
        by_Y = 2 * WY @ C @ self.slope.T
        share = self.spec.rate * self.spec.period / len(self.t)
        by_J = -2 * noise**2 / share * J @ (WY @ C @ WY.swapaxes(1, 2))
        return float(value), self._pulled(states, by_Y, by_J)

    def _pulled(
        self, states: list[np.ndarray], by_Y: np.ndarray, by_J: np.ndarray
    ) -> list[np.ndarray]:
        """Slopes by q, q', q'' from those by the regressor and the rows."""
        on_Y, on_motion = self._kernels()
        motion = dict(zip(STATES, states, strict=True))
        poses = self.model.poses.platform_motion(*states)[0]
        still = dict.fromkeys(("force", "moment", "point"), np.zeros((1, 3)))
        weights = {f"w_{name}": a for name, a in self.model.regression.split(by_Y, by_J).items()}
        back = on_Y.run(poses | still | weights).values
        down = {f"w_{name}": back[f"g_{name}"].T for name in POSES}
        found = on_motion.run(motion | down).values
        return [found[f"g_{name}"].T for name in STATES]

    # -- limits ------------------------------------------------------------------------------

    def _used(self, states: list[np.ndarray]) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
        """Shares of the limits that are used, by name, and slopes of each by its result."""
        model, study = self.model, self.spec
        solution = model.inverse_dynamics(*states, outputs=("configuration",))
        at = solution.configuration
        shares: dict[str, np.ndarray] = {}
        slopes: dict[str, Any] = {}

        def add(name: str, of: str, value: np.ndarray, size: Any) -> None:
            size = np.broadcast_to(size, value.shape)
            finite = np.isfinite(size) & (size != 0)
            if finite.any():
                one = np.where(finite, 1 / np.where(finite, size, 1.0), 0.0)
                shares[name], slopes[name] = value * one, (of, one)

        high = np.where(solution.effort >= 0, self.high, self.low)
        add("effort", "effort", solution.effort, high)
        rate = self._rate(np.unwrap(at.joint, axis=0))
        add("speed", "joint", rate, np.sign(rate) * self.speed)
        if study.contact_force is not None:
            force = solution.contact_force
            add("contact force", "contact_force", force, np.sign(force) * study.contact_force)
        ratio = at.singularity.ratio
        if study.singularity:
            # margin / ratio <= 1
            shares["singularity"] = study.singularity / ratio
            slopes["singularity"] = ("singularity_ratio", -study.singularity / ratio**2)
        for i, contact in enumerate(model.mechanism.contacts):
            for axis, key in enumerate("xy"):
                ends = getattr(contact.bounds, key, None) if contact.bounds else None
                if ends is None:
                    continue
                middle, half = np.mean(ends), np.ptp(ends) / 2 * study.margin
                value = (at.contact_point[:, i, axis] - middle) / half
                name = f"bounds of {contact.name} in {key}"
                shares[name] = np.abs(value)
                slopes[name] = ("contact_point", (i, axis, np.sign(value) / half))
        return shares, slopes

    def _rate(self, values: np.ndarray) -> np.ndarray:
        """d/dt of periodic samples, (N, ..); its transpose is its negative."""
        k = 2j * np.pi * np.fft.rfftfreq(len(values), self.spec.period / len(values))
        if len(values) % 2 == 0:
            k[-1] = 0.0
        return np.fft.irfft(k[:, None] * np.fft.rfft(values, axis=0), n=len(values), axis=0)

    def _over(self, states: list[np.ndarray]) -> tuple[float, list[np.ndarray]]:
        """Sum of squares of what goes beyond the limits, and its slopes by q, q', q''."""
        shares, slopes = self._used(states)
        cotangents: dict[str, np.ndarray] = {}
        total = 0.0
        for name, share in shares.items():
            beyond = np.maximum(share - 1.0, 0.0)
            total += float((beyond**2).sum())
            of, slope = slopes[name]
            if not beyond.any():
                continue
            if of == "contact_point":
                i, axis, sign = slope
                weight = np.zeros((len(self.t), len(self.model.mechanism.contacts), 3))
                weight[:, i, axis] = 2 * beyond * sign
            elif of == "joint":
                weight = -self._rate(2 * beyond * slope)
            else:
                weight = 2 * beyond * slope
            cotangents[of] = cotangents.get(of, 0.0) + weight
        derivatives = [np.zeros((len(self.t), self.m)) for _ in range(3)]
        q, v, a = states
        for of, weight in cotangents.items():
            wrt = ("q", "v", "a") if of in ("effort", "contact_force") else ("q",)
            moving = len(wrt) > 1
            d = self.model.vjp(
                of, weight, wrt, q=q, v=v if moving else None, a=a if moving else None
            )
            for i, name in enumerate(wrt):
                derivatives[i] += np.nan_to_num(d[name])
        return total, derivatives

    # -- the path ----------------------------------------------------------------------------

    def drawn_in(self, c: np.ndarray) -> np.ndarray | None:
        """The path with amplitudes lowered until all limits are kept; None if none keeps them."""
        fine = np.linspace(0, self.spec.period, 4 * len(self.t), endpoint=False)
        basis = [self._basis(fine, nu) for nu in range(3)]
        middle, swing = c * (np.arange(c.shape[1]) == 0), c * (np.arange(c.shape[1]) > 0)
        share = 1.0
        while share > 0.05:
            own = middle + share * swing
            states = [b @ own.T for b in basis]
            found = self.model.inverse_dynamics(*states)
            if not found.status.any():
                kept, self.t = self.t, fine
                shares = self._used(states)[0]
                self.t = kept
                if all((s <= 1 + 1e-9).all() for s in shares.values()):
                    return own
            share *= DRAWN_IN
            middle = middle * DRAWN_IN
        return None

    def worth(self, c: np.ndarray) -> float:
        found = self._information([basis @ c.T for basis in self.basis])
        return -np.inf if found is None else found[0]

    def closest(self, c: np.ndarray) -> dict[str, float]:
        shares = self._used([basis @ c.T for basis in self.basis])[0]
        return {name: float(np.max(share)) for name, share in shares.items()}

    def motion(self, c: np.ndarray) -> Motion:
        """One period, closed."""
        count = round(self.spec.period * self.spec.rate)
        t = np.linspace(0.0, self.spec.period, count + 1)
        q = self._basis(t, 0) @ c.T
        return Motion.from_arrays(t, q, self.model.independent, source="excitation")

    def deviations(self, c: np.ndarray) -> dict[str, float]:
        """Standard deviations after one period, by the identification's own covariance."""
        study, model = self.spec, self.model
        t = np.arange(0.0, PERIODS * study.period, 1 / study.rate)
        states = [self._basis(t, nu) @ c.T for nu in range(3)]
        effort = model.inverse_dynamics(*states).effort
        joint = model.inverse_kinematics(states[0]).joint + model.mechanism.zeros
        own = effort, np.zeros((len(t), 6)), None, True
        log = make_log(model, t, joint, *own, study.smooth, 1.5 / study.smooth, "excitation")
        noise = study.noise.effort or 0.01, study.noise.encoder or 1e-9
        equations = LogEquations(model, log, self.unknowns, Extras(), noise, None)
        x = self.unknowns.nominal
        rows = equations.rows(x, np.zeros(0))
        identified = np.ones(len(x), dtype=bool)
        C = predicted_covariance([equations], [rows], x, identified, np.full(len(x), np.inf))
        periods = (log.equation_times[-1] - log.equation_times[0]) / study.period
        sizes = np.sqrt(np.diag(C) * periods)
        return {one.name: float(s) for one, s in zip(self.unknowns.all, sizes, strict=True)}
