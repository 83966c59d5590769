"""The equations of a log, linear in the unknown numbers about where they stand, with their noise.

    r(x) = Y(q, q', q'') pi(x) + load - J^T (effort - bias),

smoothed as the states are. Noise of efforts comes through J^T; noise of encoders through the
derivatives of r by q, q' and q'', each of which smoothing has given its own spectrum.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

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
CORRECTED = 400  # times at which the regressors' own noise is counted


@dataclass(frozen=True)
class Extras:
    """What is unknown beside numbers of the file: the efforts' bias, a delay."""

    bias: bool
    delay: bool

    def names(self, mechanism: Mechanism) -> list[tuple[str, str]]:
        """Names and units."""
        units = {chain.name: FAMILIES[chain.kind].effort_unit for chain in mechanism.chains}
        found = [(f"bias.{name}", unit) for name, unit in units.items()] if self.bias else []
        return [*found, ("delay", "s")] if self.delay else found


@dataclass(frozen=True)
class Rows:
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
        self.model, self.log, self.unknowns, self.extras = model, log, unknowns, extras
        self.point = point
        self._at = model.regressor(log.q, log.v, log.a, log.wrench, point, **log.given)
        if (bad := np.flatnonzero(self._at.status)).size:
            raise InputError(f"{log.source}: the pose at {log.t[bad[0]]:.6g} s cannot be reached")
        effort, encoder = noise
        many = np.sqrt(log.averaged)
        n = log.effort.shape[1]
        self.effort_noise = log.noise[0] if effort is None else np.full(n, effort / many)
        self.encoder_noise = log.noise[1] if encoder is None else np.full(n, encoder / many)
        if not log.encoders:
            self.encoder_noise = np.zeros(n)
        J = self._at.J
        # q is the least squares of the joints: what their noise makes of it, (N, m, n).
        self._to_q = np.linalg.solve(J.swapaxes(1, 2) @ J, J.swapaxes(1, 2))

    # -- the equations -----------------------------------------------------------------------

    def rows(self, x: np.ndarray, extra: np.ndarray) -> Rows:
        """The equations about unknowns x, (U,), and the extras."""
        log, at = self.log, self._at
        pi, slope = self.unknowns.pi(x), self.unknowns.slope(x)
        effort = self._effort(extra)
        force = self._contact_forces(at, pi, effort)
        r = self._residual(at, pi, effort, force)
        columns = [at.Y @ slope]
        if self.extras.bias:
            columns.append(at.J.swapaxes(1, 2))
        if self.extras.delay:
            late = -np.einsum("tnm,tn->tm", at.J, log.effort_spline(log.t, 1))
            columns.append(late[..., None])
        A = np.concatenate(columns, axis=2)
        if log.contact is not None:
            A, r = self._with_contacts(A, r, at, pi, slope, effort, force)
        A, r = log.smoothed(A), log.smoothed(r)
        J = log.smoothed(at.J)
        m = at.J.shape[2]
        own = J @ np.linalg.solve(J.swapaxes(1, 2) @ J, r[:, :m, None])
        return Rows(A, r, self._covariance(pi, J, len(r[0])), own[..., 0])

    def _effort(self, extra: np.ndarray) -> np.ndarray:
        """The efforts, (N, n), without bias, at the times of the encoders."""
        log, n = self.log, self.log.effort.shape[1]
        delay = float(extra[-1]) if self.extras.delay else 0.0
        late = log.effort_spline(log.t + delay) - log.effort_spline(log.t) if delay else 0.0
        return log.effort + late - (extra[:n] if self.extras.bias else 0.0)

    def _contact_forces(self, at: Regressor, pi: np.ndarray, effort: np.ndarray) -> np.ndarray:
        """(N, k), with the friction that they bring."""
        free = at.contact_Y @ pi + at.contact_load - np.einsum("tkn,tn->tk", at.contact_J, effort)
        if not at.contact_friction.any():
            return free
        force = free
        for _ in range(FRICTION_STEPS):
            before = force
            force = free + np.einsum("tkj,tj->tk", at.contact_friction, np.abs(before))
            if np.abs(force - before).max(initial=0) <= 1e-12 * np.abs(free).max(initial=1):
                break
        return force

    @staticmethod
    def _residual(
        at: Regressor, pi: np.ndarray, effort: np.ndarray, force: np.ndarray
    ) -> np.ndarray:
        drag = np.einsum("tmk,tk->tm", at.friction, np.abs(force))
        return at.Y @ pi + at.load + drag - np.einsum("tnm,tn->tm", at.J, effort)

    def _with_contacts(
        self,
        A: np.ndarray,
        r: np.ndarray,
        at: Regressor,
        pi: np.ndarray,
        slope: np.ndarray,
        effort: np.ndarray,
        force: np.ndarray,
    ) -> tuple[np.ndarray, np.ndarray]:
        """The same with the rows of measured contact forces below."""
        log, own = self.log, [at.contact_Y @ slope]
        if self.extras.bias:
            own.append(at.contact_J)
        if self.extras.delay:
            late = -np.einsum("tkn,tn->tk", at.contact_J, log.effort_spline(log.t, 1))
            own.append(late[..., None])
        assert log.contact is not None
        more = force - log.contact
        return np.concatenate([A, np.concatenate(own, axis=2)], axis=1), np.concatenate(
            [r, more], axis=1
        )

    # -- the noise ---------------------------------------------------------------------------

    def _slopes(self, pi: np.ndarray, t: np.ndarray, keep: bool = False) -> tuple[np.ndarray, ...]:
        """Derivatives of the residual by q, q', q'': (3, N, m, m) at samples t, by number.

        Args: keep: also those of the regressor, (3, m, N, m, P).
        """
        log, m = self.log, self.log.q.shape[1]
        states = [log.q[t], log.v[t], log.a[t]]
        sizes = [np.abs(s).max() + 1e-3 for s in states]
        effort = log.effort_spline(log.t[t])
        given = each(log.given, lambda values: values[t])
        found = np.empty((3, len(t), m, m))
        regressors = []
        for order in range(3):
            h = STEP * sizes[order]
            for j in range(m):
                values, Ys = list[np.ndarray](), list[np.ndarray]()
                for sign in (1, -1):
                    moved = [s.copy() for s in states]
                    moved[order][:, j] += sign * h
                    q, v, a = moved
                    at = self.model.regressor(q, v, a, log.wrench[t], self.point, **given)
                    force = self._contact_forces(at, pi, effort)
                    values.append(self._residual(at, pi, effort, force))
                    Ys.append(at.Y)
                found[order, :, :, j] = (values[0] - values[1]) / (2 * h)
                if keep:
                    regressors.append((Ys[0] - Ys[1]) / (2 * h))
        found = np.nan_to_num(found)
        if not keep:
            return (found,)
        P = regressors[0].shape[2]
        return found, np.nan_to_num(np.reshape(regressors, (3, m, len(t), m, P)))

    def _covariance(self, pi: np.ndarray, J: np.ndarray, rows: int) -> np.ndarray:
        """Of the residual at one time, (K, rows, rows)."""
        log, m = self.log, J.shape[2]
        impulses = log.impulses
        gain = float(impulses[0] @ impulses[0])
        V = np.zeros((len(J), rows, rows))
        V[:, :m, :m] = np.einsum("tni,n,tnj->tij", J, gain * self.effort_noise**2, J)
        if self.encoder_noise.any():
            (D,) = self._slopes(pi, self._nearest)
            F = self._to_q[self._nearest]
            spread = np.einsum("tin,n,tjn->tij", F, self.encoder_noise**2, F)
            G = impulses[1:] @ impulses[1:].T
            for i in range(3):
                for j in range(3):
                    V[:, :m, :m] += G[i, j] * D[i] @ spread @ D[j].swapaxes(1, 2)
        if rows > m:
            own = gain * log.noise[2] ** 2
            C = log.smoothed(self._at.contact_J)
            V[:, m:, m:] = np.einsum("tkn,n,tjn->tkj", C, gain * self.effort_noise**2, C)
            V[:, m:, m:] += np.diag(own)
        # What is not noise at all, such as rounding, keeps the matrix regular.
        size = np.einsum("tii->t", V)[:, None, None] / rows
        return V + 1e-9 * (size + np.finfo(float).tiny) * np.eye(rows)

    @property
    def _nearest(self) -> np.ndarray:
        """The sample next to each time that is kept, (K,)."""
        step = self.log.t[-1] / (len(self.log.t) - 1)
        return np.clip(np.rint(self.log.kept / step).astype(int), 0, len(self.log.t) - 1)

    def spread(self, gain: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Covariance of the estimate that noise makes, (U, U).

        Args: gain: (U, K, rows), what the estimate takes from the residuals.
        """
        log, m, U = self.log, self.log.q.shape[1], len(gain)
        weights = log.back(np.moveaxis(gain[:, :, :m], 0, 2))  # (N, m, U)
        H = np.einsum("tnm,tmu->tnu", self._at.J, weights) * self.effort_noise[:, None]
        found = np.einsum("tnu,tnw->uw", H, H)
        if gain.shape[2] > m:
            more = log.back(np.moveaxis(gain[:, :, m:], 0, 2)) * log.noise[2][:, None]
            found += np.einsum("tku,tkw->uw", more, more)
        if self.encoder_noise.any():
            (D,) = self._slopes(self.unknowns.pi(x), np.arange(len(log.t)))
            to_q = np.zeros((len(log.t), m, U))
            for nu in range(3):
                each = np.einsum("tij,tiu->tju", D[nu], weights)
                flat = log.low_pass.back(each.reshape(len(each), -1), log.t, nu)
                to_q += flat.reshape(each.shape)
            H = np.einsum("tmn,tmu->tnu", self._to_q, to_q) * self.encoder_noise[:, None]
            found += np.einsum("tnu,tnw->uw", H, H)
        return found

    def attenuation(self, x: np.ndarray, V: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What noise of the regressors adds in the mean to A^T V^-1 r and to A^T V^-1 A, of the
        unknowns and the extras: (U + E,) and (U + E, U + E)."""
        U = len(x)
        size = U + len(self.extras.names(self.model.mechanism))
        found, square = np.zeros(size), np.zeros((size, size))
        if not self.encoder_noise.any():
            return found, square
        m, chosen = self.log.q.shape[1], np.arange(len(V))
        if len(chosen) > CORRECTED:
            chosen = chosen[:: -(-len(chosen) // CORRECTED)]
        t = self._nearest[chosen]
        D, Y = self._slopes(self.unknowns.pi(x), t, keep=True)
        A = Y @ self.unknowns.slope(x)  # (3, m, K, m, U)
        F, impulses = self._to_q[t], self.log.impulses[1:]
        spread = np.einsum("tin,n,tjn->tij", F, self.encoder_noise**2, F)
        G, inverse = impulses @ impulses.T, np.linalg.inv(V[chosen][:, :m, :m])
        for i in range(3):
            for j in range(3):
                moved = np.einsum("tij,jtau->itau", spread, A[j])
                left = np.einsum("tab,itbu->itau", inverse, A[i])
                found[:U] += G[i, j] * np.einsum("itau,taj,tij->u", left, D[j], spread)
                square[:U, :U] += G[i, j] * np.einsum("itau,itaw->uw", left, moved)
        share = len(V) / len(chosen)
        return found * share, square * share
