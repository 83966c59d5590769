"""Efforts within limits by compiled code, where at most two efforts are free: `limits.c`."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from ...progress import step
from .. import cache
from ..compiler import find_compiler
from ..kernel import AGAIN
from .shared_library import obtained, tool

FREE = 2  # efforts more than equations, at most
MOST_CONTACTS = 5


@dataclass(frozen=True)
class Limited:
    """Answers at N samples.

    effort, force: (n, N) and (k, N);  shortfall: (N,).
    certificate: residual of the equations and slack of the multipliers, (2, N).
    infeasible, unsure: (N,); what is unsure has no numbers.
    """

    effort: np.ndarray
    force: np.ndarray
    shortfall: np.ndarray
    certificate: np.ndarray
    infeasible: np.ndarray
    unsure: np.ndarray


class WithinLimits:
    """The solver of all machines with n efforts and k contacts."""

    def __init__(self, n: int, k: int) -> None:
        """Raises CompilerError where it cannot be built."""
        self._n, self._k = n, k
        self._library = _library(n, k)

    @staticmethod
    def fits(n: int, k: int) -> bool:
        """Whether so few efforts are free that it can be asked."""
        return k <= MOST_CONTACTS and 0 <= n - (6 - k) <= FREE

    def solve(
        self,
        Q: np.ndarray,
        J: np.ndarray,
        normal: np.ndarray,
        friction: np.ndarray,
        rubs: Sequence[bool],
        limits: Sequence[np.ndarray],
        weight: float,
    ) -> Limited:
        """The least sum of squares of all patterns of friction, for every sample.

        Args: Q: (6, N);  J: (6, n, N);  normal, friction: (k, 6, N), as of the question `balance`.
              rubs: contacts with friction, (k,).
              limits: low, high and scale of the efforts, (n,) each; low and high of the contact
              forces, (k,) each.
              weight: W of half the sum of squares of contact forces.
        """
        n, k, count = self._n, self._k, Q.shape[-1]
        rows = [
            _rows(a, width, count)
            for a, width in ((Q, 6), (J, 6 * n), (normal, 6 * k), (friction, 6 * k))
        ]
        starts = (ctypes.c_void_p * 4)(*(a.ctypes.data for a in rows))
        steps = (ctypes.c_ssize_t * 4)(*(a.strides[0] // 8 for a in rows))
        low, high, scale, contact_low, contact_high = limits
        own = np.concatenate([low, high, scale, contact_low, [0], contact_high, [0, weight]])
        rubbing = np.array([*rubs, False], dtype=np.intc)
        effort, force = np.empty((n, count)), np.empty((k, count))
        shortfall, certificate = np.empty(count), np.empty((2, count))
        status = np.empty(count, dtype=np.uint8)
        results = (effort, force, shortfall, certificate, status)
        self._library.within_limits_batch(
            count,
            ctypes.addressof(starts),
            ctypes.addressof(steps),
            rubbing.ctypes.data,
            own.ctypes.data,
            *(a.ctypes.data for a in results),
        )
        unsure = status == AGAIN
        return Limited(effort, force, shortfall, certificate, (status != 0) & ~unsure, unsure)


def _rows(a: np.ndarray, width: int, count: int) -> np.ndarray:
    """Rows of samples, each without gaps."""
    rows = a.reshape(width, count)
    fits = rows.dtype == np.float64 and rows.flags.aligned and rows.strides[1] == 8
    return rows if fits and not rows.strides[0] % 8 else np.ascontiguousarray(rows, dtype=float)


@lru_cache(maxsize=16)
def _library(n: int, k: int) -> Any:
    compiler = find_compiler()
    source = (files(__package__) / "limits.c").read_text(encoding="utf-8")
    text = f"#define EFFORTS {n}\n#define CONTACTS {k}\n{source}"

    def make(folder: Path) -> tuple[Path, dict[str, Any]]:
        with step("building a solver"):
            (folder / "limits.c").write_text(text, encoding="utf-8")
            compiler.build(folder / "limits.so", folder / "limits.c")
        return folder / "limits.so", {"efforts": n, "contacts": k}

    return obtained(cache.digest(text, tool(compiler)), make, _opened)[1]


def _opened(path: str) -> ctypes.CDLL:
    library = ctypes.CDLL(path)
    library.within_limits_batch.argtypes = [ctypes.c_size_t, *[ctypes.c_void_p] * 9]
    library.within_limits_batch.restype = None
    return library
