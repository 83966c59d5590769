"""Kernels for other systems: cross-compiled, and run by an emulator, have numpy's values."""

from __future__ import annotations

import os
import re
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest
from support.cases import case, error
from support.tools import need, run

from condyle.backends import compiler
from condyle.backends.c.emit import emit
from condyle.backends.c.shared_library import padded
from condyle.backends.kernel import arrays_of, places_of, results_at, shapes_of
from condyle.backends.numpy_kernel import NumpyKernel
from condyle.model.model import Model
from condyle.questions import Question
from condyle.questions.structure import structure_of

pytestmark = pytest.mark.ci
PORTABLE = [flag for flag in compiler.FLAGS if flag not in ("-fPIC", "-shared")]
LOADED = """
#include <windows.h>
static prepare_t *prepare;
static batch_t *batch;
static int loaded(void)
{
    HMODULE it = LoadLibraryA("kernel.so");
    if (it == NULL) return 0;
    prepare = (prepare_t *)GetProcAddress(it, "prepare");
    batch = (batch_t *)GetProcAddress(it, "batch");
    return prepare != NULL && batch != NULL;
}
"""
LINKED = """
extern prepare_t prepare;
extern batch_t batch;
static int loaded(void) { return 1; }
"""
# What prints the status of each sample and all results.
MAIN = """
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
typedef void prepare_t(const double *, const double *const *, double *);
typedef void batch_t(const double *, const double *const *, const ptrdiff_t *, size_t, double *,
                     size_t, uint8_t *);
%(loaded)s
static _Alignas(64) const double %(arrays)s;
static _Alignas(64) double table[%(table)d], out[%(results)d];
int main(void)
{
    const double *lane[] = {%(lanes)s}, *in[] = {%(columns)s};
    const ptrdiff_t step[] = {%(steps)s};
    uint8_t status[%(count)d];
    if (!loaded()) return 1;
    prepare(par, lane, table);
    batch(table, in, step, %(count)d, out, %(count)d, status);
    for (int i = 0; i < %(count)d; i++) printf("%%d\\n", status[i]);
    for (int i = 0; i < %(results)d; i++) printf("%%.17g\\n", out[i]);
    return 0;
}
"""


def program(
    model: Model, ports: dict[str, np.ndarray], windows: bool
) -> tuple[dict[str, str], NumpyKernel, int]:
    """Files of a kernel and of a program that runs it, the same by numpy, and how many results."""
    structure = structure_of(model.mechanism, model.formulation, model.route)
    variants, own = Question.about(structure, "inverse").variants(), model.system.numbers
    source, right = emit(variants, 2), NumpyKernel(variants, own)
    face = source.interface
    count, given = arrays_of(shapes_of(face), ports)
    columns: list[np.ndarray] = []
    for port, a in zip(face.ports, given, strict=True):
        a = np.broadcast_to(a, (count, *a.shape[1:]))
        if port.lanes:
            a = a.reshape(count, port.size, face.lanes)[..., list(right.order)]
        columns += list(a.reshape(count, -1).T)
    width = sum(face.width(r) for r in face.results)
    blocks = [padded(a[0], b[0], 2) for a, b in zip(own.lanes, own.padding, strict=True)]
    arrays = {"par": own.parameters[0]}
    arrays |= {f"block_{i}": block for i, block in enumerate(blocks)}
    arrays |= {f"in_{i}": column for i, column in enumerate(columns)}
    texts = {name: ", ".join(float(x).hex() for x in np.ravel(a)) for name, a in arrays.items()}
    main = MAIN % {
        "loaded": LOADED if windows else LINKED,
        "arrays": ",\n    ".join(f"{name}[] = {{{text or 0}}}" for name, text in texts.items()),
        "table": source.table_size,
        "results": width * count,
        "lanes": ", ".join(f"block_{i}" for i in range(len(blocks))),
        "columns": ", ".join(f"in_{i}" for i in range(len(columns))),
        "steps": ", ".join("1" for _ in columns),
        "count": count,
    }
    files = {"batch.c": source.batch, "single.c": source.single or "", "main.c": main}
    return files, right, width


SYSTEMS = {
    "64-bit Arm": ("aarch64-linux-gnu-gcc", ("qemu-aarch64",), ("-static",)),
    "Windows": ("x86_64-w64-mingw32-gcc", ("wine",), ()),
}


@pytest.mark.parametrize("system", SYSTEMS)
@pytest.mark.parametrize("name", ["masticatory", "gough-stewart"])
def test_kernels_have_numpys_values(
    system: str, name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    gcc, emulator, link = SYSTEMS[system]
    windows = system == "Windows"
    if windows and shutil.which("wine") is None:
        pytest.skip("needs wine")
    need(gcc, *emulator)
    model = Model(case(name).mechanism, backend="numpy")
    q, q1, q2, wrench, point = case(name).arguments[:5]
    ports = {
        "q": q[:24], "q1": q1[:24], "q2": q2[:24], "force": np.atleast_2d(wrench)[:24, :3],
        "moment": np.atleast_2d(wrench)[:24, 3:], "point": np.atleast_2d(point),
    }  # fmt: skip
    files, right, width = program(model, ports, windows)
    for file, text in files.items():
        (tmp_path / file).write_text(text)
    flags = [*PORTABLE, *(compiler.NO_AVX if windows else ())]
    if windows:
        run(gcc, *flags, "-shared", "batch.c", "single.c", "-o", "kernel.so", folder=tmp_path)
        run(gcc, "main.c", "-o", "main.exe", folder=tmp_path)
        monkeypatch.setenv("WINEDEBUG", "-all")
        monkeypatch.setenv("WINEPREFIX", os.environ.get("WINEPREFIX", str(tmp_path / "wine")))
        said = run(*emulator, "main.exe", folder=tmp_path)
    else:
        run(gcc, *flags, *link, *files, "-o", "main", "-lm", folder=tmp_path)
        said = run(*emulator, "./main", folder=tmp_path)
    lines = re.findall(r"^-?(?:\d[\d.e+-]*|nan|inf)\r?$", said, re.MULTILINE)
    count = len(ports["q"])
    status = np.array(lines[:count], dtype=int)
    found = np.array(lines[count:], dtype=float).reshape(width, count)
    wanted = right.run(ports)
    values = results_at(places_of(right.interface, right.order), found, count)
    assert not status.any() and not wanted.status.any()
    assert error(values["effort"].T, wanted.values["effort"].T) < 1e-12


# What a library of a target begins with.
BEGINS = {
    "x86_64-windows-gnu": b"MZ",
    "aarch64-macos": b"\xcf\xfa\xed\xfe",
    "x86_64-macos": b"\xcf\xfa\xed\xfe",
    "aarch64-linux-gnu": b"\x7fELF",
    "riscv64-linux-gnu": b"\x7fELF",
}
SECONDS = 1500  # zig makes a target's C library first, into a cache of the person's


@pytest.mark.parametrize("target", BEGINS)
def test_zig_links_for(target: str, tmp_path: Path) -> None:
    """A library as `Compiler.build` makes one, whose functions can be found by name."""
    pytest.importorskip("ziglang")
    model = Model(case("masticatory").mechanism, backend="numpy")
    structure = structure_of(model.mechanism, model.formulation, model.route)
    source = emit(Question.about(structure, "inverse").variants(), 2)
    for part, text in (("batch", source.batch), ("single", source.single or "")):
        (tmp_path / f"{part}.c").write_text(text)
    windows = "windows" in target
    flags = [flag for flag in compiler.FLAGS if not (windows and flag == "-fPIC")]
    zig = (sys.executable, "-m", "ziglang", "cc", "-target", target)
    own = ("batch.c", "single.c", "-o", "kernel.so", *(() if windows else ("-lm",)))
    run(*zig, *flags, *own, folder=tmp_path, seconds=SECONDS)
    library = (tmp_path / "kernel.so").read_bytes()
    assert library.startswith(BEGINS[target])
    for name in (b"prepare", b"batch_some", b"one"):
        assert re.search(rb"\0_?" + name + rb"\0", library), f"{name!r} is not exported"
