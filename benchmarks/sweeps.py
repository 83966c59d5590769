"""What a variant of a study costs, by one worker and by two."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

from condyle.analysis.sweep import Study, sweep

from .rows import Row

VARIANTS, FEW = 100_000, 2_000
STUDY: dict[str, Any] = {
    "motion": {"file": "reference", "rate": 40.0},  # 201 samples
    "vary": [
        {
            "what": "chain.masseter_left.base[2]",
            "mirror": "chain.masseter_right.base[2]",
            "scale": [0.98, 1.02],
        },
        {"what": "platform.mass", "range": [0.2, 0.3]},
    ],
    "sampling": {"kind": "sobol", "count": VARIANTS},
    "measure": {
        "peak": {"of": "effort", "take": "max_abs"},
        "rms": {"of": "effort", "take": "rms"},
        "load": {"of": "contact_force", "take": "min", "contact": "left_condyle"},
        "margin": {"of": "singularity_ratio", "take": "min"},
    },
}
ALL = f"sweep: {VARIANTS} variants of 201 samples, two workers"
ONE, TWO = (f"sweep: a variant, {who}" for who in ("one worker", "two workers"))


def sweep_rows() -> Iterator[Row]:
    """Seconds of a whole study, and of a variant by who does it, start of the workers included."""
    _seconds(8, 1)  # builds the kernels
    yield Row(ALL, _seconds(VARIANTS, 2), 0.0, 0.0, None)
    yield Row(ONE, _seconds(FEW, 1) / FEW, 0.0, 0.0, None)
    yield Row(TWO, _seconds(FEW, 2) / FEW, 0.0, 0.0, None)


def sweep_ratios(rows: dict[str, Row]) -> dict[str, float]:
    """The bars of studies."""
    return {
        f"{ALL} [s]": rows[ALL].seconds,
        "sweep: efficiency of two workers": rows[ONE].seconds / rows[TWO].seconds / 2,
    }


def _seconds(count: int, workers: int) -> float:
    study = Study.checked({**STUDY, "sampling": {"kind": "sobol", "count": count}}, "bench")
    start = time.perf_counter()
    sweep(study, workers=workers, scheduler="processes")
    return time.perf_counter() - start
