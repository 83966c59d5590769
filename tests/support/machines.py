"""Models that many tests share: each is derived once in a process, with its kernels."""

from __future__ import annotations

from functools import cache
from typing import Any

import condyle
from condyle.model.model import Model

from .cases import RANDOM, case


@cache
def model(name: str, backend: str = "numpy", **options: Any) -> Model:
    """The model of a bundled machine, or of one of `cases.RANDOM`.

    Args:   options: those of `derive`, hashable.
    Returns: always the same object, which no test changes.
    """
    machine = case(name).mechanism if name in RANDOM else condyle.load_mechanism(name)
    return condyle.derive(machine, backend=backend, **options)
