"""Models as functions of CasADi: our kernels as externals, with exact first derivatives."""

from __future__ import annotations

import ctypes
import shutil
import tempfile
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from ..backends import cache
from ..backends.c.compiled_kernel import CompiledKernel
from ..backends.c.shared_library import obtained, tool
from ..backends.compiler import Compiler, find_compiler
from ..backends.kernel import Kernel
from ..errors import UnsupportedError
from ..model.model import Model
from .requests import Request, ResultColumns, dynamics, inputs_of

Shapes = dict[str, tuple[int, int]]


class CasadiFunctions:
    """Inverse and forward dynamics of a model as functions of CasADi, of one sample.

        dynamics = model.to_casadi()
        effort, contact_force = dynamics.inverse_dynamics(q, v, a, wrench, at)

    Columns in and out, in the order of `Model`; NaN where there is no result. First derivatives are
    exact and compiled too; there are no second ones, and CasADi says so.
    """

    inverse_dynamics: ca.Function
    forward_dynamics: ca.Function

    def __init__(self, model: Model) -> None:
        """As of `Model.to_casadi`."""
        if model.backend.name != "compiled":
            raise UnsupportedError(
                f"to_casadi calls compiled kernels, and this model has {model.backend.name}"
            )
        for name, asked in dynamics(model).items():
            setattr(self, name, _function(name, asked))


def _function(name: str, request: Request) -> ca.Function:
    sizes = request.sizes()
    given = {own: (sum(sizes[p] for p in ports), 1) for own, ports in request.arguments}
    values, slopes = request.values, request.slopes(request.ports)
    all_results = ResultColumns.of(values).shapes
    results = {own: (all_results[own][0], 1) for own in request.results if all_results[own][0]}
    matrices = {
        f"jac_{r}_{a}": (n, m) for r, (n, _) in results.items() for a, (m, _) in given.items()
    }
    path = Path(tempfile.mkdtemp(prefix="condyle-casadi-")) / "function.so"
    shutil.copy(_external(name), path)  # each with numbers of its own
    library = ctypes.CDLL(str(path))
    with_results = given | {f"out_{r}": shape for r, shape in results.items()}
    for which, kernel, arguments, outputs in (
        (0, values, given, results),
        (1, slopes, with_results, matrices),
    ):
        own = _Kernel.of(kernel, request, arguments, outputs)
        _kept.append((kernel, own))
        library.bind(which, ctypes.byref(own))
    found = ca.external(name, str(path))
    shutil.rmtree(path.parent)  # it is loaded
    return found


_kept: list[Any] = []  # what the libraries point at: functions outlive the model


class _Kernel(ctypes.Structure):
    """The struct of a kernel in casadi_external.c."""

    _fields_ = [
        ("batch", ctypes.c_void_p),
        ("table", ctypes.c_void_p),
        *((name, ctypes.c_int64) for name in ("columns",)),
        *((name, ctypes.c_void_p) for name in ("argument", "entry")),
        ("width", ctypes.c_int64),
        *((name, ctypes.c_void_p) for name in ("result", "place")),
        ("inputs", ctypes.c_int64),
        ("outputs", ctypes.c_int64),
        *((n, ctypes.c_void_p) for n in ("shapes_in", "shapes_out", "names_in", "names_out")),
    ]

    @staticmethod
    def of(kernel: Kernel, request: Request, given: Shapes, results: Shapes) -> _Kernel:
        """The struct of a kernel that is a function of these arguments and results."""
        assert isinstance(kernel, CompiledKernel)
        argument, entry = inputs_of(kernel, request.arguments)
        result, place = _stored(kernel, request, results)
        _, batch, table = kernel.address
        own = _Kernel(batch, table, len(argument))
        own.referenced = []  # type: ignore[attr-defined]

        def keep_alive(values: Any) -> int:
            own.referenced.append(values)
            return ctypes.addressof(values)

        def numbers(values: Any) -> int:
            return keep_alive((ctypes.c_longlong * (len(values) + 1))(*values))

        def names(values: Any) -> int:
            return keep_alive((ctypes.c_char_p * (len(values) + 1))(*(v.encode() for v in values)))

        own.argument, own.entry = numbers(argument), numbers(entry)
        own.width, own.result, own.place = len(result), numbers(result), numbers(place)
        own.inputs, own.outputs = len(given), len(results)
        own.shapes_in = numbers([x for shape in given.values() for x in (*shape, 1)])
        own.shapes_out = numbers([x for shape in results.values() for x in (*shape, 1)])
        own.names_in, own.names_out = names(given), names(results)
        return own


def _stored(kernel: Kernel, request: Request, results: Shapes) -> tuple[list[int], list[int]]:
    """Which result each column of the kernel is part of, -1 for none, and where, by columns."""
    stored, names, sizes = ResultColumns.of(kernel), list(results), request.sizes()
    to, order = [], []
    for own, shape in stored.shapes.items():
        name, _, port = own.partition("/")
        matrix, first = np.arange(int(np.prod(shape))).reshape(shape), 0
        if port:
            argument, ports = next(a for a in request.arguments if port in a[1])
            first = sum(sizes[p] for p in ports[: ports.index(port)])
            matrix = request.matrix(name, port, matrix)
            name = f"jac_{name}_{argument}"
        else:
            matrix = matrix.reshape(-1, 1)
        where = np.empty(matrix.size, dtype=int)
        rows, columns = np.indices(matrix.shape)
        where[matrix] = (first + columns) * matrix.shape[0] + rows
        to.append(names.index(name) if name in names else -1)
        order.append(where)
    pairs = list(zip(stored.result, stored.place, strict=True))
    return [to[r] for r, _ in pairs], [int(order[r][p]) for r, p in pairs]


def _external(name: str) -> str:
    """The library of a function of this name."""
    source, compiler = Path(__file__).with_name("casadi_external.c"), find_compiler()
    named = Compiler(
        compiler.command,
        (*compiler.flags, f"-DNAME={name}"),
        compiler.identity,
        compiler.lanes,
    )

    def make(folder: Path) -> tuple[Path, dict[str, Any]]:
        named.build(folder / "kernel.so", source)
        return folder / "kernel.so", {}

    recipe = cache.digest(source.read_bytes(), name, tool(compiler))
    return str(obtained(recipe, make, ctypes.CDLL)[0].library)
