"""A step of the dynamics for acados, called as it calls, and by acados where it is installed."""

from __future__ import annotations

import ctypes
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
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
    assert {path.name for path in made} == {"jaw_acados.c", "jaw_acados.py"}  # acados copies one
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


SOLVE = """
import jaw_acados, numpy, os
own = jaw_acados.solver(jaw_acados.problem(steps=50))
for k in range(51):
    own.set(k, "p", numpy.array([0, 0, 0, 0.1, 0, 0, 0, 0]))
status = own.solve()
found = {name: numpy.array([own.get(k, name) for k in range(50 + (name == "x"))]) for name in "xu"}
numpy.savez(os.environ["INTO"], status=status, residuals=own.get_residuals(), **found)
"""


@pytest.mark.slow
def test_acados_solves_the_example(tmp_path: Path) -> None:
    """In a folder that is not the current one: its optimum moves as the library, within limits.

    CONDYLE_ACADOS: a Python that has `acados_template` and its library, if this one has not.
    """
    python = os.environ.get("CONDYLE_ACADOS", sys.executable)
    if subprocess.run([python, "-c", "import acados_template"], capture_output=True).returncode:
        pytest.skip("needs acados_template and its library; CONDYLE_ACADOS names a Python with it")
    weak = condyle.load_mechanism("masticatory")
    weak = weak.set({f"chain.{c}.actuator.torque_limit": 0.012 for c in weak.chain_names})
    (folder := tmp_path / "for acados").mkdir()
    condyle.export_acados(weak, folder, step=STEP, prefix="jaw")
    env = os.environ | {"PYTHONPATH": str(folder), "INTO": str(tmp_path / "found.npz")}
    done = subprocess.run([python, "-c", SOLVE], cwd=tmp_path, env=env, capture_output=True)
    assert done.returncode == 0, (done.stdout + done.stderr).decode()[-3000:]
    with np.load(tmp_path / "found.npz") as found:
        x, u = found["x"], found["u"]
        assert found["status"] == 0 and found["residuals"].max() < 1e-5
    np.testing.assert_allclose(x[1:], stepped(np.hstack([u, x[:-1]])), rtol=0, atol=1e-6)
    assert 0.0119 < np.abs(u).max() < 0.012 + 1e-6 and not x[0].any()
    assert abs(x[-1, 3] - 0.1) < 0.01 and np.abs(x[-1]).argmax() == 3
