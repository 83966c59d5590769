"""Exported C under the strictest flags, sanitizers, for Arm, with a linter, as C++, and linked."""

from __future__ import annotations

import ctypes
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from export.conftest import Folder, written
from support.speeds import few
from support.tools import need, run

import condyle
from condyle.export.c_package import write_facts
from condyle.simulation.reference_path import path_of

Folders = Callable[[str], Folder]
STRICT = "-Werror -Wshadow -Wstrict-prototypes -Wmissing-prototypes -Wdouble-promotion"
SANITIZED = "-fsanitize=address,undefined -fno-sanitize-recover=all"
LOOP = "observer", "computed_torque", "forward", "joints"
CORTEX = "-mcpu=cortex-m7 -mfpu=fpv5-d16 -mfloat-abi=hard -isystem /usr/include/newlib"


def checked(of: Folder, flags: str, **variables: str) -> str:
    """`make check`, from scratch."""
    run("make", "-s", "clean", folder=of.path)
    given = [f"{name}={value}" for name, value in variables.items()]
    told = run("make", "-s", "check", f"CFLAGS={flags} {STRICT}", *given, folder=of.path)
    functions = [f.name for f in of.exported.functions]
    # GCC has something to note about the passing of vectors.
    lines = [line for line in told.splitlines() if "worst error" in line]
    assert [line.split(":")[0] for line in lines] == functions
    assert told.count(": ok") == len(functions)
    if of.exported.precision == "double":  # the folder's own bound leaves room for others' roots
        assert all(float(e) < 1e-13 for e in re.findall(r"worst error (\S+),", told))
    return told


@pytest.mark.parametrize(
    "name", few(["jaw", "single", "curved", "struct", "mixed", "limited"], "jaw", "limited")
)
def test_the_recorded_samples(folder: Folders, name: str) -> None:
    need("gcc", "make")
    checked(folder(name), "-O1", CC="gcc")


@pytest.mark.parametrize("name", few(["struct", "limited"], "limited"))
def test_clang_has_nothing_to_say(folder: Folders, name: str) -> None:
    need("clang", "make")
    checked(folder(name), "-O1", CC="clang")


@pytest.mark.parametrize("name", few(["jaw", "rubbing"], "rubbing"))
@pytest.mark.parametrize("compiler, flags", [("clang", "-O1"), ("gcc", f"-O1 {SANITIZED}")])
def test_vector_types(folder: Folders, name: str, compiler: str, flags: str) -> None:
    """Of any processor."""
    need(compiler, "make")
    defined = f"-D{folder(name).exported.prefix.upper()}_VECTOR"
    checked(folder(name), flags, CC=compiler, VECTOR="1", VECTOR_FLAGS=defined)


@pytest.mark.ci
@pytest.mark.parametrize("name", ["struct", "limited"])
def test_sanitizers(folder: Folders, name: str) -> None:
    need("gcc", "make")
    checked(folder(name), f"-O1 -g {SANITIZED}", CC="gcc")


@pytest.mark.ci
@pytest.mark.parametrize("name", ["jaw", "single", "struct"])
def test_a_bare_arm_calls_only_what_is_stated(folder: Folders, name: str) -> None:
    of = folder(name)
    need("arm-none-eabi-nm")
    strict = ["-Wall", "-Wextra", "-Wconversion", "-pedantic", *STRICT.split()]
    build = ["-std=c99", "-O2", *strict, *CORTEX.split(), "-c", of.source, "-o", "bare.o"]
    run("arm-none-eabi-gcc", *build, folder=of.path)
    told = run("arm-none-eabi-nm", "-u", "bare.o", folder=of.path)
    # Compilers put memcpy for loops that copy.
    assert set(told.replace("U", "").split()) <= {*of.exported.symbols, "memcpy"}
    own = run("arm-none-eabi-nm", "--defined-only", "bare.o", folder=of.path)
    kinds = {line.split()[1] for line in own.splitlines()}
    assert kinds <= {"T", "t", "r", "R", "a"}, "no variables"


@pytest.mark.ci
def test_64_bit_arm(folder: Folders) -> None:
    need("aarch64-linux-gnu-gcc", "qemu-aarch64", "make")
    arm = {"CC": "aarch64-linux-gnu-gcc", "RUN": "qemu-aarch64", "LDFLAGS": "-static"}
    checked(folder("jaw"), "-O1", **arm)


@pytest.mark.ci
def test_a_linter_is_content(folder: Folders) -> None:
    of = folder("jaw")
    checks = "-checks=clang-analyzer-*,bugprone-*,-bugprone-easily-swappable-parameters"
    checks += ",-bugprone-implicit-widening-of-multiplication-result"  # of sizes below a hundred
    call = ("clang-tidy", "--quiet", checks, "-warnings-as-errors=*")
    run(*call, of.source, "main.c", "check.c", "--", "-std=c99", folder=of.path)


@pytest.mark.parametrize("name", few(["jaw", "struct"], "jaw"))
def test_the_header_is_cpp(folder: Folders, name: str) -> None:
    of = folder(name)
    flags = ("-Wall", "-Wextra", "-pedantic", "-Werror", "-std=c++11", "-fsyntax-only")
    source = of.path / "as.cpp"
    source.write_text(f'#include "{of.exported.prefix}.h"\nint main() {{ return 0; }}\n')
    run("clang", "-x", "c++", *flags, source, folder=of.path)


@pytest.mark.ci
def test_two_mechanisms_in_one_program(folder: Folders, tmp_path: Path) -> None:
    jaw, hexapod = folder("jaw"), folder("struct")
    lines = [f'#include "{of.exported.prefix}.h"' for of in (jaw, hexapod)]
    lines += ["int main(void) {", "    double q[6] = {0}, pose[6], rate[6], more[6];"]
    lines += ["    hexapod_numbers numbers = HEXAPOD_NUMBERS;", "    hexapod_constants k;"]
    lines += ["    hexapod_prepare(&numbers, &k);"]
    lines += ["    return jaw_motion(q, q, q, pose, rate, more)"]
    lines += ["        + hexapod_motion(&k, q, q, q, pose, rate, more);", "}", ""]
    (tmp_path / "both.c").write_text("\n".join(lines))
    sources = [of.path / of.source for of in (jaw, hexapod)]
    paths = [f"-I{of.path}" for of in (jaw, hexapod)]
    flags = ("-std=c99", "-O0", "-Wall", "-Werror")
    run("gcc", *flags, *paths, "both.c", *sources, "-o", "both", "-lm", folder=tmp_path)
    run("./both", folder=tmp_path)


def test_the_example(folder: Folders) -> None:
    of = folder("jaw")
    run("make", "-s", "all", "CC=gcc", "CFLAGS=-O0 -Werror", folder=of.path)
    told = run("./example", folder=of.path).splitlines()
    (effort,) = of.exported["inverse"].outputs
    assert [line.split(":")[0].removeprefix("effort ") for line in told] == list(effort.labels)


@pytest.mark.ci
def test_facts_are_measured_wherever_the_folder_is(
    folder: Folders, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By a relative path too; a function's code holds that of those that it calls."""
    need("gcc", "nm")
    of = folder("jaw")
    monkeypatch.chdir(of.path.parent)
    rows = write_facts(of.exported, Path(of.path.name))[0]["functions"]
    assert all(row["error"] < 1e-12 and not row["wrong"] for row in rows.values())
    for what in ("code", "stack"):  # the same work but for the contact forces
        assert rows["jaw_inverse"][what] > rows["jaw_contact"][what] / 2 > 0
    assert rows["jaw_computed_torque"]["code"] > rows["jaw_inverse"]["code"]


def tick_of_the_page() -> str:
    """The controller that docs/how-to/controller.md shows, on the functions of `jaw`."""
    page = Path(__file__).parents[2] / "docs" / "how-to" / "controller.md"
    shown = page.read_text(encoding="utf-8").split("```c\n")[1].split("```")[0]
    return shown.replace("masticatory", "jaw").replace("MASTICATORY", "JAW")


def test_the_tick_of_the_page(folder: Folders, tmp_path: Path) -> None:
    (tmp_path / "tick.c").write_text(tick_of_the_page())
    paths = f"-I{folder('jaw').path}"
    run("gcc", "-std=c99", "-Wall", "-Werror", paths, "-fsyntax-only", "tick.c", folder=tmp_path)


@pytest.mark.slow
def test_the_tick_of_the_page_closes_the_loop(folder: Folders, tmp_path: Path) -> None:
    """With `forward` as the plant and `joints` as its encoders it is condyle's own simulation: the
    same path, gains, low-pass and rate, through efforts that limits cut."""
    need("gcc")
    T, steps, ticks = 1e-3, 4, 150
    of = written("weak", tmp_path / "jaw", prefix="jaw", questions=LOOP)
    t = np.linspace(0, 0.1, 101)
    s = t / 0.1
    rise = s**4 * (35 - 84 * s + 70 * s**2 - 20 * s**3)
    columns = {"X": 0.002 * rise, "Y": 0.001 * rise, "alpha": 0.01 * rise, "beta": 0.05 * rise}
    motion = condyle.Motion.from_arrays(t, columns)
    law = {"kind": "computed_torque", "stiffness": 900.0, "damping": 60.0, "rate": 1 / T}
    scenario = {
        "duration": ticks * T,
        "rate": 1 / T,
        "method": "rk4",
        "step": T / steps,
        "controller": law,
        "sensors": {"velocity_cutoff": np.log(2) / (2 * np.pi * T)},  # smoothing of a half
    }
    model = condyle.derive(of.exported.mechanism)
    own = condyle.simulate(model, scenario, motion=motion)
    assert any(event["kind"] == "saturated" for event in own.condyle.events)
    q, q1 = (
        own[name].sel(coordinate=own["independent"].values).values for name in ("pose", "pose_rate")
    )
    path = path_of(model, motion, None, None).at(T * np.arange(ticks))
    (tmp_path / "tick.c").write_text(tick_of_the_page())
    flags = ("-std=c99", "-O1", "-shared", "-fPIC", f"-I{of.path}")
    run("gcc", *flags, "tick.c", of.path / of.source, "-o", "loop.so", "-lm", folder=tmp_path)
    library = ctypes.CDLL(str(tmp_path / "loop.so"))

    def call(name: str, *arrays: np.ndarray) -> None:
        pointers = [np.ascontiguousarray(a).ctypes.data_as(ctypes.c_void_p) for a in arrays]
        assert getattr(library, name)(*pointers) == 0

    def rate(y: np.ndarray) -> np.ndarray:
        acceleration, contact = np.zeros(4), np.zeros(2)
        call("jaw_forward", y[:4], y[4:], effort, *np.zeros((3, 3)), acceleration, contact)
        return np.concatenate([y[4:], acceleration])

    y, effort, h = np.zeros(8), np.zeros(6), T / steps
    for k in range(ticks):
        joint, rates, pose, pose_rate = (np.zeros(6) for _ in range(4))
        call("jaw_joints", y[:4], y[4:], joint, rates, pose, pose_rate)
        assert np.abs(q[k] - y[:4]).max() < 1e-9
        assert np.abs(q1[k] - y[4:]).max() < 1e-9
        call("tick", joint, *np.split(path[k, :12], 3), effort)
        assert np.abs(own["effort"][k] - effort).max() < 1e-9
        for _ in range(steps):
            a = rate(y)
            b = rate(y + h / 2 * a)
            c = rate(y + h / 2 * b)
            d = rate(y + h * c)
            y = y + h / 6 * (a + 2 * b + 2 * c + d)
