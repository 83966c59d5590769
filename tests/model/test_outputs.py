"""What `inverse_dynamics` returns besides efforts: what was asked for, and nothing else."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from oracles.rotations import per_twist
from support.cases import case, error
from support.loads import parts

import condyle
from condyle.errors import InputError
from condyle.model.distributing import Distribution
from condyle.model.inverse_dynamics import OUTPUTS
from condyle.model.model import Model

ALWAYS = ("effort", "contact_force", "bound", "status")


@pytest.mark.usefixtures("compiler_command")
@pytest.mark.parametrize("backend", ["compiled", "numpy"])
def test_condition_is_that_of_the_jacobian(backend: str) -> None:
    """Against singular values of the Jacobian that forward differences of the joints give."""
    c = case("masticatory")
    model = Model(c.mechanism, backend=backend)
    q, q1, q2, load = (a[:5] for a in c.packed)
    result = model.inverse_dynamics(q, q1, q2, *parts(load), outputs=("pose", "condition"))
    assert set(vars(result)) == {*ALWAYS, "pose", "condition"} and not result.status.any()
    scale = [model.characteristic_length if n in "XYZ" else 1.0 for n in model.independent]
    for i in range(len(q)):
        steps = np.vstack([q[i] + sign * 1e-6 * row for sign in (1, -1) for row in np.diag(scale)])
        still = np.zeros_like(steps)
        loads = np.tile(load[i], (len(steps), 1))
        evaluation = model.inverse_dynamics(steps, still, still, *parts(loads), outputs="all")
        forth, back = np.split(evaluation.configuration.joint, 2)
        J = (forth - back) / 2e-6 / np.array(scale)[:, None]
        ahead, behind = np.split(evaluation.pose, 2)
        M_J = (ahead - behind).T / 2e-6 / scale
        J = per_twist(result.pose[i], M_J, model.characteristic_length).T @ J
        weights = np.abs(evaluation.configuration.singularity.transmission).mean(axis=0)
        expected = np.linalg.cond(J.T * _arm(model) * weights[:, None])
        assert result.condition[i] == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize("backend", ["compiled", "numpy"])
@pytest.mark.usefixtures("compiler_command")
def test_what_is_asked_for_is_what_all_says(backend: str) -> None:
    """Samples first, chains where the file has them, and nothing else comes along."""
    c = case("mixed_k2_n8")
    model = Model(c.mechanism, backend=backend)
    whole = model.inverse_dynamics(*c.arguments, outputs="all")
    assert set(vars(whole)) == {*ALWAYS, *OUTPUTS}
    for output in OUTPUTS:
        found = model.inverse_dynamics(*c.arguments, outputs=(output,))
        assert set(vars(found)) == {*ALWAYS, output}
        for name in set(vars(found)) - {"configuration"}:
            if name == "bound":  # what rounding leaves is in it
                np.testing.assert_array_less(abs(np.log10(found.bound / whole.bound)), 1.5)
                continue
            assert error(getattr(found, name), getattr(whole, name)) < 1e-9, name
    with pytest.raises(AttributeError, match=r"share was not asked for: outputs=\('share',\)"):
        _ = model.inverse_dynamics(*c.arguments).share


SHAPES = {"a state": (), "a motion": (3,), "variants": (2, 3), "nothing": (0,), "none": (2, 0)}


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.usefixtures("compiler_command")
def test_every_leading_shape(shape: str) -> None:
    """Of every method, the same numbers as of the states one by one."""
    c = case("mixed_k2_n8")
    model, lead = Model(c.mechanism, backend="compiled"), SHAPES[shape]
    rng = np.random.default_rng(2)
    rows = rng.integers(0, len(c.q), lead)
    q, v, a, wrench, at = (x[rows] for x in c.arguments)
    effort = model.inverse_dynamics(q, v, a, wrench, at).effort
    found = {
        "inverse": model.inverse_dynamics(q, v, a, wrench, at, outputs="all"),
        "forward": model.forward_dynamics(q, v, effort, wrench, at, outputs="all"),
        "linear": model.linearise(q, v, effort, wrench, at),
        "kinematics": model.inverse_kinematics(q, v, a),
        "jacobians": model.jacobians(q),
    }
    whole = {
        "inverse": model.inverse_dynamics(*c.arguments, outputs="all"),
        "kinematics": model.inverse_kinematics(c.q, c.q1, c.q2),
        "jacobians": model.jacobians(c.q),
    }
    for name, result in found.items():
        for key, value in vars(result).items():
            if isinstance(value, np.ndarray):
                assert value.shape[: len(lead)] == lead, key
                if name in whole:
                    assert error(value, getattr(whole[name], key)[rows]) < 1e-9, key
    joint = found["kinematics"].joint
    assert error(model.forward_kinematics(joint).q, q) < 1e-9
    assert error(model.mass_matrix(q), model.mass_matrix(c.q)[rows]) < 1e-12
    assert model.bias(q, v).shape == model.gravity(q).shape == q.shape
    assert error(found["forward"].acceleration, a) < 1e-6


def test_arguments_broadcast_and_points_have_names() -> None:
    model = Model(case("masticatory").mechanism, backend="numpy")
    home, many, force = np.zeros(4), np.zeros((2, 3, 4)), [0, 0, -50.0, 0, 0, 0]
    one = model.inverse_dynamics(home, home, home, force, "incisor")
    for q, v, wrench in [(many, home, force), (home, many, force), (home, home, [[force] * 3] * 2)]:
        found = model.inverse_dynamics(q, v, home, wrench, at="incisor").effort
        np.testing.assert_allclose(found, np.broadcast_to(one.effort, (2, 3, 6)), atol=1e-12)
    point = model.mechanism.platform.points["incisor"]
    np.testing.assert_array_equal(
        model.inverse_dynamics(home, home, home, force, point).effort, one.effort
    )
    assert np.abs(model.inverse_dynamics(home, home, home, force).effort - one.effort).max() > 0.1


WRONG: dict[str, tuple[Any, str]] = {
    "a word": (lambda m, x: m.inverse_dynamics("q", x, x), "q: expected numbers"),
    "an object": (lambda m, x: m.inverse_dynamics(x, object(), x), "v: expected numbers"),
    "too few": (lambda m, x: m.forward_dynamics(x, x, x), r"effort: .*got shape \(4,\)"),
    "shapes": (
        lambda m, x: m.inverse_dynamics(np.zeros((2, 4)), np.zeros((3, 4)), x),
        r"leading shapes do not go together: q \(2, 4\), v \(3, 4\)",
    ),
    "no point": (lambda m, x: m.inverse_dynamics(x, x, x, at="incisors"), 'at: .*"incisors"'),
    "no output": (lambda m, x: m.inverse_dynamics(x, x, x, outputs="contacts"), "put 'contacts'"),
    "outputs": (lambda m, x: m.forward_dynamics(x, x, x, outputs=3), "outputs: expected names"),
    "threads": (lambda m, x: m.inverse_dynamics(x, x, x, threads="2"), "threads: expected an int"),
    "space": (lambda m, x: m.mass_matrix(x, space="Q"), 'space: there is no "Q"'),
    "joint": (lambda m, x: m.forward_kinematics(x), r"joint: .*got shape \(4,\)"),
    "start": (lambda m, x: m.forward_kinematics(np.zeros(6), start=x), "start: expected"),
    "tolerance": (lambda m, x: m.forward_kinematics(x, tolerance="1"), "tolerance: expected"),
    "linearise": (lambda m, x: m.linearise(x, x, None), "effort: expected numbers"),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_is_wrong_is_named(name: str) -> None:
    call, said = WRONG[name]
    with pytest.raises(InputError, match=said):
        call(Model(case("masticatory").mechanism, backend="numpy"), np.zeros(4))


WRONG_MODELS = {
    "mechanism": (3, {}),
    "formulation": ("masticatory", {"formulation": 3}),
    "route": ("masticatory", {"route": None}),
    "backend": ("masticatory", {"backend": b"numpy"}),
    "distribution": ("masticatory", {"distribution": 1.0}),
}


@pytest.mark.parametrize("name", WRONG_MODELS)
def test_a_wrong_model_is_named(name: str) -> None:
    mechanism, options = WRONG_MODELS[name]
    with pytest.raises(InputError, match=f"^{name}: expected"):
        condyle.derive(mechanism, **options)


@pytest.mark.parametrize("name", ["preload", "contact_weight"])
@pytest.mark.parametrize("value", ["1", -1.0, np.nan, np.inf, None, np.zeros(2)])
def test_numbers_of_a_distribution(name: str, value: Any) -> None:
    with pytest.raises(InputError, match=f"^{name}: expected a number of at least 0"):
        Distribution("bounded", **{name: value})


@pytest.mark.parametrize("name", ["masticatory", "mixed_k3_n9_curved"])
@pytest.mark.parametrize("backend", ["compiled", "numpy"])
@pytest.mark.usefixtures("compiler_command")
def test_gravity_is_the_shares_at_rest(name: str, backend: str) -> None:
    """What gravity and load alone ask for, whatever the rates are."""
    c = case(name)
    model = Model(c.mechanism, backend=backend)
    moving = model.inverse_dynamics(*c.arguments, outputs=("gravity_share", "share"))
    resting = model.inverse_dynamics(
        c.q, 0 * c.q1, 0 * c.q2, *parts(c.load), outputs=("gravity_share", "share")
    )
    assert error(moving.gravity_share, resting.share) < 1e-12
    assert error(resting.gravity_share, resting.share) < 1e-12
    assert error(moving.gravity_share, moving.share) > 1e-3
    assert error(moving.share.sum(axis=1), moving.effort) < 1e-12


def _arm(model: Model) -> np.ndarray:
    """Crank lengths, (n, 1): J_W = J_A J in lengths of the coupler."""
    return np.array(
        [[np.linalg.norm(np.subtract(c.crank_tip, c.base))] for c in model.mechanism.chains]
    )


@pytest.mark.usefixtures("compiler_command")
def test_a_call_derives_nothing_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """What the mechanism alone decides is found once: a call of few samples would pay for it."""
    c = case("masticatory")
    model = Model(c.mechanism)
    model.inverse_dynamics(*c.arguments)

    def again(_: object) -> None:
        raise AssertionError("derived again")

    for place in ("questions.structure.dependent_coordinates", "model.system.characteristic"):
        monkeypatch.setattr(f"condyle.{place}", again)
    model.inverse_dynamics(*c.arguments)
    assert len(model.independent) == 4
