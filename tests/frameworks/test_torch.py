"""Models in PyTorch, where it is installed: it is large, so the tests do without."""

from __future__ import annotations

from importlib.util import find_spec

import pytest
from support.machines import model

from condyle.errors import InputError, MissingExtraError

from .conftest import ARGUMENTS, RESULTS, answer, arguments, check_slopes, slopes, state

HERE = find_spec("torch") is not None
needs_torch = pytest.mark.skipif(not HERE, reason="PyTorch is not installed")


@pytest.mark.skipif(HERE, reason="PyTorch is installed")
def test_missing():
    with pytest.raises(MissingExtraError, match="torch"):
        model("masticatory").to_torch()


@needs_torch
@pytest.mark.parametrize("name", ["masticatory", "gough-stewart", "human-jaw"])
def test_values_and_derivatives(name, compiler_command):
    import torch

    given, functions = state(name, size=0.1), model(name, "compiled").to_torch()
    for question in ARGUMENTS:
        tensors = [torch.tensor(a, requires_grad=True) for a in arguments(question, given)]
        value = getattr(functions, question)(*tensors)[RESULTS[question]]
        right = getattr(answer(name, question, given), RESULTS[question])
        assert value.detach().numpy() == pytest.approx(right, rel=1e-12)
        rows = [torch.autograd.grad(x, tensors, retain_graph=True) for x in value]
        found = [torch.stack(column).numpy() for column in zip(*rows, strict=True)]
        check_slopes(found, slopes(name, question, 1e-5, 0.1), 3e-6)  # limits are near


@needs_torch
def test_vmap_broadcasting_and_compile(compiler_command):
    import torch

    inverse, given = (
        model("masticatory", "compiled").to_torch().inverse_dynamics,
        state("masticatory", count=5),
    )
    q, v, a = (torch.tensor(given[own]) for own in "qva")
    mapped = torch.vmap(lambda x: inverse(x, v[0], a[0])["effort"])(q)
    assert torch.equal(mapped, inverse(q, v[0], a[0])["effort"])
    shared, alone = v[0].clone().requires_grad_(), v[:1].expand(5, 4).clone().requires_grad_()
    for x in (shared, alone):
        inverse(q, x, a)["effort"].square().sum().backward()
    assert torch.allclose(shared.grad, alone.grad.sum(0), rtol=1e-10)
    cost = lambda x: inverse(x, v, a)["effort"].square().sum()  # noqa: E731
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

    inverse = model("masticatory").to_torch().inverse_dynamics
    with pytest.raises(InputError, match="float64"):
        inverse(torch.zeros(4), torch.zeros(4), torch.zeros(4))
    with pytest.raises(InputError, match="v is missing"):
        inverse(torch.zeros(4).double())
