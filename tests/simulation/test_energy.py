"""Energy: kept where nothing takes it, and what is lost is the work of what takes it."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from scipy.integrate import simpson
from support.points import moved

import condyle
from condyle.model.model import Model

STIFFNESS, REST = 600.0, -0.001
PLACES = (("incisor", 0), ("incisor", 1), ("incisor", 2))
PLACES += (("left_molar", 1), ("left_molar", 2), ("right_molar", 2))
SPRINGS = [
    {
        "kind": "spring",
        "point": point,
        "direction": np.eye(3)[axis].tolist(),
        "stiffness": STIFFNESS,
        "rest": REST,
    }
    for point, axis in PLACES
]


def accounts(solution: xr.Dataset) -> dict[str, np.ndarray]:
    return {str(n): solution["energy"].sel(account=n).values for n in solution["account"].values}


def test_energy_of_free_motion(jaw: Model) -> None:
    """A jaw on springs swings for a second; their energy is written here."""
    solution = condyle.simulate(jaw, {"duration": 1.0, "rtol": 1e-11, "load": SPRINGS})
    energy = accounts(solution)
    total = energy["kinetic"] + energy["potential"]
    pose = solution["pose"].values
    for place, axis in PLACES:
        p = np.array(jaw.mechanism.platform.points[place])
        x = np.array([moved(row, p)[axis] for row in pose])
        total = total + STIFFNESS / 2 * (x - REST) ** 2
    size = energy["kinetic"].max()
    assert size > 1e-3 and np.abs(total - total[0]).max() < 1e-9 * max(size, total.max())


@pytest.fixture(scope="module")
def lossy(rubbing: Model) -> xr.Dataset:
    return condyle.simulate(
        rubbing, {"duration": 0.05, "rate": 20000, "rtol": 1e-10, "load": SPRINGS}
    )


def test_energy_balances(lossy: xr.Dataset) -> None:
    """T + U less what it was is the work of loads and actuators less all losses."""
    e = accounts(lossy)
    kept = e["kinetic"] + e["potential"]
    work = e["actuators"] + e["load"] - e["actuator_losses"] - e["contact_friction"]
    assert np.abs(kept - kept[0] - work).max() < 1e-7 * e["contact_friction"][-1]


def test_losses_are_the_work_of_friction(lossy: xr.Dataset) -> None:
    """Integrals of the powers at the results' times, by Simpson's rule (20 kHz)."""
    e, t = accounts(lossy), lossy["time"].values
    assert e["contact_friction"][-1] > 1e-6 and e["actuator_losses"][-1] > 1e-6
    rubbed = -simpson(lossy["friction_power"].sum("contact").values, x=t)
    assert np.isclose(rubbed, e["contact_friction"][-1], rtol=1e-7)
    lost = simpson(lossy["actuator_loss"].sum("chain").values, x=t)
    assert np.isclose(lost, e["actuator_losses"][-1], rtol=1e-7)


def test_shares_add_up_to_the_efforts_that_acted(lossy: xr.Dataset) -> None:
    assert "internal" in lossy["part"].values
    off = lossy["share"].sum("part") - lossy["effort"]
    assert np.abs(off).max() < 1e-12
