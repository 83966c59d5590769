"""Modes against MuJoCo, whose joints have the springs: its forces, differenced, and its inertia."""

import numpy as np
import pytest
from mpmath import mpf
from oracles.closure import contact_normals
from oracles.description import COORDINATES
from oracles.digits import Machine, plain
from oracles.mujoco_engine import MujocoEngine
from oracles.random_mechanism import random_mechanism, random_state, toml_text
from oracles.rotations import platform_motion
from oracles.springs import SprungMachine
from scipy.linalg import eigh

import condyle
from condyle.mechanism import parse
from condyle.model.model import Model

from .test_stiffness import sprung

SMOOTH = (
    "sphere",
    "quadratic",
    "ellipsoid",
    "cylinder",
    "plane",
)  # a spline has a third derivative
SIXTH = {1: 3 / 4, 2: -3 / 20, 3: 1 / 60}  # central differences, to h^6


class Sprung:
    """An engine with springs k and dampers d in its drives, which deliver tau at a pose."""

    def __init__(self, raw, model, k, d):
        self.engine, self.free = (
            MujocoEngine(raw),
            [COORDINATES.index(n) for n in model.independent],
        )
        self.machine, m = Machine(raw, model.independent), self.engine.model
        joints = m.dof_jntid[self.engine.drives]
        m.jnt_stiffness[joints], m.dof_damping[self.engine.drives] = k, d
        self.joints, self.k = joints, k

    def hold(self, pose, tau):
        self.near, q = pose, self.engine.coordinates(pose)
        at = self.engine.model.jnt_qposadr[self.joints]
        self.engine.model.qpos_spring[at] = q[at] + tau / self.k

    def basis(self, pose):
        """Rates of the tree by q, (nv, m)."""
        L, motion = self.engine.loops(), platform_motion(pose)
        chains = -np.linalg.solve(L[:, 6:], L[:, :6])
        M_J = np.zeros((6, len(self.free)))
        M_J[self.free, range(len(self.free))] = 1.0
        if self.engine.d.contacts:
            held = [i for i in range(6) if i not in self.free]
            normals = contact_normals(self.engine.d, motion)
            C = np.einsum("ki,kij->kj", normals, self.engine.points())
            M_J[held] = -np.linalg.solve(C[:, held], C[:, self.free])
        return np.vstack([M_J, chains @ M_J])

    def at(self, q):
        """The pose, closed in many digits: differences ask for all of a double's."""
        still = np.zeros(len(q))
        return np.array(plain(self.machine.closed(self.near, q, still, still)[0][0]), dtype=float)

    def force(self, q):
        pose = self.at(q)
        tree = self.engine.coordinates(pose)
        still = np.zeros(self.engine.model.nv)
        return self.basis(pose).T @ self.engine.inverse(tree, still, still)

    def matrices(self, q, size):
        """K, M and D."""
        K = np.zeros((len(q), len(q)))
        for j, step in enumerate(np.diag(size)):
            for i, weight in SIXTH.items():
                K[:, j] += weight * (self.force(q + i * step) - self.force(q - i * step)) / size[j]
        pose = self.at(q)
        tree = self.engine.coordinates(pose)
        B, still = self.basis(pose), np.zeros(self.engine.model.nv)
        M = B.T @ self.engine.matrices(tree, still)[0] @ B
        return K, M, B.T @ np.diag(self.engine.model.dof_damping) @ B


@pytest.mark.slow
@pytest.mark.parametrize("k", range(6))
def test_against_mujoco(k: int) -> None:
    rng = np.random.default_rng([7, k])
    families = ("RSS", "PSS", "SPS")
    raw = random_mechanism(rng, families, contacts=k, surface=SMOOTH, tilted_gravity=True)
    for chain in raw["chain"]:
        stiffness = float(rng.uniform(5, 20)) * (1.0 if chain["kind"] == "RSS" else 2e3)
        chain["actuator"] = {"stiffness": stiffness, "damping": 1e-3 * stiffness}
    model, state = Model(parse(toml_text(raw)), backend="numpy"), random_state(rng, raw)
    q, effort = state["q"][0], rng.uniform(-0.3, 0.3, 6)
    springs = [[chain["actuator"][n] for chain in raw["chain"]] for n in ("stiffness", "damping")]
    engine = Sprung(raw, model, *map(np.array, springs))
    engine.hold(state["pose"][0], effort)
    turns = [name not in ("X", "Y", "Z") for name in model.independent]
    K, M, D = engine.matrices(q, np.where(turns, 1.0, model.characteristic_length) * 1e-4)

    found = model.modes(q, effort)
    square, _ = eigh((K + K.T) / 2, M)
    np.testing.assert_allclose(found.frequency, np.sqrt(square) / (2 * np.pi), rtol=1e-8)
    X = found.shape
    np.testing.assert_allclose(X @ M @ X.T, np.eye(len(q)), atol=1e-8)
    np.testing.assert_allclose(X @ K @ X.T, np.diag(square), atol=1e-7 * square.max())
    wanted = np.diag(X @ D @ X.T) / (2 * np.sqrt(square))
    np.testing.assert_allclose(found.damping, wanted, rtol=1e-7)
    roots = np.linalg.eigvals(
        np.block([[0 * M, np.eye(len(q))], [-np.linalg.solve(M, K), -np.linalg.solve(M, D)]])
    )
    for s in found.eigenvalue:
        assert np.abs(roots - s).min() < 1e-7 * np.abs(roots).max()


@pytest.mark.slow
def test_joints_follow_where_drive_and_rod_balance() -> None:
    """One damper tells how its joint moves in each mode: between a spring, a rod and a load."""
    rng = np.random.default_rng(11)
    raw = sprung(rng, random_mechanism(rng, ("RSS",), contacts=2, surface="sphere"), "both")
    for chain in raw["chain"]:
        chain["actuator"]["damping"] = 0.0
    raw["chain"][0]["actuator"]["damping"] = damping = 0.03
    model, state = Model(parse(toml_text(raw)), backend="numpy"), random_state(rng, raw)
    q, effort = state["q"][0], rng.uniform(-0.3, 0.3, len(raw["chain"]))
    found, zero = model.modes(q, effort), np.zeros(6)
    machine = SprungMachine(raw, model.independent, state["pose"][0], effort, zero, zero[:3])
    machine.energy(machine.q)
    for x, ratio, hertz in zip(found.shape, found.damping, found.frequency, strict=True):
        ends, h = [], mpf(10) ** -10
        for s in (1, -1):
            machine.energy([a + s * h * mpf(b) for a, b in zip(machine.q, x, strict=True)])
            ends.append(machine.joints[0])
        rate = float((ends[0] - ends[1]) / (2 * h))
        np.testing.assert_allclose(ratio * 4 * np.pi * hertz, damping * rate**2, rtol=1e-8)


def test_maps_are_of_the_same_matrices() -> None:
    """With the file's stiffness, under the load; a given one takes its place, without."""
    machine = condyle.load_mechanism("masticatory")
    stiff = {f"chain.{name}.actuator.stiffness": 400.0 for name in machine.chain_names}
    model = Model(machine.set(stiff), backend="numpy")
    load = {"Fx": 3.0, "Fz": 20.0}
    names = ["frequency", "deflection", "stiffness"]
    found = condyle.workspace_map(model, {"X": (1e-3, 2e-3, 2)}, names, load=load)
    q = np.array([[1e-3, 0, 0, 0], [2e-3, 0, 0, 0]])
    wrench, at = np.array([3.0, 0, 20.0, 0, 0, 0]), "right_molar"
    here = model.stiffness(q, wrench=wrench, at=at)
    np.testing.assert_allclose(found.frequency, model.modes(q, wrench=wrench, at=at).frequency)
    np.testing.assert_allclose(found.deflection, here.compliance @ wrench)
    np.testing.assert_allclose(found.stiffness_matrix, here.K)
    given, bare = (
        condyle.workspace_map(one, {"X": (1e-3, 2e-3, 2)}, "stiffness", stiffness=400.0)
        for one in (model, Model(machine, backend="numpy"))
    )
    np.testing.assert_array_equal(given.stiffness_matrix, bare.stiffness_matrix)
