"""The gate: every array of strangers passes `as_doubles`, which knows labels, masks and units."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from numbers import Real
from typing import Any

import numpy as np

from ..errors import InputError, brief, quoted
from ..files.limits import LISTS
from .column_units import ratio

# Nothing hides in these; all else that has one of these attributes says more than its numbers.
PLAIN = {np.ndarray, float, int, bool, str, type(None), np.float64, np.float32, np.int64}
TELLING = ("mask", "units", "unit", "columns", "column_names", "iloc", "coords")
# Dimensions of results along which the entries of an argument stand.
ENTRIES = {"coordinate", "independent", "chain", "component", "axis"}


def as_number(
    given: Any, name: str, expected: str, accept: Callable[[float], bool] = math.isfinite
) -> float:
    """`given` as a finite float that `accept` takes; `expected` says which.

    Raises: InputError: for anything else.
    """
    if isinstance(given, Real) and not isinstance(given, bool):
        try:
            if math.isfinite(value := float(given)) and accept(value):
                return value
        except OverflowError:
            pass
    raise InputError(f"{name}: expected {expected}, got {brief(given)}")


def as_text(given: Any, name: str, expected: str) -> str | None:
    """`given` where it is a text or None.

    Raises: InputError: for anything else.
    """
    if given is None or isinstance(given, str):
        return given
    raise InputError(f"{name}: expected {expected}, got {brief(given)}")


def as_samples(
    values: Any, name: str, source: str, size: int | None = None, unit: str | None = None
) -> np.ndarray:
    """`values` as finite floats, (size,), in `unit`.

    Raises: InputError: for anything else, with the sample at fault.
    """
    array = as_doubles(values, f'{source}: "{name}"', unit)
    if array.ndim != 1 or (size is not None and len(array) != size):
        expected = "(samples,)" if size is None else f"({size},), as t has"
        raise InputError(f'{source}: "{name}" has shape {array.shape}, expected {expected}')
    bad = np.flatnonzero(~np.isfinite(array))
    if len(bad):
        i = bad[0]
        raise InputError(f'{source}, sample {i}: "{name}" is {array[i]}, expected a finite number')
    return array


def as_doubles(
    given: Any,
    name: str,
    units: str | Sequence[str] | None = None,
    names: Sequence[str] = (),
    also: Sequence[str] = (),
) -> np.ndarray:
    """`given` as an array of doubles, a new one.

    Where columns, an index or a coordinate name the entries along the last axis, they are taken by
    name, in any order; an array with units is converted.

    Args:   units: of these entries, or of all; None: an array with units is refused.
            names, also: of these entries, and others that they may have; (): labels say nothing.
    Raises: InputError: for anything but real numbers, masked ones, other labels or units.
    """
    found = numbers_in(given, name, units, names, also)
    if found is None:
        raise InputError(f"{name}: expected an array of numbers, got {brief(given)}")
    return found


def numbers_in(
    given: Any,
    name: str,
    units: str | Sequence[str] | None = None,
    names: Sequence[str] = (),
    also: Sequence[str] = (),
) -> np.ndarray | None:
    """`as_doubles`, or None for anything but real numbers."""
    units = (units,) * max(1, len(names)) if isinstance(units, str) else units
    try:
        if not _plain(given):
            return _labelled_doubles(given, name, units, names, also)
        array = np.array(given)
        if array.dtype.kind in "fiubO" and not (array.dtype == object and None in array.ravel()):
            return array.astype(float, copy=False)
    except (TypeError, ValueError, OverflowError):  # ragged lists, objects, huge integers
        pass
    return None


def _plain(given: Any, depth: int = 0) -> bool:
    """Whether it is numbers alone, or at least no labels, masks or units."""
    if type(given) in PLAIN or depth > LISTS.most:
        return True
    if isinstance(given, list | tuple):
        return {*map(type, given)} <= PLAIN or all(_plain(one, depth + 1) for one in given)
    return not any(hasattr(given, attribute) for attribute in TELLING)


def _labelled_doubles(
    given: Any,
    name: str,
    units: Sequence[str] | None,
    names: Sequence[str],
    also: Sequence[str],
) -> np.ndarray:
    """As doubles, of what says more than its numbers."""
    if isinstance(given, list | tuple):  # of the entries, or of states
        own = units if units is not None and len(units) == len(given) else None
        each = [units if own is None or np.ndim(x) else (own[i],) for i, x in enumerate(given)]
        parts = zip(given, each, strict=True)
        return np.stack([as_doubles(x, name, unit, names, also) for x, unit in parts])
    if np.ma.is_masked(given):
        raise InputError(
            f"{name}: {np.ma.count_masked(given)} of its {given.size} numbers are masked; leave "
            "those samples out, or fill them, as with .filled(0.0)"
        )
    unit = _unit_of(given)
    if hasattr(given, "to") and unit is not None:  # of pint, astropy or unyt
        return _converted(given, unit, name, units)
    values, labels = _labelled(given)
    array = as_doubles(values, name, units)
    if names and labels is not None and all(isinstance(label, str) for label in labels):
        array = array[..., _order(labels, name, names, also)]
    return array if unit is None else array * _factors(str(unit), name, units)


def _labelled(given: Any) -> tuple[Any, list[Any] | None]:
    """The array of a table, a frame, a series or an `xarray.DataArray`, and what the entries along
    its last axis are called."""
    if hasattr(given, "column_names"):  # of pyarrow
        given = given.to_pandas()
    if hasattr(given, "coords"):
        dims = [str(dim) for dim in given.dims]
        last = next((dim for dim in reversed(dims) if dim in ENTRIES), dims[-1] if dims else None)
        if last is not None:
            given = given.transpose(..., last)
        labels = list(given[last].values) if last in given.coords else None
        return given.data, labels
    if hasattr(given, "to_numpy"):
        return given.to_numpy(), list(given.columns if hasattr(given, "columns") else given.index)
    return np.asarray(getattr(given, "data", given)), None


def _order(
    labels: Sequence[str], name: str, names: Sequence[str], also: Sequence[str]
) -> list[int]:
    """Where each entry stands."""
    for wanted in (names, also):
        if sorted(labels) == sorted(wanted):
            return [labels.index(one) for one in wanted]
    raise InputError(
        f"{name}: got numbers of {quoted(labels)}; expected {', '.join(names)}, in any order"
    )


def _unit_of(given: Any) -> Any:
    """The unit that an array has; None: it says nothing."""
    found = next((getattr(given, key) for key in ("units", "unit") if hasattr(given, key)), None)
    return None if callable(found) or str(found) in ("", "1", "dimensionless") else found


def _converted(given: Any, unit: Any, name: str, units: Sequence[str] | None) -> np.ndarray:
    wanted = {*units} if units is not None else set()
    try:
        (one,) = wanted
        found = given.to(one.replace("^", "**").replace(" ", "*"))
        return np.array(getattr(found, "magnitude", getattr(found, "value", None)), dtype=float)
    except Exception:  # each library has its own
        raise _refused(unit, name, units) from None


def _factors(unit: str, name: str, units: Sequence[str] | None) -> np.ndarray | float:
    """Factors from the unit of an array, or those of its entries, to ours."""
    if units is None:
        raise _refused(unit, name, units)
    own = [text.strip() for text in unit.split(",")]
    if {*own} == {*units}:
        return 1.0
    own = own * len(units) if len(own) == 1 else own
    found = [ratio(a, b) for a, b in zip(own, units, strict=False)]
    if len(own) != len(units) or None in found:
        raise _refused(unit, name, units)
    return np.array(found, dtype=float)


def _refused(unit: Any, name: str, units: Sequence[str] | None) -> InputError:
    wanted = f"numbers in {', '.join(dict.fromkeys(units))}" if units else "numbers without a unit"
    return InputError(f"{name}: got numbers in {brief(str(unit))}; expected {wanted}")


def check_rising(t: np.ndarray, where: Callable[[int], str]) -> None:
    """Raise an InputError at the first time that is not later than the one before."""
    falls = np.flatnonzero(np.diff(t) <= 0)
    if len(falls):
        i = int(falls[0]) + 1
        before, now = float(t[i - 1]), float(t[i])
        raise InputError(
            f"{where(i)}: t is {now} s after {before} s; times must be strictly increasing"
        )


def runs_of(flag: np.ndarray) -> list[slice]:
    """Where an array of truths, (N,), is true, stretch by stretch."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flag.astype(np.int8), [0]])))
    return [slice(int(a), int(b)) for a, b in edges.reshape(-1, 2)]
