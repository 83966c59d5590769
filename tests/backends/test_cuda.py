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
from condyle.backends.c.straight_line import Scalar
from condyle.backends.compiler import find_compiler
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
QUESTIONS = {
    "masticatory": ("inverse", ("contact", "bound")),
    "human-jaw": ("inverse", ("contact",)),
    "masticatory-curved": ("forward", ()),
    "gough-stewart": ("forward", ()),
}


def states(model: condyle.Model, count: int) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(4)
    m, n = len(model.independent), len(model.mechanism.chains)
    given = {name: rng.normal(0, 0.004, (count, m)) for name in ("q", "q1", "q2")}
    given["effort"] = rng.normal(0, 1.0, (count, n))
    return given | {name: rng.normal(0, 2.0, (1, 3)) for name in ("force", "moment", "point")}


def asked(name: str, mu: float = 0.0) -> tuple[condyle.Model, Question]:
    mechanism = condyle.load_mechanism(name)
    if mu:
        first = mechanism.contact_names[0]
        mechanism = mechanism.set({f"contact.{first}.friction.coefficient": mu})
    model = condyle.derive(mechanism, backend="numpy")
    question, *details = QUESTIONS[name]
    return model, Question.about(model.system.structure, question, *details)


@pytest.mark.slow
@pytest.mark.parametrize("precision", ["double", "float"])
@pytest.mark.parametrize(
    ("name", "mu"), [(name, 0.0) for name in QUESTIONS] + [("masticatory", 0.3)]
)
def test_values(name, mu, precision, tmp_path: Path):
    model, question = asked(name, mu)
    variants, numbers, count = question.variants(), model.system.numbers, 37
    expected = NumpyKernel(variants, numbers)
    given = {p.name: states(model, count)[p.name] for p in expected.interface.ports}
    program, kind = rescaled(variants.main, question.name, precision), cuda.TYPES[precision]
    text = cuda.source(program, "main", precision).replace('extern "C" ', "")
    source = tmp_path / "kernel.c"
    source.write_text(AS_C + text + LOOP)
    library = tmp_path / "kernel.so"
    command = [*find_compiler().command, str(source), "-o", str(library)]
    subprocess.run([*command, "-O1", "-fPIC", "-shared", "-lm", "-w"], check=True)
    _, columns = columns_of(expected.interface, given, numbers.order)
    columns = [np.ascontiguousarray(c, dtype=kind) for c in columns]
    # A column of one number is read in its place.
    constant = [len(np.unique(c)) == 1 for c in columns]
    starts = (ctypes.c_void_p * len(columns))(*(c.ctypes.data for c in columns))
    steps = (ctypes.c_longlong * len(columns))(*(0 if one else 1 for one in constant))
    width = sum(map(expected.interface.width, expected.interface.results))
    out, status = np.full((width, count), np.nan, dtype=kind), np.full(count, 99, dtype=np.uint8)
    table = constants_table(Scalar(fused(program), 1), numbers).astype(kind)
    where = [ctypes.c_void_p(a.ctypes.data) for a in (table, out, status)]
    long = ctypes.c_longlong(count)
    ctypes.CDLL(str(library)).run(where[0], starts, steps, long, where[1], long, where[2])
    found = results_of(expected.interface, out.astype(float), numbers.order)
    answer = expected.run(given)
    good = (status == 0) & (answer.status == 0)
    assert good.sum() > count / 2
    if precision == "double":
        assert np.array_equal(status == 0, answer.status == 0)
    for result, value in found.items():
        if result == "bound":
            continue
        largest = np.abs(answer.values[result][..., good]).max()
        error = np.abs(value - answer.values[result])[..., good].max()
        assert error <= {"double": 1e-11, "float": 3e-2}[precision] * largest, result


@pytest.mark.slow
@pytest.mark.parametrize("precision", ["double", "float"])
@pytest.mark.parametrize("name", ["masticatory", "masticatory-curved"])
def test_cuda_compiles(name, precision):
    pytest.importorskip("nvidia.cuda_nvrtc")
    _, question = asked(name)
    program = rescaled(question.variants().main, question.name, precision)
    ptx = compiled(cuda.source(program, "main", precision))
    assert ".visible .entry condyle_main" in ptx
    assert ("fma.rn.f64" in ptx) == (precision == "double")
    assert ("fma.rn.f32" in ptx) == (precision == "float")


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
def test_without_cupy():
    with pytest.raises(MissingExtraError, match="cuda"):
        condyle.derive("masticatory", backend="cuda")
