"""The matrices of the equations of motion ([Cheng2023] eqs 57, 61, 63, 64).

    M_r q'' + C_r q' + G_r = (J_theta M_J)^T tau + load,

in the independent coordinates q_EE, or, without M_J, dual to X_EE. The generalized force is that of
inverse dynamics; M_r is its exact derivative in the accelerations, G_r its value at rest.
"""

from __future__ import annotations

import casadi as ca

from ..dynamics.joint_space import chain_jacobians
from ..graph.program import Program
from ..kinematics.chain import FAMILIES
from ..kinematics.state import pose_state
from .builder import Builder
from .configuration import twist_rows, wrench_scale
from .equations import Wrench, equations, total
from .instant import inertia_matrix, inertia_matrix_X
from .platform import given, independent_indices
from .structure import Structure


def matrices(structure: Structure) -> Program:
    """Inertia matrix, Coriolis and centrifugal force, gravity: in q_EE, and dual to X_EE.

    At whole poses and admissible rates; port pose_acceleration is X_EE'' for q'' = 0.
    """
    b = Builder(structure)
    platform = given(b)
    X, X1, X2 = platform.pose, platform.motion.rate, platform.motion.acceleration
    zero = ca.SX.zeros(3)
    eq = equations(b, platform, Wrench(zero, zero, zero), route="core", state=pose_state(X, X1, X2))
    Q = b.cut(total(list(eq.parts.values())))
    M = b.jacobian(Q, X2)
    moving = b.at_zero(Q, X2)
    G = b.at_zero(moving, X1)
    bias = moving - G
    M_J = platform.motion.M_J
    b.output("inertia_matrix", M_J.T @ M @ M_J, "kg, kg m, kg m^2", structure.m, structure.m)
    b.output("bias", M_J.T @ (bias + M @ X2), "N, N m", structure.m)
    b.output("gravity", M_J.T @ G, "N, N m", structure.m)
    b.output("inertia_matrix_X", M, "kg, kg m, kg m^2", 6, 6)
    b.output("bias_X", bias, "N, N m", 6)
    b.output("gravity_X", G, "N, N m", 6)
    return b.finish()


def coriolis(structure: Structure, unconstrained: bool = False) -> Program:
    """C by Christoffel's symbols of the inertia matrix M, at whole poses that meet the contacts.

        C_ij = 1/2 sum_k (dM_ij/dq_k + dM_ik/dq_j - dM_jk/dq_i) v_k

    Args: unconstrained: dual to X_EE, of the mechanism without contacts; else in q_EE.
    """
    b = Builder(structure)
    platform = given(b, still=True)
    rate, ind = b.sample("pose_rate", 6), independent_indices(structure.dependent)
    motion = platform.motion
    if unconstrained:
        M, direction, v = inertia_matrix_X(b, platform), ca.SX.eye(6), rate
    else:
        M, direction, v = inertia_matrix(b, platform), motion.M_J, rate[ind]
    size = M.shape[0]
    upper = [(i, j) for j in range(size) for i in range(j + 1)]
    entries = b.cut(ca.vertcat(*(M[i, j] for i, j in upper)))
    slopes = b.jacobian(entries, platform.pose) @ direction  # the pose follows q along M_J
    C = ca.SX.zeros(size, size)
    for n, (i, j) in enumerate(upper):
        for k in range(size):
            # dM_ij/dq_k in the three places where it stands, and those of dM_ji/dq_k.
            for r, s in {(i, j), (j, i)}:
                half = slopes[n, k] / 2
                C[r, s] += half * v[k]
                C[r, k] += half * v[s]
                C[k, r] -= half * v[s]
    b.output("coriolis", C, "kg/s, kg m/s, kg m^2/s", size, size)
    return b.finish()


def jacobians(structure: Structure) -> Program:
    """J on the twist, J_theta on X_EE', M_J, and M_1i, M_2i, M_3i of every chain.

    [Cheng2023] eqs (8), (9), (11), (15)-(18); J_W on [V; L omega], dimensionless, and the contacts'
    wrenches N dual to it.
    """
    b = Builder(structure)
    platform = given(b, still=True)
    motion = platform.motion
    state = pose_state(platform.pose, motion.rate, motion.acceleration)
    twists, rods, sines, rows, M_1, M_2, M_3 = [], [], [], [], [], [], []
    for group, kind in enumerate(structure.families):
        family = FAMILIES[kind]
        c = family.named(b.lane(group, "constants"))
        M = state.point(b.lane(group, "joint"))
        loop = family.loop(c, M.position)
        twists.append(ca.vertcat(loop.J, ca.cross(M.lever, loop.J)))
        rods.append(loop.rod / loop.rod_length)
        sines.append(loop.transmission)
        rows.append(state.generalized_force(loop.J, M.lever))
        one, inverse = chain_jacobians(family, c, loop.q_r)
        two = ca.horzcat(ca.SX.eye(3), -ca.skew(M.lever)) @ state.B
        M_1.append(one)
        M_2.append(two)
        M_3.append(inverse @ two)
    scale = wrench_scale(b)
    b.output("J", twists, "rad or m per m or rad")
    b.output("J_W", [scale * row for row in twist_rows(b, platform, rods)], "1")
    b.output("transmission", sines, "1")
    b.output("N", (ca.diag(scale) @ motion.frame.N).T, "1", len(structure.contacts), 6)
    b.output("twist_basis", motion.E @ motion.M_J, "", 6, structure.m)
    b.output("J_theta", rows, "rad or m per m or rad")
    b.output("M_J", motion.M_J, "", 6, structure.m)
    b.output("M_1", M_1, "m", 3, 3)
    b.output("M_2", M_2, "", 3, 6)
    b.output("M_3", M_3, "", 3, 6)
    return b.finish()
