"""Actuators, friction and cables in a file: what is read, what is refused, what is told."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

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
    f"{MOTOR}.rotor_inertia": NUMBERS,
    f"{MOTOR}.gear": (*NUMBERS, 0.0),
    f"{MOTOR}.viscous": NUMBERS,
    f"{MOTOR}.coulomb": NUMBERS,
    f"{MOTOR}.smoothing_speed": (*NUMBERS, 0.0),
    f"{BALL}.coefficient": NUMBERS,
    f"{BALL}.smoothing_speed": (*NUMBERS, 0.0),
    MOTOR: ({"force_limit": 3.0},),
    BALL: ({}, 0.1, [0.1], "low", {"smoothing_speed": 1.0}, {"coefficient": 0.1, "normal": 1.0}),
}


@pytest.mark.parametrize("path", WRONG)
def test_each_wrong_value_is_one_clear_line(reference: Mechanism, path: str) -> None:
    owner, name, key = path.split(".")[:3]
    for value in WRONG[path]:
        with pytest.raises(MechanismError) as caught:
            reference.set(path, value)
        (line,) = caught.value.problems
        assert line.startswith(f'{owner} "{name}".{key}'), value
        assert len(line) < 250 and "\n" not in line


@pytest.mark.parametrize(
    ("stated", "wanted"),
    [
        (None, (-INF, INF)),
        (1.5, (-1.5, 1.5)),
        (2, (-2.0, 2.0)),
        ([-1, 2.5], (-1.0, 2.5)),
        ([0.5, INF], (0.5, INF)),
        ([-INF, 3.0], (-INF, 3.0)),
        (np.array([-1.0, 2.0]), (-1.0, 2.0)),
    ],
)
def test_limits_of_a_motor(reference: Mechanism, stated: Any, wanted: tuple[float, float]) -> None:
    machine = reference.set(f"{MOTOR}.torque_limit", stated)
    found = limits(machine.chains[2])
    assert found == (*wanted, 6.0) and all(isinstance(v, float) for v in found)
    assert parse(dumps(machine)) == machine


def test_every_key_survives_a_file(reference: Mechanism) -> None:
    """What is not said is ideal and left out; what is said is read, written and described."""
    text = dumps(reference)
    for name in ("gear", "rotor", "viscous", "coulomb", "smoothing", "friction"):
        assert name not in text
    actuator, contact = reference.chains[0].actuator, reference.contacts[0]
    assert (actuator.gear, actuator.smoothing_speed, actuator.ideal) == (1.0, 1e-3, True)
    assert (contact.friction.coefficient, contact.friction.smoothing_speed) == (0.0, 1e-3)
    motor = {"torque_limit": [-1.0, 2.5], "rotor_inertia": 9.2e-7, "gear": 14, "viscous": 0.004}
    motor |= {"coulomb": 0.03, "smoothing_speed": 0.01}
    changes = {f"{MOTOR}.{key}": value for key, value in motor.items()}
    changes |= {f"{BALL}.coefficient": 0.12, f"{BALL}.smoothing_speed": 0.002}
    machine = reference.set(changes)
    assert parse(dumps(machine)) == machine != reference
    assert machine.get(f"{MOTOR}.gear") == 14.0
    assert machine.chains[2].actuator.reflected_inertia == pytest.approx(9.2e-7 * 196)
    assert machine.get(f"{BALL}.smoothing_speed") == 0.002
    again = machine.set({BALL: None, MOTOR: {"torque_limit": 3.0, "speed_limit": 6.0}})
    assert again == reference
    described = check(machine)
    told = str(described)
    assert "limits -1 to 2.5 N m, 6 rad/s, rotor 9.2e-07 kg m^2 with gear 14" in told
    assert "viscous 0.004 N m s/rad, Coulomb 0.03 N m, fading below 0.01 rad/s" in told
    assert "friction 0.12 fading below 0.002 m/s" in told
    assert told.count("rotor") == told.count("friction") == 1
    assert described.data["chains"]["masseter_left"]["effort_limit"] == [-1.0, 2.5]
    assert described.data["chains"]["masseter_right"]["effort_limit"] == 3.0


def test_speeds_are_si_in_a_file_in_millimetres(raw: dict[str, Any]) -> None:
    """`length_unit` is for lengths: not for m/s, nor for what a gear is in."""
    raw["contact"][0]["friction"] = {"coefficient": 0.1, "smoothing_speed": 0.002}
    raw["chain"][0]["actuator"] = {"gear": 14, "smoothing_speed": 0.01}
    machine = from_data(raw)
    assert machine.contacts[0].friction.smoothing_speed == 0.002
    assert machine.chains[0].actuator.gear == 14.0


def cabled(raw: dict[str, Any], **changes: Any) -> dict[str, Any]:
    """The tables with a cable for their first chain."""
    first, *others = raw["chain"]
    ends = {key: first[key] for key in ("base", "platform")}
    return raw | {"chain": [{"name": "cable", "kind": "cable"} | ends | changes, *others]}


@pytest.mark.parametrize(
    ("stated", "wanted"),
    [
        (None, (0.0, INF)),
        (190.4, (0.0, 190.4)),
        ([0, 190.4], (0.0, 190.4)),
        ([5.0, INF], (5.0, INF)),
    ],
)
def test_a_cable_pulls(raw: dict[str, Any], stated: Any, wanted: tuple[float, float]) -> None:
    actuator = {} if stated is None else {"force_limit": stated, "speed_limit": 0.3}
    machine = from_data(cabled(raw, actuator=actuator))
    chain = machine.chains[0]
    assert limits(chain) == (*wanted, INF if stated is None else 0.3)
    assert parse(dumps(machine)) == machine
    length = np.linalg.norm(np.subtract(chain.base, chain.platform))
    assert chain.lengths["line"] == pytest.approx(length)
    assert (chain.masses, chain.radii_of_gyration) == ({}, {})


ROD = {"mass": 0.1, "com": 0.5, "transverse": 0, "axial": 0}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"rod": ROD}, "has no rod;"),
        ({"coupler": ROD, "crank": {"inertia": 1}}, "has no coupler, crank;"),
        ({"cylinder": ROD, "piston": ROD}, "a cable is a massless line"),
        ({"slider": {"mass": 1}}, "has no slider;"),
        ({"axis": [0, 0, 1]}, "has no axis;"),
        ({"crank_tip": [0, 0, 1]}, "has no crank_tip;"),
        ({"mass": 1}, ".mass: is not a key of the file format"),
        ({"base": [0, 0, 1], "platform": [0, 0, 1]}, "the cable has zero length"),
        ({"base": None}, ".base: expected a list"),
        ({"actuator": {"torque_limit": 1}}, "torque_limit: is not a key"),
        ({"actuator": {"force_limit": [-1, 5]}}, "a cable can only pull"),
        ({"actuator": {"force_limit": [-5, -1]}}, "a cable can only pull"),
        ({"actuator": {"force_limit": 0}}, "force_limit: expected a value above"),
        ({"actuator": {"force_limit": [5, 5]}}, "least < greatest"),
    ],
)
def test_what_is_no_cable_is_one_clear_line(
    raw: dict[str, Any], changes: dict[str, Any], message: str
) -> None:
    with pytest.raises(MechanismError) as caught:
        from_data(cabled(raw, **changes))
    (line,) = caught.value.problems
    assert line.startswith('chain "cable"') and message in line


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
    assert limits(condyle.load_mechanism("hexaglide").chains[0]) == (-200.0, 200.0, 1.5)
    assert limits(condyle.load_mechanism("gough-stewart").chains[0]) == (-INF, INF, INF)
