"""A small study, and what comes of it in this process alone."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
import xarray as xr

import condyle

# 21 samples in the independent coordinates. Of the values, offsets from the mechanism's own, one
# is no body's, and one shortens a crank until it cannot follow.
STUDY: dict[str, Any] = {
    "motion": {"file": "trial", "rate": 4.0},
    "load": "none",
    "vary": [
        {"what": "platform.mass", "range": [0.2, 0.3], "count": 5},
        {"what": "platform.inertia.xx", "values": [0.0, -1.0]},
        {"what": "chain.temporalis_left.base[0]", "values": [0.0, -0.0165]},
    ],
    "measure": {
        "peak": {"of": "effort", "take": "max_abs", "better": "less"},
        "rms": {"of": "effort", "take": "rms", "over": ["time"]},
        "load": {"of": "contact_force", "take": "min", "contact": "left_condyle"},
        "margin": {"of": "singularity_ratio", "take": "min", "better": "more"},
    },
}


@pytest.fixture(scope="session")
def machine() -> condyle.Mechanism:
    """The mechanism of the study."""
    return condyle.load_mechanism("masticatory")


@pytest.fixture(scope="session")
def tables(machine: condyle.Mechanism) -> dict[str, Any]:
    """The study, its values about those of the bundled mechanism."""
    found = {**STUDY, "vary": [dict(one) for one in STUDY["vary"]]}
    for one, offsets in ((1, STUDY["vary"][1]["values"]), (2, STUDY["vary"][2]["values"])):
        own = machine.get(STUDY["vary"][one]["what"])
        found["vary"][one]["values"] = [own + offset for offset in offsets]
    return found


@pytest.fixture(scope="session")
def alone(tables: dict[str, Any]) -> xr.Dataset:
    """All rows, by one process."""
    return condyle.sweep(tables, workers=1)


@pytest.fixture(scope="session")
def same() -> Callable[[xr.Dataset, xr.Dataset], None]:
    """Checks that every column but the seconds is the same to the last bit."""

    def check(one: xr.Dataset, other: xr.Dataset) -> None:
        assert list(one) == list(other)
        for name in one:
            if name != "seconds":
                xr.testing.assert_identical(one[name].drop_attrs(), other[name].drop_attrs())

    return check
