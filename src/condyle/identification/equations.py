"""The equations of a log, linear in the unknown numbers about where they stand, with their noise.

    r(x) = Y(q, q', q'') pi(x) + load - J^T (effort - bias),

smoothed as the states are. Noise of efforts comes through J^T; noise of encoders through the
derivatives of r by q, q' and q'', each of which smoothing has given its own spectrum.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.integrate import cumulative_trapezoid

from ..errors import InputError
from ..kinematics.chain import FAMILIES
from ..mechanism.mechanism import Mechanism
from ..model.model import Model
from ..model.regressor import Regressor
from ..motion.gravity_and_base import each
from .log import Log
from .unknowns import Unknowns

STEP = 1e-6  # of central differences, over the size of a state
FRICTION_STEPS = 30  # at most, to the contact forces under friction
CHANNEL = "channel"  # of a delay: one for each effort
CORRECTED = 400  # times at which the regressors' own noise is counted


@dataclass(frozen=True)
class Extras:
    """What is unknown beside numbers of the file: of each effort a constant and a gain, and delays,
    one for all or one for each."""

    bias: bool = False
    delay: bool | str = False
    gain: bool = False

    def names(self, mechanism: Mechanism) -> list[tuple[str, str]]:
        """Names and units, in the order of x."""
        units = {chain.name: FAMILIES[chain.kind].effort_unit for chain in mechanism.chains}
        entries = [(f"bias.{name}", unit) for name, unit in units.items()] if self.bias else []
        entries += [(f"gain.{name}", "") for name in units] if self.gain else []
        if self.delay == CHANNEL:
            return [*entries, *((f"delay.{name}", "s") for name in units)]
        return [*entries, ("delay", "s")] if self.delay else entries

    def of(self, extra: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Constants, gains over 1 and delays of the efforts, (n,) each."""
        place, parts = 0, []
        for there in (self.bias, self.gain):
            parts.append(extra[place : place + n] if there else np.zeros(n))
            place += n * there
        delay = extra[place:] if self.delay else np.zeros(1)
        return parts[0], parts[1], np.broadcast_to(delay, n)


@dataclass(frozen=True)
class EquationRows:
    """Equations at K times of a log, about some x.

    A: (K, rows, U);  r: (K, rows), A dx + r is the residual at x + dx;  V: (K, rows, rows),
    covariance of r;  effort: (K, n), the residual as efforts, of least norm.
    """

    A: np.ndarray
    r: np.ndarray
    V: np.ndarray
    effort: np.ndarray


class LogEquations:
    """A log's equations, on a model that gives the regressor."""

    def __init__(
        self,
        model: Model,
        log: Log,
        unknowns: Unknowns,
        extras: Extras,
        noise: tuple[float | None, float | None],
        point: str | None,
    ) -> None:
        self.model: Model = model
        self.log: Log = log
        self.unknowns: Unknowns = unknowns
        self.extras: Extras = extras
        self.point = point
        self._at = model.regressor(log.q, log.v, log.a, log.wrench, point, **log.given)
        if (bad := np.flatnonzero(self._at.status)).size:
            raise InputError(f"{log.source}: the pose at {log.t[bad[0]]:.6g} s cannot be reached")
        effort, encoder = noise
        root = np.sqrt(log.averaged)
        n = log.effort.shape[1]
        self.effort_noise: np.ndarray = (
            log.noise[0] if effort is None else np.full(n, effort / root)
        )
        self.encoder_noise: np.ndarray = (
            log.noise[1] if encoder is None else np.full(n, encoder / root)
        )
        if not log.encoders:
            self.encoder_noise = np.zeros(n)
        J = self._at.J
        # q is the least squares of the joints: what their noise makes of it, (N, m, n).
        self._to_q = np.linalg.solve(J.swapaxes(1, 2) @ J, J.swapaxes(1, 2))

    # -- the equations -----------------------------------------------------------------------

    def rows(self, x: np.ndarray, extra: np.ndarray) -> EquationRows:
        """The equations about unknowns x, (U,), and the extras."""
        log, at = self.log, self._at
        effort = self._effort(extra)
        by, more = self.by_effort, []
        bias, gain, _ = self.extras.of(extra, at.J.shape[1])
        if self.extras.bias:
            more.append(-by)
        if self.extras.gain:
            more.append(-by * ((self.predicted(x, extra) + bias) / (1 + gain))[:, None])
        if self.extras.delay:
            rate = by * (log.effort_spline(log.t, 1) / (1 + gain))[:, None]
            one = self.extras.delay == CHANNEL
            more.append(rate if one else rate.sum(axis=2, keepdims=True))
        r, force = self._left(at, x, effort)
        A = self._columns(at, x, force, [*more, by])
        m, n = at.J.shape[2], at.J.shape[1]
        if log.contact is not None:
            r[:, m:] -= log.contact
        A, r, J = log.smoothed(A), log.smoothed(r), log.smoothed(at.J)
        least = J @ np.linalg.solve(J.swapaxes(1, 2) @ J, r[:, :m, None])
        return EquationRows(A[..., :-n], r, self._covariance(x, A[..., -n:]), least[..., 0])

    @property
    def _contacts(self) -> tuple[str, ...]:
        return self.model.mechanism.contact_names

    @property
    def by_effort(self) -> np.ndarray:
        """Slopes by efforts of what is left and of contact forces, as if without friction there,
        (N, m + k, n)."""
        return -np.concatenate([self._at.J.swapaxes(1, 2), self._at.contact_J], axis=1)

    def predicted(self, x: np.ndarray, extra: np.ndarray) -> np.ndarray:
        """Efforts that balance, nearest to the measured ones, (N, n): without the noise that the
        residual has, with which a gain would otherwise be found that is none."""
        J, effort = self._at.J, self._effort(extra)
        left = self._left(self._at, x, effort)[0][:, : J.shape[2], None]
        return np.asarray(effort + (J @ np.linalg.solve(J.swapaxes(1, 2) @ J, left))[..., 0])

    @cached_property
    def joint_motion(self) -> np.ndarray:
        """Places about their mean, rates and accelerations of the joints, (3, N, n)."""
        t = self.log.t
        rate = np.einsum("tnm,tm->tn", self._at.J, self.log.v)
        place = cumulative_trapezoid(rate, t, axis=0, initial=0)
        return np.stack([place - place.mean(axis=0), rate, np.gradient(rate, t, axis=0)])

    def _effort(self, extra: np.ndarray) -> np.ndarray:
        """The efforts, (N, n), without bias, at the times of the encoders and their own gain."""
        log = self.log
        bias, gain, delay = self.extras.of(extra, log.effort.shape[1])
        effort = log.effort
        if delay.any():
            late = [log.effort_spline(log.t + d)[:, i] for i, d in enumerate(delay)]
            effort = effort + np.column_stack(late) - log.effort_spline(log.t)
        return np.asarray(effort / (1 + gain) - bias)

    def _left(
        self, at: Regressor, x: np.ndarray, effort: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """What is left of the equations about x, (N, rows), and the contact forces, (N, k), which
        are the last rows where they are measured. Friction at contacts turns with these forces:

            force = free + contact_friction |force|,
            r = Y pi + load + friction |force| - J^T effort.
        """
        pi, (rough, _) = self.unknowns.pi(x), self.unknowns.coefficients(x, self._contacts)
        force = free = (
            at.contact_Y @ pi + at.contact_load - np.einsum("tkn,tn->tk", at.contact_J, effort)
        )
        across = at.contact_friction * rough
        for _ in range(FRICTION_STEPS if across.any() else 0):
            before = force
            force = free + np.einsum("tkj,tj->tk", across, np.abs(before))
            if np.abs(force - before).max(initial=0) <= 1e-12 * np.abs(free).max(initial=1):
                break
        drag = np.einsum("tmk,tk->tm", at.friction * rough, np.abs(force))
        r = at.Y @ pi + at.load + drag - np.einsum("tnm,tn->tm", at.J, effort)
        return (r if self.log.contact is None else np.concatenate([r, force], axis=1)), force

    def _columns(
        self, at: Regressor, x: np.ndarray, force: np.ndarray, more: Sequence[np.ndarray] = ()
    ) -> np.ndarray:
        """Slopes of what is left by x and by what else is unknown, (N, rows, U).

        Args: more: slopes by what else is unknown, (N, m + k, .), as if without friction there.
        """
        slope, m = self.unknowns.slope(x), at.J.shape[2]
        rough, by_x = self.unknowns.coefficients(x, self._contacts)
        size, sign = np.abs(force)[:, None], np.sign(force)[:, None]
        A = at.Y @ slope + (at.friction * size) @ by_x
        A = np.concatenate([A, *(block[:, :m] for block in more)], axis=2)
        measured, drag = self.log.contact is not None, at.friction * rough
        if not measured and not drag.any():
            return A
        C = at.contact_Y @ slope + (at.contact_friction * size) @ by_x
        C = np.concatenate([C, *(block[:, m:] for block in more)], axis=2)
        C = np.linalg.solve(np.eye(len(rough)) - at.contact_friction * (rough * sign), C)
        A = A + (drag * sign) @ C
        return np.concatenate([A, C], axis=1) if measured else A

    # -- the noise ---------------------------------------------------------------------------

    def _slopes(self, x: np.ndarray, t: np.ndarray, keep: bool = False) -> tuple[np.ndarray, ...]:
        """Derivatives of the residual by q, q', q'': (3, N, rows, m) at samples t, by number.

        Args: keep: also those of its slopes by the unknowns, (3, m, N, rows, U).
        """
        log, m = self.log, self.log.q.shape[1]
        states = [log.q[t], log.v[t], log.a[t]]
        sizes = [np.abs(s).max() + 1e-3 for s in states]
        effort = log.effort_spline(log.t[t])
        given = each(log.given, lambda values: values[t])
        slopes, second = [], []
        for order in range(3):
            h = STEP * sizes[order]
            for j in range(m):
                ends, columns = list[np.ndarray](), list[np.ndarray]()
                for sign in (1, -1):
                    moved = [s.copy() for s in states]
                    moved[order][:, j] += sign * h
                    q, v, a = moved
                    at = self.model.regressor(q, v, a, log.wrench[t], self.point, **given)
                    r, force = self._left(at, x, effort)
                    ends.append(r)
                    if keep:
                        columns.append(self._columns(at, x, force))
                slopes.append((ends[0] - ends[1]) / (2 * h))
                if keep:
                    second.append((columns[0] - columns[1]) / (2 * h))
        found = np.nan_to_num(np.reshape(slopes, (3, m, len(t), -1))).transpose(0, 2, 3, 1)
        if not keep:
            return (found,)
        return found, np.nan_to_num(np.reshape(second, (3, m, len(t), -1, len(x))))

    def _covariance(self, x: np.ndarray, by_effort: np.ndarray) -> np.ndarray:
        """The covariance of the residual at one time, (K, rows, rows).

        Args: by_effort: its slopes, (K, rows, n).
        """
        log, m, rows = self.log, self.log.q.shape[1], by_effort.shape[1]
        impulses = log.impulses
        gain = float(impulses[0] @ impulses[0])
        V = np.einsum("tin,n,tjn->tij", by_effort, gain * self.effort_noise**2, by_effort)
        if self.encoder_noise.any():
            (D,) = self._slopes(x, self._nearest)
            F = self._to_q[self._nearest]
            spread = np.einsum("tin,n,tjn->tij", F, self.encoder_noise**2, F)
            G = impulses[1:] @ impulses[1:].T
            for i in range(3):
                for j in range(3):
                    V += G[i, j] * D[i] @ spread @ D[j].swapaxes(1, 2)
        if rows > m:
            V[:, m:, m:] += np.diag(gain * log.noise[2] ** 2)
        # What is not noise at all, such as rounding, keeps the matrix regular.
        size = np.einsum("tii->t", V)[:, None, None] / rows
        return V + 1e-9 * (size + np.finfo(float).tiny) * np.eye(rows)

    @property
    def _nearest(self) -> np.ndarray:
        """The sample next to each time that is kept, (K,)."""
        step = self.log.t[-1] / (len(self.log.t) - 1)
        return np.clip(np.rint(self.log.equation_times / step).astype(int), 0, len(self.log.t) - 1)

    def spread(self, gain: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Covariance of the estimate that noise makes, (U, U).

        Args: gain: (U, K, rows), what the estimate takes from the residuals.
        """
        log, m, U, n = self.log, self.log.q.shape[1], len(gain), self.log.effort.shape[1]
        weights = log.back(np.moveaxis(gain, 0, 2))  # (N, rows, U)
        force = self._left(self._at, x, log.effort)[1]
        by = self._columns(self._at, x, force, [self.by_effort])[..., -n:]
        H = np.einsum("trn,tru->tnu", by, weights) * self.effort_noise[:, None]
        covariance = np.einsum("tnu,tnw->uw", H, H)
        if log.contact is not None:
            own = weights[:, m:] * log.noise[2][:, None]
            covariance += np.einsum("tku,tkw->uw", own, own)
        if self.encoder_noise.any():
            (D,) = self._slopes(x, np.arange(len(log.t)))
            to_q = np.zeros((len(log.t), m, U))
            for nu in range(3):
                each = np.einsum("tij,tiu->tju", D[nu], weights)
                flat = log.low_pass.back(each.reshape(len(each), -1), log.t, nu)
                to_q += flat.reshape(each.shape)
            H = np.einsum("tmn,tmu->tnu", self._to_q, to_q) * self.encoder_noise[:, None]
            covariance += np.einsum("tnu,tnw->uw", H, H)
        return covariance

    def attenuation(
        self, x: np.ndarray, V: np.ndarray, weight: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """What noise of the regressors adds in the mean to A^T W r and to A^T W A, of the unknowns
        and the extras: (U + E,) and (U + E, U + E).

        Args: weight: (F,), of frequencies in band, beside that by V.
        """
        U = len(x)
        size = U + len(self.extras.names(self.model.mechanism))
        bias, square = np.zeros(size), np.zeros((size, size))
        if not self.encoder_noise.any():
            return bias, square
        chosen = np.arange(len(V))
        if len(chosen) > CORRECTED:
            chosen = chosen[:: -(-len(chosen) // CORRECTED)]
        t = self._nearest[chosen]
        D, A = self._slopes(x, t, keep=True)
        F, G = self._to_q[t], self._weighted(weight)
        spread = np.einsum("tin,n,tjn->tij", F, self.encoder_noise**2, F)
        inverse = np.linalg.inv(V[chosen])
        for i in range(3):
            for j in range(3):
                moved = np.einsum("tij,jtau->itau", spread, A[j])
                left = np.einsum("tab,itbu->itau", inverse, A[i])
                bias[:U] += G[i, j] * np.einsum("itau,taj,tij->u", left, D[j], spread)
                square[:U, :U] += G[i, j] * np.einsum("itau,itaw->uw", left, moved)
        share = len(V) / len(chosen)
        return bias * share, square * share

    def _weighted(self, weight: np.ndarray) -> np.ndarray:
        """Covariance of q, q' and q'' over that of a sample, (3, 3), as weights of frequencies in
        band, (F,), leave it."""
        log = self.log
        impulses = np.fft.fft(log.impulses[1:], axis=1)
        there = np.abs(np.fft.fftfreq(len(log.t), log.t[-1] / (len(log.t) - 1)))
        own = np.arange(len(weight)) / (
            2 * len(log.equation_times) * np.diff(log.equation_times).mean()
        )
        passed = np.interp(there, own, weight, right=0.0)
        return np.asarray((impulses * passed @ impulses.conj().T).real / len(log.t))
