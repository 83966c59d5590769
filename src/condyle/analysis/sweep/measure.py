"""Measures of a variant: columns of numbers from the variables of a solution."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass
from itertools import product

import numpy as np

from ...errors import InputError, did_you_mean
from ...model.model import Model, parts_with_inputs
from ...quantities import variables
from ...quantities.entries import labels_of
from ...results.derived import Derived
from ...results.variant_solutions import by_solution
from .study import Measure

Reduced = Callable[..., np.ndarray]
TAKES: dict[str, Reduced] = {
    "min": np.min,
    "max": np.max,
    "min_abs": lambda a, axis: np.min(np.abs(a), axis=axis),
    "max_abs": lambda a, axis: np.max(np.abs(a), axis=axis),
    "mean": np.mean,
    "rms": lambda a, axis: np.sqrt(np.mean(np.square(a), axis=axis)),
    "span": np.ptp,
}


@dataclass(frozen=True)
class Reading:
    """A measure, looked up: its columns follow from one array.

    place: of the variable's dimensions, the one entry that counts, or all;  axes: that are reduced.
    names: of the columns, in the order of what is left.
    """

    variable: str
    take: str
    place: tuple[int | slice, ...]
    axes: tuple[int, ...]
    names: tuple[str, ...]
    units: str

    def values(self, derived: Derived, count: int = 1) -> np.ndarray:
        """The columns, (count, len(names)), of as many solutions whose samples are all good, one
        after the other in time."""
        a = by_solution(variables()[self.variable], derived, count)[(slice(None), *self.place)]
        if a.dtype == bool:
            a = a.astype(float)
        found = TAKES[self.take](a, axis=tuple(axis + 1 for axis in self.axes))
        return np.reshape(found, (count, len(self.names)))


def reading(name: str, measure: Measure, model: Model, given: Collection[str] = ()) -> Reading:
    """A measure, looked up in what a model's solutions have.

    Args:   given: gravity or base, if the motions give them.

    Raises: InputError: for a variable, dimension or entry that there is not.
    """
    about, known_ones = Derived(model.mechanism, None, limited=model.limited), variables()
    there = [name for name, one in known_ones.items() if about.has(one)]
    if (variable := known_ones.get(measure.of)) is None:
        known = did_you_mean(measure.of, there)
        raise InputError(f'measure {name}: no variable "{measure.of}".{known}')
    if measure.of not in there:
        raise InputError(
            f"measure {name}: solutions of this mechanism have no {measure.of} ({variable.meaning})"
        )
    labels = {**labels_of(model.mechanism), "part": parts_with_inputs(model, given)}
    labels |= labels_of(model.mechanism, "mode")
    dims = variable.dims
    for dim, entry in measure.chosen.items():
        if dim not in dims:
            raise InputError(
                f"measure {name}: {measure.of} has no {dim}; it goes over {', '.join(dims)}"
            )
        if entry not in labels[dim]:
            raise InputError(
                f'measure {name}: no {dim} "{entry}".{did_you_mean(entry, labels[dim])}'
            )
    place = tuple(
        labels[d].index(measure.chosen[d]) if d in measure.chosen else slice(None) for d in dims
    )
    left = [d for d in dims if d not in measure.chosen]
    over = left if measure.over is None else list(measure.over)
    for dim in over:
        if dim not in left:
            raise InputError(
                f'measure {name}: over has "{dim}", and {measure.of} goes over {", ".join(left)}'
            )
        if over.count(dim) > 1:
            raise InputError(f'measure {name}: over has "{dim}" {over.count(dim)} times')
    if "time" not in over:
        raise InputError(f'measure {name}: over must have "time"')
    kept = [labels[d] for d in left if d not in over]
    names = tuple(".".join((name, *entries)) for entries in product(*kept))
    if not names:
        raise InputError(f"measure {name}: this mechanism has nothing along {', '.join(left)}")
    if empty := [d for d in over if d in labels and not labels[d]]:
        raise InputError(f"measure {name}: this mechanism has no {empty[0]}")
    axes = tuple(left.index(d) for d in over)
    units = variable.attributes(model.mechanism)["units"]
    return Reading(measure.of, measure.take, place, axes, names, units)
