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
SPRING = {"kind": "spring", "stiffness": STIFFNESS, "rest": REST}
CURVE = [[0, 0], [0.02, 0.5], [0.06, 4]]
SPRINGS = [SPRING | {"point": p, "direction": np.eye(3)[axis].tolist()} for p, axis in PLACES]


def accounts(solution: xr.Dataset) -> dict[str, np.ndarray]:
    return {str(n): solution["energy"].sel(account=n).values for n in solution["account"].values}


def total_energy(model: Model, solution: xr.Dataset) -> np.ndarray:
    """Of the jaw and of `SPRINGS`, which is written here, (N,) [J]."""
    energy, pose = accounts(solution), solution["pose"].values
    total = energy["kinetic"] + energy["potential"]
    for place, axis in PLACES:
        p = np.array(model.mechanism.platform.points[place])
        x = np.array([moved(row, p)[axis] for row in pose])
        total = total + STIFFNESS / 2 * (x - REST) ** 2
    return total


def test_energy_of_free_motion(plain: Model) -> None:
    """A jaw on springs swings."""
    solution = condyle.simulate(plain, {"duration": 0.05, "rtol": 1e-11, "load": SPRINGS})
    total, size = total_energy(plain, solution), accounts(solution)["kinetic"].max()
    assert size > 1e-3 and np.abs(total - total[0]).max() < 1e-9 * max(size, total.max())


@pytest.mark.ci
def test_energy_of_a_minute(jaw: Model) -> None:
    """On compiled kernels, in fixed steps: what is lost is the method's, whose order is four."""
    lost = []
    for step in (1e-3, 5e-4):
        tables = {"duration": 60.0, "rate": 50.0, "method": "rk4", "step": step, "load": SPRINGS}
        total = total_energy(jaw, condyle.simulate(jaw, tables))
        lost.append(np.abs(total - total[0]).max() / total[0])
    assert lost[1] < lost[0] / 16 < 1e-5


def test_losses_are_the_work_of_what_takes_it(rubbing: Model) -> None:
    """T + U less what it was is the work of loads and actuators less all losses, which are the
    integrals of their powers at the results' times, by Simpson's rule (20 kHz)."""
    tables = {"duration": 0.01, "rate": 20000, "rtol": 1e-10, "load": SPRINGS}
    lossy = condyle.simulate(condyle.derive(rubbing.mechanism, backend="numpy"), tables)
    e, t = accounts(lossy), lossy["time"].values
    kept = e["kinetic"] + e["potential"]
    work = e["actuators"] + e["load"] - e["actuator_losses"] - e["contact_friction"]
    assert np.abs(kept - kept[0] - work).max() < 1e-7 * e["contact_friction"][-1]
    assert e["contact_friction"][-1] > 1e-6 and e["actuator_losses"][-1] > 1e-6
    rubbed = -simpson(lossy["friction_power"].sum("contact").values, x=t)
    assert np.isclose(rubbed, e["contact_friction"][-1], rtol=1e-7)
    lost = simpson(lossy["actuator_loss"].sum("chain").values, x=t)
    assert np.isclose(lost, e["actuator_losses"][-1], rtol=1e-7)
    assert "internal" in lossy["part"].values
    assert np.abs(lossy["share"].sum("part") - lossy["effort"]).max() < 1e-12


def test_energy_with_ligaments() -> None:
    """A jaw that hangs on ligaments: what they store is written here, what they damp is lost."""
    sides = {f"contact.{side}_condyle.one_sided": False for side in ("left", "right")}
    mechanism, ligaments = condyle.load_mechanism("human-jaw").set(sides), []
    for i, (place, axis) in enumerate(PLACES):
        p = np.array(mechanism.platform.points[place])
        one = {"name": f"ligament_{i}", "base": p + 0.03 * np.eye(3)[axis], "platform": p}
        one |= {"slack_length": 0.0295 + 1e-4 * i, "damping": 0.5}
        ligaments.append(one | {"stiffness": CURVE if i % 2 else STIFFNESS})
    model = Model(mechanism.replace(ligaments=tuple(ligaments)), backend="numpy")
    solution = condyle.simulate(model, {"duration": 0.01, "rate": 4000, "rtol": 1e-10})
    e, length = accounts(solution), solution["ligament_length"].values
    stored = np.zeros(len(length))
    for i, one in enumerate(ligaments):
        L0, x = one["slack_length"], np.linspace(0, 0.02, 40001)
        table = np.interp(x / L0, [0, 0.02, 0.06, 0.1], [0, 0.5, 4, 7.5])  # CURVE, carried on
        force = table if i % 2 else STIFFNESS * x
        work = np.concatenate([[0], np.cumsum((force[1:] + force[:-1]) / 2 * np.diff(x))])
        stored += np.interp(np.maximum(length[:, i] - L0, 0), x, work)
    fall = mechanism.platform.mass * 9.81 * solution["pose"].sel(coordinate="Z").values
    np.testing.assert_allclose(e["potential"] - e["potential"][0], fall - fall[0]
                               + stored - stored[0], atol=1e-9)  # fmt: skip
    total = e["kinetic"] + e["potential"] + e["actuator_losses"]
    assert np.abs(total - total[0]).max() < 1e-6 * e["kinetic"].max()
    assert e["actuator_losses"][-1] > 1e-6 and stored.max() > 1e-4
