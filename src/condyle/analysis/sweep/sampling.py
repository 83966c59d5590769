"""The design of a study: any row can be computed without the rows before it.

So each worker computes its own rows, and they do not depend on the scheduler.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.special import ndtri

from ...errors import InputError
from .study import Sampling, Vary

MOST_LATIN = 10_000_000  # rows that are held at once, since each column is one permutation
MOST_ROWS = 2**30  # of Sobol's sequence
_EDGE = 2.0**-53  # from 0 and 1, where a normal distribution has no end


@dataclass(frozen=True)
class Design:
    """Rows of values for `vary`.

    base: the file's own number of each, which `scale` multiplies.
    """

    vary: tuple[Vary, ...]
    sampling: Sampling
    base: tuple[float, ...]

    @property
    def count(self) -> int:
        """Rows."""
        kind, count = self.sampling.kind, self.sampling.count or 0
        if kind == "grid":
            return math.prod(self._levels)
        return count * (len(self.vary) + 2) if kind == "saltelli" else count

    @property
    def _levels(self) -> tuple[int, ...]:
        return tuple(len(v.values) if v.values else v.count or 1 for v in self.vary)

    def check(self) -> None:
        """Raises InputError for more rows than the kind has."""
        kind = self.sampling.kind
        most = MOST_LATIN if kind == "latin" else MOST_ROWS if kind in ("sobol", "saltelli") else 0
        if most and (self.sampling.count or 0) > most:
            raise InputError(
                f"sampling.count: {kind} has a maximum of {most} rows, got {self.sampling.count}; "
                "choose random"
            )

    def rows(self, start: int, stop: int) -> np.ndarray:
        """Values of rows `start` to `stop`, (stop - start, len(vary)) [SI]."""
        if self.sampling.kind == "grid":
            places = np.unravel_index(np.arange(start, stop), self._levels)
            parts = zip(self.vary, self._levels, places, self.base, strict=True)
            columns = [_at(v, (k + 0.5) / n, base, (n, k)) for v, n, k, base in parts]
        else:
            unit = self._unit(start, stop)
            columns = [
                _at(v, u, base) for v, u, base in zip(self.vary, unit.T, self.base, strict=True)
            ]
        return np.column_stack(columns)

    def _unit(self, start: int, stop: int) -> np.ndarray:
        """The rows in the unit cube."""
        d, kind, seed = len(self.vary), self.sampling.kind, self.sampling.seed
        if kind == "random":
            source = np.random.PCG64(seed)
            source.advance(start * d)  # one draw a number
            return np.random.Generator(source).random((stop - start, d))
        if kind == "latin":
            return _latin(d, self.sampling.count or 0, seed)[start:stop]
        if kind == "sobol":
            return _sobol(d, seed, start, stop)
        # Saltelli's: of each base row A, then A with one column of B after the other, then B.
        first, last = start // (d + 2), -(-stop // (d + 2))
        both = _sobol(2 * d, seed, first, last)
        A, B = both[:, :d], both[:, d:]
        blocks = np.repeat(A[:, None], d + 2, axis=1)
        for i in range(d):
            blocks[:, i + 1, i] = B[:, i]
        blocks[:, -1] = B
        skipped = first * (d + 2)
        return blocks.reshape(-1, d)[start - skipped : stop - skipped]


def _sobol(d: int, seed: int, start: int, stop: int) -> np.ndarray:
    from scipy.stats import qmc  # which takes half a second, where it is needed

    sequence = qmc.Sobol(d, scramble=True, seed=np.random.default_rng(seed))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # that a count is no power of two
        if start:
            sequence.fast_forward(start)
        return sequence.random(stop - start)


@lru_cache(maxsize=1)
def _latin(d: int, count: int, seed: int) -> np.ndarray:
    from scipy.stats import qmc

    return qmc.LatinHypercube(d, seed=np.random.default_rng(seed)).random(count)


def _at(
    vary: Vary, unit: np.ndarray, base: float, grid: tuple[int, np.ndarray] | None = None
) -> np.ndarray:
    """Values at places in [0, 1) of a distribution; or on a grid, ends included."""
    if vary.values is not None:
        return np.array(vary.values)[(unit * len(vary.values)).astype(int)]
    if vary.normal is not None:
        mean, deviation = vary.normal
        return mean + deviation * ndtri(np.clip(unit, _EDGE, 1 - _EDGE))
    scaled = sorted(factor * base for factor in vary.scale or ())
    low, high = scaled or vary.range or (base, base)
    return low + (high - low) * unit if grid is None else np.linspace(low, high, grid[0])[grid[1]]
