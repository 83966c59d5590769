"""A second of motion: ours, and that of simulators that close the loops by constraints.

The bundled mechanism swings on springs and dampers on X, Y, alpha and beta, without efforts. What
is right is an integration of ours to ten digits; its equations are tested elsewhere against those
of other engines.
"""

from __future__ import annotations

import ctypes
import tomllib
from collections.abc import Iterator
from dataclasses import replace
from statistics import median
from types import ModuleType

import numpy as np

from condyle.backends.c.compiled_kernel import CompiledKernel
from condyle.mechanism import bundled_text, load_mechanism
from condyle.model.model import Model

from .own import Timer
from .rows import Row

SECOND = "a second of motion"
STIFFNESS = np.array([2e4, 2e4, 30.0, 30.0])  # N/m, N m
DAMPING = np.array([5.0, 5.0, 0.01, 0.01])  # N s/m, N m s
START = np.array([0.0, 0.0, 0.0, 0.02])  # X, Y [m], alpha, beta [rad]
STEPS = {"ours": (2e-3, 1e-3), "mujoco": (1e-3, 2e-4, 5e-5), "pinocchio": (1e-3, 2e-4)}
RIGHT = 2e-5  # s, the step at which ours is taken for right
REPEATS = 3


def motion_rows(name: str, peers: ModuleType | None, unavailable: dict[str, str]) -> Iterator[Row]:
    """Seconds a second of motion, by step; the error is that of q in the end [m, rad].

    Args: name: a mechanism of X, Y, alpha, beta;  peers: `benchmarks.peers.closed_loops`.
          unavailable: engines that do not run, and why; filled here.
    """
    model, timer = Model(load_mechanism(name), backend="compiled"), Timer()
    kernel = model.kernel("forward", ())
    assert isinstance(kernel, CompiledKernel)
    right, _ = _ours(kernel, timer, RIGHT)
    for step in STEPS["ours"]:
        found = [_ours(kernel, timer, step) for _ in range(20)]
        yield _row(f"{name}: {SECOND}, RK4", step, found, right)
    if peers is None:
        return
    task = peers.Task(tomllib.loads(bundled_text(name)), STIFFNESS, DAMPING, START)
    for engine, simulate in peers.SIMULATORS.items():
        try:
            for step in STEPS[engine]:
                runs = [simulate(task, step) for _ in range(REPEATS)]
                row = _row(
                    f"peer {engine}: {SECOND}, loops closed by constraints",
                    step,
                    [(run.q, run.seconds) for run in runs],
                    right,
                )
                yield replace(row, note=f"loops open by {runs[0].gap:.0e} m")
        except (ImportError, AttributeError, TypeError) as problem:  # or of another version
            unavailable[f"{engine}, {SECOND}"] = str(problem).partition("\n")[0]


def _ours(kernel: CompiledKernel, timer: Timer, step: float) -> tuple[np.ndarray, float]:
    """q after a second, (4,), and the seconds that took."""
    one, _, table = (ctypes.c_void_p(address) for address in kernel.address)
    lanes = kernel.facts["lanes"]
    given, found = np.zeros(kernel.interface.columns + lanes), np.zeros(32)
    x = np.concatenate([START, np.zeros(4)])
    stiffness, damping = STIFFNESS.copy(), DAMPING.copy()
    arrays = [ctypes.c_void_p(a.ctypes.data) for a in (given, found, x, stiffness, damping)]
    seconds = timer.library.time_springs(
        one,
        table,
        arrays[0],
        ctypes.c_int(kernel.interface.lanes),
        *arrays[1:],
        ctypes.c_double(step),
        ctypes.c_long(round(1 / step)),
    )
    return x[:4], seconds


def _row(name: str, step: float, runs: list[tuple[np.ndarray, float]], right: np.ndarray) -> Row:
    seconds = [seconds for _, seconds in runs]
    off = float(np.abs(runs[0][0] - right).max())
    spread = max(seconds) - min(seconds)
    return Row(f"{name}, {1e3 * step:g} ms", median(seconds), spread, off, None)
