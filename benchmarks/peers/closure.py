"""Closed-form closure in NumPy for the Python peers, one sample a call, chains as rows.

The same formulas as `native/closure.hpp`, in the way a NumPy user makes them quick: the platform in
plain numbers, since an array of three costs as much as one of thousands, and all chains at once.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, sin, sqrt

import numpy as np

from .mechanism import Array, Mechanism

Triple = tuple[float, float, float]


def dot(a: Triple, b: Triple) -> float:
    """Scalar product of plain numbers."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Triple, b: Triple) -> Triple:
    """Vector product of plain numbers."""
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


def turn(rows: list[Triple], v: Triple) -> Triple:
    """Product of a matrix's rows and a vector, plain numbers."""
    return dot(rows[0], v), dot(rows[1], v), dot(rows[2], v)


def skew(v: Triple) -> Array:
    """Matrix of v x, (3, 3)."""
    x, y, z = v
    return np.array(((0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0)))


def rows_cross(a: Array, b: Array) -> Array:
    """Vector products of rows; much quicker than `np.cross` on six of them."""
    (ax, ay, az), (bx, by, bz) = a.T, b.T
    return np.array((ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx)).T


def _rows_dot(a: Array, b: Array) -> Array:
    dots: Array = np.einsum("ij,ij->i", a, b)
    return dots


rows_dot = getattr(np, "vecdot", _rows_dot)  # new in NumPy 2, three times as quick


@dataclass(slots=True)
class Platform:
    """Pose and motion of {M} in {S}; `M_J`: twist of O_M per independent rate, (6, 4)."""

    R: Array
    p: Triple
    v: Triple
    a: Triple
    omega: Triple
    alpha: Triple
    M_J: Array


@dataclass(slots=True)
class Chains:
    """Motion of the chains, rows.

    `motion`: P, P', P'' side by side; `n`: coupler direction in N_i0, (3, 6); `c`: cos(gamma_i);
    `turns`: beta_i and gamma_i with first and second rates, (3, 2, 6).
    """

    r: Array
    motion: Array
    J: Array
    t: Array
    cos_theta: Array
    sin_theta: Array
    theta_d: Array
    theta_dd: Array
    n: Array
    c: Array
    turns: Array


class Closure:
    """The closure of one mechanism."""

    def __init__(self, mechanism: Mechanism) -> None:
        self.normals = [c.normal.tolist() for c in mechanism.contacts]
        self.points = [c.point.tolist() for c in mechanism.contacts]
        self.offsets = [c.offset for c in mechanism.contacts]
        self.load_point = mechanism.load_point
        self.gamma_branch = mechanism.gamma_branch

        def stack(name: str) -> Array:
            return np.array([getattr(c, name) for c in mechanism.chains])

        self.base, self.u, self.w, self.joint = map(stack, ("base", "u", "w", "joint"))
        self.N, self.branch = stack("N"), stack("branch")
        self.crank, self.coupler = stack("crank"), stack("coupler")
        self.l = self.crank[:, None]
        self.per_2l = 0.5 / self.crank
        self.l2_L2 = self.crank**2 - self.coupler**2
        self.per_L = 1 / self.coupler
        self.N_per_L = self.N / self.coupler[:, None, None]

    def place(self, q: Array, qd: Array, qdd: Array) -> Platform:
        """Platform from the independent coordinates, Z and gamma from the two planes."""
        X, Y, alpha, beta = q.tolist()
        X_d, Y_d, alpha_d, beta_d = qd.tolist()
        X_dd, Y_dd, alpha_dd, beta_dd = qdd.tolist()
        sa, ca, sb, cb = sin(alpha), cos(alpha), sin(beta), cos(beta)
        x, y, z = (cb, sa * sb, -ca * sb), (0.0, ca, sa), (sb, -sa * cb, ca * cb)
        (n0, n1), (t0, t1), (o0, o1) = self.normals, self.points, self.offsets
        v0x, v0y, v0z, v1x, v1y, v1z = (dot(n, e) for n in (n0, n1) for e in (x, y, z))
        dnx, dny = n0[0] - n1[0], n0[1] - n1[1]
        A = v0x * t0[0] + v0y * t0[1] - v1x * t1[0] - v1y * t1[1]
        B = v0y * t0[0] - v0x * t0[1] - v1y * t1[0] + v1x * t1[1]
        C = o0 - o1 - dnx * X - dny * Y - v0z * t0[2] + v1z * t1[2]
        h = A * A + B * B
        k = self.gamma_branch * sqrt(h - C * C)
        cg, sg = (A * C + B * k) / h, (B * C - A * k) / h
        rows = [(cg * x[i] + sg * y[i], cg * y[i] - sg * x[i], z[i]) for i in range(3)]

        r0, r1 = turn(rows, t0), turn(rows, t1)
        m0, m1 = cross(r0, n0), cross(r1, n1)
        dm = (m0[0] - m1[0], m0[1] - m1[1], m0[2] - m1[2])
        # Gradients of gamma and Z by (X, Y, alpha, beta); alpha turns about X_S, beta about y.
        m_z = dot(m0, z)
        per = -1 / dot(dm, z)
        gX, gY, ga, gb = dnx * per, dny * per, dm[0] * per, dot(dm, y) * per
        ZX, ZY = -n0[0] - m_z * gX, -n0[1] - m_z * gY
        Za, Zb = -m0[0] - m_z * ga, -dot(m0, y) - m_z * gb

        gamma_d = gX * X_d + gY * Y_d + ga * alpha_d + gb * beta_d
        omega_xy = (alpha_d, beta_d * ca, beta_d * sa)
        omega = (
            omega_xy[0] + gamma_d * z[0],
            omega_xy[1] + gamma_d * z[1],
            omega_xy[2] + gamma_d * z[2],
        )
        about_z, ab = cross(omega_xy, z), alpha_d * beta_d
        bias = (
            gamma_d * about_z[0],
            gamma_d * about_z[1] - ab * sa,
            gamma_d * about_z[2] + ab * ca,
        )
        c0 = dot(n0, cross(omega, cross(omega, r0))) + dot(m0, bias)
        c1 = dot(n1, cross(omega, cross(omega, r1))) + dot(m1, bias)
        gamma_bias = (c0 - c1) * per
        gamma_dd = gX * X_dd + gY * Y_dd + ga * alpha_dd + gb * beta_dd + gamma_bias
        Z_dd = ZX * X_dd + ZY * Y_dd + Za * alpha_dd + Zb * beta_dd - c0 - m_z * gamma_bias
        return Platform(
            R=np.array(rows),
            p=(X, Y, o0 - n0[0] * X - n0[1] * Y - dot(n0, r0)),
            v=(X_d, Y_d, ZX * X_d + ZY * Y_d + Za * alpha_d + Zb * beta_d),
            a=(X_dd, Y_dd, Z_dd),
            omega=omega,
            alpha=(
                alpha_dd + gamma_dd * z[0] + bias[0],
                beta_dd * ca + gamma_dd * z[1] + bias[1],
                beta_dd * sa + gamma_dd * z[2] + bias[2],
            ),
            M_J=np.array(
                (
                    (1.0, 0.0, 0.0, 0.0),
                    (0.0, 1.0, 0.0, 0.0),
                    (ZX, ZY, Za, Zb),
                    (gX * z[0], gY * z[0], ga * z[0] + 1.0, gb * z[0]),
                    (gX * z[1], gY * z[1], ga * z[1], gb * z[1] + ca),
                    (gX * z[2], gY * z[2], ga * z[2], gb * z[2] + sa),
                )
            ),
        )

    def move(self, b: Platform) -> Chains:
        """Chains from the platform."""
        Omega = skew(b.omega)
        r = self.joint @ b.R.T
        turned = np.concatenate((np.eye(3), Omega, skew(b.alpha) + Omega @ Omega))
        motion = r @ turned.T + (*b.p, *b.v, *b.a)
        P, P_d, P_dd = motion[:, :3], motion[:, 3:6], motion[:, 6:]

        d = P - self.base
        a, e_w = rows_dot(d, self.u), rows_dot(d, self.w)
        reach = (rows_dot(d, d) + self.l2_L2) * self.per_2l
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

        n = np.concatenate((e, e_d, e_dd), axis=1).reshape(6, 3, 3) @ self.N_per_L
        (x, y, z), (x_d, y_d, z_d), (x_dd, y_dd, z_dd) = n.transpose(1, 2, 0)
        c2 = x * x + z * z
        c = np.sqrt(c2)
        gamma_d = y_d / c
        beta_d = (x_d * z - z_d * x) / c2
        gamma_dd = (y_dd + y * gamma_d * gamma_d) / c
        beta_dd = (x_dd * z - z_dd * x) / c2 + 2 * beta_d * gamma_d * y / c
        rates = ((beta_d, gamma_d), (beta_dd, gamma_dd))
        return Chains(
            r=r,
            motion=motion,
            J=J,
            t=t,
            cos_theta=cos_theta,
            sin_theta=sin_theta,
            theta_d=theta_d,
            theta_dd=theta_dd,
            n=n[:, 0].T,
            c=c,
            turns=np.array(((np.arctan2(-z, x), np.arcsin(y)), *rates)),
        )

    def project(
        self, b: Platform, c: Chains, force: Array, ends: Array, turns: Array, F: Array
    ) -> Array:
        """Minimum-norm torques from the forces of the cut tree.

        Args: force: on the platform and its moment about O_M, then on the six shafts, (12,); ends:
            on the couplers at the platform joints, (6, 3), all in {S}; turns: dual to beta_i and
            gamma_i, (6, 2); F: bite force, (3,).
        """
        per_c = self.per_L / c.c
        by_beta, by_gamma = turns[:, 0] * per_c / c.c, turns[:, 1] * per_c
        local = np.array((by_beta * c.n[2], by_gamma, -by_beta * c.n[0])).T
        g = (self.N @ local[:, :, None])[:, :, 0]
        F_P = ends + g + (force[6:] - rows_dot(g, c.t))[:, None] * c.J
        # The sum of r x F is the skew part of the sum of their outer products.
        outer = c.r.T @ F_P - np.outer(b.R @ self.load_point, F)
        moment = outer[[1, 2, 0], [2, 0, 1]] - outer[[2, 0, 1], [1, 2, 0]]
        Q = force[:6] + np.concatenate((F_P.sum(axis=0) - F, moment))
        A = c.J @ b.M_J[:3] + rows_cross(c.r, c.J) @ b.M_J[3:]
        return A @ np.linalg.solve(A.T @ A, Q @ b.M_J)
