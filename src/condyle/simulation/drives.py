"""Drives of a scenario, between the efforts that are asked for and the joints, as numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from pydantic import Field

from ..errors import InputError
from ..kinematics.chain import FAMILIES
from ..kinematics.chain.muscle import muscles
from ..mechanism.table import Table
from ..model.model import Model, model_with_mechanism
from ..questions.drive import NUMBERS
from ..questions.entries import Gains, Signed, each

NONE = 1e100  # stands for no limit: products with it stay finite


class DrivesTable(Table):
    """What is between the efforts that are asked for and the joints, unknown to the controller.

    Each a number, or one a chain. Without this table drives are rigid and give what is asked for.
    """

    gear_stiffness: Gains = Field(
        default=0.0, description="N m/rad or N/m at the joint, between rotor and joint; 0: rigid"
    )
    gear_damping: Gains = Field(default=0.0, description="N m s/rad or N s/m, of the gear")
    backlash: Gains = Field(default=0.0, description="play of the gear at the joint, rad or m")
    static_friction: Gains = Field(
        default=0.0,
        description="N m or N at the joint, of a rotor behind an elastic gear, which grips below "
        "it and slides with the actuator's coulomb; 0: none",
    )
    motor_constant: Gains = Field(default=0.0, description="N m/A of the motor's shaft, as assumed")
    motor_constant_error: Signed = Field(
        default=0.0, description="of the true constant, as a part of the assumed one"
    )
    current_limit: Gains | None = Field(default=None, description="A; default none")
    encoders: Literal["joint", "motor"] = Field(
        default="joint", description="which side of the gear the encoders read"
    )


@dataclass(frozen=True)
class Drives:
    """The drives of a run.

    numbers: (12, n), of port `drive`;  motor: (2, n), position and rate to begin with, in turns of
    the joint, 0 of rigid drives;  side: that encoders read, "joint" or "motor".
    static: (n,), of port `static_friction`.
    """

    numbers: np.ndarray
    motor: np.ndarray
    side: str
    static: np.ndarray

    @property
    def half_play(self) -> np.ndarray:
        """Half the backlash, (n,) [rad or m]."""
        found: np.ndarray = self.numbers[NUMBERS.index("half_play")]
        return found

    @property
    def gripping(self) -> tuple[int, ...]:
        """Chains whose rotors have static friction, by number."""
        return tuple(np.flatnonzero(self.static > 0).tolist())

    @property
    def limited(self) -> np.ndarray:
        """Chains with a largest current, by number."""
        return np.flatnonzero(self.numbers[NUMBERS.index("most")] < NONE)

    def read(self, joint: np.ndarray) -> np.ndarray:
        """What encoders read to begin with, of joints (n,)."""
        return np.where(self.elastic & (self.side == "motor"), self.motor[0], joint)

    @property
    def elastic(self) -> np.ndarray:
        """Which drives are, (n,)."""
        found: np.ndarray = self.numbers[NUMBERS.index("elastic")] > 0
        return found


def drive_numbers(model: Model, table: DrivesTable) -> np.ndarray:
    """Port `drive`, (12, n).

    Raises: InputError: for what does not fit the mechanism.
    """
    chains, names = model.mechanism.chains, model.mechanism.chain_names
    if driven := muscles(chains):
        raise InputError(f"drives: a muscle has no motor ({names[driven[0]]}, ...); remove it")
    own = {
        key: each(value, names, f"drives.{key}")
        for key, value in table.entries().items()
        if key != "encoders" and value is not None
    }
    stiffness, backlash, error = (
        own[key] for key in ("gear_stiffness", "backlash", "motor_constant_error")
    )
    elastic = stiffness > 0
    actuators = [chain.actuator for chain in chains]
    inertia = np.array([actuator.reflected_inertia for actuator in actuators])
    for key in ("gear_damping", "backlash", "static_friction"):
        text = f"drives.{key}: a rigid gear has none; give gear_stiffness"
        _require(elastic | (own[key] == 0), names, text)
    text = "drives.gear_stiffness: it is between rotor and joint; give actuator.rotor_inertia"
    _require(~elastic | (inertia > 0), names, text)
    _require(error > -1, names, "drives.motor_constant_error: expected more than -1")
    most = np.full(len(chains), NONE)
    if "current_limit" in own:
        constant = own["motor_constant"]
        _require(constant > 0, names, "drives.current_limit: give drives.motor_constant too")
        most = constant * [actuator.gear for actuator in actuators] * own["current_limit"]
    viscous, coulomb, slow = (
        np.array([getattr(actuator, key) for actuator in actuators])
        for key in ("viscous", "coulomb", "smoothing_speed")
    )
    families = [FAMILIES[chain.kind] for chain in chains]
    numbers = {
        "elastic": elastic,
        "stiffness": stiffness,
        "damping": own["gear_damping"],
        "half_play": backlash / 2,
        "inertia": np.where(elastic, inertia, 1.0),
        "viscous": viscous,
        "coulomb": coulomb,
        "square": slow**2,
        "gain": 1 + error,
        "most": most,
        "least": np.array([0.0 if chain.kind == "cable" else -NONE for chain in chains]),
        "turn": np.array([2 * np.pi if f.joint_unit == "rad" else NONE for f in families]),
    }
    return np.array([numbers[name] for name in NUMBERS], dtype=float)


def static_friction(model: Model, table: DrivesTable) -> np.ndarray:
    """Port `static_friction`, (n,).

    Raises: InputError: for less than a rotor slides with.
    """
    chains, names = model.mechanism.chains, model.mechanism.chain_names
    static = each(table.static_friction, names, "drives.static_friction")
    coulomb = np.array([chain.actuator.coulomb for chain in chains])
    text = "drives.static_friction: expected no less than actuator.coulomb"
    _require((static == 0) | (static >= coulomb), names, text)
    return static


def _require(good: np.ndarray, names: Sequence[str], text: str) -> None:
    if not good.all():
        raise InputError(f"{text} ({', '.join(np.array(names)[~good])})")


def without_rotors(model: Model, numbers: np.ndarray, shared: dict[Any, Any]) -> Model:
    """The model without what is on the motors' side of elastic gears."""
    elastic = np.flatnonzero(numbers[NUMBERS.index("elastic")])
    if not elastic.size:
        return model
    key = id(model), "without rotors", elastic.tobytes()
    if key not in shared:
        names = model.mechanism.chain_names
        bare = {
            f"chain.{names[i]}.actuator.{loss}": 0.0
            for i in elastic
            for loss in ("rotor_inertia", "viscous", "coulomb")
        }
        shared[key] = model_with_mechanism(model, model.mechanism.set(bare), model.distribution)
    found: Model = shared[key]
    return found


def motors_of(numbers: np.ndarray, joint: np.ndarray, effort: np.ndarray) -> np.ndarray:
    """Position and rate of motors, (2, n), whose gears bear efforts (n,) at joints (2, n)."""
    n = dict(zip(NUMBERS, numbers, strict=True))
    elastic = n["elastic"] > 0
    bent = effort / np.where(elastic, n["stiffness"], 1.0) + np.sign(effort) * n["half_play"]
    found: np.ndarray = np.where(elastic, joint + np.array([bent, 0 * bent]), 0.0)
    return found
