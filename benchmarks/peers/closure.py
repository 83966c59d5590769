"""Closed-form closure in NumPy for the Python peers, one sample a call, chains as rows.

The same formulas as `native/closure.hpp`, in the way a NumPy user writes them: scalars of the
platform with `math`, arrays of chains with as few calls as will do.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, sin, sqrt

import numpy as np

from .mechanism import Array, Mechanism


def skew(v: Array) -> Array:
    """Matrix of v x, (3, 3)."""
    x, y, z = v
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def rows_cross(a: Array, b: Array) -> Array:
    """Cross products of rows; much quicker than `np.cross` on six of them."""
    return a[:, [1, 2, 0]] * b[:, [2, 0, 1]] - a[:, [2, 0, 1]] * b[:, [1, 2, 0]]


def rows_dot(a: Array, b: Array) -> Array:
    """Scalar products of rows."""
    return np.einsum("ij,ij->i", a, b)


@dataclass
class Platform:
    """Pose and motion of {M}; `W`: columns of R_omega; `M_J`: (6, 4), twist of O_M per q'."""

    R: Array
    p: Array
    v: Array
    a: Array
    omega: Array
    alpha: Array
    W: Array
    M_J: Array


@dataclass
class Chains:
    """Motion of the chains, each (6, 3) or (6,); `n`: coupler direction in N_i0; `c`: cos gamma_i."""

    r: Array
    P: Array
    P_d: Array
    P_dd: Array
    J: Array
    t: Array
    cos_theta: Array
    sin_theta: Array
    theta_d: Array
    theta_dd: Array
    n: Array
    c: Array
    angles: Array
    angles_d: Array
    angles_dd: Array


class Closure:
    """The closure of one mechanism."""

    def __init__(self, mechanism: Mechanism) -> None:
        self.mechanism = mechanism
        self.normals = [c.normal for c in mechanism.contacts]
        self.points = [c.point for c in mechanism.contacts]
        left, right = mechanism.contacts
        self.dn = left.normal - right.normal
        self.d_offset = left.offset - right.offset
        self.offset = left.offset
        self.gamma_branch = mechanism.gamma_branch

        def stack(name: str) -> Array:
            return np.array([getattr(c, name) for c in mechanism.chains])

        self.base, self.u, self.w, self.joint = map(stack, ("base", "u", "w", "joint"))
        self.N = stack("N")
        self.crank, self.coupler, self.branch = map(stack, ("crank", "coupler", "branch"))
        self.l, self.axes = self.crank[:, None], np.hstack([self.u, self.w])
        self.l2_L2 = self.crank**2 - self.coupler**2

    def place(self, q: Array, qd: Array, qdd: Array) -> Platform:
        """Platform from the independent coordinates, Z and gamma from the two planes."""
        X, Y, alpha, beta = q.tolist()
        sa, ca, sb, cb = sin(alpha), cos(alpha), sin(beta), cos(beta)
        R_xy = np.array([[cb, 0.0, sb], [sa * sb, ca, -sa * cb], [-ca * sb, sa, ca * cb]])
        (n0, n1), (t0, t1) = self.normals, self.points
        v0x, v0y, v0z = (n0 @ R_xy).tolist()
        v1x, v1y, v1z = (n1 @ R_xy).tolist()
        (t0x, t0y, t0z), (t1x, t1y, t1z) = t0.tolist(), t1.tolist()
        dnx, dny, _ = self.dn.tolist()
        A = v0x * t0x + v0y * t0y - v1x * t1x - v1y * t1y
        B = v0y * t0x - v0x * t0y - v1y * t1x + v1x * t1y
        C = self.d_offset - dnx * X - dny * Y - v0z * t0z + v1z * t1z
        h = A * A + B * B
        k = self.gamma_branch * sqrt(h - C * C)
        cg, sg = (A * C + B * k) / h, (B * C - A * k) / h
        R = R_xy @ np.array([[cg, -sg, 0.0], [sg, cg, 0.0], [0.0, 0.0, 1.0]])

        r0, r1 = R @ t0, R @ t1
        nx, ny, _ = n0.tolist()
        p = np.array([X, Y, self.offset - nx * X - ny * Y - n0 @ r0])
        W = np.array([[1.0, 0.0, sb], [0.0, ca, -sa * cb], [0.0, sa, ca * cb]])
        m0 = skew(r0) @ n0
        dm = m0 - skew(r1) @ n1
        c0, dc = m0 @ W, dm @ W
        gamma_q = np.array([dnx, dny, dc[0], dc[1]]) / -dc[2]
        Z_q = -np.array([nx, ny, c0[0], c0[1]]) - c0[2] * gamma_q
        M_J = np.zeros((6, 4))
        M_J[0, 0] = M_J[1, 1] = 1.0
        M_J[2] = Z_q
        M_J[3:] = np.outer(W[:, 2], gamma_q)
        M_J[3:, 2:] += W[:, :2]

        twist = M_J @ qd
        omega = twist[3:]
        alpha_d, beta_d = qd[2], qd[3]
        gamma_d = gamma_q @ qd
        Omega = skew(omega)
        bias = alpha_d * beta_d * np.array([0.0, -sa, ca])
        bias += gamma_d * (Omega @ W[:, 2])
        spin2 = Omega @ Omega
        curve0 = n0 @ spin2 @ r0
        gamma_bias = (curve0 - n1 @ spin2 @ r1 + dm @ bias) / -dc[2]
        rate = M_J @ qdd
        rate[2] -= curve0 + m0 @ bias + c0[2] * gamma_bias
        rate[3:] += gamma_bias * W[:, 2] + bias
        return Platform(R, p, twist[:3], rate[:3], omega, rate[3:], W, M_J)

    def move(self, b: Platform) -> Chains:
        """Chains from the platform."""
        Omega = skew(b.omega)
        r = self.joint @ b.R.T
        P, P_d = r + b.p, r @ Omega.T + b.v
        P_dd = r @ (skew(b.alpha) + Omega @ Omega).T + b.a

        d = P - self.base
        a, e_w = rows_dot(d, self.u), rows_dot(d, self.w)
        reach = (rows_dot(d, d) + self.l2_L2) / (2 * self.crank)
        h = a * a + e_w * e_w
        k = self.branch * np.sqrt(h - reach * reach)
        cos_theta, sin_theta = (a * reach + e_w * k) / h, (e_w * reach - a * k) / h
        l_cos, l_sin = self.l * cos_theta[:, None], self.l * sin_theta[:, None]
        arm, t = l_cos * self.u + l_sin * self.w, l_cos * self.w - l_sin * self.u
        e, e_t = d - arm, self.crank * k
        J = e / e_t[:, None]
        theta_d = rows_dot(J, P_d)
        e_d = P_d - theta_d[:, None] * t
        lifted = P_dd + (theta_d * theta_d)[:, None] * arm
        theta_dd = rows_dot(J, lifted) + rows_dot(e_d, e_d) / e_t
        e_dd = lifted - theta_dd[:, None] * t

        all_e = np.stack([e, e_d, e_dd], axis=1) / self.coupler[:, None, None]
        n, n_d, n_dd = (all_e @ self.N).transpose(1, 0, 2)
        (x, y, z), (x_d, y_d, z_d), (x_dd, y_dd, z_dd) = n.T, n_d.T, n_dd.T
        c2 = x * x + z * z
        c = np.sqrt(c2)
        gamma_d = y_d / c
        beta_d = (x_d * z - z_d * x) / c2
        gamma_dd = (y_dd + y * gamma_d * gamma_d) / c
        beta_dd = (x_dd * z - z_dd * x) / c2 + 2 * beta_d * gamma_d * y / c
        return Chains(
            r, P, P_d, P_dd, J, t, cos_theta, sin_theta, theta_d, theta_dd, n, c,
            angles=np.array([np.arctan2(-z, x), np.arcsin(y)]).T,
            angles_d=np.array([beta_d, gamma_d]).T,
            angles_dd=np.array([beta_dd, gamma_dd]).T,
        )  # fmt: skip

    def project(
        self, b: Platform, c: Chains, wrench: Array, ends: Array, turns: Array, shafts: Array, F: Array
    ) -> Array:
        """Minimum-norm torques from the forces of the cut tree.

        Args: wrench: on the platform about O_M, (6,); ends: on the couplers at the platform joints,
            (6, 3), both in {S}; turns: dual to beta_i and gamma_i, (6, 2); shafts: (6,).
        """
        x, _, z = c.n.T
        by_beta = turns[:, 0] / (c.c * c.c * self.coupler)
        by_gamma = turns[:, 1] / (c.c * self.coupler)
        g = (self.N @ np.array([by_beta * z, by_gamma, -by_beta * x]).T[:, :, None])[:, :, 0]
        F_P = ends + g + (shafts - rows_dot(g, c.t))[:, None] * c.J
        bite = np.concatenate([F, skew(b.R @ self.mechanism.load_point) @ F])
        Q = wrench - bite + np.hstack([F_P, rows_cross(c.r, F_P)]).sum(axis=0)
        A = np.hstack([c.J, rows_cross(c.r, c.J)]) @ b.M_J
        return A @ np.linalg.solve(A.T @ A, b.M_J.T @ Q)
