"""State and load from encoders and efforts: an extended Kalman filter with the load as a state.

    x = (q, q', f),    q'' = forward dynamics of (q, q', effort, f at a point) + n_a,    f' = n_f,

with f (3,) [N] in {S} a random walk: whatever the model does not know of pushes on the point. From
one tick to the next, T later, with the effort that acted in between and B = dq'' / df,

    q + T q' + T^2/2 q'',   q' + T q'',   f,      P- = F P F^T + Q,

F and Q those of three integrators in a row, 1, B and the noises n_a, n_f exact over T; slopes of
q'' by q and q' are left out of F, where they are T times smaller. Counts theta have errors of
variance R a chain, and so, with A = d theta / dq at the predicted q,

    V = (A^T R^-1 A)^-1,    nu = V A^T R^-1 (theta - theta(q)),    S = P-_qq + V,
    K = P-_q S^-1,    x = x- + K nu,    P = P- - K P-_q^T:

the update by all encoders at once, through the pose of least squares nu and its covariance V, which
costs m by m equations where n encoders would take n by n (Bar-Shalom, Li and Kirubarajan,
Estimation with Applications to Tracking and Navigation, 2001, sections 5.4 and 7.2; disturbance as
a state: Ohnishi, Shibata and Murakami, IEEE/ASME Trans. Mechatronics 1 (1996) 56-67). nu^T S^-1 nu,
`innovation`, has the mean m where the noises are what they are said to be.
"""

from __future__ import annotations

import casadi as ca

from ..dynamics.least_norm import definite_solve, gram
from ..graph.program import Programs
from ..kinematics.chain import FAMILIES
from .builder import Builder, Lanes
from .configuration import loops_of, on_rates
from .equations import Wrench
from .forward import accelerated
from .inverse import DOUBTFUL
from .observer import Measured, counted
from .platform import feasibility, platform_at
from .pose import without_turns
from .structure import Structure

REGULAR = 1e-12  # minimum |pivot| over the diagonal's entry, of A^T R^-1 A and of S
BEFORE = {  # port -> result
    "estimate_before": "estimate",
    "covariance_before": "covariance",
    "begun_before": "begun",
}


def entries(size: int) -> list[tuple[int, int]]:
    """Rows and columns of a covariance as it goes in and comes out: its lower triangle by rows."""
    return [(i, j) for i in range(size) for j in range(i + 1)]


def kalman(structure: Structure) -> Programs:
    """The state and the load from encoders and the efforts that acted since the last call.

    Ports: as of `estimated`.  Results: q, q1 (m,), force (3,), and those of `estimated`.
    """
    b = Builder(structure)
    reading, acted = b.lane_sample("joint", unit="rad or m"), b.lane_sample("acted")
    found = estimated(b, reading, acted, b.sample("period", 1, "s"))
    b.output("q", found.q, "m, rad", structure.m)
    b.output("q1", found.q1, "per s", structure.m)
    b.output("force", found.force, "N", 3)
    return Programs(b.finish(), single=True)


def estimated(b: Builder, reading: Lanes, acted: Lanes, period: ca.SX) -> Measured:
    """The same as a part of another question.

    Ports: resolution; encoder_std, of the counts; acceleration_std (m,) and force_std, of the
    noises a root of time; load_point (3,) in {M}; results of `BEFORE`, all 0 at the first call.
    Results: estimate (2 m + 3,), covariance as of `entries`, innovation, begun.
    """
    m = b.structure.m
    size = 2 * m + 3
    std, noise = b.lane_sample("encoder_std"), b.sample("acceleration_std", m) ** 2
    walk, point = b.sample("force_std", 1) ** 2, b.sample("load_point", 3, "m")
    x, packed = b.sample("estimate_before", size), b.sample("covariance_before", _count(size))
    T = ca.if_else(b.sample("begun_before", 1) > 0, period, 0)
    counts = counted(b, reading)

    # -- prediction
    q, q1, f = x[:m], x[m : 2 * m], x[2 * m :]
    none = ca.SX.zeros(3)
    still = ca.SX.zeros(m)
    q2 = accelerated(b, platform_at(b, q, q1, still), Wrench(f, none, point), acted, False).q2
    B = b.jacobian(q2, f)
    q2, B = b.cut(q2), ca.reshape(b.cut(B), m, 3)
    q, q1 = b.cut(q + T * q1 + T**2 / 2 * q2), b.cut(q1 + T * q2)
    P = _predicted(b, _full(packed, size), B, noise, walk, T)

    # -- what the encoders say
    platform = platform_at(b, q, q1, still)
    loops = loops_of(b, platform)
    A = on_rates(b, platform, [loop.J for loop in loops])
    turns = [FAMILIES[kind].joint_unit == "rad" for kind in b.structure.families]
    pairs = [count - loop.q_r[0] for count, loop in zip(counts, loops, strict=True)]
    error = [without_turns(e) if turn else e for e, turn in zip(pairs, turns, strict=True)]
    groups = range(len(A))
    weight = [b.lane(i, "mask") / ca.if_else(std[i] > 0, std[i], 1) for i in groups]
    A_w = [a * w for a, w in zip(A, weight, strict=True)]
    G = gram(b.total, A_w, A_w)
    y = b.total([a * w * e for a, w, e in zip(A_w, weight, error, strict=True)])
    found, excess, _ = definite_solve(G, ca.horzcat(y, ca.SX.eye(m)), ca.diag(G), REGULAR)
    nu, V = b.cut(found[:, 0]), ca.reshape(b.cut(found[:, 1:]), m, m)

    # -- update
    S = P[:m, :m] + (V + V.T) / 2
    right = ca.horzcat(nu, P[:m, :])
    solved, more, _ = definite_solve(S, right, ca.diag(S), REGULAR)
    x = ca.vertcat(q, q1, f) + P[:, :m] @ solved[:, 0]
    P = P - P[:, :m] @ solved[:, 1:]
    b.output("estimate", x, "m, rad, per s, N", size)
    b.output("covariance", ca.vertcat(*(P[i, j] for i, j in entries(size))), "", _count(size))
    b.output("innovation", ca.dot(nu, solved[:, 0]), "1")
    b.output("begun", ca.SX(1), "1")
    b.check(feasibility(b, platform, [loop.discriminant for loop in loops]), DOUBTFUL)
    for one in (*excess, *more):
        b.check(2 * (one > 0) - 1, 0.5)
    q1 = x[m : 2 * m]
    return Measured(x[:m], q1, counts, [ca.dot(a, q1) for a in A], x[2 * m :])


def _count(size: int) -> int:
    return size * (size + 1) // 2


def _full(packed: ca.SX, size: int) -> ca.SX:
    P = ca.SX(size, size)
    for k, (i, j) in enumerate(entries(size)):
        P[i, j] = P[j, i] = packed[k]
    return P


def _predicted(b: Builder, P: ca.SX, B: ca.SX, noise: ca.SX, walk: ca.SX, T: ca.SX) -> ca.SX:
    """F P F^T + Q, (2 m + 3, 2 m + 3).

    Args: noise: variance of n_a, (m,), and walk: of n_f, for each second.
    """
    m, none = B.shape[0], ca.SX
    one, three = ca.SX.eye(m), ca.SX.eye(3)
    F = ca.vertcat(
        ca.horzcat(one, T * one, T**2 / 2 * B),
        ca.horzcat(none(m, m), one, T * B),
        ca.horzcat(none(3, 2 * m), three),
    )
    a, BB, Bw = ca.diag(noise), walk * B @ B.T, walk * B
    qq, qv, vv = T**3 / 3 * a, T**2 / 2 * a, T * a
    qq, qv, vv = qq + T**5 / 20 * BB, qv + T**4 / 8 * BB, vv + T**3 / 3 * BB
    qf, vf = T**3 / 6 * Bw, T**2 / 2 * Bw
    Q = ca.vertcat(
        ca.horzcat(qq, qv, qf), ca.horzcat(qv.T, vv, vf), ca.horzcat(qf.T, vf.T, T * walk * three)
    )
    size = P.shape[0]
    found = F @ P @ F.T + Q
    lower = b.cut(ca.vertcat(*(found[i, j] for i, j in entries(size))))
    return _full(lower, size)
