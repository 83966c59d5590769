"""Models as operators of PyTorch, with exact derivatives."""

from __future__ import annotations

from collections.abc import Callable
from itertools import count
from typing import Any

import numpy as np

from ..errors import InputError
from ..extras import require
from ..model.model import Model

Function = Callable[..., dict[str, Any]]
_THIRD = {"inverse_dynamics": "a", "forward_dynamics": "effort"}
_RESULT = {"inverse_dynamics": "effort", "forward_dynamics": "acceleration"}
_number = count()  # operators of all models have names of their own


class TorchFunctions:
    """Inverse and forward dynamics of a model on tensors of doubles, also under `vmap`, `compile`.

        dynamics = model.to_torch()
        dynamics.inverse_dynamics(q, v, a, wrench)["effort"].square().sum().backward()

    Arguments are as of `Model`, without names of points; results are `effort` (..., n) or
    `acceleration` (..., m), `contact_force` (..., k) and `status` (...), NaN where that is not 0.
    There are no second derivatives, and PyTorch says so.
    """

    inverse_dynamics: Function
    forward_dynamics: Function

    def __init__(self, model: Model) -> None:
        """As of `Model.to_torch`."""
        require("torch", "torch")
        for name in _THIRD:
            setattr(self, name, _function(model, name))


def _function(model: Model, name: str) -> Function:
    import torch

    names = ("q", "v", _THIRD[name], "wrench", "at")
    results = (_RESULT[name], "contact_force")
    called = _operator(model, name, names, results)

    def function(*given: Any, **named: Any) -> dict[str, Any]:
        if len(given) > len(names) or not {*named} <= {*names[len(given) :]}:
            raise InputError(f"expected the arguments {', '.join(names)}")
        known = dict(zip(names, given, strict=False)) | named
        known.setdefault("wrench", torch.zeros(6, dtype=torch.float64))
        known.setdefault("at", torch.zeros(3, dtype=torch.float64))
        arrays = []
        for own in names:
            if own not in known:
                raise InputError(f"{own} is missing")
            a = known[own]
            if not isinstance(a, torch.Tensor) or a.dtype != torch.float64:
                got = a.dtype if isinstance(a, torch.Tensor) else type(a).__name__
                raise InputError(f"{own}: expected a tensor of torch.float64, got {got}")
            arrays.append(a)
        *found, status = called(*arrays)
        return dict(zip(results, found, strict=True)) | {"status": status}

    function.__name__ = name
    return function


def _operator(
    model: Model, name: str, names: tuple[str, ...], results: tuple[str, ...]
) -> Callable[..., Any]:
    """An operator of five tensors, and one for its derivatives."""
    import torch

    sizes = [len(model.mechanism.chains), len(model.mechanism.contacts)]
    if name == "forward_dynamics":
        sizes[0] = len(model.independent)
    title, given = f"condyle::{name}_{next(_number)}", ", ".join(f"Tensor {own}" for own in names)
    cpu: dict[str, Any] = {"mutates_args": (), "device_types": "cpu"}

    @torch.library.custom_op(title, **cpu, schema=f"({given}) -> (Tensor, Tensor, Tensor)")
    def called(*tensors: Any) -> Any:
        found = getattr(model, name)(*(a.numpy() for a in tensors))
        arrays = [getattr(found, one) for one in (*results, "status")]
        return tuple(torch.from_numpy(np.array(a)) for a in arrays)

    @called.register_fake
    def _(*tensors: Any) -> Any:
        lead = torch.broadcast_shapes(*(a.shape[:-1] for a in tensors))
        first, force = (tensors[0].new_empty((*lead, size)) for size in sizes)
        return first, force, tensors[0].new_empty(lead, dtype=torch.uint8)

    given += ", Tensor first, Tensor force"
    back_to = ", ".join(["Tensor"] * len(names))

    @torch.library.custom_op(f"{title}_vjp", **cpu, schema=f"({given}) -> ({back_to})")
    def pulled(*tensors: Any) -> Any:
        arrays = [a.numpy() for a in tensors]
        weights = {r: w for r, w in zip(results, arrays[-2:], strict=True) if w.shape[-1]}
        gradients = model.vjp(
            tuple(weights), weights, names, **dict(zip(names, arrays[:-2], strict=True))
        )
        pairs = zip(names, arrays[:-2], strict=True)
        return tuple(torch.from_numpy(_summed(gradients[by], a.shape)) for by, a in pairs)

    @pulled.register_fake
    def _(*tensors: Any) -> Any:
        return tuple(torch.empty_like(a) for a in tensors[:-2])

    def keep(ctx: Any, inputs: Any, output: Any) -> None:
        ctx.save_for_backward(*inputs)

    def back(ctx: Any, first: Any, force: Any, status: Any) -> Any:
        return pulled(*ctx.saved_tensors, first.contiguous(), force.contiguous())

    called.register_autograd(back, setup_context=keep)
    for operator, many in ((called, 3), (pulled, 5)):
        operator.register_vmap(_mapped(operator, many, pulled is operator))
    return called


def _mapped(operator: Any, results: int, own_shapes: bool) -> Callable[..., Any]:
    """The operator with one leading dimension more.

    Args: own_shapes: whether every argument has a result of its own shape, and so that dimension.
    """

    def mapped(info: Any, dims: Any, *given: Any) -> Any:
        first = [
            a.unsqueeze(0) if dim is None else a.movedim(dim, 0)
            for a, dim in zip(given, dims, strict=True)
        ]
        if own_shapes:
            first = [a.expand(info.batch_size, *a.shape[1:]) for a in first]
        rank = max(a.dim() for a in first)
        aligned = [a.reshape(a.shape[0], *[1] * (rank - a.dim()), *a.shape[1:]) for a in first]
        found = operator(*(a.contiguous() for a in aligned))
        if own_shapes:
            found = tuple(x.reshape(a.shape) for x, a in zip(found, first, strict=False))
        return found, (0,) * results

    return mapped


def _summed(a: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """Over the leading dimensions that an argument was broadcast along."""
    a = a.sum(axis=tuple(range(a.ndim - len(shape))))
    same = tuple(i for i, size in enumerate(shape[:-1]) if size == 1 and a.shape[i] != 1)
    return np.array(a.sum(axis=same, keepdims=True))
