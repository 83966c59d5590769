"""Models that several tests share."""

from __future__ import annotations

import pytest

import condyle
from condyle.model.model import Model

FRICTION = {"coefficient": 0.1, "smoothing_speed": 0.1}
LOSSES = {"torque_limit": 3.0, "viscous": 2e-3, "coulomb": 5e-3, "smoothing_speed": 1.0}


@pytest.fixture(scope="session")
def jaw() -> Model:
    """The bundled robot, without friction."""
    return condyle.derive("masticatory")


@pytest.fixture(scope="session")
def rubbing() -> Model:
    """The same with friction at a contact, and actuators that lose power and have rotors."""
    machine = condyle.load_mechanism("masticatory")
    changes = {"contact.left_condyle.friction": FRICTION}
    for name in machine.chain_names:
        changes[f"chain.{name}.actuator"] = LOSSES | {"rotor_inertia": 1e-7, "gear": 10}
    return condyle.derive(machine.set(changes))
