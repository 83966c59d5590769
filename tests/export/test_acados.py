"""A step of the dynamics for acados, compiled against declared headers and called as it calls."""

from __future__ import annotations

import ctypes
from pathlib import Path

import numpy as np
from export.conftest import shared
from support.machines import model

import condyle

HEADERS = Path(__file__).parents[1] / "support" / "acados"
M, N, STEP, OFF = 4, 6, 0.02, 3
X, V = 2 * M, N + 2 * M
pointer, number = ctypes.c_void_p, ctypes.c_int


class Vector(ctypes.Structure):
    _fields_ = (("pa", pointer), ("m", number))


class Matrix(ctypes.Structure):
    _fields_ = (("pA", pointer), ("m", number), ("n", number))


class Arguments(ctypes.Structure):
    """Where a vector or a matrix begins in another."""

    _fields_ = (("of", pointer), ("i", number), ("j", number))


def called(library: ctypes.CDLL, x: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """x+ and its derivatives by u and x, (V, X), at places that are not the first."""
    given = [np.concatenate([np.full(OFF, np.nan), part]) for part in (x, u)]
    found, slopes = np.full(OFF + X, np.nan), np.full((OFF + X, OFF + V), np.nan)
    held = [Vector(a.ctypes.data, len(a)) for a in (*given, found)]
    held.append(Matrix(slopes.ctypes.data, OFF + V, OFF + X))
    args = [Arguments(ctypes.addressof(one), OFF, OFF) for one in held]
    into, out = (
        (pointer * 2)(*(ctypes.addressof(one) for one in part)) for part in (args[:2], args[2:])
    )
    assert library.jaw_disc_dyn_fun_jac(into, out, None) == 0
    alone = found[OFF:].copy()
    found[:] = np.nan
    assert library.jaw_disc_dyn_fun(into, out, None) == 0
    np.testing.assert_allclose(found[OFF:], alone, rtol=1e-13)
    assert np.isnan(slopes[:OFF]).all() and np.isnan(slopes[:, :OFF]).all()
    return alone, slopes[OFF:, OFF:].T


def stepped(both: np.ndarray) -> np.ndarray:
    """The same by the library's forward dynamics, for rows of u and x."""
    u, x = both[..., :N], both[..., N:]

    def rate(x: np.ndarray) -> np.ndarray:
        found = model("masticatory").forward_dynamics(x[..., :M], x[..., M:], u)
        return np.concatenate([x[..., M:], found.acceleration], axis=-1)

    a = rate(x)
    b = rate(x + STEP / 2 * a)
    c = rate(x + STEP / 2 * b)
    return x + STEP / 6 * (a + 2 * b + 2 * c + rate(x + STEP * c))


def test_a_step_and_its_derivatives(tmp_path: Path) -> None:
    """And where there is no motion there are no numbers."""
    made = condyle.export_acados("masticatory", tmp_path, step=STEP, prefix="jaw")
    assert {path.name for path in made} == {"jaw.h", "jaw.c", "jaw_acados.c", "jaw_acados.py"}
    compile((tmp_path / "jaw_acados.py").read_text(), "jaw_acados.py", "exec")
    library = shared(tmp_path, "jaw_acados.c", f"-I{HEADERS}", "-Wno-missing-prototypes")
    rng, h = np.random.default_rng(4), 1e-5
    for _ in range(3):
        x = rng.uniform(-1, 1, X) * [1e-3, 1e-3, 0.02, 0.02, 0.02, 0.02, 0.4, 0.4]
        both = np.concatenate([0.02 * rng.normal(size=N), x])
        found, slopes = called(library, x, both[:N])
        np.testing.assert_allclose(found, stepped(both), rtol=0, atol=1e-12)
        ends = [stepped(both + k * h * np.eye(V)) for k in (-2, -1, 1, 2)]
        wanted = (ends[0] - 8 * ends[1] + 8 * ends[2] - ends[3]) / (12 * h)
        assert np.abs((slopes - wanted) / np.abs(wanted).max(axis=0)).max() < 1e-7
    far, _ = called(library, np.eye(X)[0], np.zeros(N))
    assert np.isnan(far).all()
