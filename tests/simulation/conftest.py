"""Models that several tests share."""

from __future__ import annotations

import pytest
from support.machines import model

import condyle
from condyle.model.model import Model

FRICTION = {"coefficient": 0.1, "smoothing_speed": 0.1}
LOSSES = {"torque_limit": 3.0, "viscous": 2e-3, "coulomb": 5e-3, "smoothing_speed": 1.0}


@pytest.fixture(scope="session")
def jaw() -> Model:
    """The bundled robot, without friction, compiled: for long runs in fixed steps."""
    return condyle.derive("masticatory")


@pytest.fixture(scope="session")
def plain() -> Model:
    """The same by numpy, which builds no kernels: for short runs."""
    return model("masticatory")


@pytest.fixture(scope="session")
def rubbing(plain: Model) -> Model:
    """The same with friction, and actuators that lose power and have rotors."""
    changes = {f"contact.{name}.friction": FRICTION for name in plain.mechanism.contact_names}
    for name in plain.mechanism.chain_names:
        changes[f"chain.{name}.actuator"] = LOSSES | {"rotor_inertia": 1e-7, "gear": 10}
    return condyle.derive(plain.mechanism.set(changes))
