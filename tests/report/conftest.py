from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

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


@pytest.fixture(scope="session")
def solution(comparison: Comparison) -> xr.Dataset:
    return comparison.solution


@pytest.fixture(scope="session")
def fewer_contacts() -> dict[int, xr.Dataset]:
    """The stand-in with none and one of its contacts, under a force and a moment."""
    mechanism = condyle.load_mechanism("masticatory")
    found = {}
    t = np.linspace(0, 1, 30)
    for k in (0, 1):
        fewer = mechanism.replace(contacts=mechanism.contacts[:k], dependent=None)
        model = condyle.derive(fewer, backend="interpreted")
        size = {name: 1e-3 if name in "XYZ" else 0.02 for name in model.independent}
        motion = Motion.from_arrays(t, {name: a * np.sin(6 * t) for name, a in size.items()})
        load = Load.constant((0, 0, -10), (0, 0.1, 0), point="right_molar")
        found[k] = model.solve(motion, load)
    return found


@pytest.fixture
def mixed(solution: xr.Dataset) -> xr.Dataset:
    """Two cranks and four sliders by name and unit, with samples that failed."""
    names = ["crank_left", "crank_right", "rail_1", "rail_2", "rail_3", "rail_4"]
    found = solution.copy(deep=True).assign_coords(
        chain=names,
        effort_unit=("chain", ["N m"] * 2 + ["N"] * 4),
        joint_unit=("chain", ["rad"] * 2 + ["m"] * 4),
    )
    machine = solution.condyle.mechanism
    pairs = zip(machine.chains, names, strict=True)
    chains = [chain.model_copy(update={"name": name}) for chain, name in pairs]
    found.attrs["mechanism"] = condyle.dumps(machine.replace(chains=tuple(chains)))
    found["status"].values[10:15] = 1
    found["effort"].values[10:15] = np.nan
    return found
