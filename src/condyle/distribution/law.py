"""What an effort answers to its price.

With multipliers u of the equations, the price of x_i is g_i = G_i . u, and the least of
f(x) - g x within bounds decides x: a law of one variable, the same for every effort.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np


class Law(ABC):
    """One term f of a separable objective; arrays of any shape."""

    def take(self, rows: np.ndarray) -> Law:
        """The law of some of the samples."""
        return self

    @abstractmethod
    def answer(self, g: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
        """x, the least of f(x) - g x in [low, high]."""

    @abstractmethod
    def compliance(self, x: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
        """dx / dg; 0 at a bound."""

    @abstractmethod
    def value(self, x: np.ndarray) -> np.ndarray:
        """f(x)."""

    @abstractmethod
    def slope(self, x: np.ndarray) -> np.ndarray:
        """f'(x)."""


@dataclass(frozen=True)
class Square(Law):
    """f = x^2 / 2."""

    def answer(self, g: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
        return np.minimum(np.maximum(g, low), high)

    def compliance(self, x: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
        return ((x > low) & (x < high)).astype(float)

    def value(self, x: np.ndarray) -> np.ndarray:
        return 0.5 * x * x

    def slope(self, x: np.ndarray) -> np.ndarray:
        return x


@dataclass(frozen=True)
class Cube(Law):
    """f = x^3 / 3 + soft x^2 / 2 on x >= 0; `soft` > 0 bounds the compliance at 0."""

    soft: np.ndarray | float = 0.0

    def take(self, rows: np.ndarray) -> Cube:
        return Cube(self.soft[rows]) if isinstance(self.soft, np.ndarray) else self

    def answer(self, g: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
        # The root of x^2 + soft x = g without cancellation.
        price = np.maximum(g, 0.0)
        half = 0.5 * self.soft
        below = half + np.sqrt(half * half + price)
        x = price / np.where(below > 0, below, 1.0)
        return np.minimum(np.maximum(x, low), high)

    def compliance(self, x: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
        inside = (x > low) & (x < high)
        return inside / np.where(inside, 2.0 * x + self.soft, 1.0)

    def value(self, x: np.ndarray) -> np.ndarray:
        return x * x * (x / 3.0 + 0.5 * self.soft)

    def slope(self, x: np.ndarray) -> np.ndarray:
        return x * (x + self.soft)
