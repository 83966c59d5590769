"""A program as CUDA: one thread a sample, in `double` or `float`, by CuPy on NVIDIA's processors.

    derive(mechanism, backend="cuda")

`source` needs no device: any compiler of CUDA takes it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from copy import copy
from functools import cached_property
from typing import Any

import numpy as np

from ..extras import require
from ..graph.graph import Value
from ..graph.program import Interface, Numbers, Program, Programs
from .c.constants_table import constants_table
from .c.emit import fused, text
from .c.levelled import LevelledCode
from .c.straight_line import ScalarCode
from .kernel import (
    AGAIN,
    NONE,
    Arrays,
    KernelValues,
    arrays_of,
    column_steps,
    places_of,
    results_at,
    run_by_variant,
    sample_rows,
    shapes_of,
)
from .threads import workers

BLOCK = 128  # threads of a block
TYPES = {"double": np.float64, "float": np.float32}
_HEAD = """typedef {real} real;
#define F(name) {function}
#define R(number) {number}
#ifndef HUGE_VAL
#define HUGE_VAL (1.0 / 0.0)
#define NAN (0.0 / 0.0)
#endif
#define AGAIN {again}
#define CHECKS {checks}
#define INLINE static __device__
__constant__ real tolerance[CHECKS + 1] = {{{tolerances}}};
__constant__ int below[CHECKS + 1] = {{{below}}};
"""
_FUNCTIONS = """static real atan2_s(real y, real x) { return F(atan2)(y, x); }
static void sincos_s(real x, real *sine, real *cosine) { F(sincos)(x, sine, cosine); }
"""
_SIGNATURE = """extern "C" __global__ void condyle_{name}(const real *__restrict__ table,
    const real *const *__restrict__ in, const long long *__restrict__ step, long long count,
    real *__restrict__ out, long long rows, unsigned char *__restrict__ status)
{{
const long long s = blockIdx.x * (long long)blockDim.x + threadIdx.x;
if (s >= count) return;
"""


def source(program: Program, name: str, precision: str = "double") -> str:
    """A kernel `condyle_<name>(table, in, step, count, out, rows, status)`.

    table: `constants_table`;  in: columns, `step` numbers from sample to sample, 0 for constants;
    out: columns, `rows` apart;  status: as of `KernelValues`.
    """
    printer, checks = _Thread(fused(program), 1, precision), program.checks
    floats = precision == "float"
    head = _HEAD.format(
        real=precision,
        function="name##f" if floats else "name",
        number="number##f" if floats else "number",
        again=AGAIN,
        checks=len(checks),
        tolerances=", ".join(printer.number(float(c.tolerance)) for c in checks) or "0",
        below=", ".join(str(AGAIN if c.below is None else int(c.below)) for c in checks) or "0",
    )
    functions = text("functions.h").replace("R(1.0) / F(sqrt)(a)", "F(rsqrt)(a)") + _FUNCTIONS
    parts = [
        head,
        functions.replace("static ", "static __device__ "),
        text("judge.h").replace("const double *", "const real *"),
        _SIGNATURE.format(name=name),
        *printer.lines(),
        "}\n",
    ]
    return "\n".join(parts)


class _Thread(LevelledCode):
    """One sample, by one thread: chain after chain, so that few values wait in its registers."""

    def lines(self) -> Iterator[str]:
        yield from self.by_levels(self.varying)
        yield from self.outputs()
        values = ", ".join([*(self.name(c.value, 0) for c in self.program.checks), "0"])
        yield f"const real check[CHECKS + 1] = {{{values}}};"
        yield "status[s] = judged(check);"

    def chains(
        self, group: int, values: list[Value], terms: list[tuple[Value, Value]]
    ) -> Iterator[str]:
        for number in range(self.copies[group]):
            yield from self.chain(values, terms, number)

    def sample(self, i: object) -> str:
        return f"in[{i}][s * step[{i}]]"

    def lane_sample(self, first: object, copy: int) -> str:
        assert isinstance(first, int)
        return self.sample(first + copy)

    def outputs(self) -> Iterator[str]:
        """Results alone."""
        width = sum(map(self.program.interface.width, self.program.interface.results))
        for at, v, count in self.program.stored():
            if at < width:
                yield from (f"out[{at + c} * rows + s] = {self.name(v, c)};" for c in range(count))


class CudaKernel:
    """A question with the numbers of its mechanisms, on a device.

    Attributes: order: where each lane stands among the callers'.
    """

    name = "cuda"

    def __init__(self, variants: Programs, numbers: Numbers, precision: str = "double") -> None:
        """Raises: MissingExtraError: without CuPy."""
        require("cupy", "cuda")
        self.interface: Interface = variants.main.interface
        self.columns: int = sum(map(self.interface.width, self.interface.results))
        self._variants, self._type = variants, np.dtype(TYPES[precision])
        self._prepare(numbers)

    def renumbered(self, numbers: Numbers) -> CudaKernel:
        """As of `Kernel`."""
        other = copy(self)
        other._prepare(numbers)
        return other

    def _prepare(self, numbers: Numbers) -> None:
        self.order: tuple[int, ...] = numbers.order
        self._numbers = numbers
        self._tables: dict[str, Any] = {}

    @cached_property
    def _code(self) -> dict[str, Any]:
        """Functions on the device: `main`, and `robust` if there is one."""
        import cupy

        programs = {"main": self._variants.main, "robust": self._variants.robust}
        precision = next(name for name, of in TYPES.items() if of == self._type)
        return {
            name: cupy.RawModule(code=source(p, name, precision)).get_function(f"condyle_{name}")
            for name, p in programs.items()
            if p is not None
        }

    def run(
        self,
        inputs: Mapping[str, np.ndarray],
        threads: int | None = None,
        without: frozenset[str] = NONE,
    ) -> KernelValues:
        """Evaluate samples; what `on_device` cannot vouch for is done again, robustly, there."""
        import cupy

        workers(threads)
        if len(self._numbers) > 1:
            return run_by_variant(self, self._numbers, inputs, threads, without)
        shapes = shapes_of(self.interface)
        count, arrays = arrays_of(shapes, inputs)
        given = dict(zip(shapes, arrays, strict=True))

        def some(few: Mapping[str, np.ndarray], name: str) -> tuple[Arrays, np.ndarray]:
            sent = {port: cupy.asarray(a, dtype=self._type) for port, a in few.items()}
            values, status = self.on_device(sent, name)
            back = {
                result: cupy.asnumpy(a).astype(float, copy=False) for result, a in values.items()
            }
            return back, cupy.asnumpy(status)

        values, status = some(given, "main")
        if "robust" in self._code and (again := np.flatnonzero(status == AGAIN)).size:
            better, status[again] = some(sample_rows(given, again, count), "robust")
            for name, value in values.items():
                value[..., again] = better[name]
        return KernelValues(values, status).without(without)

    def on_device(
        self, inputs: Mapping[str, Any], name: str = "main"
    ) -> tuple[dict[str, Any], Any]:
        """Results and statuses as arrays on the device, from arrays there.

        Args: inputs: port -> array of this precision, of one row or N;  name: `main` or `robust`.
        """
        import cupy

        arrays = [inputs[port.name] for port in self.interface.ports]
        count = max((len(a) for a in arrays), default=1)
        starts, steps = column_steps(
            self.interface, arrays, self.order, count, lambda a: int(a.data.ptr)
        )
        steps = [step // self._type.itemsize for step in steps]
        out = cupy.empty((self.columns, count), dtype=self._type)
        status = cupy.empty(count, dtype=cupy.uint8)
        args = (
            self._table(name),
            cupy.asarray(np.array(starts, dtype=np.uint64)),
            cupy.asarray(np.array(steps, dtype=np.int64)),
            np.int64(count),
            out,
            np.int64(count),
            status,
        )
        self._code[name]((-(-count // BLOCK),), (BLOCK,), args)
        places = [
            p if p.moved is None else p._replace(moved=cupy.asarray(p.moved))
            for p in places_of(self.interface, self.order)
        ]
        return results_at(places, out, count), status

    def _table(self, name: str) -> Any:
        import cupy

        if name not in self._tables:
            program = self._variants.robust if name == "robust" else self._variants.main
            assert program is not None
            table = constants_table(ScalarCode(fused(program), 1), self._numbers)
            self._tables[name] = cupy.asarray(table, dtype=self._type)
        return self._tables[name]
