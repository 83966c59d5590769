"""Models as functions of JAX that jit, vmap, and are differentiated.

The kernel is called by XLA itself; its derivatives are those of the same graph.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

import numpy as np

from ..backends import cache
from ..backends.c.compiled_kernel import CompiledKernel
from ..backends.c.shared_library import obtained, tool
from ..backends.compiler import Compiler, find_compiler
from ..backends.kernel import AGAIN, Kernel
from ..errors import InputError, UnsupportedError, as_name, brief, did_you_mean
from ..extras import require
from ..model.model import Model
from ..status import Status
from .file_values import DIRECTIONS, FILE, NUMBERS, FileValues
from .requests import Request, ResultColumns, dynamics, inputs_of
from .traced import traced

JaxMethod = Literal["kernel", "graph"]
TARGET = "condyle_batch"
UNSURE = int(Status.uncertified)
Function = Callable[..., dict[str, Any]]
Called = Callable[..., dict[str, Any]]  # of one array a port, of one leading shape


class JaxFunctions:
    """Inverse and forward dynamics of a model as pure functions.

        dynamics = model.to_jax()
        jax.jit(jax.vmap(dynamics.inverse_dynamics))(q, v, a)["effort"]

    Arguments are as of `Model`, without names of points; results are `effort` (..., n) or
    `acceleration` (..., m), `contact_force` (..., k) and `status` (...), NaN where that is not 0.
    Samples that no kernel can certify, which a model solves by robust methods, are `uncertified`.
    """

    inverse_dynamics: Function
    forward_dynamics: Function

    def __init__(
        self, model: Model, method: JaxMethod = "kernel", numbers: Sequence[str] = ()
    ) -> None:
        """As of `Model.to_jax`."""
        as_name(method, "method")
        if method not in METHODS:
            raise InputError(
                f"method: unknown method {brief(method)}.{did_you_mean(method, METHODS)}"
            )
        require("jax", "jax")
        import jax

        if not jax.config.read("jax_enable_x64"):
            raise InputError(
                "to_jax computes in doubles, and JAX is set to float32. First call "
                'jax.config.update("jax_enable_x64", True)'
            )
        if method == "kernel" and model.backend.name != "compiled":
            raise UnsupportedError(
                f"to_jax calls compiled kernels, and this model has {model.backend.name}; "
                'method="graph" needs none'
            )
        file = FileValues.of(model, numbers) if numbers else None
        for name, asked in dynamics(model, file is not None).items():
            setattr(self, name, _function(asked, METHODS[method](asked, file), file))


def _traced(request: Request, file: FileValues | None) -> Called:
    """The graph, operation by operation."""
    import jax.numpy as jnp

    run = traced(request.written(request.question, *request.details), request.system.numbers)

    def called(*given: Any) -> dict[str, Any]:
        if file is not None:
            given = *given[:-1], *file.kernel_numbers(given[-1])
        values = run(dict(zip((*request.ports, *NUMBERS), given, strict=False)))
        status = jnp.where(values["status"] == AGAIN, jnp.uint8(UNSURE), values["status"])
        good = (status == 0)[..., None]
        values |= {name: jnp.where(good, values[name], jnp.nan) for name in request.results}
        return values | {"status": status}

    return called


def _compiled(request: Request, file: FileValues | None) -> Called:
    """The kernel, with derivatives by others."""
    import jax
    import jax.numpy as jnp

    _registered()
    ports = request.ports + (NUMBERS if file is not None else ())
    values = _caller(request.values, ports)

    def with_file_numbers(given: Any) -> Any:
        return given if file is None else (*given[:-1], *file.kernel_numbers(given[-1]))

    @jax.custom_jvp
    def called(*given: Any) -> dict[str, Any]:
        return values(*with_file_numbers(given))

    def rule(primals: Any, tangents: Any) -> Any:
        moving = {
            port: t
            for port, t in zip(request.ports, tangents, strict=False)
            if type(t) is not jax.custom_derivatives.SymbolicZero
        }
        values = called(*primals)
        slopes: dict[str, Any] = {}
        if moving:
            slopes = _caller(request.slopes(tuple(moving)), ports)(*with_file_numbers(primals))
        if file is not None and type(tangents[-1]) is not jax.custom_derivatives.SymbolicZero:
            moving[FILE] = tangents[-1]
            along = _caller(request.derivative("directional", NUMBERS), ports + DIRECTIONS)
            slopes |= file.slopes(along, with_file_numbers(primals), primals[-1], request.results)
        change: dict[str, Any] = {name: jnp.zeros_like(values[name]) for name in request.results}
        for name in (own for own in request.results if values[own].shape[-1]):
            for port, t in moving.items():
                own = slopes[f"{name}/{port}"]
                own = own if port == FILE else request.matrix(name, port, own)
                change[name] = change[name] + jnp.einsum("...rp,...p->...r", own, t)
        change["status"] = np.zeros(values["status"].shape, dtype=jax.dtypes.float0)
        return values, change

    called.defjvp(rule, symbolic_zeros=True)
    return called


METHODS: dict[JaxMethod, Callable[[Request, FileValues | None], Called]] = {
    "kernel": _compiled,
    "graph": _traced,
}


def _function(request: Request, called: Called, file: FileValues | None) -> Function:
    import jax.numpy as jnp

    sizes = request.sizes()

    def function(
        *given: Any, numbers: Mapping[str, Any] | None = None, **named: Any
    ) -> dict[str, Any]:
        flat = _ports(request, sizes, given, named)
        if file is not None:
            flat.append(file.given(numbers or {}))
        elif numbers:
            names = ", ".join(map(str, numbers))
            raise InputError(f"numbers: name them first: to_jax(numbers=[...]); got {names}")
        lead = jnp.broadcast_shapes(*(a.shape[:-1] for a in flat))
        found: dict[str, Any] = called(*(jnp.broadcast_to(a, (*lead, a.shape[-1])) for a in flat))
        return found

    function.__name__ = request.question
    return function


def _ports(request: Request, sizes: dict[str, int], given: Sequence[Any], named: Any) -> list[Any]:
    """An array for each port, of what a call gave."""
    import jax.numpy as jnp

    names = [name for name, _ in request.arguments]
    if len(given) > len(names) or not {*named} <= {*names[len(given) :]}:
        raise InputError(f"expected the arguments {', '.join(names)}")
    known = dict(zip(names, given, strict=False)) | named
    flat = []
    for name, ports in request.arguments:
        own = [sizes[port] for port in ports]
        a = known.get(name)
        if a is None:
            if name not in ("wrench", "at"):
                raise InputError(f"{name} is missing")
            a = jnp.zeros(sum(own))
        a = jnp.asarray(a, dtype=float)
        if not a.ndim or a.shape[-1] != sum(own):
            raise InputError(f"{name}: expected an array of shape (..., {sum(own)}), got {a.shape}")
        flat += jnp.split(a, np.cumsum(own)[:-1].tolist(), axis=-1)
    return flat


def _caller(kernel: Kernel, ports: Sequence[str]) -> Callable[..., dict[str, Any]]:
    """The batch of a kernel as XLA calls it."""
    import jax
    import jax.numpy as jnp

    assert isinstance(kernel, CompiledKernel)
    _keep.append(kernel)
    _, batch, table = kernel.address
    columns = ResultColumns.of(kernel)
    argument, entry = inputs_of(kernel, [(port, (port,)) for port in ports])
    given = {"address": (batch, table), "argument": argument, "entry": entry}
    given |= {"result": columns.result, "place": columns.place}
    attributes = {name: np.array(value, dtype=np.int64) for name, value in given.items()}

    def call(*arrays: Any) -> dict[str, Any]:
        lead = arrays[0].shape[:-1]
        sizes = [math.prod(shape) for shape in columns.shapes.values()]
        wanted = [jax.ShapeDtypeStruct((*lead, size), jnp.float64) for size in sizes]
        wanted.append(jax.ShapeDtypeStruct(lead, jnp.uint8))
        called = jax.ffi.ffi_call(TARGET, wanted, vmap_method="broadcast_all")
        *found, status = called(*arrays, **attributes)
        return {
            name: a.reshape(*lead, *shape)
            for a, (name, shape) in zip(found, columns.shapes.items(), strict=True)
        } | {"status": status}

    return call


_keep: list[Kernel] = []  # compiled functions outlive the model they call


@lru_cache(maxsize=1)
def _registered() -> ctypes.CDLL:
    """The handler, built for this JAX."""
    import jax

    compiler = find_compiler()
    source = Path(__file__).with_name("xla_handler.c")
    headers = jax.ffi.include_dir()
    recipe = cache.digest(source.read_bytes(), jax.__version__, tool(compiler))

    def make(folder: Path) -> tuple[Path, dict[str, Any]]:
        library = folder / "kernel.so"
        including = Compiler(
            compiler.command,
            (*compiler.flags, f"-I{headers}", f"-DAGAIN={AGAIN}", f"-DUNCERTIFIED={UNSURE}"),
            compiler.identity,
            compiler.lanes,
        )
        including.build(library, source)
        return library, {}

    _, library = obtained(recipe, make, ctypes.CDLL)
    jax.ffi.register_ffi_target(TARGET, jax.ffi.pycapsule(library.condyle_batch), platform="cpu")
    return library
