"""Straight-line C as CasADi writes it: what our kernels are measured against."""

from __future__ import annotations

import casadi as ca
import numpy as np

from ..dynamics import formulation as formulation_named
from ..dynamics.equations import closure_function, core_function
from ..mechanism.mechanism import Mechanism


def torque_function(mechanism: Mechanism, formulation: str, load_point: np.ndarray) -> ca.Function:
    """(q, q', q'', F) in one vector -> tau, closure and minimum norm included."""
    m = mechanism.degrees_of_freedom
    x = ca.SX.sym("x", 3 * m + 3)
    q, q1, q2, force = x[:m], x[m : 2 * m], x[2 * m : 3 * m], x[3 * m :]
    X, X1, X2, _ = closure_function(mechanism)(q, q1, q2)
    load = ca.vertcat(force, ca.SX.zeros(3), ca.DM(load_point))
    forces, J, Pi, *_ = core_function(mechanism, formulation_named(formulation))(X, X1, X2, load)
    A, b = J @ Pi, Pi.T @ ca.sum2(forces)
    tau = A @ _solve(A.T @ A, b)
    return ca.Function("straight_line", [x], [ca.cse(ca.densify(tau))])


def _solve(G: ca.SX, b: ca.SX) -> ca.SX:
    """G^-1 b for a symmetric positive definite G, by elimination."""
    G, b = ca.SX(G), ca.SX(b)
    m = b.shape[0]
    for k in range(m):
        for j in range(k + 1, m):
            ratio = G[j, k] / G[k, k]
            G[j, :] -= ratio * G[k, :]
            b[j] -= ratio * b[k]
    x = ca.SX.zeros(m)
    for k in reversed(range(m)):
        x[k] = (b[k] - ca.dot(G[k, k + 1 :].T, x[k + 1 :]) if k + 1 < m else b[k]) / G[k, k]
    return x
