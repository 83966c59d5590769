"""Poses followed from home by Newton's method, with every condition written as CasADi's expression.

Six conditions fix a pose: the k contacts, phi = 0, and 6 - k prescribed functions g of the pose,
g = s(t). Each sample is solved from home, alone; rates come by the chain rule through the Jacobian
K of (phi, g):

    K X' = (0, s'),     K X'' = (0, s'') - K' X'.

Shared with the library: the mechanism's description, the contacts' residuals and the rotation. The
iteration, its way from home and the rates are its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

import casadi as ca
import numpy as np

from condyle.kinematics.batch import evaluate
from condyle.kinematics.constraints import closed_form_available, contacts_of, indices, residuals
from condyle.kinematics.rotation import rotation
from condyle.mechanism import COORDINATES, Mechanism
from condyle.mechanism.home import characteristic_length

SMALLEST_PIECE = 2.0**-10  # of the way from home
ITERATIONS = 30
ROUNDING = 1e-15


@dataclass(frozen=True)
class PlatformMotion:
    """X_EE and its rates, (N, 6) each; `reached` tells where the conditions were met, (N,)."""

    pose: np.ndarray
    rate: np.ndarray
    acceleration: np.ndarray
    reached: np.ndarray


class Closure:
    """Solves a mechanism's poses for one choice of prescribed functions."""

    def __init__(
        self, mechanism: Mechanism, prescribed: ca.Function, two_branches: bool = False
    ) -> None:
        """Args: prescribed: g(X_EE), (6) -> (6 - k); two_branches: whether there are no more."""
        x, rate = ca.SX.sym("x", 6), ca.SX.sym("rate", 6)
        conditions = ca.vertcat(residuals(contacts_of(mechanism), x), prescribed(x))
        K = ca.jacobian(conditions, x)
        bias = ca.jtimes(K @ rate, x, rate)
        self._k = len(mechanism.contacts)
        self._two_branches = two_branches
        self._conditions = ca.Function("conditions", [x], [conditions, K])
        self._bias = ca.Function("bias", [x, rate], [bias])
        home, K_home = evaluate(self._conditions, np.zeros((1, 6)))
        self._home = home[0, self._k :]
        self._branch = np.linalg.slogdet(_square(K_home)).sign[0]
        length = characteristic_length(mechanism)
        self._unit = np.repeat([length, 1.0], 3)
        self._scale = 1.0 + length  # lengths, and angles of scale 1

    def solve(self, s: np.ndarray, s1: np.ndarray, s2: np.ndarray) -> PlatformMotion:
        """Poses and rates where g = s, g' = s1, g'' = s2, (N, 6 - k) each."""
        pose, reached = self._poses(s)
        K = self._jacobian(pose)
        rate = solve_samples(K, self._padded(s1))
        bias = evaluate(self._bias, pose, rate)[0]
        acceleration = solve_samples(K, self._padded(s2) - bias)
        return PlatformMotion(pose, rate, acceleration, reached)

    def _poses(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Follow each sample from home, at once where Newton can, in pieces where it needs them."""
        pose, done, piece = np.zeros((len(s), 6)), np.zeros(len(s)), np.ones(len(s))
        active = np.flatnonzero(np.isfinite(s).all(axis=1))
        while active.size:
            goal = np.minimum(done[active] + piece[active], 1.0)
            target = self._home + (s[active] - self._home) * goal[:, None]
            x, ok = self._newton(pose[active], target)
            # Branches meet where K is singular, and the sign of its determinant changes: a leap
            # from one to the other was too long.
            ok &= self._on_branch(x)
            pose[active[ok]], done[active[ok]] = x[ok], goal[ok]
            piece[active] *= np.where(ok, 2.0, 0.5)
            active = active[(done[active] < 1) & (piece[active] >= SMALLEST_PIECE)]
        reached = done == 1
        if self._two_branches:
            # The straight way may leave the surfaces where another would not: one bold leap, to
            # be judged by its branch.
            missed = np.flatnonzero(~reached & np.isfinite(s).all(axis=1))
            pose[missed], reached[missed] = self._newton(pose[missed] * 0, s[missed], bold=True)
        reached &= self._on_branch(pose)
        pose[~reached] = np.nan
        return pose, reached

    def _newton(
        self, x: np.ndarray, target: np.ndarray, bold: bool = False
    ) -> tuple[np.ndarray, np.ndarray]:
        """Newton from x, down to rounding.

        Steps that shrink to a quarter each time lead to the solution nearest to x, so that no
        sample leaves the branch of home; unless `bold`, a sample with other steps fails.
        """
        longest, shrink = (10.0, np.inf) if bold else (1.0, 0.25)
        x = x.copy()
        last = np.full(len(x), np.inf)
        active = np.arange(len(x))
        converged = np.zeros(len(x), dtype=bool)
        for _ in range(ITERATIONS):
            if not active.size:
                break
            value, K = evaluate(self._conditions, x[active])
            value[:, self._k :] -= target[active]
            step = solve_samples(_square(K), value)
            size = np.abs(step / self._unit).max(axis=1)
            finite = np.isfinite(size)
            x[active[finite]] -= step[finite]
            small = size <= ROUNDING * self._scale
            # A stall near rounding is convergence. Contacts that hold badly magnify rounding in
            # the steps, never in the residual.
            stalled = size > shrink * last[active]
            rounding = ROUNDING * (self._scale + np.abs(x[active]).max(axis=1))
            near = (size < 1e-13) | (np.abs(value).max(axis=1) <= rounding)
            converged[active] = small | (near & (stalled | bold))
            failed = ~finite | (stalled & ~near) | (size > longest)
            last[active] = size
            active = active[~(converged[active] | failed)]
        return x, converged

    def _on_branch(self, pose: np.ndarray) -> np.ndarray:
        return np.linalg.slogdet(self._jacobian(pose)).sign == self._branch

    def _jacobian(self, pose: np.ndarray) -> np.ndarray:
        return _square(evaluate(self._conditions, pose)[1])

    def _padded(self, s: np.ndarray) -> np.ndarray:
        return np.hstack([np.zeros((len(s), self._k)), s])


def coordinate_closure(mechanism: Mechanism, names: Sequence[str]) -> Closure:
    """Poses from 6 - k pose coordinates."""
    dependent = [name for name in COORDINATES if name not in names]
    x = ca.SX.sym("x", 6)
    forms = [contact.offset_surface.form for contact in mechanism.contacts]
    return Closure(
        mechanism,
        ca.Function("coordinates", [x], [x[indices(names)]]),
        two_branches=closed_form_available(forms, dependent),
    )


def landmark_closure(mechanism: Mechanism, landmark: str) -> Closure:
    """Poses from the displacement of a landmark from home, in {S}, and the middle's in Y."""
    x = ca.SX.sym("x", 6)
    R = rotation(x[3:])
    m = ca.DM(mechanism.platform.points[landmark])
    middle = (ca.DM(mechanism.contacts[0].point) + ca.DM(mechanism.contacts[1].point)) / 2
    sideways = x[1] + (R @ middle)[1] - middle[1]
    path = x[:3] + R @ m - m
    return Closure(mechanism, ca.Function("landmark", [x], [ca.vertcat(path, sideways)]))


def _square(K: np.ndarray) -> np.ndarray:
    return K.reshape(len(K), 6, 6).transpose(0, 2, 1)


def solve_samples(K: np.ndarray, b: np.ndarray) -> np.ndarray:
    """K^-1 b for each sample; NaN where K is singular or not finite."""
    good = np.isfinite(K).all(axis=(1, 2)) & np.isfinite(b).all(axis=1)
    x = np.full_like(b, np.nan)
    try:
        x[good] = np.linalg.solve(K[good], b[good][..., None])[..., 0]
    except np.linalg.LinAlgError:
        for i in np.flatnonzero(good):  # as above, so that no sample depends on its company
            with suppress(np.linalg.LinAlgError):
                x[i] = np.linalg.solve(K[i], b[i])
    return x
