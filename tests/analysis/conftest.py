from __future__ import annotations

import pytest

import condyle
from condyle.analysis.comparison import Comparison, compare
from condyle.motion import Motion, bundled_reference


@pytest.fixture(scope="session")
def reference() -> Comparison:
    """All 5001 samples of the reference case, by one formulation."""
    mechanism = condyle.load_mechanism("masticatory")
    motion, load = condyle.reference_motion(), condyle.reference_load()
    return compare(mechanism, motion, load, formulations=["momentum"])


@pytest.fixture(scope="session")
def comparison() -> Comparison:
    """The reference motion at 50 Hz by every model."""
    motion = Motion.from_csv(bundled_reference()[0], rate=50)
    return compare(condyle.load_mechanism("masticatory"), motion, condyle.reference_load())
