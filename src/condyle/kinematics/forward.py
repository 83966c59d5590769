"""Forward kinematics: from joint coordinates, as encoders give them, to the pose.

n joint coordinates over-determine a pose that the contacts leave 6 - k freedoms. Gauss-Newton on
the contact manifold finds the pose whose joints are nearest in the least-squares sense, with
angles multiplied by the characteristic length:

    X <- X + M_J dq + dX_phi,    J_theta M_J dq ~ theta - theta(X) - J_theta dX_phi,

where dX_phi moves the dependent coordinates back onto the surfaces. All samples start from home at
once; those that fail start again from the solution of the sample before.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from ..mechanism.home import characteristic_length, dependent_coordinates
from ..mechanism.mechanism import Mechanism
from .batch import evaluate
from .chain import FAMILIES
from .closure import contact_symbols, solve_samples
from .contact import contact_frame, indices, parasitic_jacobian, residuals, solve_small
from .state import pose_state

ITERATIONS = 40
CONVERGED = 1e-12  # step, in characteristic lengths and radians
LONG = 0.05  # steps beyond this are checked before they are taken; all are in a second attempt
HALVINGS = 4


@dataclass(frozen=True)
class ForwardSolution:
    """Poses of N samples.

    pose:      X_EE, (N, 6) [m, rad]; NaN where nothing was found.
    residual:  (N, n): given less computed joint coordinates [rad or m].
    condition: (N,), condition number of the dimensionless actuator Jacobian.
    found:     (N,).
    """

    pose: np.ndarray
    residual: np.ndarray
    condition: np.ndarray
    found: np.ndarray


class ForwardKinematics:
    """Solves poses of one mechanism from its joint coordinates."""

    def __init__(self, mechanism: Mechanism) -> None:
        self._length = characteristic_length(mechanism)
        families = [FAMILIES[chain.kind] for chain in mechanism.chains]
        self._turning = np.array([family.joint_unit == "rad" for family in families])
        self._weight = np.where(self._turning, self._length, 1.0)
        dependent = indices(dependent_coordinates(mechanism))
        self._independent = [i for i in range(6) if i not in dependent]
        self._unit = np.where(np.arange(6) < 3, self._length, 1.0)[self._independent]
        self._system = _system(mechanism)

    def solve(self, joints: np.ndarray) -> ForwardSolution:
        """Poses from joint coordinates, (N, n) [rad or m], zero at home."""
        count = len(joints)
        pose, found = np.full((count, 6), np.nan), np.zeros(count, dtype=bool)
        finite = np.isfinite(joints).all(axis=1)
        start = np.zeros((count, 6))
        for beyond in (LONG, 0.0):
            todo = np.flatnonzero(finite & ~found)
            pose[todo], found[todo] = self._newton(start[todo], joints[todo], beyond)
        while True:
            # A sample that home could not reach may be reached from the one before it.
            failed = np.flatnonzero(finite & ~found)
            failed = failed[failed > 0]
            todo = failed[found[failed - 1] & (start[failed] != pose[failed - 1]).any(axis=1)]
            if not todo.size:
                break
            start[todo] = pose[todo - 1]
            pose[todo], found[todo] = self._newton(start[todo], joints[todo], 0.0)
        pose[~found] = np.nan
        residual, J = self._residual(pose, joints)[:2]
        condition = np.full(count, np.nan)
        condition[found] = np.linalg.cond(J[found] * self._unit)
        residual[~found] = np.nan
        return ForwardSolution(pose, residual, condition, found)

    def _newton(
        self, x: np.ndarray, joints: np.ndarray, check_beyond: float
    ) -> tuple[np.ndarray, np.ndarray]:
        x, done = x.copy(), np.zeros(len(x), dtype=bool)
        active = np.arange(len(x))
        for _ in range(ITERATIONS):
            step, size, error = self._step(x[active], joints[active])
            better = np.isfinite(size)
            # Far from the solution a whole step may lead out of reach or away; take less of it.
            long = np.flatnonzero(better & (size > check_beyond))
            for _ in range(HALVINGS):
                tried = x[active[long]] + step[long]
                long = long[self._error(tried, joints[active[long]]) > 2 * error[long]]
                step[long] /= 2
            x[active[better]] += step[better]
            done[active] = better & (size < CONVERGED)
            active = active[better & ~done[active]]
            if not active.size:
                break
        return x, done

    def _step(self, x: np.ndarray, joints: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """A Gauss-Newton step (N, 6), its size (N,) and the error before it (N,)."""
        residual, A, M_J, J, fall, phi = self._residual(x, joints)
        A = A * self._unit
        right = (residual - (J @ fall[..., None])[..., 0]) * self._weight
        with np.errstate(all="ignore"):
            transposed = A.transpose(0, 2, 1)
            dq = solve_samples(transposed @ A, (transposed @ right[..., None])[..., 0])
        step = fall + (M_J @ (dq * self._unit)[..., None])[..., 0]
        size = np.maximum(np.abs(dq).max(axis=1), np.abs(fall).max(axis=1, initial=0.0))
        return step, size, _norm(residual * self._weight, phi)

    def _error(self, x: np.ndarray, joints: np.ndarray) -> np.ndarray:
        residual, *_, phi = self._residual(x, joints)
        error = _norm(residual * self._weight, phi)
        return np.where(np.isfinite(error), error, np.inf)

    def _residual(self, x: np.ndarray, joints: np.ndarray) -> list[np.ndarray]:
        """Joint residual (N, n), weighted J_theta M_J (N, n, m), M_J, J_theta, dX_phi and phi."""
        count, n, m = len(x), joints.shape[1], len(self._independent)
        theta, J, M_J, fall, phi = evaluate(self._system, x)
        J = J.reshape(count, 6, n).transpose(0, 2, 1)
        M_J = M_J.reshape(count, m, 6).transpose(0, 2, 1)
        residual = joints - theta
        turns = np.round(residual / (2 * np.pi)) * (2 * np.pi)
        residual = np.where(self._turning, residual - turns, residual)
        return [residual, (J @ M_J) * self._weight[:, None], M_J, J, fall, phi]


def _norm(residual: np.ndarray, phi: np.ndarray) -> np.ndarray:
    return np.sqrt((residual**2).sum(axis=1) + (phi**2).sum(axis=1))


def _system(mechanism: Mechanism) -> ca.Function:
    """X_EE -> joints (n,), J_theta on X_EE' (n, 6), M_J (6, m), dX_phi (6,), phi (k,)."""
    X = ca.SX.sym("X", 6)
    state = pose_state(X, ca.SX.zeros(6), ca.SX.zeros(6))
    contacts = contact_symbols(mechanism)
    dependent = dependent_coordinates(mechanism)
    dep = indices(dependent)
    C = contact_frame(contacts, X[:3], state.R).N.T @ state.B
    joints, rows = [], []
    for chain in mechanism.chains:
        family = FAMILIES[chain.kind]
        constants = family.named(ca.SX(ca.DM(family.vector(family.constants(chain)))))
        M = state.point(ca.SX(ca.DM(chain.platform)))
        loop = family.loop(constants, M.position)
        joints.append(loop.q_r[0])
        rows.append(state.pull(loop.J, M.lever).T)
    phi = residuals(contacts, X)
    fall = ca.SX.zeros(6)
    if dep:
        fall[dep] = -solve_small(C[:, dep], phi)
    outputs = [ca.vertcat(*joints), ca.vertcat(*rows), parasitic_jacobian(C, dependent), fall, phi]
    return ca.Function("forward", [X], ca.cse([ca.densify(o) for o in outputs]))
