"""How the page shows a quantity: millimetres and degrees for people, SI for the rest."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

DIGITS = 4  # significant, of the largest value shown


@dataclass(frozen=True)
class Shown:
    """scale: from SI to `unit`."""

    unit: str
    scale: float = 1.0

    def decimals(self, values: np.ndarray) -> int:
        """Decimal places that give the largest of `values` (in SI) four digits."""
        finite = np.abs(values[np.isfinite(values)])
        largest = float(finite.max(initial=0.0)) * self.scale
        if largest == 0.0:
            return DIGITS - 1
        return min(max(DIGITS - 1 - math.floor(math.log10(largest)), 0), 9)


_PEOPLE = {"m": Shown("mm", 1e3), "rad": Shown("°", 180 / math.pi), "1": Shown("")}


def shown(unit: str) -> Shown:
    """How a value in the SI unit `unit` is shown."""
    return _PEOPLE.get(unit, Shown(unit))
