"""Exported C under the strictest flags, sanitizers, for Arm, with a linter, as C++, and linked."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from export.conftest import C99, STRICT, Folder
from support.tools import need, run

from condyle.export import Exported
from condyle.status import Status

Folders = Callable[[str], Folder]
SANITIZED = "-O0 -g -fsanitize=address,undefined -fno-sanitize-recover=all"
CORTEX = "-mcpu=cortex-m7 -mfpu=fpv5-d16 -mfloat-abi=hard -isystem /usr/include/newlib"
AARCH64 = {"CC": "aarch64-linux-gnu-gcc", "RUN": "qemu-aarch64", "LDFLAGS": "-static"}
GCC, CLANG = {"CC": "gcc"}, {"CC": "clang"}
ci = pytest.mark.ci


def require_right(told: str, exported: Exported) -> None:
    """What `check` says of every function."""
    names = [f.name for f in exported.functions]
    # GCC has something to note about the passing of vectors.
    lines = [line for line in told.splitlines() if "worst error" in line]
    assert [line.split(":")[0] for line in lines] == names and told.count(": ok") == len(names)
    if exported.precision == "double":  # the folder's own bound leaves room for others' roots
        assert all(float(e) < 1e-13 for e in re.findall(r"worst error (\S+),", told))


@pytest.mark.parametrize(
    ("name", "flags", "vectors", "variables"),
    [
        ("limited", "-O0", False, CLANG),
        ("rubbing", SANITIZED, True, GCC),
        pytest.param("mixed", "-O0", False, GCC, marks=ci),
        *(pytest.param(n, "-O1", False, GCC, marks=ci) for n in ("limited", "rubbing")),
        *(pytest.param(n, SANITIZED, False, GCC, marks=ci) for n in ("limited", "struct")),
        pytest.param("rubbing", "-O0", True, CLANG, marks=ci),
        pytest.param("struct", "-O1", False, CLANG, marks=ci),
        *(pytest.param(n, "-O0", False, AARCH64, marks=ci) for n in ("rubbing", "struct")),
    ],
)
def test_the_recorded_samples(
    folder: Folders, name: str, flags: str, vectors: bool, variables: dict[str, str]
) -> None:
    """As C99 without a warning; sanitizers find nothing; vectors are of any processor."""
    of = folder(name)
    need(variables["CC"], "make", *([variables["RUN"]] if "RUN" in variables else ()))
    if vectors:
        defined = f"-D{of.exported.prefix.upper()}_VECTOR"
        variables = variables | {"VECTOR": "1", "VECTOR_FLAGS": defined}
    run("make", "-s", "clean", folder=of.path)
    given = [f"{key}={value}" for key, value in variables.items()]
    told = run("make", "-s", "check", f"CFLAGS={flags} {STRICT}", *given, folder=of.path)
    require_right(told, of.exported)


def test_fast_math_is_refused(folder: Folders) -> None:
    """Whatever would drop NaN or another order of operations: the recorded samples see neither."""
    of = folder("curved")
    for compiler, flag in (
        ("gcc", "-ffast-math"),
        ("gcc", "-Ofast"),
        ("clang", "-ffast-math"),
        ("gcc", "-ffinite-math-only"),
    ):
        need(compiler)
        call = (compiler, *C99, flag, "-fsyntax-only", of.source)
        done = subprocess.run(call, cwd=of.path, capture_output=True, text=True, timeout=300)
        assert done.returncode and "compile without -ffast-math" in done.stderr, call


def test_limits_bind_in_the_recorded_samples(folder: Folders) -> None:
    """Else the samples of `bounded` would say nothing that those of `contact` do not."""
    of = folder("limited")
    text = (of.path / f"{of.exported.prefix}_vectors.h").read_text()

    def recorded(name: str) -> np.ndarray:
        body = text.partition(f"{of.exported.prefix}_{name}[")[2].partition("= {")[2]
        return np.array(re.sub(r"[{},]", " ", body.partition("};")[0]).split(), dtype=float)

    status = recorded("bounded_status")
    efforts = np.abs(recorded("bounded_effort").reshape(len(status), -1))
    at_limit = np.isclose(efforts, 0.35, atol=1e-12).any(axis=1)
    assert (status == Status.infeasible).any() and at_limit.sum() >= 3
    assert efforts.max() <= 0.35 + 1e-12


@ci
@pytest.mark.parametrize("name", ["curved", "struct", "rubbing"])
def test_a_bare_arm_and_a_linter(folder: Folders, name: str) -> None:
    """The first has no variables and calls only what is stated; the second is content."""
    of = folder(name)
    need("arm-none-eabi-gcc", "arm-none-eabi-nm", "clang-tidy")
    build = (*C99, "-O1", *CORTEX.split(), "-c", of.source, "-o", "bare.o")
    run("arm-none-eabi-gcc", *build, folder=of.path)
    told = run("arm-none-eabi-nm", "-u", "bare.o", folder=of.path)
    # Compilers put memcpy for loops that copy.
    assert set(told.replace("U", "").split()) <= {*of.exported.symbols, "memcpy"}
    own = run("arm-none-eabi-nm", "--defined-only", "bare.o", folder=of.path)
    assert {line.split()[1] for line in own.splitlines()} <= {"T", "t", "r", "R", "a"}
    checks = "-checks=clang-analyzer-*,bugprone-*,-bugprone-easily-swappable-parameters"
    checks += ",-bugprone-implicit-widening-of-multiplication-result"  # of sizes below a hundred
    call = ("clang-tidy", "--quiet", checks, "-warnings-as-errors=*")
    run(*call, of.source, "main.c", "check.c", "--", "-std=c99", folder=of.path)


def test_the_example_and_two_mechanisms_in_one_program_of_cpp(
    folder: Folders, tmp_path: Path
) -> None:
    """Single precision has its recorded samples; headers are C++, too, and their names apart."""
    need("gcc", "g++")
    both = curved, _ = folder("curved"), folder("struct")
    for of in both:
        run("gcc", *C99, "-O0", "-c", of.path / of.source, folder=tmp_path)
    objects = [of.source.replace(".c", ".o") for of in both]
    for name, text in (("example", "main.c"), ("checker", "check.c")):
        run("gcc", *C99, curved.path / text, objects[0], "-o", name, "-lm", folder=tmp_path)
    require_right(run("./checker", folder=tmp_path), curved.exported)
    told = run("./example", folder=tmp_path).splitlines()
    (effort,) = curved.exported["inverse"].outputs
    assert [line.split(":")[0].removeprefix("effort ") for line in told] == list(effort.labels)
    (tmp_path / "both.cpp").write_text(
        "\n".join(f'#include "{of.exported.prefix}.h"' for of in both)
        + """
int main() {
    float q[6] = {0}, pose[6], rate[6], more[6];
    double p[6] = {0}, found[3][6];
    hexapod_numbers numbers = HEXAPOD_NUMBERS;
    hexapod_constants k;
    hexapod_prepare(&numbers, &k);
    return masticatory_curved_motion(q, q, q, pose, rate, more)
        + hexapod_motion(&k, p, p, p, found[0], found[1], found[2]);
}
"""
    )
    paths = [f"-I{of.path}" for of in both]
    flags = ("-std=c++11", "-Wall", "-Wextra", "-pedantic", "-Werror")
    run("g++", *flags, *paths, "both.cpp", *objects, "-o", "both", "-lm", folder=tmp_path)
    run("./both", folder=tmp_path)
