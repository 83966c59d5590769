"""What `Model.torques` returns besides efforts: what was asked for, and nothing else."""

from __future__ import annotations

import numpy as np
import pytest
from support.cases import case, error

from condyle.errors import InputError
from condyle.model.inverse_dynamics import RESULTS
from condyle.model.model import Model


@pytest.mark.usefixtures("unoptimised")
@pytest.mark.parametrize("backend", ["compiled", "numpy"])
def test_condition_is_that_of_the_jacobian(backend: str) -> None:
    """Against singular values of the Jacobian that forward differences of the joints give."""
    c = case("masticatory")
    model = Model(c.mechanism, backend=backend)
    q, q1, q2, load = (a[:5] for a in c.arguments)
    result = model.torques(q, q1, q2, load, outputs=("condition",))
    assert set(result.others) == {"condition"} and not result.status.any()
    scale = [model.characteristic_length if n in "XYZ" else 1.0 for n in model.independent]
    for i in range(len(q)):
        steps = np.vstack([q[i] + sign * 1e-6 * row for sign in (1, -1) for row in np.diag(scale)])
        still = np.zeros_like(steps)
        loads = np.tile(load[i], (len(steps), 1))
        evaluation = model.evaluate(steps, still, still, loads)
        forth, back = np.split(evaluation.configuration.joint, 2)
        J = (forth - back) / 2e-6
        weights = np.abs(evaluation.configuration.singularity.transmission).mean(axis=0)
        expected = np.linalg.cond(J.T * _arm(model) * weights[:, None])
        assert result["condition"][i] == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize("backend", ["compiled", "numpy"])
@pytest.mark.parametrize("output", [*RESULTS, "condition"])
@pytest.mark.usefixtures("unoptimised")
def test_what_is_asked_for_is_what_evaluate_says(output: str, backend: str) -> None:
    """Samples first, chains where the file has them, and nothing else comes along."""
    c = case("mixed_k2_n8")
    model = Model(c.mechanism, backend=backend)
    whole = model.evaluate(*c.arguments)
    found = model.torques(*c.arguments, outputs=(output,))
    assert error(found.effort, whole.effort) < 1e-12
    assert set(found.others) == set(RESULTS.get(output, ("condition",)))
    for name, value in found.others.items():
        if name == "condition":
            assert error(value, whole.configuration.singularity.condition) < 1e-9
        elif name == "gravity":
            assert value.shape == whole.share.shape
        else:
            assert error(value, getattr(whole, name)) < 1e-12


@pytest.mark.parametrize("name", ["masticatory", "mixed_k3_n9_curved"])
@pytest.mark.parametrize("backend", ["compiled", "numpy"])
@pytest.mark.usefixtures("unoptimised")
def test_gravity_is_the_shares_at_rest(name: str, backend: str) -> None:
    """What gravity and load alone ask for, whatever the rates are."""
    c = case(name)
    model = Model(c.mechanism, backend=backend)
    moving = model.torques(*c.arguments, outputs=("gravity", "share"))
    resting = model.torques(c.q, 0 * c.q1, 0 * c.q2, c.load, outputs=("gravity", "share"))
    assert error(moving["gravity"], resting["share"]) < 1e-12
    assert error(resting["gravity"], resting["share"]) < 1e-12
    assert error(moving["gravity"], moving["share"]) > 1e-3
    assert error(moving["share"].sum(axis=0), moving.effort) < 1e-12


def _arm(model: Model) -> np.ndarray:
    """Crank lengths, (n, 1): J_W = J_A J in lengths of the coupler."""
    return np.array(
        [[np.linalg.norm(np.subtract(c.crank_tip, c.base))] for c in model.mechanism.chains]
    )


def test_an_unknown_output_is_named() -> None:
    c = case("masticatory")
    with pytest.raises(InputError, match='no output "contacts"'):
        Model(c.mechanism, backend="numpy").torques(*c.arguments, outputs=("contacts",))


@pytest.mark.usefixtures("unoptimised")
def test_a_call_derives_nothing_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """What the mechanism alone decides is found once: a call of few samples would pay for it."""
    c = case("masticatory")
    model = Model(c.mechanism)
    model.torques(*c.arguments)

    def again(_: object) -> None:
        raise AssertionError("derived again")

    for place in ("questions.structure.dependent_coordinates", "model.system.characteristic"):
        monkeypatch.setattr(f"condyle.{place}", again)
    model.torques(*c.arguments)
    assert len(model.independent) == 4
