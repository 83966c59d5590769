"""Contacts that yield: the balance by virtual work, the law at every gap, and the rigid limit."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

import condyle
from condyle.analysis.sweep import with_bands
from condyle.backends.kernel import sample_rows
from condyle.model.model import inverse_of
from condyle.model.yielding import Yielding, place_by_coordinates

LAYER = {"kind": "foundation", "modulus": 2.7e6, "poisson": 0.4, "thickness": 2e-3, "radius": 8e-3}
BITE = np.array([10.0, 5.0, -60.0, 0.0, 0.0, 0.0])


def machine(name: str, law: dict[str, Any]) -> condyle.Mechanism:
    made = condyle.load_mechanism(name)
    return made.set({f"contact.{one}.compliance": law for one in made.contact_names})


@lru_cache
def jaw(distribution: Any = "bounded") -> condyle.Model:
    """Massless muscles, and curved surfaces whose phi is no distance."""
    return condyle.derive(
        machine("human-jaw-curved", LAYER), distribution=distribution, backend="numpy"
    )


def at_rest(model: condyle.Model, q: np.ndarray, **options: Any) -> Any:
    still = np.zeros_like(q)
    return model.inverse_dynamics(q, still, still, BITE, "incisor", **options)


def normal(contact: Any, pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The contact's point, and the unit normal of the level of phi there, by differences."""
    p = pose[:3] + Rotation.from_euler("XYZ", pose[3:]).as_matrix() @ contact.point
    e = 1e-6 * np.eye(3)
    n = np.array([float(contact.surface.phi(p + d) - contact.surface.phi(p - d)) for d in e])
    return p, n / np.linalg.norm(n)


def gap(contact: Any, pose: np.ndarray) -> float:
    """Distance of the point from the surface along that normal, by root finding."""
    p, n = normal(contact, pose)
    return brentq(lambda g: float(contact.surface.phi(p - g * n)), -5e-3, 5e-3, xtol=1e-16)


def work(model: condyle.Model, found: Any, i: int, pose: np.ndarray) -> float:
    """Work of weight, bite, tensions and contact forces to a pose [J]; forces are held."""
    m, R = model.mechanism, Rotation.from_euler("XYZ", pose[3:]).as_matrix()
    place = pose[:3] + R @ m.platform.points["incisor"]
    total = m.platform.mass * m.gravity[2] * pose[2] + BITE[:3] @ place
    for chain, tension in zip(m.chains, found.effort[i], strict=True):
        total -= tension * np.linalg.norm(pose[:3] + R @ chain.platform - chain.base)
    for contact, force in zip(m.contacts, found.contact_force[i], strict=True):
        total += force * normal(contact, found.pose[i])[1] @ normal(contact, pose)[0]
    return float(total)


@pytest.mark.parametrize("distribution", ["minimum_norm", "bounded", "cubic"])
def test_the_balance_holds_where_the_contacts_give_what_their_law_says(distribution: str) -> None:
    model = jaw(distribution)
    q = np.array([[0.0, 0, 0, 0], [0.003, 0.001, 0.01, 0.1], [0.006, -0.001, 0.0, 0.15]])
    found = at_rest(model, q, contacts="compliant", outputs="all")
    assert (found.status == 0).all()
    for i, pose in enumerate(found.pose):
        np.testing.assert_allclose(pose[[0, 1, 3, 4]], q[i], atol=1e-14)
        for axis in np.eye(6):
            moved = [work(model, found, i, pose + s * 1e-5 * axis) for s in (1, -1)]
            assert abs(moved[0] - moved[1]) / 2e-5 < 1e-5  # N or N m, of some 100
        for k, contact in enumerate(model.mechanism.contacts):
            force, depth = found.contact_force[i, k], found.indentation[i, k]
            assert gap(contact, pose) == pytest.approx(depth, abs=1e-10)  # above: into the wall
            law, bend = contact.compliance, _profile_bend(contact, pose)
            wanted = law.patch(np.array(max(-force, 0)), np.sort([125 + bend, 125]))
            assert depth == pytest.approx(float(wanted.indentation), abs=2e-8)
    if distribution != "minimum_norm":
        assert (found.indentation > 1e-4).all()


def _profile_bend(contact: Any, pose: np.ndarray) -> float:
    """Curvature of the profile at the foot, positive where it is hollow to the ball below."""
    p, n = normal(contact, pose)
    x = (p - gap(contact, pose) * n)[0]
    h = 1e-4

    def height(s: float) -> float:
        return -float(contact.surface.phi((s, 0.0, 0.0)))

    slope = (height(x + h) - height(x - h)) / (2 * h)
    bend = (height(x + h) - 2 * height(x) + height(x - h)) / h**2
    return bend / (1 + slope**2) ** 1.5


def test_stiff_contacts_are_rigid_ones() -> None:
    q = np.array([[0.001, 0.0005, 0.02, -0.03], [0.0, 0.0, 0.05, 0.0]])
    given = q, np.full_like(q, 0.1), np.ones_like(q), BITE, "incisor"
    rigid = condyle.derive("masticatory-curved", backend="numpy").inverse_dynamics(
        *given, outputs="pose"
    )
    errors = []
    for stiffness in (1e6, 1e7, 1e8):
        law = {"kind": "linear", "stiffness": stiffness}
        model = condyle.derive(machine("masticatory-curved", law), backend="numpy")
        found = model.inverse_dynamics(*given, contacts="compliant", outputs="pose")
        depth = np.abs(found.contact_force) / stiffness
        np.testing.assert_allclose(found.indentation, depth, rtol=0, atol=1e-12)
        names = ("effort", "contact_force", "pose")
        errors.append([np.abs(getattr(found, n) - getattr(rigid, n)).max() for n in names])
    ratios = np.array(errors[:-1]) / errors[1:]
    assert np.abs(ratios - 10).max() < 0.1  # as 1 / stiffness


@pytest.mark.parametrize("distribution", ["minimum_norm", "bounded", "minimax"])
def test_slopes_of_forces_are_differences(distribution: str) -> None:
    model, h = jaw(distribution), 1e-7
    q, still = np.array([[0.003, 0.001, 0.01, 0.1]]), np.zeros((1, 4))
    solver, robust = inverse_of(model, "compliant"), model.system.robust
    closure = model.system.closure(model.independent, None).followed
    place = place_by_coordinates(closure, q, still, still)
    pose = at_rest(model, q, outputs="pose").pose
    point = np.array(model.mechanism.platform.points["incisor"])
    load = {"force": BITE[None, :3], "moment": BITE[None, 3:], "point": point[None]}

    def evaluate(poses: Any, reached: Any, given: Any) -> Any:
        values, status = robust.evaluate_at(poses, reached, given)
        if model.chooses_efforts:
            solver._choose(values, status, given)
        return values, status

    def forces(level: np.ndarray) -> Any:
        at = place(level, pose, np.zeros(1, dtype=int))
        return at, evaluate(at.motion, np.ones(1, dtype=bool), load)[0]

    level = np.array([[1e-4, 2e-4]])
    own = Yielding(model.system, model.distributor, evaluate)
    at, values = forces(level)
    given = sample_rows(load, np.zeros(1, dtype=int), 1)
    slopes = own._force_slopes(at, values, given, np.ones(1, dtype=bool))[0]
    for i in range(2):
        step = h * np.eye(2)[i]
        more, less = (forces(level + s * step)[1]["contact_force"][:, 0] for s in (1, -1))
        np.testing.assert_allclose(slopes[:, i], (more - less) / (2 * h), rtol=1e-5)


def test_what_a_motion_prescribes_stays_and_the_rest_yields() -> None:
    model = jaw()
    t = np.linspace(0, 1, 11)
    path = {axis: 2e-3 * s * np.sin(np.pi * t) for axis, s in zip("xyz", (1, 0.5, -3), strict=True)}
    motion = condyle.Motion.from_arrays(t, path, landmark="incisor")
    load = condyle.Load.constant(BITE[:3], point="incisor")
    found = model.solve(motion, load, contacts="compliant")
    kept = model.solve(motion, load)
    point = model.mechanism.platform.points["incisor"]
    for pose, k in zip(found["pose"].values, range(11), strict=True):
        R = Rotation.from_euler("XYZ", pose[3:]).as_matrix()
        np.testing.assert_allclose(
            pose[:3] + R @ point - point, [path[a][k] for a in "xyz"], atol=1e-13
        )
    moved = np.abs(found["pose"].values - kept["pose"].values).max()
    assert 1e-4 < moved < 2e-2 and found.condyle.options["contacts"] == "compliant"
    depth = kept["indentation"].values
    assert 0 < np.abs(found["indentation"].values - depth).max() < 0.1 * depth.max()


@pytest.mark.parametrize(
    ("name", "law"),
    [("masticatory-curved", {"kind": "linear", "stiffness": 1e5}), ("human-jaw-curved", LAYER)],
)
def test_joints_lead_back_to_the_pose_that_yielded(name: str, law: dict[str, Any]) -> None:
    model = condyle.derive(machine(name, law), backend="numpy")
    q = np.array([[0.0005, 0.0003, 0.01, -0.02], [0.001, 0, 0.01, 0.03]])
    there = at_rest(model, q, contacts="compliant", outputs="all")
    joint = there.configuration.joint + np.array(model.mechanism.zeros)
    how: dict[str, Any] = {"contacts": "compliant", "wrench": BITE, "at": "incisor"}
    found = model.forward_kinematics(joint, **how)
    assert found.status.tolist() == [0, 0] and np.abs(found.residual).max() < 1e-11
    np.testing.assert_allclose(found.pose, there.pose, atol=1e-11)
    for result in ("contact_force", "effort", "indentation"):
        np.testing.assert_allclose(getattr(found, result), getattr(there, result), atol=1e-8)
    one = model.forward_kinematics(joint[1], **how)
    np.testing.assert_allclose(one.pose, found.pose[1], atol=1e-14)
    # Contacts that are kept fit these joints nowhere.
    assert (model.forward_kinematics(joint).status == 3).all()
    off = model.forward_kinematics(joint + 0.05 * np.arange(joint.shape[1]), **how)
    assert (off.status != 0).all() and np.isnan(off.pose).all() and np.isnan(off.effort).all()


def test_what_cannot_yield_is_said() -> None:
    still, model = np.zeros(4), condyle.derive("masticatory", backend="numpy")
    with pytest.raises(condyle.InputError, match="no contact of this mechanism has compliance"):
        model.inverse_dynamics(still, still, still, contacts="compliant")
    with pytest.raises(condyle.InputError, match="Available: compliant, kept"):
        model.inverse_dynamics(still, still, still, contacts="soft")  # type: ignore[arg-type]
    with pytest.raises(condyle.InputError, match="do not follow from loads"):
        model.forward_kinematics(np.zeros(6), wrench=BITE)
    with pytest.raises(condyle.InputError, match="leave them out"):
        condyle.run(jaw().mechanism, contacts="compliant", prove=1)


@pytest.mark.slow
def test_sweeps_and_bands_are_of_contacts_that_yield() -> None:
    """Each row is the variant's own solution, and the median of two their mean."""
    path, modulus = "contact.left_condyle.compliance.modulus", [2e6, 3e6]
    made = machine("human-jaw-curved", LAYER)
    t = np.linspace(0, 1, 6)
    motion = condyle.Motion.from_arrays(t, np.outer(t, [0.002, 0, 0, 0.05]), jaw().independent)
    load = condyle.Load.constant(BITE[:3], point="incisor")
    alone = []
    for value in modulus:
        model = condyle.derive(made.set({path: value}), distribution="bounded", backend="numpy")
        alone.append(model.solve(motion, load, contacts="compliant"))
    how = {"distribution": "bounded", "backend": "numpy"}
    study = {
        "vary": [{"what": path, "values": modulus}],
        "measure": {
            "depth": {"of": "indentation", "take": "max", "contact": "left_condyle"},
            "effort": {"of": "effort", "take": "max"},
        },
    }
    given: Any = {"mechanism": made, "motion": motion, "load": load, "workers": 1}
    rows = condyle.sweep(study | how | {"contacts": "compliant"}, **given)
    kept = condyle.sweep(study | how, **given)
    wanted = [float(one["indentation"].sel(contact="left_condyle").max()) for one in alone]
    np.testing.assert_allclose(rows["depth"], wanted, rtol=1e-9)
    np.testing.assert_allclose(rows["effort"], [float(one["effort"].max()) for one in alone])
    assert (np.abs(rows["depth"] - kept["depth"]) > 1e-3 * kept["depth"]).all()
    banded = with_bands(alone[0], condyle.Study(**study), motion, load, mechanism=made)
    middle = banded["effort_quantile"].sel(quantile=0.5)
    both = [one["effort"].values for one in alone]
    np.testing.assert_allclose(middle, np.mean(both, axis=0), atol=1e-7)


def test_designs_are_of_contacts_that_are_kept() -> None:
    study = {"minimise": "x", "measure": {"x": {"of": "effort", "take": "max_abs"}}}
    study |= {"vary": [{"what": "platform.mass", "scale": [0.9, 1.1]}], "contacts": "compliant"}
    with pytest.raises(condyle.InputError, match='designs are of contacts that are "kept"'):
        condyle.design(study)


@pytest.mark.slow
def test_maps_are_of_contacts_that_yield() -> None:
    made = machine("human-jaw-curved", LAYER)
    stiff = {f"chain.{name}.actuator.stiffness": 2e4 for name in made.chain_names}
    model = condyle.derive(made.set(stiff), distribution="bounded", backend="numpy")
    grid, load = {"X": (0, 3e-3, 2), "beta": (0, 0.1, 2)}, {"Fx": 10.0, "Fy": 5.0, "Fz": -60.0}
    names = ["effort", "contact_force", "deflection", "frequency", "stiffness"]
    given: Any = {"load": load, "load_point": "incisor", "contacts": "compliant"}
    found = condyle.workspace_map(model, grid, names, **given)
    q = np.array([[[x, 0, 0, beta] for beta in (0, 0.1)] for x in (0, 3e-3)])
    held = at_rest(model, q, contacts="compliant")
    here = model.stiffness(q, None, BITE, "incisor", contacts="compliant")
    modes = model.modes(q, None, BITE, "incisor", contacts="compliant")
    np.testing.assert_allclose(found.effort, held.effort, atol=1e-8)
    np.testing.assert_allclose(found.contact_force, held.contact_force, atol=1e-8)
    np.testing.assert_allclose(found.deflection, here.compliance @ BITE, rtol=1e-9)
    np.testing.assert_allclose(found.frequency, modes.frequency, rtol=1e-9)
    np.testing.assert_allclose(found.stiffness_matrix, here.K, rtol=1e-9)
    with pytest.raises(condyle.InputError, match="no quantity of the map depends on it"):
        condyle.workspace_map(model, grid, "ratio", contacts="compliant")
    bare = condyle.derive("human-jaw", backend="numpy")
    with pytest.raises(condyle.InputError, match="no contact of this mechanism has compliance"):
        condyle.workspace_map(bare, grid, "effort", contacts="compliant")
