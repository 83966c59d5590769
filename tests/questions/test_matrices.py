"""The matrices of the equations of motion against inverse dynamics, energy and differences."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
import pytest
from support.cases import Case, case, error
from support.interpreter import Interpreter
from support.machines import model
from support.speeds import first

from condyle.dynamics import FORMULATIONS
from condyle.errors import InputError
from condyle.model.model import Model

pytestmark = pytest.mark.slow

# Two families, three curved contacts; a ball on a curved contact; none; those of one kind.
NAMES = ("mixed_k3_n9_curved", "rss_k1_n6_ball", "gough-stewart", "masticatory")
NAMES += ("masticatory-curved", "mixed_k2_n8", "mixed_k4_n6", "mixed_k5_n6", "sps_k2_n6_ellipsoid")


def check_balance(c: Case, models: list[Model]) -> None:
    """M q'' + C q' + G = A^T tau + load by the witness, which shares no graph; G is that at rest,
    whatever rates are asked for."""
    witness = Interpreter(c.mechanism, "momentum")
    s, still = (
        witness.system(witness.poses(c.q, f * c.q1, f * c.q2)[0], f * c.load) for f in (1.0, 0.0)
    )
    needed, load, at_rest = s["b"].sum(axis=2), s["b"][..., -1], still["b"].sum(axis=2)
    for m in models:
        M, bias, gravity = m.mass_matrix(c.q), m.bias(c.q, c.q1), m.gravity(c.q)
        parts = [(M @ c.q2[..., None])[..., 0], bias, gravity]
        size = max(np.abs(part).max() for part in parts)
        assert np.abs(sum(parts) - (needed - load)).max() < 1e-12 * size
        assert min(np.abs(part).max() for part in (parts[0], gravity)) > 1e-3 * size
        assert error(gravity, at_rest) < 1e-12
        assert np.abs(m.bias(c.q, 0 * c.q1)).max() < 1e-14 * size  # compilers fuse


@pytest.mark.parametrize("name", first(NAMES, 4))
def test_they_make_up_the_efforts(name: str) -> None:
    every = FORMULATIONS if name == NAMES[0] else ("virtual_power",)
    check_balance(case(name), [model(name, formulation=one) for one in every])


@pytest.mark.usefixtures("compiler_command")
def test_compiled() -> None:
    check_balance(case(NAMES[0]), [model(NAMES[0], backend="compiled")])


@pytest.mark.parametrize("name", first(NAMES, 4))
def test_laws(name: str) -> None:
    """M symmetric and positive; C v is the bias; M' - 2 C is skew, so that C does no work: M' by
    differences along q', of second order.

    What belongs to X is what the contacts project: M_J^T M_X M_J = M_q, M_J^T (C_X + M_X M_J' q')
    = C_q.
    """
    c, m, h = case(name), model(name), 1e-6
    M_J = m.jacobians(c.q).M_J
    for space, rates in (("q", c.q1), ("X", (M_J @ c.q1[..., None])[..., 0])):
        M, C = m.mass_matrix(c.q, space=space), m.coriolis(c.q, c.q1, space=space)
        scale = np.sqrt(np.einsum("nii->ni", M))
        scaled = M / scale[:, :, None] / scale[:, None, :]
        np.testing.assert_allclose(scaled, scaled.transpose(0, 2, 1), atol=1e-13)
        assert (np.linalg.eigvalsh(scaled) > 1e-6).all()
        assert error((C @ rates[..., None])[..., 0], m.bias(c.q, c.q1, space=space)) < 1e-12
        ends = [m.mass_matrix(c.q + s * h * c.q1, space=space) for s in (1, -1)]
        skew = (ends[0] - ends[1]) / (2 * h) - 2 * C
        assert np.abs(skew + skew.transpose(0, 2, 1)).max() < 1e-5 * np.abs(C).max()
        assert m.coriolis(c.q[0], c.q1[0], space=space).shape == C.shape[1:]
    turned = M_J.transpose(0, 2, 1)
    assert error(turned @ M @ M_J, m.mass_matrix(c.q)) < 1e-13
    G = (turned @ m.gravity(c.q, space="X")[..., None])[..., 0]
    assert error(G, m.gravity(c.q)) < 1e-13
    drift = m.poses.platform_motion(c.q, c.q1, 0 * c.q)[0]["pose_acceleration"]
    inside = m.bias(c.q, c.q1, space="X") + (M @ drift[..., None])[..., 0]
    assert error((turned @ inside[..., None])[..., 0], m.bias(c.q, c.q1)) < 1e-12


@pytest.mark.parametrize("name", first(NAMES, 4))
def test_jacobians_are_slopes_of_the_configuration(name: str) -> None:
    """M_J and J_theta M_J by central differences of poses and joints; M_3 = M_1^-1 M_2."""
    c, m, h = case(name), model(name), 1e-6
    found = m.jacobians(c.q)
    for k, unit in enumerate(np.eye(c.q.shape[1])):
        moved = [
            m.poses.platform_motion(c.q + s * h * unit, 0 * c.q, 0 * c.q)[0]["pose"]
            for s in (1, -1)
        ]
        assert error(found.M_J[:, :, k], (moved[0] - moved[1]) / (2 * h)) < 2e-6
        ends = [
            np.stack([at.joint, at.beta, at.gamma], axis=2)
            for at in map(m.poses.configuration, moved)
        ]
        wanted = (ends[0] - ends[1]) / (2 * h)
        rates = (found.M_3 @ found.M_J[:, None, :, k, None])[..., 0]
        own = (found.J_theta @ found.M_J[:, :, k, None])[..., 0]
        size = max(np.abs(wanted).max(), 1.0)
        np.testing.assert_allclose(rates, wanted, atol=1e-6 * size)
        np.testing.assert_allclose(own, wanted[..., 0], atol=1e-6 * size)
    assert error(found.M_1 @ found.M_3, found.M_2) < 1e-12
    assert error(found.M_3[:, :, 0], found.J_theta) < 1e-11


def test_inertia_of_platform_and_rods_by_pinocchio() -> None:
    """M of the machine without contacts: the forces of unit accelerations from rest."""
    pytest.importorskip("pinocchio", reason="pin is not installed (it is in the `test` extra)")
    from oracles.pinocchio_engine import PinocchioEngine
    from oracles.random_mechanism import random_mechanism, random_state, toml_text

    from condyle.mechanism import parse

    raw = random_mechanism(np.random.default_rng(4), contacts=0)
    m, engine = Model(parse(toml_text(raw)), backend="numpy"), PinocchioEngine(raw)
    q = random_state(np.random.default_rng(1), raw, 3)["q"]
    zero = np.zeros(6)
    for pose, M, G, J in zip(
        q, m.mass_matrix(q), m.gravity(q), m.jacobians(q).J_theta, strict=True
    ):
        at_rest, *pushed = (
            engine.inverse_dynamics(pose, zero, unit, zero, "right_molar")["tau"] @ J
            for unit in (zero, *np.eye(6))
        )
        assert error(M, np.transpose(pushed) - at_rest[:, None]) < 1e-9
        assert error(G, at_rest) < 1e-9


def test_what_cannot_be_asked() -> None:
    m, zero = model("masticatory"), np.zeros((1, 4))
    asks: tuple[Any, ...] = (m.mass_matrix, m.gravity, partial(m.coriolis, v=zero))
    for ask in asks:
        with pytest.raises(InputError, match='space: unknown space "Q"'):
            ask(zero, space="Q")
    with pytest.raises(InputError, match="the contacts cannot be met at sample 1"):
        model("mixed_k3_n9_curved").gravity(np.array([[0.0] * 3, [40.0] * 3]))
