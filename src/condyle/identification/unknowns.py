"""The unknown numbers of a fit: where they stand in the file, and what they may be."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..errors import InputError
from ..model.arguments import NOTHING
from ..model.regressor import StandardNumbers
from ..questions.number_paths import NumberPath, entry_names
from .fit_study import FitStudy

# What identification knows; all else of a file is no number that efforts are linear in.
FREE = ("mass", "com", "inertia", "transverse", "axial", "viscous", "coulomb", "rotor_inertia")
ROUGH = "friction.coefficient"  # of a contact; drag is linear in it where contact forces are known


@dataclass(frozen=True)
class Unknown:
    """One unknown: its name, unit, and the numbers of the file that it is, by their place."""

    name: str
    unit: str
    path: str
    places: tuple[int, ...]


class Unknowns:
    """Unknown numbers x, (U,), their prior, and what they make of the standard numbers."""

    prior: np.ndarray
    spread: np.ndarray

    def __init__(
        self, standard: StandardNumbers, study: FitStudy, rough: Mapping[str, float] = NOTHING
    ) -> None:
        """Args:   rough: coefficients of friction at contacts, by path, that are 1 in `standard`.

        Raises: InputError: for unknown paths, and numbers that no log can tell.
        """
        self.standard: StandardNumbers = standard
        self._rough = rough
        unknowns: list[Unknown] = []
        for path, number in zip(study.numbers, standard.at(list(study.numbers)), strict=True):
            unknowns += self._of(path, number, path in study.shared)
        self.all: tuple[Unknown, ...] = tuple(unknowns)
        first = [number.places[0] for number in unknowns]
        self.nominal: np.ndarray = np.array(
            [rough.get(self._name(p), standard.home[p]) for p in first]
        )
        self.prior, self.spread = study.priors(self.nominal, [number.path for number in unknowns])
        self._spread_out = np.zeros((standard.home.size, len(unknowns)))
        for i, unknown in enumerate(unknowns):
            self._spread_out[list(unknown.places), i] = 1.0

    def _name(self, place: int) -> str:
        return self.standard.file_names[place]

    def _of(self, path: str, number: NumberPath, shared: bool) -> list[Unknown]:
        last = path.rpartition(".")[2].partition("[")[0]
        places = self.standard.places(number)
        known = last in FREE or path.startswith("platform.inertia")
        if path.startswith(("contact.", "gravity")):
            known = all(self._name(place) in self._rough for place in places)
        if not known:
            raise InputError(
                f"numbers: efforts are not linear in {path}; expected masses, mass "
                "centres, inertias, viscous or Coulomb friction and rotors of chains, or, of "
                f"condyle identify, {ROUGH} of contacts. Lengths and points are for condyle "
                "calibrate"
            )
        if shared:
            rows = np.reshape(places, (number.shape[0], -1)).T
            names = entry_names(path, number.shape[1:])
            return [
                Unknown(name, number.unit, path, tuple(row))
                for name, row in zip(names, rows, strict=True)
            ]
        names = [self._name(place) for place in places]
        return [Unknown(n, number.unit, path, (p,)) for n, p in zip(names, places, strict=True)]

    def of_file(self) -> list[Unknown]:
        """One of each number of the file."""
        return [
            Unknown(self._name(place), one.unit, one.path, (place,))
            for one in self.all
            for place in one.places
        ]

    def file(self, x: np.ndarray) -> np.ndarray:
        """All numbers of the file, (F,), with these unknowns."""
        found = self.standard.home.copy()
        for value, one in zip(x, self.all, strict=True):
            found[list(one.places)] = value
        return found

    def pi(self, x: np.ndarray) -> np.ndarray:
        """Standard numbers, (P,)."""
        return self.standard.of(self.file(x))

    def slope(self, x: np.ndarray) -> np.ndarray:
        """Their derivatives by the unknowns, (P, U)."""
        return self.standard.slope(self.file(x)) @ self._spread_out

    def coefficients(self, x: np.ndarray, contacts: Sequence[str]) -> tuple[np.ndarray, np.ndarray]:
        """Friction of contacts over that of the model, (k,), and its slopes, (k, U)."""
        values, slope = np.ones(len(contacts)), np.zeros((len(contacts), len(self.all)))
        for u, one in enumerate(self.all):
            for name in file_names_of(one, self.standard):
                if name in self._rough:
                    i = list(contacts).index(name.split(".")[1])
                    values[i], slope[i, u] = x[u], 1.0
        return values, slope

    @cached_property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Least and largest values by the rules of the file, (U,) each."""
        low, high = np.full(len(self.all), -np.inf), np.full(len(self.all), np.inf)
        for i, one in enumerate(self.all):
            unit = self.standard.file_units[one.places[0]]
            towards_end = one.name.startswith("chain.") and one.name.endswith(".com")
            if unit.gt is not None or unit.ge is not None or towards_end:
                low[i] = 0.0
            if unit.le is not None:
                high[i] = unit.le
        return low, high

    def axial_rules(self) -> list[tuple[int | None, int | None, float, float]]:
        """axial <= 2 transverse of every body: places among x or None, and the file's values."""
        at = {
            name: i for i, one in enumerate(self.all) for name in file_names_of(one, self.standard)
        }
        rules = []
        for place, name in enumerate(self.standard.file_names):
            if not name.endswith(".axial"):
                continue
            other = name.removesuffix("axial") + "transverse"
            i, j = at.get(name), at.get(other)
            if i is not None or j is not None:
                values = self.standard.home
                rules.append((i, j, values[place], values[self.standard.file_names.index(other)]))
        return rules


def file_names_of(one: Unknown, standard: StandardNumbers) -> list[str]:
    """Names in the file of the numbers of an unknown."""
    return [standard.file_names[place] for place in one.places]


def changes(unknowns: Unknowns, x: np.ndarray) -> dict[str, float]:
    """What `Mechanism.set` takes: path -> value."""
    found: dict[str, float] = {}
    for value, one in zip(x, unknowns.all, strict=True):
        found |= dict.fromkeys(file_names_of(one, unknowns.standard), float(value))
    return found
