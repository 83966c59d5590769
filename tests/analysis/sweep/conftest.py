"""A small study, and what comes of it in this process alone."""

from typing import Any

import pytest
import xarray as xr

import condyle

MACHINE = condyle.load_mechanism("masticatory")
BASE, XX = "chain.temporalis_left.base[0]", "platform.inertia.xx"
# 21 samples in the independent coordinates. Of the values one is no body's, and one shortens a
# crank until it cannot follow.
STUDY: dict[str, Any] = {
    "motion": {"file": "trial", "rate": 4.0},
    "load": "none",
    "vary": [
        {"what": "platform.mass", "range": [0.2, 0.3], "count": 5},
        {"what": XX, "values": [MACHINE.get(XX), MACHINE.get(XX) - 1.0]},
        {"what": BASE, "values": [MACHINE.get(BASE), MACHINE.get(BASE) - 0.0165]},
    ],
    "measure": {
        "peak": {"of": "effort", "take": "max_abs", "better": "less"},
        "rms": {"of": "effort", "take": "rms", "over": ["time"]},
        "load": {"of": "contact_force", "take": "min", "contact": "left_condyle"},
        "margin": {"of": "singularity_ratio", "take": "min", "better": "more"},
    },
}


def masses(count: int) -> dict[str, Any]:
    """The study with so many values of the mass; a part has four rows."""
    return {**STUDY, "vary": [{**STUDY["vary"][0], "count": count}]}


@pytest.fixture(scope="module")
def alone() -> xr.Dataset:
    """All rows, by one process."""
    return condyle.sweep(STUDY, workers=1)


def same(one: xr.Dataset, other: xr.Dataset) -> None:
    """Every column but the seconds is the same to the last bit."""
    assert list(one) == list(other)
    for name in one:
        if name != "seconds":
            xr.testing.assert_identical(one[name].drop_attrs(), other[name].drop_attrs())
