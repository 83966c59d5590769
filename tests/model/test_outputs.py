"""What `Model.torques` returns besides torques: what was asked for, and nothing else."""

from __future__ import annotations

import numpy as np
import pytest

from condyle.errors import InputError
from condyle.model import Model
from support.cases import case


@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize("backend", ["compiled", "numpy"])
def test_condition_is_that_of_the_jacobian(backend: str) -> None:
    """Against singular values of the Jacobian that forward differences of the joints give."""
    c = case("masticatory")
    model = Model(c.mechanism, backend=backend)
    q, q1, q2, load = (a[:5] for a in c.arguments)
    result, status = model.torques(q, q1, q2, load, outputs=("condition",))
    assert result.contact_force is None and not status.any()
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
        assert result.condition[i] == pytest.approx(expected, rel=1e-4)


def _arm(model: Model) -> np.ndarray:
    """Crank lengths, (n, 1): J_W = J_A J in lengths of the coupler."""
    return np.array(
        [[np.linalg.norm(np.subtract(c.crank_tip, c.base))] for c in model.mechanism.chains]
    )


def test_an_unknown_output_is_named() -> None:
    c = case("masticatory")
    with pytest.raises(InputError, match='no output "contacts"'):
        Model(c.mechanism, backend="numpy").torques(*c.arguments, outputs=("contacts",))
