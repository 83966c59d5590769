from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from support.machines import model

import condyle
from condyle.analysis.comparison import Comparison, compare
from condyle.motion import Load, Motion, bundled_reference


@pytest.fixture(scope="session")
def comparison() -> Comparison:
    """The reference motion at 20 Hz by the paper's models."""
    motion = Motion.from_csv(bundled_reference()[0], rate=20)
    models = ["momentum", "lagrange"]
    machine = condyle.load_mechanism("masticatory")
    return compare(machine, motion, condyle.reference_load(), formulations=models)


def chewed(name: str) -> xr.Dataset:
    """The reference motion and load at 20 Hz."""
    motion = Motion.from_csv(bundled_reference()[0], rate=20)
    return model(name).solve(motion, condyle.reference_load())


@pytest.fixture(scope="session")
def solution() -> xr.Dataset:
    return chewed("masticatory")


@pytest.fixture(scope="session")
def jaw() -> xr.Dataset:
    return chewed("human-jaw")


@pytest.fixture(scope="session")
def fewer_contacts() -> dict[int, xr.Dataset]:
    """The stand-in with none and one of its contacts, under a force and a moment."""
    mechanism = condyle.load_mechanism("masticatory")
    found = {}
    t = np.linspace(0, 1, 30)
    for k in (0, 1):
        fewer = mechanism.replace(contacts=mechanism.contacts[:k], dependent=None)
        model = condyle.derive(fewer, backend="numpy")
        size = {name: 1e-3 if name in "XYZ" else 0.02 for name in model.independent}
        motion = Motion.from_arrays(t, {name: a * np.sin(6 * t) for name, a in size.items()})
        load = Load.constant((0, 0, -10), (0, 0.1, 0), point="right_molar")
        found[k] = model.solve(motion, load)
    return found
