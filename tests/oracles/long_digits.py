"""The text of `digits` for many states at once, in numbers of 64 bits (`numpy.longdouble`).

A number is an array, one entry a state; what decides between states, pivots and pieces of
profiles, is written for arrays here. `digits` itself checks it, state by state.
"""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

_spec = importlib.util.spec_from_file_location(
    "oracles.digits_of_arrays", Path(__file__).with_name("digits.py")
)
assert _spec is not None and _spec.loader is not None
_text: Any = importlib.util.module_from_spec(_spec)
sys.modules[_spec.name] = _text  # its dataclass looks there
_spec.loader.exec_module(_text)
Number = np.longdouble
PRECISE = np.finfo(Number).eps < 2e-19  # of 64 bits or more, on this machine
Jet, jet = _text.Jet, _text.jet


def solved(A: list[list[Any]], b: list[Any]) -> list[Any]:
    """A^-1 b; of jets by A x' = b' - A' x, A x'' = b'' - 2 A' x' - A'' x."""
    n = len(b)
    cells = [*(e for row in A for e in row), *b]
    moving = any(isinstance(e, Jet) for e in cells)

    def part(name: str) -> tuple[Any, Any]:
        values = np.broadcast_arrays(*(Number(getattr(jet(e), name)) for e in cells), np.zeros(1))
        whole = np.array(values[:-1])
        return whole[: n * n].reshape(n, n, -1), whole[n * n :]

    A0, b0 = part("x")
    x = _eliminated(A0, b0)
    if not moving:
        return list(x)
    (A1, b1), (A2, b2) = part("v"), part("a")
    v = _eliminated(A0, b1 - _times(A1, x))
    a = _eliminated(A0, b2 - 2 * _times(A1, v) - _times(A2, x))
    return [Jet(*e) for e in zip(x, v, a, strict=True)]


def _times(A: Any, x: Any) -> Any:
    return (A * x[None]).sum(axis=1)


def _eliminated(A: Any, b: Any) -> Any:
    shape = np.broadcast_shapes(A.shape[2:], b.shape[1:])
    n, all_ = len(b), np.arange(shape[0])
    M = np.empty((n, n + 1, *shape), Number)
    M[:, :n], M[:, n] = A, b
    # Pivots are compared where rows and columns, of any unit, are of one size; powers of 2 are
    # exact.
    M = M / _size(M[:, :n], 1)[:, None]
    columns = _size(M[:, :n], 0)
    M[:, :n] /= columns
    for k in range(n):
        best = k + np.argmax(np.abs(M[k:, k]), axis=0)
        top = M[best, :, all_].T
        M[best, :, all_] = M[k].T
        M[k] = top
        M[k + 1 :] -= (M[k + 1 :, k] / M[k, k])[:, None] * M[k]
    x = np.empty((n, *shape), Number)
    for k in reversed(range(n)):
        x[k] = (M[k, n] - (M[k, k + 1 : n] * x[k + 1 :]).sum(axis=0)) / M[k, k]
    return x / columns


def _size(A: Any, axis: int) -> Any:
    """The power of 2 next to the largest entries along an axis; 1 where all are 0."""
    most = np.abs(A).max(axis=axis)
    return np.exp2(np.floor(np.log2(np.where(most > 0, most, Number(1)))))


def largest(values: Any) -> Any:
    return max(np.abs(x).max() for x in values)


def _profile(table: dict[str, Any], scale: Any) -> Any:
    """As that of `digits`, each state in its own piece."""
    direction = _text.unit([Number(v) for v in table["direction"]][:2])
    x, z = (np.array([Number(p[k]) * scale for p in table["points"]]) for k in (0, 1))
    n = len(x)
    A = [[Number(i == j) for j in range(n)] for i in range(n)]
    b = [Number(0)] * n
    for i in range(1, n - 1):
        h, k = x[i] - x[i - 1], x[i + 1] - x[i]
        A[i][i - 1 : i + 2] = [h / 6, (h + k) / 3, k / 6]
        b[i] = (z[i + 1] - z[i]) / k - (z[i] - z[i - 1]) / h
    bend = np.concatenate(solved(A, b))

    def graph(p: list[Any]) -> tuple[Any, list[Any], list[list[Any]]]:
        s = direction[0] * p[0] + direction[1] * p[1]
        at = jet(s).x
        i = np.clip(np.searchsorted(x[1:], at), 0, n - 2)
        held = np.clip(at, x[0], x[-1])
        inside: Any = held
        if isinstance(s, Jet):
            inside = Jet(held, np.where(held == at, s.v, 0), np.where(held == at, s.a, 0))
        h, u, w = x[i + 1] - x[i], inside - x[i], x[i + 1] - inside
        P, Q, low = bend[i], bend[i + 1], z[i]
        rise = (z[i + 1] - low) / h - (Q - P) * h / 6
        height = P * w * w * w / (6 * h) + Q * u * u * u / (6 * h) + (low - P * h * h / 6)
        slope = Q * u * u / (2 * h) - P * w * w / (2 * h) + rise
        height = height + rise * u + slope * (s - inside)
        curve = (P * w + Q * u) / h * Number(held == at)
        a, b = direction
        flat = [-a * slope, -b * slope, Number(1)]
        H = [[-a * a * curve, -a * b * curve, 0], [-a * b * curve, -b * b * curve, 0], [0, 0, 0]]
        return p[2] - height, flat, H

    return graph


_text.mp = SimpleNamespace(
    sqrt=np.sqrt, sin=np.sin, cos=np.cos, sign=np.sign, atan2=np.arctan2,
    radians=lambda x: np.deg2rad(Number(x)),
)  # fmt: skip
_text.mpf, _text.TINY = Number, Number(1e-13)  # Newton's next step is below rounding
_text.solved, _text.largest, _text._profile = solved, largest, _profile
Machine = _text.Machine
