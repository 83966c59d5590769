"""Samples of several mechanisms, those of each solved by themselves."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np

from ..backends.kernel import VARIANT, Arrays, sample_rows


def solve_per_variant(inputs: Mapping[str, np.ndarray], solve: Callable[[int, Arrays], Any]) -> Any:
    """Arrays with samples last, or dicts and tuples of them, in the order of the samples.

    Args: inputs: of N samples, with `variant`;  solve: of a mechanism's number and its samples.
    """
    variant = inputs[VARIANT]
    order = np.argsort(variant, kind="stable")
    parts = []
    for i in np.unique(variant).tolist():
        rows = sample_rows(inputs, np.flatnonzero(variant == i), len(variant))
        parts.append(solve(i, rows))
    return _joined(parts, np.argsort(order))


def _joined(parts: list[Any], order: np.ndarray) -> Any:
    first = parts[0]
    if isinstance(first, dict):
        return {name: _joined([part[name] for part in parts], order) for name in first}
    if isinstance(first, tuple):
        return tuple(_joined(list(own), order) for own in zip(*parts, strict=True))
    return np.concatenate(parts, axis=-1)[..., order]


class PerVariantMethods:
    """The methods of an object that each mechanism has one of, by samples of several."""

    def __init__(self, single: Callable[[int], Any]) -> None:
        self._single = single

    def __getattr__(self, name: str) -> Callable[[Mapping[str, np.ndarray]], Any]:
        return partial(
            solve_per_variant, solve=lambda i, rows: getattr(self._single(i), name)(rows)
        )
