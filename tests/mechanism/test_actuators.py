"""Actuators, friction and cables in a file: what is read, what is refused, what is told."""

from __future__ import annotations

import copy
import math
from typing import Any

import numpy as np
import pytest
from mechanism.test_schema import Validator

import condyle
from condyle.errors import MechanismError
from condyle.mechanism import Mechanism, dumps, parse
from condyle.mechanism.actuator import Limits
from condyle.mechanism.chain import limits
from condyle.mechanism.files import from_data, json_schema
from condyle.mechanism.mechanism_checks import mechanism_warnings
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


def key(name: str, *wrong: Any, without: tuple[Any, ...] = ()) -> list[tuple[str, Any]]:
    return [(name, value) for value in (*NUMBERS, *wrong) if value not in without]


WRONG = [
    *((f"{MOTOR}.torque_limit", value) for value in RANGES),
    *key(f"{MOTOR}.rotor_inertia"),
    *key(f"{MOTOR}.gear", 0.0),
    *key(f"{MOTOR}.viscous"),
    *key(f"{MOTOR}.coulomb"),
    *key(f"{MOTOR}.smoothing_speed", 0.0),
    *key(f"{BALL}.coefficient"),
    *key(f"{BALL}.smoothing_speed", 0.0),
    (MOTOR, {"force_limit": 3.0}),
    *((BALL, value) for value in ({}, 0.1, [0.1], "low", {"smoothing_speed": 1.0})),
    (BALL, {"coefficient": 0.1, "normal": 1.0}),
]


@pytest.mark.parametrize(("path", "value"), WRONG, ids=lambda v: str(v)[-40:])
def test_each_wrong_value_is_one_clear_line(reference: Mechanism, path: str, value: Any) -> None:
    with pytest.raises(MechanismError) as caught:
        reference.set(path, value)
    (line,) = caught.value.problems
    owner, name = path.split(".")[:2]
    assert line.startswith(f'{owner} "{name}".{path.split(".")[2]}')
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
    chain = machine.chains[2]
    assert limits(chain) == (*wanted, 6.0)
    assert parse(dumps(machine)) == machine
    assert all(isinstance(v, float) for v in limits(chain))


def test_what_is_not_said_is_ideal_and_left_out_of_files(reference: Mechanism) -> None:
    text = dumps(reference)
    for name in ("gear", "rotor", "viscous", "coulomb", "smoothing", "friction"):
        assert name not in text
    actuator, contact = reference.chains[0].actuator, reference.contacts[0]
    assert (actuator.gear, actuator.smoothing_speed, actuator.ideal) == (1.0, 1e-3, True)
    assert (contact.friction.coefficient, contact.friction.smoothing_speed) == (0.0, 1e-3)


def everything(machine: Mechanism) -> Mechanism:
    return machine.set(
        {
            f"{MOTOR}.torque_limit": [-1.0, 2.5],
            f"{MOTOR}.rotor_inertia": 9.2e-7,
            f"{MOTOR}.gear": 14,
            f"{MOTOR}.viscous": 0.004,
            f"{MOTOR}.coulomb": 0.03,
            f"{MOTOR}.smoothing_speed": 0.01,
            f"{BALL}.coefficient": 0.12,
            f"{BALL}.smoothing_speed": 0.002,
        }
    )


def test_every_key_survives_a_file(reference: Mechanism) -> None:
    machine = everything(reference)
    assert parse(dumps(machine)) == machine and machine != reference
    assert machine.get(f"{MOTOR}.gear") == 14.0
    assert machine.chains[2].actuator.reflected_inertia == pytest.approx(9.2e-7 * 196)
    assert machine.get(f"{BALL}.smoothing_speed") == 0.002
    again = machine.set({BALL: None, MOTOR: {"torque_limit": 3.0, "speed_limit": 6.0}})
    assert again == reference


def test_speeds_are_si_in_a_file_in_millimetres(raw: dict[str, Any]) -> None:
    """`length_unit` is for lengths: not for m/s, nor for what a gear is in."""
    raw["contact"][0]["friction"] = {"coefficient": 0.1, "smoothing_speed": 0.002}
    raw["chain"][0]["actuator"] = {"gear": 14, "smoothing_speed": 0.01}
    machine = from_data(raw)
    assert machine.contacts[0].friction.smoothing_speed == 0.002
    assert machine.chains[0].actuator.gear == 14.0


def test_check_tells_what_there_is(reference: Mechanism) -> None:
    described = check(everything(reference))
    text = str(described)
    assert "limits -1 to 2.5 N m, 6 rad/s, rotor 9.2e-07 kg m^2 with gear 14" in text
    assert "viscous 0.004 N m s/rad, Coulomb 0.03 N m, fading below 0.01 rad/s" in text
    assert "friction 0.12 fading below 0.002 m/s" in text
    assert text.count("rotor") == text.count("friction") == 1
    assert described.data["chains"]["masseter_left"]["effort_limit"] == [-1.0, 2.5]
    assert described.data["chains"]["masseter_right"]["effort_limit"] == 3.0


@pytest.mark.parametrize(
    ("changes", "kind"),
    [
        ({f"{BALL}.coefficient": 2.5}, "friction_large"),
        ({f"{MOTOR}.coulomb": 3.0}, "coulomb_large"),
        ({f"{MOTOR}.coulomb": 0.1, f"{MOTOR}.smoothing_speed": 6.0}, "smoothing_large"),
        ({f"{BALL}.coefficient": 2.0, f"{MOTOR}.coulomb": 2.9}, None),
    ],
)
def test_what_is_hardly_meant(
    reference: Mechanism, changes: dict[str, Any], kind: str | None
) -> None:
    found = {warning.kind for warning in mechanism_warnings(reference.set(changes))}
    assert found == ({kind} if kind else set())


# -- cables ----------------------------------------------------------------------------------------


def cabled(raw: dict[str, Any], **changes: Any) -> dict[str, Any]:
    raw = copy.deepcopy(raw)
    first = raw["chain"][0]
    raw["chain"][0] = {
        "name": "cable",
        "kind": "cable",
        "base": first["base"],
        "platform": first["platform"],
    } | changes
    return raw


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
    assert chain.lengths["line"] == pytest.approx(
        np.linalg.norm(np.subtract(chain.base, chain.platform))
    )
    assert (chain.masses, chain.radii_of_gyration) == ({}, {})


ROD = {"mass": 0.1, "com": 0.5, "transverse": 0, "axial": 0}
NO_CABLES: dict[str, tuple[dict[str, Any], str]] = {
    "rod": ({"rod": ROD}, "has no rod;"),
    "coupler and crank": ({"coupler": ROD, "crank": {"inertia": 1}}, "has no coupler, crank;"),
    "leg": ({"cylinder": ROD, "piston": ROD}, "a cable is a massless line"),
    "slider": ({"slider": {"mass": 1}}, "has no slider;"),
    "axis": ({"axis": [0, 0, 1]}, "has no axis;"),
    "crank tip": ({"crank_tip": [0, 0, 1]}, "has no crank_tip;"),
    "mass": ({"mass": 1}, ".mass: is not a key of the file format"),
    "no length": ({"base": [0, 0, 1], "platform": [0, 0, 1]}, "the cable has zero length"),
    "no base": ({"base": None}, ".base: expected a list"),
    "torque": ({"actuator": {"torque_limit": 1}}, "torque_limit: is not a key"),
    "pushes": ({"actuator": {"force_limit": [-1, 5]}}, "a cable can only pull"),
    "pushes only": ({"actuator": {"force_limit": [-5, -1]}}, "a cable can only pull"),
    "no force": ({"actuator": {"force_limit": 0}}, "force_limit: expected a value above"),
    "never": ({"actuator": {"force_limit": [5, 5]}}, "least < greatest"),
}


@pytest.mark.parametrize("case", NO_CABLES)
def test_what_is_no_cable_is_one_clear_line(raw: dict[str, Any], case: str) -> None:
    changes, message = NO_CABLES[case]
    with pytest.raises(MechanismError) as caught:
        from_data(cabled(raw, **changes))
    (line,) = caught.value.problems
    assert line.startswith('chain "cable"') and message in line


def test_the_schema_knows_cables_limits_and_friction(raw: dict[str, Any]) -> None:
    schema = json_schema()
    accepts = Validator(schema).fits
    raw["contact"][0]["friction"] = {"coefficient": 0.1}
    for limit in (3.0, [0.0, 3.0]):
        good = cabled(raw, actuator={"force_limit": limit, "gear": 14.0, "rotor_inertia": 1e-6})
        assert accepts(good, schema)
        from_data(good)
    for wrong in (-1.0, [1.0], [1.0, 2.0, 3.0], "3"):
        assert not accepts(cabled(raw, actuator={"force_limit": wrong}), schema)
    assert not accepts(cabled(raw, rod=ROD), schema)
    raw["contact"][0]["friction"] = {"coefficient": -0.1}
    assert not accepts(raw, schema)


# -- Limits ----------------------------------------------------------------------------------------


def test_use_and_text_of_limits() -> None:
    both, pull, more = Limits(-3.0, 3.0, INF), Limits(0.0, 190.4, 0.1), Limits(5.0, INF, INF)
    free = Limits(-INF, INF, INF)
    assert (both.use(-1.5), pull.use(95.2), pull.use(0.0), pull.use(-1.0)) == (0.5, 0.5, 0.0, INF)
    assert more.use(50.0) is None and free.use(-1.0) is None
    assert [one.effort_text("N") for one in (both, pull, more, free)] == [
        "±3 N",
        "0 to 190.4 N",
        "at least 5 N",
        "",
    ]
    assert Limits(-INF, 2.0, INF).effort_text("N") == "at most 2 N"
    np.testing.assert_array_equal(
        pull.beyond(np.array([-1.0, 0.0, 190.4, 191.0, NAN])), [True, False, False, True, False]
    )
    assert (pull.greatest, pull.symmetric, both.symmetric) == (190.4, False, True)
    assert [one.limited for one in (both, pull, more, free)] == [True, True, True, False]
    assert pull.of_speed[:2] == (-0.1, 0.1)


def test_bundled_limits() -> None:
    assert limits(condyle.load_mechanism("hexaglide").chains[0]) == (-200.0, 200.0, 1.5)
    assert limits(condyle.load_mechanism("gough-stewart").chains[0]) == (-INF, INF, INF)
