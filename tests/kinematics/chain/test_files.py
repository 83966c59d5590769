"""The tables of rails, legs and cables: what they mean, and what is wrong with others."""

from __future__ import annotations

import copy
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from support.families import MECHANISMS, MIXED, WITH_CABLES, case

import condyle
from condyle.errors import MechanismError
from condyle.kinematics.chain import FAMILIES
from condyle.mechanism import dumps, json_schema, parse
from condyle.mechanism.files import from_data

Change = Callable[[dict[str, Any]], None]


def tables() -> dict[str, Any]:
    """A mechanism with a chain of each family, in mm: chains 0 RSS, 1 PSS, 2 SPS, 3 cable."""
    raw = copy.deepcopy(case("every_family").raw)
    one = {kind: next(c for c in raw["chain"] if c["kind"] == kind) for kind in (*MIXED, "cable")}
    rest = [c for c in raw["chain"] if c not in one.values()]
    raw["chain"] = [*one.values(), *rest]
    return raw


def chain(raw: dict[str, Any], kind: str) -> dict[str, Any]:
    return next(c for c in raw["chain"] if c["kind"] == kind)


def test_lengths_become_metres_and_fractions_stay() -> None:
    raw = tables()
    mechanism = from_data(raw)
    slider, leg = mechanism.chains[1], mechanism.chains[2]
    np.testing.assert_allclose(slider.base, np.array(chain(raw, "PSS")["base"]) / 1000)
    assert slider.rod.com == chain(raw, "PSS")["rod"]["com"]
    assert leg.cylinder.com == pytest.approx(chain(raw, "SPS")["cylinder"]["com"] / 1000)
    assert leg.piston.transverse == chain(raw, "SPS")["piston"]["transverse"]


@pytest.mark.parametrize("name", [*MECHANISMS, *WITH_CABLES])
def test_round_trip(name: str) -> None:
    mechanism = case(name).mechanism
    assert parse(dumps(mechanism)) == mechanism


@pytest.mark.parametrize("name", ["gough-stewart", "hexaglide"])
def test_bundled_files(name: str) -> None:
    mechanism = condyle.load_mechanism(name)
    assert parse(dumps(mechanism)) == mechanism
    assert name in condyle.bundled_mechanisms()


def put(kind: str, *path: str, value: Any) -> Change:
    def change(raw: dict[str, Any]) -> None:
        table = chain(raw, kind)
        for key in path[:-1]:
            table = table[key]
        table[path[-1]] = value

    return change


def drop(kind: str, key: str) -> Change:
    return lambda raw: chain(raw, kind).pop(key)


def upright(raw: dict[str, Any]) -> None:
    table = chain(raw, "PSS")
    rod = np.subtract(table["platform"], table["base"])
    table["axis"] = np.cross(rod, [0.3, -0.8, 0.4]).tolist()


PROBLEMS: dict[str, tuple[Change, str]] = {
    "rail across rod": (upright, "the rod is perpendicular to the rail at home"),
    "no rail": (drop("PSS", "axis"), "axis: is missing"),
    "zero rail": (put("PSS", "axis", value=[0, 0, 0]), "a direction cannot be the zero vector"),
    "no slider": (drop("PSS", "slider"), "slider: is missing"),
    "negative slider": (put("PSS", "slider", "mass", value=-1), "slider.mass: expected a value"),
    "com outside the rod": (put("PSS", "rod", "com", value=1.2), "rod.com: expected a value of at"),
    "impossible rod": (put("PSS", "rod", "axial", value=1.0), "no rigid body has such moments"),
    "crank of a slider": (put("PSS", "crank", value={"inertia": 1.0}), "is not a key of the file"),
    "torque of a slider": (
        put("PSS", "actuator", value={"torque_limit": 3}),
        "torque_limit: is not a key",
    ),
    "no cylinder": (drop("SPS", "cylinder"), "cylinder: is missing"),
    "com behind the joint": (put("SPS", "piston", "com", value=-3), "piston.com: expected a value"),
    "impossible piston": (put("SPS", "piston", "axial", value=1.0), "no rigid body has such"),
    "infinite mass": (put("SPS", "cylinder", "mass", value=float("inf")), "expected a finite"),
    "axis of a leg": (put("SPS", "axis", value=[0, 0, 1]), "axis: is not a key of the file"),
    "mass of a cable": (put("cable", "mass", value=0.1), "mass: is not a key of the file"),
    "unknown kind": (put("SPS", "kind", value="SPR"), "'SPR' is unknown. Did you mean"),
}


@pytest.mark.parametrize("problem", PROBLEMS)
def test_problems_are_named(problem: str) -> None:
    change, message = PROBLEMS[problem]
    raw = tables()
    change(raw)
    with pytest.raises(MechanismError, match="chain") as caught:
        from_data(raw)
    assert message in str(caught.value)


@pytest.mark.parametrize("kind", ["PSS", "SPS", "cable"])
def test_zero_length(kind: str) -> None:
    raw = tables()
    table = chain(raw, kind)
    table["base"] = table["platform"]
    with pytest.raises(MechanismError, match="zero length: base and platform are the same point"):
        from_data(raw)


def test_massless_links_are_allowed() -> None:
    raw = tables()
    nothing = {"mass": 0, "transverse": 0, "axial": 0}
    for kind, bodies in (("PSS", ("rod",)), ("SPS", ("cylinder", "piston"))):
        for body in bodies:
            chain(raw, kind)[body] |= nothing
    raw["chain"] = [c for c in raw["chain"] if c["kind"] != "cable"]  # never has a mass
    mechanism = from_data(raw)
    q = np.zeros((1, 4))
    model = condyle.derive(mechanism, backend="numpy")
    assert np.isfinite(model.inverse_dynamics(q, q, q).effort).all()


def test_schema_knows_every_family() -> None:
    text = str(json_schema())
    assert all(f"'const': '{kind}'" in text for kind in FAMILIES)
