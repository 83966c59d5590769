"""CUDA's kernels without a device: values by the C compiler, and that CUDA's compiles them."""

from __future__ import annotations

import ctypes
import subprocess
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

import condyle
from condyle.backends import cuda
from condyle.backends.c.constants_table import constants_table
from condyle.backends.c.emit import fused
from condyle.backends.c.straight_line import ScalarCode
from condyle.backends.kernel import columns_of, results_of
from condyle.backends.numpy_kernel import NumpyKernel
from condyle.errors import MissingExtraError
from condyle.questions import Question
from condyle.questions.precision import rescaled

# What CUDA's compiler has and C's has not; a loop in the place of threads.
AS_C = """#include <math.h>
#define __device__
#define __global__
#define __constant__ static const
#define __restrict__ restrict
#define rsqrt(a) (1.0 / sqrt(a))
#define rsqrtf(a) (1.0f / sqrtf(a))
static struct { long long x; } blockIdx, blockDim, threadIdx;
"""
LOOP = """
void run(const real *table, const real *const *in, const long long *step, long long count,
         real *out, long long rows, unsigned char *status) {
    for (threadIdx.x = 0; threadIdx.x < count + 3; threadIdx.x++)
        condyle_main(table, in, step, count, out, rows, status);
}
"""
# Name, friction of its first contact, question.
ASKED = [
    ("masticatory", 0.0, "inverse", ("contact", "bound")),
    ("masticatory", 0.3, "inverse", ("contact", "bound")),
    ("human-jaw", 0.0, "inverse", ("contact",)),
    ("masticatory-curved", 0.0, "forward", ()),
    ("gough-stewart", 0.0, "forward", ()),
]


def states(model: condyle.Model, count: int) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(4)
    m, n = len(model.independent), len(model.mechanism.chains)
    given = {name: rng.normal(0, 0.004, (count, m)) for name in ("q", "q1", "q2")}
    given["effort"] = rng.normal(0, 1.0, (count, n))
    return given | {name: rng.normal(0, 2.0, (1, 3)) for name in ("force", "moment", "point")}


def of(name: str, mu: float = 0.0) -> condyle.Model:
    mechanism = condyle.load_mechanism(name)
    if mu:
        first = mechanism.contact_names[0]
        mechanism = mechanism.set({f"contact.{first}.friction.coefficient": mu})
    return condyle.derive(mechanism, backend="numpy")


@pytest.mark.parametrize(("name", "mu", "question", "details"), ASKED)
def test_values(
    name: str,
    mu: float,
    question: str,
    details: tuple[str, ...],
    compiler_command: tuple[str, ...],
    tmp_path: Path,
) -> None:
    """In double as numpy's, to what C contracts; in float to what is left of its digits."""
    model, count = of(name, mu), 37
    variants = Question.about(model.system.structure, question, details).variants()
    numbers, expected = model.system.numbers, NumpyKernel(variants, model.system.numbers)
    given = {p.name: states(model, count)[p.name] for p in expected.interface.ports}
    answer = expected.run(given)
    for precision, bound in (("double", 1e-11), ("float", 3e-2)):
        program, kind = rescaled(variants.main, question, precision), cuda.TYPES[precision]
        text = cuda.source(program, "main", precision).replace('extern "C" ', "")
        source, library = tmp_path / f"{precision}.c", tmp_path / f"{precision}.so"
        source.write_text(AS_C + text + LOOP)
        command = [*compiler_command, str(source), "-o", str(library)]
        subprocess.run([*command, "-O0", "-fPIC", "-shared", "-lm", "-w"], check=True)
        _, columns = columns_of(expected.interface, given, numbers.order)
        columns = [np.ascontiguousarray(c, dtype=kind) for c in columns]
        # A column of one number is read in its place.
        strides = [0 if len(np.unique(c)) == 1 else 1 for c in columns]
        starts = (ctypes.c_void_p * len(columns))(*(c.ctypes.data for c in columns))
        steps = (ctypes.c_longlong * len(columns))(*strides)
        width = sum(map(expected.interface.width, expected.interface.results))
        out, status = np.full((width, count), np.nan, dtype=kind), np.full(count, 99, np.uint8)
        table = constants_table(ScalarCode(fused(program), 1), numbers).astype(kind)
        where = [ctypes.c_void_p(a.ctypes.data) for a in (table, out, status)]
        long = ctypes.c_longlong(count)
        ctypes.CDLL(str(library)).run(where[0], starts, steps, long, where[1], long, where[2])
        found = results_of(expected.interface, out.astype(float), numbers.order)
        good = (status == 0) & (answer.status == 0)
        assert good.sum() > count / 2
        if precision == "double":
            assert np.array_equal(status == 0, answer.status == 0)
        for result in {*found} - {"bound"}:
            largest = np.abs(answer.values[result][..., good]).max()
            off = np.abs(found[result] - answer.values[result])[..., good].max()
            assert off <= bound * largest, result


def test_cuda_compiles() -> None:
    pytest.importorskip("nvidia.cuda_nvrtc")
    structure = of("masticatory-curved").system.structure
    variants = Question.about(structure, "forward").variants()
    for precision, own, other in (("double", "f64", "f32"), ("float", "f32", "f64")):
        program = rescaled(variants.main, "forward", precision)
        ptx = compiled(cuda.source(program, "main", precision))
        assert ".visible .entry condyle_main" in ptx
        assert f"fma.rn.{own}" in ptx and f"fma.rn.{other}" not in ptx


def compiled(source: str) -> str:
    """PTX of a source, for the processors of 2020 and later."""
    from nvidia import cuda_nvrtc

    folder = Path(next(iter(cuda_nvrtc.__path__))) / "lib"
    nvrtc = ctypes.CDLL(str(next(folder.glob("libnvrtc.so*"))))
    program, size = ctypes.c_void_p(), ctypes.c_size_t()
    text = ctypes.create_string_buffer(source.encode())
    nvrtc.nvrtcCreateProgram(ctypes.byref(program), text, b"kernel.cu", 0, None, None)
    options = (ctypes.c_char_p * 1)(b"--gpu-architecture=compute_80")
    failed = nvrtc.nvrtcCompileProgram(program, 1, options)
    for kind in ("ProgramLog", "PTX") if failed else ("PTX",):
        getattr(nvrtc, f"nvrtcGet{kind}Size")(program, ctypes.byref(size))
        found = ctypes.create_string_buffer(size.value)
        getattr(nvrtc, f"nvrtcGet{kind}")(program, found)
        assert not failed, found.value.decode()
    return found.value.decode()


@pytest.mark.skipif(find_spec("cupy") is not None, reason="CuPy is installed")
def test_without_cupy() -> None:
    with pytest.raises(MissingExtraError, match="cuda"):
        condyle.derive("masticatory", backend="cuda")
