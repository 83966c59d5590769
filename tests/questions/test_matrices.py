"""The matrices of the equations of motion against inverse dynamics, energy and differences."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from support.cases import Case, case, error
from support.interpreter import Interpreter

from condyle.dynamics import FORMULATIONS
from condyle.errors import InputError
from condyle.model.model import Model

pytestmark = pytest.mark.slow

NAMES = ("masticatory", "masticatory-curved", "gough-stewart", "rss_k1_n6_ball", "mixed_k2_n8")
NAMES += ("mixed_k3_n9_curved", "mixed_k4_n6", "mixed_k5_n6", "sps_k2_n6_ellipsoid")


@cache
def model(name: str, formulation: str = "virtual_power", backend: str = "numpy") -> Model:
    return Model(case(name).mechanism, formulation=formulation, backend=backend)


def system(c: Case) -> tuple[np.ndarray, np.ndarray]:
    """A^T tau and the load's part of it, (N, m), by the witness."""
    witness = Interpreter(c.mechanism, "momentum")
    poses, _ = witness.poses(c.q, c.q1, c.q2)
    s = witness.system(poses, c.load)
    return s["b"].sum(axis=2), s["b"][..., -1]


def check_balance(c: Case, m: Model) -> None:
    """M q'' + C q' + G = A^T tau + load."""
    M, bias, gravity = m.mass_matrix(c.q), m.bias(c.q, c.q1), m.gravity(c.q)
    needed, load = system(c)
    parts = [(M @ c.q2[..., None])[..., 0], bias, gravity]
    size = max(np.abs(part).max() for part in parts)
    assert np.abs(sum(parts) - (needed - load)).max() < 1e-12 * size
    assert min(np.abs(part).max() for part in (parts[0], gravity)) > 1e-3 * size


@pytest.mark.parametrize("formulation", FORMULATIONS)
@pytest.mark.parametrize("name", NAMES)
def test_they_make_up_the_efforts(name: str, formulation: str) -> None:
    check_balance(case(name), model(name, formulation))


@pytest.mark.parametrize("name", ["masticatory", "mixed_k3_n9_curved"])
@pytest.mark.usefixtures("compiler_command")
def test_compiled(name: str) -> None:
    check_balance(case(name), model(name, backend="compiled"))


@pytest.mark.parametrize("name", NAMES)
def test_inertia_is_symmetric_and_positive(name: str) -> None:
    c, m = case(name), model(name)
    for space in ("q", "X"):
        M = m.mass_matrix(c.q, space=space)
        scale = np.sqrt(np.einsum("nii->ni", M))
        scaled = M / scale[:, :, None] / scale[:, None, :]
        np.testing.assert_allclose(scaled, scaled.transpose(0, 2, 1), atol=1e-13)
        assert (np.linalg.eigvalsh(scaled) > 1e-6).all()


@pytest.mark.parametrize("name", NAMES)
def test_contacts_project_what_belongs_to_x(name: str) -> None:
    """M_J^T M_X M_J = M_q, and M_J^T (C_X + M_X M_J' q') = C_q."""
    c, m = case(name), model(name)
    M_J = m.jacobians(c.q).M_J
    turned = M_J.transpose(0, 2, 1)
    M_X = m.mass_matrix(c.q, space="X")
    assert error(turned @ M_X @ M_J, m.mass_matrix(c.q)) < 1e-13
    G = (turned @ m.gravity(c.q, space="X")[..., None])[..., 0]
    assert error(G, m.gravity(c.q)) < 1e-13
    drift = m.poses.whole(c.q, c.q1, 0 * c.q)[0]["pose_acceleration"]
    inside = m.bias(c.q, c.q1, space="X") + (M_X @ drift[..., None])[..., 0]
    assert error((turned @ inside[..., None])[..., 0], m.bias(c.q, c.q1)) < 1e-12


@pytest.mark.parametrize("name", NAMES)
def test_coriolis_forces_do_no_work_on_energy(name: str) -> None:
    """q'^T (M' - 2 C) q' = 0: bias . q' is half of q'^T M' q', by differences along q'."""
    c, m = case(name), model(name)
    h = 1e-5
    along = [m.mass_matrix(c.q + s * h * c.q1) for s in (-2, -1, 1, 2)]
    rate = (along[0] - 8 * along[1] + 8 * along[2] - along[3]) / (12 * h)
    work = np.einsum("ni,nij,nj->n", c.q1, rate, c.q1) / 2
    got = (m.bias(c.q, c.q1) * c.q1).sum(axis=1)
    size = np.abs(m.bias(c.q, c.q1) * c.q1).max()
    assert np.abs(got - work).max() < 1e-6 * size


@pytest.mark.parametrize("name", NAMES)
def test_gravity_holds_it_at_rest(name: str) -> None:
    """A^T tau where nothing moves, whatever rate the matrices are asked at."""
    c, m = case(name), model(name)
    still = Case(c.mechanism, c.q, 0 * c.q1, 0 * c.q2, 0 * c.load)
    needed, _ = system(still)
    assert error(m.gravity(c.q), needed) < 1e-12
    assert np.abs(m.bias(c.q, 0 * c.q1)).max() == 0


def test_inertia_of_platform_and_rods_by_pinocchio() -> None:
    """M of the machine without contacts: the forces of unit accelerations from rest."""
    pytest.importorskip("pinocchio", reason="pin is not installed (it is in the `test` extra)")
    from oracles.pinocchio_engine import PinocchioEngine
    from oracles.random_mechanism import random_mechanism, random_state, toml_text

    from condyle.mechanism import parse

    raw = random_mechanism(np.random.default_rng(4), contacts=0)
    m, engine = Model(parse(toml_text(raw)), backend="numpy"), PinocchioEngine(raw)
    q = random_state(np.random.default_rng(1), raw, 3)["q"]
    M, G = m.mass_matrix(q), m.gravity(q)
    zero, no_load = np.zeros(6), np.zeros(6)
    for i, pose in enumerate(q):
        rows = []
        for unit in [zero, *np.eye(6)]:
            found = engine.inverse_dynamics(pose, zero, unit, no_load, "right_molar")
            J = m.jacobians(pose[None]).J_theta[0]
            rows.append(J.T @ found["tau"])
        wanted = np.array(rows[1:]) - rows[0]
        assert error(M[i], wanted.T) < 1e-9
        assert error(G[i], rows[0]) < 1e-9


@pytest.mark.parametrize("name", NAMES)
def test_jacobians_are_slopes_of_the_configuration(name: str) -> None:
    """M_J and J_theta M_J by central differences of poses and joints; M_3 = M_1^-1 M_2."""
    c, m = case(name), model(name)
    found = m.jacobians(c.q)
    h = 1e-6
    for k in range(c.q.shape[1]):
        step = h * np.eye(c.q.shape[1])[k]
        moved = [m.poses.whole(c.q + s * step, 0 * c.q, 0 * c.q)[0]["pose"] for s in (1, -1)]
        slope = (moved[0] - moved[1]) / (2 * h)
        assert error(found.M_J[:, :, k], slope) < 2e-6
        joints = [m.poses.configuration(pose) for pose in moved]
        wanted = np.stack(
            [
                (getattr(joints[0], a) - getattr(joints[1], a)) / (2 * h)
                for a in ("joint", "beta", "gamma")
            ],
            axis=2,
        )
        rates = found.M_3 @ found.M_J[:, None, :, k, None]
        size = max(np.abs(wanted).max(), 1.0)
        np.testing.assert_allclose(rates[..., 0], wanted, atol=1e-6 * size)
        own = (found.J_theta @ found.M_J[:, :, k, None])[..., 0]
        np.testing.assert_allclose(own, wanted[..., 0], atol=1e-6 * size)
    assert error(found.M_1 @ found.M_3, found.M_2) < 1e-12
    assert error(found.M_3[:, :, 0], found.J_theta) < 1e-11


def test_what_cannot_be_asked() -> None:
    m = model("masticatory")
    with pytest.raises(InputError, match='space: there is no "Q"'):
        m.mass_matrix(np.zeros((1, 4)), space="Q")
    walls = Model(case("mixed_k3_n9_curved").mechanism, backend="numpy")
    q = np.zeros((2, 3))
    q[1, :] = 40.0
    with pytest.raises(InputError, match="the contacts cannot be met at sample 1"):
        walls.gravity(q)


@pytest.mark.parametrize("space", ["q", "X"])
@pytest.mark.parametrize("name", NAMES)
def test_coriolis(name: str, space: str) -> None:
    """C v is the bias; M' - 2 C is skew, by differences of the mass matrix along the motion."""
    c, m = case(name), model(name)
    C = m.coriolis(c.q, c.q1, space=space)
    rates = c.q1 if space == "q" else (m.jacobians(c.q).M_J @ c.q1[..., None])[..., 0]
    assert error((C @ rates[..., None])[..., 0], m.bias(c.q, c.q1, space=space)) < 1e-12
    h = 1e-6
    ends = [m.mass_matrix(c.q + s * h * c.q1, space=space) for s in (1, -1)]
    skew = (ends[0] - ends[1]) / (2 * h) - 2 * C
    assert np.abs(skew + skew.transpose(0, 2, 1)).max() < 1e-5 * np.abs(C).max()
    assert m.coriolis(c.q[0], c.q1[0], space=space).shape == C.shape[1:]
    with pytest.raises(InputError, match='no "Z"'):
        m.coriolis(c.q, c.q1, space="Z")
