"""What `inverse_dynamics` returns besides efforts: what was asked for, and nothing else."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from support.cases import case, error
from support.machines import model as shared

import condyle
from condyle.errors import InputError
from condyle.model.distributing import Distribution
from condyle.model.inverse_dynamics import OUTPUTS

ALWAYS = ("effort", "contact_force", "bound", "status")


@pytest.mark.usefixtures("compiler_command")
def test_what_is_asked_for_is_what_all_says() -> None:
    """Samples first, chains where the file has them, and nothing else comes along.

    What gravity and load alone ask for are the shares at rest, whatever the rates are.
    """
    c, model = case("mixed_k2_n8"), shared("mixed_k2_n8")
    whole = model.inverse_dynamics(*c.arguments, outputs="all")
    asked = [(model, (output,), {output}) for output in OUTPUTS]
    for own, outputs, names in [*asked, (shared("mixed_k2_n8", "compiled"), "all", {*OUTPUTS})]:
        found = own.inverse_dynamics(*c.arguments, outputs=outputs)
        assert set(vars(found)) == {*ALWAYS, *names}
        for name in set(vars(found)) - {"configuration"}:
            if name == "bound":  # what rounding leaves is in it
                np.testing.assert_array_less(abs(np.log10(found.bound / whole.bound)), 1.5)
                continue
            assert error(getattr(found, name), getattr(whole, name)) < 1e-9, name
    with pytest.raises(AttributeError, match=r"share was not requested; pass outputs=\('share',\)"):
        _ = model.inverse_dynamics(*c.arguments).share
    np.testing.assert_array_equal(whole.condition, whole.configuration.singularity.condition)
    q, v, a, *load = c.arguments
    resting = model.inverse_dynamics(q, 0 * v, 0 * a, *load, outputs=("gravity_share", "share"))
    for found in (whole, resting):
        assert error(found.gravity_share, resting.share) < 1e-12
    assert error(whole.gravity_share, whole.share) > 1e-3
    assert error(whole.share.sum(axis=1), whole.effort) < 1e-12


@pytest.mark.slow
def test_every_leading_shape() -> None:
    """Of every method, the same numbers as of the states one by one."""
    c, model = case("mixed_k2_n8"), shared("mixed_k2_n8")

    def asked(q: Any, v: Any, a: Any, wrench: Any, at: Any, effort: Any) -> dict[str, Any]:
        return {
            "inverse": model.inverse_dynamics(q, v, a, wrench, at, outputs=("share",)),
            "forward": model.forward_dynamics(q, v, effort, wrench, at, outputs=("pose",)),
            "linear": model.linearise(q, v, effort, wrench, at),
            "kinematics": model.inverse_kinematics(q, v, a),
            "jacobians": model.jacobians(q),
        }

    given = *c.arguments, model.inverse_dynamics(*c.arguments).effort
    whole = asked(*given)
    for lead in ((), (3,), (2, 3), (0,), (2, 0)):
        rows = np.random.default_rng(2).integers(0, len(c.q), lead)
        q, v, a, *_ = own = [x[rows] for x in given]
        found = asked(*own)
        for name, result in found.items():
            for key, value in vars(result).items():
                if isinstance(value, np.ndarray):
                    assert value.shape[: len(lead)] == lead, key
                    assert error(value, getattr(whole[name], key)[rows]) < 1e-9, key
        assert error(model.forward_kinematics(found["kinematics"].joint).q, q) < 1e-9
        assert error(model.mass_matrix(q), model.mass_matrix(c.q)[rows]) < 1e-12
        assert model.bias(q, v).shape == model.gravity(q).shape == q.shape
        assert error(found["forward"].acceleration, a) < 1e-6


def test_arguments_broadcast_and_points_have_names(monkeypatch: pytest.MonkeyPatch) -> None:
    """What the mechanism alone decides is found once: a call of few samples would pay for it."""
    model = shared("masticatory")
    home, many, force = np.zeros(4), np.zeros((2, 3, 4)), [0, 0, -50.0, 0, 0, 0]
    one = model.inverse_dynamics(home, home, home, force, "incisor").effort
    for place in ("questions.structure.dependent_coordinates", "model.system.characteristic"):
        monkeypatch.setattr(f"condyle.{place}", lambda _: pytest.fail("derived again"))
    for q, v, wrench in [(many, home, force), (home, many, force), (home, home, [[force] * 3] * 2)]:
        found = model.inverse_dynamics(q, v, home, wrench, at="incisor").effort
        np.testing.assert_allclose(found, np.broadcast_to(one, (2, 3, 6)), atol=1e-12)
    for at, same in ((model.mechanism.platform.points["incisor"], True), (None, False)):
        effort = model.inverse_dynamics(home, home, home, force, at).effort
        assert np.array_equal(effort, one) if same else np.abs(effort - one).max() > 0.1
    assert len(model.independent) == 4


CALLS: list[tuple[Any, str]] = [
    (lambda m, x: m.inverse_dynamics("q", x, x), "q: expected numbers"),
    (lambda m, x: m.inverse_dynamics(x, object(), x), "v: expected numbers"),
    (lambda m, x: m.forward_dynamics(x, x, x), r"effort: .*got shape \(4,\)"),
    (
        lambda m, x: m.inverse_dynamics(np.zeros((2, 4)), np.zeros((3, 4)), x),
        r"leading shapes do not go together: q \(2, 4\), v \(3, 4\)",
    ),
    (lambda m, x: m.inverse_dynamics(x, x, x, at="incisors"), 'at: .*"incisors"'),
    (lambda m, x: m.inverse_dynamics(x, x, x, outputs="contacts"), "put 'contacts'"),
    (lambda m, x: m.forward_dynamics(x, x, x, outputs=3), "outputs: expected names"),
    (lambda m, x: m.inverse_dynamics(x, x, x, threads="2"), "threads: expected an int"),
    (lambda m, x: m.mass_matrix(x, space="Q"), 'space: unknown space "Q"'),
    (lambda m, x: m.forward_kinematics(x), r"joint: .*got shape \(4,\)"),
    (lambda m, x: m.forward_kinematics(np.zeros(6), start=x), "start: expected"),
    (lambda m, x: m.forward_kinematics(np.zeros(6), tolerance="1"), "tolerance: expected"),
    (lambda m, x: m.linearise(x, x, None), "effort: expected numbers"),
    (lambda m, x: condyle.derive(3), "^mechanism: expected"),
]
OPTIONS = {"formulation": 3, "route": None, "backend": b"numpy", "distribution": 1.0}


def test_what_is_wrong_is_named() -> None:
    for call, said in CALLS:
        with pytest.raises(InputError, match=said):
            call(shared("masticatory"), np.zeros(4))
    for name, value in OPTIONS.items():
        with pytest.raises(InputError, match=f"^{name}: expected"):
            condyle.derive("masticatory", **{name: value})
    for name in ("preload", "contact_weight"):
        for value in ("1", -1.0, np.nan, np.inf, None, np.zeros(2)):
            with pytest.raises(InputError, match=f"^{name}: expected a number of at least 0"):
                Distribution("bounded", **{name: value})
