"""A kernel that was just built, held against numpy on a few samples before anyone uses it.

Small inputs of the mechanism itself run the quick code. The robust code runs on equations that the
quick code cannot solve: those of the same mechanism with its chains moved almost onto one another.
Among these samples stand some without numbers (NaN), which it may not call solved. Kernels without
a robust code have none of these: their checks may be minima, in which NaN is lost or is not.

What compilers may round differently can be large where results hang on a decision; a kernel that
is wrong is wrong nearly everywhere. So most of the samples decide.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from ...graph.program import Numbers, Programs
from ..compiler import CompilerError
from ..kernel import AGAIN, OK, Arrays, KernelValues, shapes_of
from ..numpy_kernel import NumpyKernel

# How a kernel runs on the numbers of a mechanism: its batch, or its code for one sample.
Way = Callable[[Numbers, Arrays], KernelValues]

SAMPLES, SMALL = 8, 1e-3  # of each kind, and the size of their inputs
ALIKE, TINY = 1e-6, 1e-9  # relative and absolute difference that rounding may make
# Bounds of errors are rounding themselves: by numpy and by C they may differ by such a factor.
BOUNDS, FACTOR = ("bound", "data_error"), 30.0
# What is left of the chains' differences. Normal equations then lose all digits, Gram-Schmidt half.
NEAR = 1e-4


def require_numpys_values(ways: Sequence[Way], variants: Programs, numbers: Numbers) -> None:
    """Compare every way a kernel runs with numpy.

    Args:   numbers: of one mechanism, the kernel's.
    Raises: CompilerError: where most samples differ.
    """
    rng = np.random.default_rng(0)
    shapes = shapes_of(variants.main.interface).items()
    ports = {name: rng.uniform(-SMALL, SMALL, (SAMPLES, *shape)) for name, shape in shapes}
    right = NumpyKernel(variants, numbers).run(ports)
    for way in ways:
        _require_few(_differs(way(numbers, ports), right), "are not those of numpy")
    if variants.robust is None:
        return
    numbers = _nearly_alike(numbers)
    for a in ports.values():
        a[1::2] = np.nan
    right = NumpyKernel(Programs(variants.robust), numbers).run(ports)
    for way in ways:
        found = way(numbers, ports)
        solved = (found.status == OK) & (right.status != OK)
        _require_few(solved[1::2], "have no solution and are called solved")
        differs = _differs(found, right)[::2]
        _require_few(differs, "that need the robust method are not those of numpy")


def _nearly_alike(numbers: Numbers) -> Numbers:
    """The chains of every group almost where the group's first is, which leaves them in reach."""
    first = [own[..., :1] for own in numbers.lanes]
    lanes = [a + NEAR * (own - a) for own, a in zip(numbers.lanes, first, strict=True)]
    return replace(numbers, lanes=tuple(lanes))


def _require_few(wrong: np.ndarray, what: str) -> None:
    count = int(np.count_nonzero(wrong))
    if count > len(wrong) / 2:
        raise CompilerError(f"{count} of {len(wrong)} samples {what}")


def _differs(found: KernelValues, wanted: KernelValues) -> np.ndarray:
    """Samples, (N,), whose status or values differ by more than rounding makes."""
    known = (found.status != AGAIN) & (wanted.status != AGAIN)
    differs: np.ndarray = known & (found.status != wanted.status)
    for name, right in wanted.values.items():
        with np.errstate(all="ignore"):
            axes = tuple(range(right.ndim - 1))
            off = np.abs(found.values[name] - right)
            off = np.where(np.isfinite(right), off, 0.0).max(axis=axes, initial=0.0)
            size = np.where(np.isfinite(right), np.abs(right), 0.0).max(axis=axes, initial=0.0)
        alike = FACTOR if name in BOUNDS else ALIKE
        differs = differs | known & ~(off <= alike * size + TINY)
    return differs
