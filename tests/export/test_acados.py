"""A step of the dynamics for acados, compiled against declared headers and called as it calls."""

from __future__ import annotations

import ctypes
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.tools import run

import condyle
from condyle.errors import InputError

pytestmark = pytest.mark.usefixtures("compiler_command")

HEADERS = Path(__file__).parents[1] / "support" / "acados"
M, N, STEP, OFF = 4, 6, 0.02, 3
X, V = 2 * M, N + 2 * M
STRICT = ("-std=c99", "-O2", "-Wall", "-Wextra", "-Werror", "-pedantic")
double = ctypes.c_double


class Vector(ctypes.Structure):
    _fields_ = (("pa", ctypes.POINTER(double)), ("m", ctypes.c_int))


class Matrix(ctypes.Structure):
    _fields_ = (("pA", ctypes.POINTER(double)), ("m", ctypes.c_int), ("n", ctypes.c_int))


class Vectors(ctypes.Structure):
    _fields_ = (("x", ctypes.POINTER(Vector)), ("xi", ctypes.c_int))


class Matrices(ctypes.Structure):
    _fields_ = (("A", ctypes.POINTER(Matrix)), ("ai", ctypes.c_int), ("aj", ctypes.c_int))


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    folder = tmp_path_factory.mktemp("acados")
    made = condyle.export_acados("masticatory", folder, step=STEP, prefix="jaw")
    names = {"jaw.h", "jaw.c", "jaw_acados.c", "jaw_acados.py"}
    assert {path.name for path in made} == names
    compile((folder / "jaw_acados.py").read_text(), "jaw_acados.py", "exec")
    flags = (*STRICT, "-shared", "-fPIC", f"-I{HEADERS}")
    run("gcc", *flags, "jaw_acados.c", "-o", "it.so", "-lm", folder=folder)
    return ctypes.CDLL(str(folder / "it.so"))


def pointer(a: np.ndarray) -> Any:
    return a.ctypes.data_as(ctypes.POINTER(double))


def called(library: ctypes.CDLL, x: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """x+ and its derivatives by u and x, (V, X), at places that are not the first."""
    given = [np.concatenate([np.full(OFF, np.nan), part]) for part in (x, u)]
    found, slopes = np.full(OFF + X, np.nan), np.full((OFF + X, OFF + V), np.nan)
    vectors = [Vector(pointer(a), len(a)) for a in (*given, found)]
    matrix = Matrix(pointer(slopes), OFF + V, OFF + X)
    args = [Vectors(ctypes.pointer(one), OFF) for one in vectors]
    more = Matrices(ctypes.pointer(matrix), OFF, OFF)
    into = (ctypes.c_void_p * 2)(*(ctypes.addressof(one) for one in args[:2]))
    out = (ctypes.c_void_p * 2)(ctypes.addressof(args[2]), ctypes.addressof(more))
    assert library.jaw_disc_dyn_fun_jac(into, out, None) == 0
    alone = found[OFF:].copy()
    found[:] = np.nan
    assert library.jaw_disc_dyn_fun(into, out, None) == 0
    np.testing.assert_allclose(found[OFF:], alone, rtol=1e-13)
    assert np.isnan(slopes[:OFF]).all() and np.isnan(slopes[:, :OFF]).all()
    return alone, slopes[OFF:, OFF:].T


def stepped(x: np.ndarray, u: np.ndarray) -> np.ndarray:
    """The same by the library's forward dynamics."""
    model = condyle.derive("masticatory", backend="numpy")

    def rate(x: np.ndarray) -> np.ndarray:
        found = model.forward_dynamics(x[..., :M], x[..., M:], u)
        return np.concatenate([x[..., M:], found.acceleration], axis=-1)

    a = rate(x)
    b = rate(x + STEP / 2 * a)
    c = rate(x + STEP / 2 * b)
    d = rate(x + STEP * c)
    return x + STEP / 6 * (a + 2 * b + 2 * c + d)


def test_a_step_and_its_derivatives(library: ctypes.CDLL) -> None:
    rng = np.random.default_rng(4)
    for _ in range(5):
        x = rng.uniform(-1, 1, X) * [1e-3, 1e-3, 0.02, 0.02, 0.02, 0.02, 0.4, 0.4]
        u = 0.02 * rng.normal(size=N)
        found, slopes = called(library, x, u)
        np.testing.assert_allclose(found, stepped(x, u), rtol=0, atol=1e-12)
        h, both = 1e-5, np.concatenate([u, x])
        ways = [both + k * h * np.eye(V) for k in (-2, -1, 1, 2)]
        ends = [np.array([stepped(w[N:], w[:N]) for w in way]) for way in ways]
        wanted = (ends[0] - 8 * ends[1] + 8 * ends[2] - ends[3]) / (12 * h)
        size = np.abs(wanted).max(axis=0)
        assert np.abs((slopes - wanted) / size).max() < 1e-7


def test_where_there_is_no_motion_there_are_no_numbers(library: ctypes.CDLL) -> None:
    found, _ = called(library, np.array([1.0, 0, 0, 0, 0, 0, 0, 0]), np.zeros(N))
    assert np.isnan(found).all()


@pytest.mark.parametrize("step", [0.0, -1.0, float("nan"), "fast", True])
def test_a_step_that_is_none(step: Any, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="step"):
        condyle.export_acados("masticatory", tmp_path, step=step)
    assert not any(tmp_path.iterdir())
