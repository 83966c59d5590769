"""The equations of motion written a second time, chain by chain, and run by CasADi and numpy.

    Pi^T Q = (J Pi)^T tau,     Q - J^T tau = G mu.

It shares the formulas of a surface, a chain and a body with the library, and nothing else: no
graphs, lanes or kernels. Poses are closed in closed form or followed from home, the efforts come
from singular values, contact forces from the pseudo-inverse. It is what graphs and backends are
tested against.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca
import numpy as np

from condyle.dynamics import FORMULATIONS
from condyle.dynamics.formulation import Formulation, PlatformBody
from condyle.kinematics.batch import evaluate
from condyle.kinematics.chain import FAMILIES, ChainDynamics, Constants, Family
from condyle.kinematics.constraints import (
    closed_form,
    contact_frame,
    contacts_of,
    indices,
    parasitic_jacobian,
)
from condyle.kinematics.parasitic import platform_rates
from condyle.kinematics.state import PointMotion, pose_state, twist_state
from condyle.mechanism import Mechanism
from condyle.mechanism.home import (
    characteristic_length,
    dependent_coordinates,
    independent_coordinates,
)
from condyle.questions.file_numbers import numbers_of
from condyle.questions.numbers import Layout, has_closed_form
from condyle.questions.structure import structure_of

from .following import coordinate_closure

Array = np.ndarray


@dataclass(frozen=True)
class Found:
    """N samples, by the names of `condyle.model.model_result.ModelResult`."""

    pose: Array
    pose_rate: Array
    pose_acceleration: Array
    effort: Array
    share: Array
    contact_force: Array
    joint_rate: Array
    joint_acceleration: Array
    reached: Array


class Interpreter:
    """Inverse dynamics of one mechanism by one formulation, in the coordinates of the core."""

    def __init__(self, mechanism: Mechanism, formulation: str = "virtual_power") -> None:
        self.mechanism = mechanism
        self._independent = independent_coordinates(mechanism)
        self._core = core_function(mechanism, FORMULATIONS[formulation])
        self._parts = len(part_names(mechanism))
        angles = np.array([i >= 3 for i in indices(self._independent)])
        self._scale = np.where(angles, characteristic_length(mechanism), 1.0)

    def solve(self, q: Array, q1: Array, q2: Array, load: Array) -> Found:
        """Samples of the independent coordinates, (N, m) each, under loads (N, 9)."""
        with np.errstate(all="ignore"):
            poses, reached = self.poses(q, q1, q2)
            return self._solve(poses, reached, load)

    def poses(self, q: Array, q1: Array, q2: Array) -> tuple[tuple[Array, ...], Array]:
        """X_EE and its rates, (N, 6) each, and where there are such poses."""
        if has_closed_form(self.mechanism):
            *poses, reach = evaluate(closure_function(self.mechanism), q, q1, q2)
            return tuple(poses), reach[:, 0] >= 0
        found = coordinate_closure(self.mechanism, self._independent).solve(q, q1, q2)
        return (found.pose, found.rate, found.acceleration), found.reached

    def system(self, poses: tuple[Array, ...], load: Array) -> dict[str, Array]:
        """A (N, n, m) and b (N, m, parts) of A^T tau = b, with what belongs to them."""
        n, k, m = len(self.mechanism.chains), len(self.mechanism.contacts), len(self._scale)
        raw = evaluate(self._core, *poses, load)
        forces, J, Pi, rate, acceleration, reach, G, n_length = raw
        shaped = [
            a.reshape(len(load), columns, rows).transpose(0, 2, 1)
            for a, rows, columns in (
                (forces, 6, self._parts),
                (J, n, 6),
                (Pi, 6, m),
                (G, 6, k),
            )
        ]
        forces, J, Pi, G = shaped
        b = Pi.transpose(0, 2, 1) @ forces
        names = ("A", "b", "Q", "J", "G", "n_length", "rate", "acceleration", "reach")
        values = (J @ Pi, b, forces.sum(axis=2), J, G, n_length, rate, acceleration, reach)
        return dict(zip(names, values, strict=True))

    def _solve(self, poses: tuple[Array, ...], reached: Array, load: Array) -> Found:
        s = self.system(poses, load)
        share = least_norm(s["A"], s["b"], self._scale)
        effort = share.sum(axis=2)
        left = s["Q"] - (s["J"].transpose(0, 2, 1) @ effort[..., None])[..., 0]
        mu = np.full(s["n_length"].shape, np.nan)
        good = np.isfinite(left).all(axis=1) & np.isfinite(s["G"]).all(axis=(1, 2))
        mu[good] = (np.linalg.pinv(s["G"][good]) @ left[good][..., None])[..., 0]
        return Found(
            *poses,
            effort=effort,
            share=share.transpose(0, 2, 1),
            contact_force=mu * s["n_length"],
            joint_rate=s["rate"],
            joint_acceleration=s["acceleration"],
            reached=reached & (s["reach"] >= 0).all(axis=1),
        )


def least_norm(A: Array, b: Array, scale: Array) -> Array:
    """The shortest tau with A^T tau = b, (N, n, r), from singular values of A; NaN where A is."""
    tau = np.full((len(A), A.shape[1], b.shape[2]), np.nan)
    good = np.isfinite(A).all(axis=(1, 2))
    U, sigma, Vt = np.linalg.svd(A[good] / scale, full_matrices=False)
    tau[good] = U @ (Vt @ (b[good] / scale[:, None]) / sigma[..., None])
    return tau


def part_names(mechanism: Mechanism) -> tuple[str, ...]:
    """Parts that share the efforts: platform, the links of the chains, load."""
    links: dict[str, None] = {}
    for kind in dict.fromkeys(chain.kind for chain in mechanism.chains):
        links.update(dict.fromkeys(reversed(FAMILIES[kind].bodies)))
    return ("platform", *links, "load")


def core_function(mechanism: Mechanism, formulation: Formulation) -> ca.Function:
    """(X_EE, X_EE', X_EE'', load) -> forces (s, parts), J (n, s), Pi (s, m), joint rates and
    accelerations, reach, G (s, k) and |grad phi| (k,).

    load: force and moment in {S} and the point they act at in {M}, (9,).
    """
    X, X1, X2 = (ca.SX.sym(name, 6) for name in ("X", "X1", "X2"))
    load = ca.SX.sym("load", 9)
    state = pose_state(X, X1, X2)
    frame = contact_frame(contacts_of(mechanism), X[:3], state.R)
    M_J = parasitic_jacobian(frame.N.T @ state.B, dependent_coordinates(mechanism))
    Pi, G = M_J, state.B.T @ frame.N
    if formulation.uses_twist:
        Pi, G = state.B @ M_J, frame.N
        state = twist_state(X, state.R, state.twist, state.twist_rate)
    g = ca.SX(ca.DM(mechanism.gravity))
    platform = mechanism.platform
    body = PlatformBody(
        ca.SX(platform.mass), ca.SX.zeros(3), ca.SX(ca.DM(platform.inertia.tensor()))
    )
    parts = {name: ca.SX(6, 1) for name in part_names(mechanism)}
    parts["platform"] = formulation.platform(state, body, g)
    r, force, moment = state.R @ load[6:], load[:3], load[3:6]
    parts["load"] = -(state.B.T @ ca.vertcat(force, ca.cross(r, force) + moment))
    laws: list[ChainDynamics] = []
    rows = []
    cached: dict[str, Callable[..., ChainDynamics]] = {}
    for chain in mechanism.chains:
        family = FAMILIES[chain.kind]
        if chain.kind not in cached:
            cached[chain.kind] = chain_function(formulation, family)
        M = state.point(ca.SX(ca.DM(chain.platform)))
        constants = ca.SX(ca.DM(family.vector(family.constants(chain))))
        law = cached[chain.kind](constants, M, g)
        laws.append(law)
        for name, f in law.forces.items():
            parts[name] += state.generalized_force(f, M.lever)
        rows.append(state.generalized_force(law.J, M.lever).T)
    columns = [
        ca.horzcat(*parts.values()),
        ca.vertcat(*rows),
        Pi,
        *(ca.vertcat(*(getattr(law, a) for law in laws)) for a in ("rate", "acceleration")),
        ca.vertcat(*(law.discriminant for law in laws)),
        G,
        frame.n_length,
    ]
    return _function("core", [X, X1, X2, load], columns)


def closure_function(mechanism: Mechanism) -> ca.Function:
    """Closed-form parasitic motion: (q, q', q'') -> X_EE, X_EE', X_EE'', reach."""
    dependent = dependent_coordinates(mechanism)
    m = 6 - len(dependent)
    q, q1, q2 = (ca.SX.sym(name, m) for name in ("q", "q1", "q2"))
    contacts = contacts_of(mechanism)
    structure = structure_of(mechanism)
    at, _ = Layout.of(structure).parameters["branch"]
    branch = float(numbers_of(structure, mechanism).parameters[0, at])
    placement = closed_form(contacts, dependent, q, ca.SX(branch))
    motion = platform_rates(contacts, dependent, placement, q1, q2)
    pose = placement.pose()
    # The given angles as they are: arc functions would take them to their principal values.
    pose[indices(independent_coordinates(mechanism))] = q
    reach = placement.discriminant if placement.discriminant is not None else ca.SX(1.0)
    return _function("closure", [q, q1, q2], [pose, motion.rate, motion.acceleration, reach])


def chain_function(formulation: Formulation, family: Family) -> Callable[..., ChainDynamics]:
    """A family's law, derived once and called for each chain with its numbers."""
    c = ca.SX.sym("c", family.size())
    P, V, A, r, g = (ca.SX.sym(name, 3) for name in "PVArg")
    named: Constants = family.named(c)
    law = formulation.chain(family, named, PointMotion(P, V, A, r), g)
    names = list(law.forces)
    outputs = [*law.forces.values(), law.J, law.discriminant, law.rate, law.acceleration]
    function = ca.Function("law", [c, P, V, A, g], outputs)

    def call(constants: ca.SX, M: PointMotion, gravity: ca.SX) -> ChainDynamics:
        values = function.call([constants, M.position, M.velocity, M.acceleration, gravity])
        forces = dict(zip(names, values, strict=False))
        return ChainDynamics(forces, *values[len(names) :])

    return call


def _function(name: str, inputs: list[ca.SX], outputs: list[ca.SX]) -> ca.Function:
    return ca.Function(name, inputs, ca.cse([ca.densify(o) for o in outputs]))
