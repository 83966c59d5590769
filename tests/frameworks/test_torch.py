"""Models in PyTorch, where it is installed: it is large, so the tests do without."""

from __future__ import annotations

from importlib.util import find_spec

import numpy as np
import pytest

import condyle
from condyle.errors import InputError, MissingExtraError

from .conftest import ARGUMENTS, RESULTS, slopes, state

HERE = find_spec("torch") is not None
needs_torch = pytest.mark.skipif(not HERE, reason="PyTorch is not installed")
pytestmark = pytest.mark.slow


@pytest.mark.skipif(HERE, reason="PyTorch is installed")
def test_missing():
    with pytest.raises(MissingExtraError, match="torch"):
        condyle.derive("masticatory", backend="numpy").to_torch()


@needs_torch
@pytest.mark.parametrize("name", ["masticatory", "gough-stewart", "human-jaw"])
@pytest.mark.parametrize("question", ARGUMENTS)
def test_values_and_derivatives(name, question, compiler_command):
    import torch

    model = condyle.derive(name)
    given, names, result = state(model), ARGUMENTS[question], RESULTS[question]
    given = {own: 0.1 * value for own, value in given.items()}
    tensors = [torch.tensor(given[own], requires_grad=True) for own in names]
    function = getattr(model.to_torch(), question)
    value = function(*tensors)[result]
    expected = getattr(getattr(model, question)(*(given[own] for own in names)), result)
    assert value.detach().numpy() == pytest.approx(expected, rel=1e-12)
    rows = [torch.autograd.grad(x, tensors, retain_graph=True) for x in value]
    for i, own in enumerate(names):
        right = slopes(model, question, given, own, 1e-5)  # limits are near
        found = np.array([row[i].numpy() for row in rows])
        assert np.abs(found - right).max() <= 3e-6 * np.abs(right).max(), own


@needs_torch
def test_vmap_broadcasting_and_compile(compiler_command):
    import torch

    model = condyle.derive("masticatory")
    dynamics, given = model.to_torch(), state(model, count=5)
    q, v, a = (torch.tensor(given[own]) for own in "qva")
    mapped = torch.vmap(lambda x: dynamics.inverse_dynamics(x, v[0], a[0])["effort"])(q)
    plain = dynamics.inverse_dynamics(q, v[0], a[0])["effort"]
    assert torch.equal(mapped, plain)
    shared = v[0].clone().requires_grad_()
    dynamics.inverse_dynamics(q, shared, a)["effort"].square().sum().backward()
    alone = v[:1].expand(5, 4).clone().requires_grad_()
    dynamics.inverse_dynamics(q, alone, a)["effort"].square().sum().backward()
    assert torch.allclose(shared.grad, alone.grad.sum(0), rtol=1e-10)
    cost = lambda x: dynamics.inverse_dynamics(x, v, a)["effort"].square().sum()  # noqa: E731
    whole = torch.compile(cost, backend="aot_eager", fullgraph=True)
    ones = [q.clone().requires_grad_() for _ in range(2)]
    cost(ones[0]).backward()
    whole(ones[1]).backward()
    assert torch.allclose(ones[0].grad, ones[1].grad, rtol=1e-12)
    torch.library.opcheck(
        torch.ops.condyle.inverse_dynamics_0.default,
        (q[0], v[0], a[0], torch.zeros(6).double(), torch.zeros(3).double()),
        test_utils=("test_schema", "test_faketensor"),
    )


@needs_torch
def test_refused():
    import torch

    dynamics = condyle.derive("masticatory", backend="numpy").to_torch()
    with pytest.raises(InputError, match="float64"):
        dynamics.inverse_dynamics(torch.zeros(4), torch.zeros(4), torch.zeros(4))
    with pytest.raises(InputError, match="v is missing"):
        dynamics.inverse_dynamics(torch.zeros(4).double())
