"""Symbolic expressions of the paper for SymPy: Section 3, and Section 4's Model 2 (the core).

Every function returns expressions and the symbols in them. One chain is derived once, with its
constants as symbols, in components along N_i0; it serves all six.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import sympy as sp

from .mechanism import Mechanism

X_EE = sp.symbols("X Y Z alpha beta gamma")
X_EE_d = sp.symbols("X' Y' Z' alpha' beta' gamma'")
X_EE_dd = sp.symbols("X'' Y'' Z'' alpha'' beta'' gamma''")
Q_R = sp.symbols("theta_i beta_i gamma_i")
Q_R_d = sp.symbols("theta_i' beta_i' gamma_i'")
Q_R_dd = sp.symbols("theta_i'' beta_i'' gamma_i''")
CONSTANTS = sp.symbols(
    "G_x G_y G_z u_x u_y u_z w_x w_y w_z M_x M_y M_z N_xx N_xy N_xz N_yx N_yy N_yz N_zx N_zy N_zz "
    "g_x g_y g_z l L branch I_c m_i c_i I_t I_a"
)

R_X, R_Y, R_Z = sp.rot_ccw_axis1, sp.rot_ccw_axis2, sp.rot_ccw_axis3


@dataclass
class Stage:
    """One numeric function to be made: its arguments and its values."""

    arguments: tuple[Any, ...]
    values: sp.Matrix


def rate(M: sp.Matrix, state: tuple[Any, ...], state_d: tuple[Any, ...]) -> sp.Matrix:
    """Time derivative of a matrix by the chain rule."""
    zero = sp.zeros(*M.shape)
    return sum((M.diff(s) * s_d for s, s_d in zip(state, state_d, strict=True)), zero)


def contacts(mechanism: Mechanism) -> dict[str, Stage]:
    """Pose, M_J and M_J' from the independent coordinates: eqs (4)-(10)."""
    q = (X_EE[0], X_EE[1], X_EE[3], X_EE[4])
    qd = (X_EE_d[0], X_EE_d[1], X_EE_d[3], X_EE_d[4])
    R_xy = R_X(q[2]) * R_Y(q[3])
    gamma = X_EE[5]
    heights = []
    for c in mechanism.contacts:
        n = sp.Matrix(c.normal)
        p = sp.Matrix([q[0], q[1], 0]) + R_xy * R_Z(gamma) * sp.Matrix(c.point)
        heights.append(sp.expand(c.offset - n.dot(p)))
    # The two heights Z are the same: A cos(gamma) + B sin(gamma) + C = 0.
    difference = sp.expand(heights[0] - heights[1])
    A, B = difference.coeff(sp.cos(gamma)), difference.coeff(sp.sin(gamma))
    C = sp.expand(difference - A * sp.cos(gamma) - B * sp.sin(gamma))
    k = -mechanism.gamma_branch * sp.sqrt(A**2 + B**2 - C**2)
    root = sp.atan2(-B * C - A * k, -A * C + B * k)
    Z = heights[0].subs(gamma, root)
    pose = sp.Matrix([q[0], q[1], Z, q[2], q[3], root])
    M_J = pose.jacobian(q)
    return {
        "pose": Stage((q,), pose),
        "M_J": Stage((q,), M_J),
        "M_J'": Stage((q, qd), rate(M_J, q, qd)),
    }


def platform(mechanism: Mechanism) -> dict[str, Stage]:
    """Platform's force dual to X_EE' and [M_1a; M_0a]^T W by F: eqs (8), (11), (29)-(32), (44)."""
    alpha, beta, _ = X_EE[3:]
    R = R_X(alpha) * R_Y(beta) * R_Z(X_EE[5])
    R_omega = sp.Matrix.hstack(
        sp.Matrix([1, 0, 0]), R_X(alpha)[:, 1], (R_X(alpha) * R_Y(beta))[:, 2]
    )
    twist = sp.diag(sp.eye(3), R_omega)
    dyad = sp.diag(mechanism.mass * sp.eye(3), R * sp.Matrix(mechanism.inertia) * R.T)
    B = dyad * twist
    weight = sp.Matrix([*(mechanism.mass * sp.Matrix(mechanism.gravity)), 0, 0, 0])
    momentum_d = rate(B, X_EE, X_EE_d) * sp.Matrix(X_EE_d) + B * sp.Matrix(X_EE_dd)
    arm = R * sp.Matrix(mechanism.load_point)
    return {
        "force": Stage((X_EE, X_EE_d, X_EE_dd), twist.T * (momentum_d - weight)),
        "bite": Stage((X_EE,), twist.T * sp.Matrix.vstack(sp.eye(3), _skew(arm))),
    }


def chain() -> dict[str, Stage]:
    """Angles, M_3i, its rate, the force dual to q_ri': eqs (12)-(23), (33)-(40)."""
    G, u, w, joint, *N_rows, g = (sp.Matrix(CONSTANTS[i : i + 3]) for i in range(0, 24, 3))
    l, L, branch, I_c, m_i, c_i, I_t, I_a = CONSTANTS[24:]
    to_home = sp.Matrix.hstack(*N_rows).T
    theta, beta, gamma = Q_R
    R = R_X(X_EE[3]) * R_Y(X_EE[4]) * R_Z(X_EE[5])
    P = to_home * (sp.Matrix(X_EE[:3]) + R * joint)

    d = P - G
    a, b, c = d.dot(u), d.dot(w), (d.dot(d) + l**2 - L**2) / (2 * l)
    k = branch * sp.sqrt(a**2 + b**2 - c**2)
    crank = l * (sp.cos(theta) * u + sp.sin(theta) * w)
    n = (d - crank) / L

    turn = R_Y(beta) * R_Z(gamma)
    M_1 = (crank + L * turn[:, 0]).jacobian(Q_R)
    M_2 = P.jacobian(X_EE)
    M_3 = M_1.adjugate().applyfunc(sp.simplify) / sp.simplify(M_1.det()) * M_2

    J_E = (crank + c_i * L * turn[:, 0]).jacobian(Q_R)
    R_omega = sp.Matrix([[0, 0, sp.sin(beta)], [0, 1, 0], [0, 0, sp.cos(beta)]])
    motion = sp.Matrix.vstack(J_E, R_omega)
    B = sp.diag(m_i * sp.eye(3), turn * sp.diag(I_a, I_t, I_t) * turn.T) * motion
    momentum_d = rate(B, Q_R, Q_R_d) * sp.Matrix(Q_R_d) + B * sp.Matrix(Q_R_dd)
    force = motion.T * (momentum_d - sp.Matrix([*(m_i * g), 0, 0, 0]))
    force[0] += I_c * Q_R_dd[0]
    return {
        "theta": Stage((X_EE, CONSTANTS), sp.Matrix([sp.atan2(b * c - a * k, a * c + b * k)])),
        "turns": Stage((X_EE, theta, CONSTANTS), sp.Matrix([sp.atan2(-n[2], n[0]), sp.asin(n[1])])),
        "M_3": Stage((X_EE, Q_R, CONSTANTS), M_3),
        "M_3'": Stage(
            (X_EE, X_EE_d, Q_R, Q_R_d, CONSTANTS),
            rate(M_3, (*X_EE, *Q_R), (*X_EE_d, *Q_R_d)),
        ),
        "force": Stage((Q_R, Q_R_d, Q_R_dd, CONSTANTS), force),
    }


def _skew(v: sp.Matrix) -> sp.Matrix:
    return sp.Matrix([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
