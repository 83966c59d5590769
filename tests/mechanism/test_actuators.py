"""Actuators, friction and cables in a file: what is read, what is refused, what is told."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from support.surfaces import ball_options

import condyle
from condyle.errors import MechanismError
from condyle.mechanism import Mechanism, dumps, parse
from condyle.mechanism.actuator import Limits
from condyle.mechanism.chain import limits
from condyle.mechanism.files import from_data
from condyle.report.mechanism_summary import check

INF, NAN = math.inf, math.nan
MOTOR = "chain.masseter_left.actuator"
BALL = "contact.left_condyle.friction"
NUMBERS: tuple[Any, ...] = (-1.0, NAN, INF, "1", True, [1.0, "a"], {}, 1e9, 1e-30, 10**400)
RANGES: tuple[Any, ...] = (
    *(0.0, -1.0, NAN, INF, "3", True, {}, [], [1.0], [1.0, 2.0, 3.0], [2.0, 1.0], [1.0, 1.0]),
    *([NAN, 1.0], [0.0, NAN], ["a", 1.0], [True, 2.0], [INF, INF], [-INF, -INF], [0.0, 1e13]),
    *([1e-30, 1.0], [0.0, 10**400], [[0.0], 1.0]),
)
WRONG: dict[str, tuple[Any, ...]] = {
    f"{MOTOR}.torque_limit": RANGES,
    f"{MOTOR}.gear": (*NUMBERS, 0.0),
    f"{MOTOR}.smoothing_speed": (*NUMBERS, 0.0),
    **{f"{MOTOR}.{key}": NUMBERS for key in ("rotor_inertia", "viscous", "coulomb")},
    f"{BALL}.coefficient": NUMBERS,
    f"{BALL}.smoothing_speed": (*NUMBERS, 0.0),
    MOTOR: ({"force_limit": 3.0},),
    BALL: ({}, 0.1, [0.1], "low", {"smoothing_speed": 1.0}, {"coefficient": 0.1, "normal": 1.0}),
}


def test_each_wrong_value_is_one_clear_line(reference: Mechanism) -> None:
    for path, values in WRONG.items():
        owner, name, key = path.split(".")[:3]
        for value in values:
            with pytest.raises(MechanismError) as caught:
                reference.set(path, value)
            (line,) = caught.value.problems
            assert line.startswith(f'{owner} "{name}".{key}'), value
            assert len(line) < 280 and "\n" not in line


def test_limits_of_motors_and_cables(reference: Mechanism, raw: dict[str, Any]) -> None:
    """A number is one for both ways; a cable can only pull, and has no lengths but its own."""
    stated = [
        (None, (-INF, INF)),
        (2, (-2.0, 2.0)),
        ([-1, 2.5], (-1.0, 2.5)),
        ([0.5, INF], (0.5, INF)),
        ([-INF, 3.0], (-INF, 3.0)),
        (np.array([-1.0, 2.0]), (-1.0, 2.0)),
    ]
    for limit, wanted in stated:
        machine = reference.set(f"{MOTOR}.torque_limit", limit)
        found = limits(machine.chains[2])
        assert found == (*wanted, 6.0) and all(isinstance(v, float) for v in found)
        assert parse(dumps(machine)) == machine
    cable = {key: raw["chain"][0][key] for key in ("base", "platform")}
    cable |= {"name": "cable", "kind": "cable"}
    for limit, wanted in (
        (None, (0.0, INF)),
        (190.4, (0.0, 190.4)),
        ([0, 190.4], (0.0, 190.4)),
        ([5.0, INF], (5.0, INF)),
    ):
        actuator = {} if limit is None else {"force_limit": limit, "speed_limit": 0.3}
        machine = from_data(raw | {"chain": [cable | {"actuator": actuator}, *raw["chain"][1:]]})
        chain = machine.chains[0]
        assert limits(chain) == (*wanted, INF if limit is None else 0.3)
        assert parse(dumps(machine)) == machine
        length = np.linalg.norm(np.subtract(chain.base, chain.platform))
        assert chain.lengths["line"] == pytest.approx(length)
        assert (chain.masses, chain.radii_of_gyration) == ({}, {})
    assert limits(condyle.load_mechanism("hexaglide").chains[0]) == (-200.0, 200.0, 1.5)
    assert limits(condyle.load_mechanism("gough-stewart").chains[0]) == (-INF, INF, INF)


def test_every_key_survives_a_file_and_is_told(reference: Mechanism, raw: dict[str, Any]) -> None:
    """What is not said is ideal and left out; what is said is read, written and described.

    `length_unit` is for lengths: not for m/s, nor for what a gear is in.
    """
    text = dumps(reference)
    for name in ("gear", "rotor", "viscous", "coulomb", "smoothing", "friction"):
        assert name not in text
    actuator, contact = reference.chains[0].actuator, reference.contacts[0]
    assert (actuator.gear, actuator.smoothing_speed, actuator.ideal) == (1.0, 1e-3, True)
    assert (contact.friction.coefficient, contact.friction.smoothing_speed) == (0.0, 1e-3)
    motor = {"torque_limit": [-1.0, 2.5], "rotor_inertia": 9.2e-7, "gear": 14, "viscous": 0.004}
    raw["chain"][2]["actuator"] |= motor | {"coulomb": 0.03, "smoothing_speed": 0.01}
    wall = {"kind": "sphere", "centre": [-26.65, 72, 12.53], "radius": 26.0}
    options = ball_options("sphere", first=False) | {"one_sided": True}
    friction = {"coefficient": 0.12, "smoothing_speed": 0.002}
    raw["contact"][0] |= {"surface": wall, "friction": friction} | options
    machine = from_data(raw)
    assert parse(dumps(machine)) == machine
    assert machine.get(f"{MOTOR}.gear") == 14.0
    assert machine.chains[2].actuator.smoothing_speed == 0.01
    assert machine.chains[2].actuator.reflected_inertia == pytest.approx(9.2e-7 * 196)
    assert machine.get(f"{BALL}.smoothing_speed") == 0.002
    surface = reference.contacts[0].surface
    plain = {BALL: None, MOTOR: {"torque_limit": 3.0, "speed_limit": 6.0}}
    again = (
        machine.set(plain)
        .contacts[0]
        .model_copy(
            update={"surface": surface, "side": None, "ball_radius": None, "one_sided": False}
        )
    )
    assert again == reference.contacts[0] and machine.set(plain).chains == reference.chains
    described = check(machine)
    told = str(described)
    for words in (
        "limits -1 to 2.5 N m, 6 rad/s, rotor 9.2e-07 kg m^2 with gear 14",
        "viscous 0.004 N m s/rad, Coulomb 0.03 N m, fading below 0.01 rad/s",
        "friction 0.12 fading below 0.002 m/s",
        "sphere, outside, ball of radius 4 mm, unilateral,",
        "joint [rad], effort [N m]",
        "6 chains, 2 contacts, 4 degrees",
    ):
        assert words in told
    assert told.count("rotor") == told.count("friction") == 1
    effort = {name: chain["effort_limit"] for name, chain in described.data["chains"].items()}
    assert (effort["masseter_left"], effort["masseter_right"]) == ([-1.0, 2.5], 3.0)
    found = described.data["contacts"]["left_condyle"]
    assert (found["kind"], found["side"], found["ball_radius"]) == ("sphere", "outside", 0.004)


def test_use_and_text_of_limits() -> None:
    both, pull, more = Limits(-3.0, 3.0, INF), Limits(0.0, 190.4, 0.1), Limits(5.0, INF, INF)
    free, below = Limits(-INF, INF, INF), Limits(-INF, 2.0, INF)
    assert (both.use(-1.5), pull.use(95.2), pull.use(0.0), pull.use(-1.0)) == (0.5, 0.5, 0.0, INF)
    assert more.use(50.0) is None and free.use(-1.0) is None
    texts = [one.effort_text("N") for one in (both, pull, more, free, below)]
    assert texts == ["±3 N", "0 to 190.4 N", "at least 5 N", "", "at most 2 N"]
    beyond = pull.beyond(np.array([-1.0, 0.0, 190.4, 191.0, NAN]))
    assert beyond.tolist() == [True, False, False, True, False]
    assert (pull.greatest, pull.symmetric, both.symmetric) == (190.4, False, True)
    assert [one.limited for one in (both, pull, more, free)] == [True, True, True, False]
    assert pull.of_speed[:2] == (-0.1, 0.1)
