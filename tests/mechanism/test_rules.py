"""Every rule of the file format: a file that breaks one is told so, by name, and once."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from condyle import MechanismError
from condyle.mechanism import Mechanism
from condyle.mechanism.files import from_data

Raw = dict[str, Any]
NAN, INF = math.nan, math.inf


def put(*path: Any, value: Any) -> Callable[[Raw], None]:
    """An edit that sets one entry, such as put("chain", 0, "name", value="x")."""

    def edit(raw: Raw) -> None:
        node = raw
        for key in path[:-1]:
            node = node[key]
        node[path[-1]] = value

    return edit


def drop(*path: Any) -> Callable[[Raw], None]:
    def edit(raw: Raw) -> None:
        node = raw
        for key in path[:-1]:
            node = node[key]
        del node[path[-1]]

    return edit


def tilt_axis(degrees: float) -> Callable[[Raw], None]:
    """Turn the first shaft towards its crank."""

    def edit(raw: Raw) -> None:
        chain = raw["chain"][0]
        crank = np.subtract(chain["crank_tip"], chain["base"])
        crank /= np.linalg.norm(crank)
        axis = np.array(chain["axis"], float)
        axis -= crank * (axis @ crank)
        axis /= np.linalg.norm(axis)
        angle = math.radians(degrees)
        chain["axis"] = list(axis * math.cos(angle) + crank * math.sin(angle))

    return edit


def in_line(sign: float) -> Callable[[Raw], None]:
    """Lay the first coupler on the line of its crank."""

    def edit(raw: Raw) -> None:
        chain = raw["chain"][0]
        base, tip = (np.array(chain[key], float) for key in ("base", "crank_tip"))
        chain["platform"] = list(tip + sign * 2.5 * (tip - base))

    return edit


def off_surface(millimetres: float) -> Callable[[Raw], None]:
    """Lower the first contact's plane, measured along its normal."""

    def edit(raw: Raw) -> None:
        surface = raw["contact"][0]["surface"]
        surface["offset"] -= millimetres * math.hypot(*surface["slope"], 1)

    return edit


def coincide(raw: Raw) -> None:
    raw["contact"][1]["point"] = list(raw["contact"][0]["point"])


def contacts(count: int) -> list[Raw]:
    level = {"kind": "plane", "slope": [0, 0], "offset": 0}
    points = [[30 * i, (7 * i * i) % 5, 0] for i in range(count)]
    return [{"name": f"c{i}", "point": p, "surface": level} for i, p in enumerate(points)]


def keep_chains(count: int) -> Callable[[Raw], None]:
    return lambda raw: raw.update(chain=raw["chain"][:count])


def first(*path: Any, value: Any) -> Callable[[Raw], None]:
    return put("chain", 0, *path, value=value)


TEMPORALIS = 'chain "temporalis_left"'
LEFT = 'contact "left_condyle"'
BROKEN: dict[str, tuple[Callable[[Raw], None], str]] = {
    "unknown key": (put("colour", value=1), "colour: is not a key"),
    "unknown key in platform": (put("platform", "colour", value=1), "platform.colour: is not"),
    "unknown key in a chain": (first("colour", value=1), f"{TEMPORALIS}.colour: is not a key"),
    "unknown key in a rod": (first("coupler", "x", value=1), f"{TEMPORALIS}.coupler.x: is not"),
    "unknown key in bounds": (put("contact", 0, "bounds", "r", value=1), f"{LEFT}.bounds.r: is"),
    "name of Python": (put("chains", value=[]), "chains: is not a key"),
    "missing key": (drop("platform", "mass"), "platform.mass: is missing"),
    "missing kind": (drop("chain", 0, "kind"), f"{TEMPORALIS}: the key `kind` is missing"),
    "unknown family": (first("kind", value="RSR"), f"{TEMPORALIS}: the kind 'RSR' is unknown"),
    "unknown surface": (put("contact", 0, "surface", "kind", value="plain"), "'plain' is unknown"),
    "no chains": (drop("chain"), "chain: is missing"),
    "no platform": (drop("platform"), "platform: is missing"),
    "no name": (drop("name"), "name: is missing"),
    "empty name": (put("name", value=""), "name"),
    "name with a comma": (first("name", value="a,b"), "name has no comma"),
    "same chain names": (
        put("chain", 1, "name", value="temporalis_left"),
        '"temporalis_left" is given 2',
    ),
    "same contact names": (
        put("contact", 1, "name", value="left_condyle"),
        '"left_condyle" is given 2',
    ),
    "nan": (put("platform", "mass", value=NAN), "platform.mass: expected a finite number"),
    "inf": (put("gravity", 2, value=-INF), "gravity[2]: expected a finite number"),
    "nan in a point": (first("base", 1, value=NAN), f"{TEMPORALIS}.base[1]: expected a finite"),
    "text": (put("platform", "mass", value="0.2"), "platform.mass: expected a number, got '0.2'"),
    "truth": (put("platform", "mass", value=True), "platform.mass: expected a number"),
    "number as name": (put("name", value=3), "name: expected text"),
    "two coordinates": (first("base", value=[1.0, 2.0]), f"{TEMPORALIS}.base[2]: is missing"),
    "unit": (put("length_unit", value="cm"), 'length_unit: expected "m" or "mm", got'),
    "list as unit": (put("length_unit", value=["mm"]), 'length_unit: expected "m" or "mm", got'),
    "zero crank": (lambda r: first("crank_tip", value=r["chain"][0]["base"])(r), "zero length"),
    "zero coupler": (lambda r: first("platform", value=r["chain"][0]["crank_tip"])(r), "zero leng"),
    "zero axis": (first("axis", value=[0, 0, 0]), f"{TEMPORALIS}.axis: a direction cannot be"),
    "axis off": (tilt_axis(0.6), "axis is 0.60 degrees off the perpendicular"),
    "axis off, other way": (tilt_axis(-0.6), "axis is 0.60 degrees off the perpendicular"),
    "in line, stretched": (in_line(1), "crank and coupler are in line at home"),
    "in line, folded": (in_line(-1), "crank and coupler are in line at home"),
    "negative mass": (put("platform", "mass", value=-0.2), "platform.mass: expected a value above"),
    "zero mass": (put("platform", "mass", value=0.0), "platform.mass: expected a value above"),
    "negative rod mass": (first("coupler", "mass", value=-1e-9), f"{TEMPORALIS}.coupler.mass"),
    "negative rod inertia": (first("coupler", "axial", value=-1e-9), f"{TEMPORALIS}.coupler.axial"),
    "no crank inertia": (first("crank", "inertia", value=0.0), f"{TEMPORALIS}.crank.inertia"),
    "com beyond the rod": (first("coupler", "com", value=1.01), f"{TEMPORALIS}.coupler.com"),
    "com before the rod": (first("coupler", "com", value=-0.01), f"{TEMPORALIS}.coupler.com"),
    "rod triangle": (first("coupler", "axial", value=2e-6), "more than twice transverse"),
    "triangle": (put("platform", "inertia", "zz", value=217.5e-6), "largest principal moment"),
    "triangle, turned": (put("platform", "inertia", "yz", value=45e-6), "largest principal moment"),
    "not positive": (put("platform", "inertia", "xy", value=110e-6), "positive definite"),
    "negative moment": (put("platform", "inertia", "xx", value=-1e-6), "platform.inertia.xx"),
    "off surface": (off_surface(0.02), "+0.02 mm off the surface at home"),
    "off surface, below": (off_surface(-0.02), "-0.02 mm off the surface at home"),
    "contacts coincide": (coincide, "cannot hold the platform"),
    "too few chains": (keep_chains(3), "3 actuators cannot drive 4 degrees of freedom"),
    "too few for six": (lambda r: (drop("contact")(r), keep_chains(5)(r)), "5 actuators cannot"),
    "too many contacts": (lambda r: r.update(contact=contacts(6)), "contact: expected at most 5"),
    "dependent unknown": (put("dependent", value=["Z", "delta"]), "dependent[1]: expected"),
    "dependent twice": (
        put("dependent", value=["Z", "Z"]),
        "dependent: a coordinate is given",
    ),
    "dependent too few": (put("dependent", value=["Z"]), "dependent: names 1 coordinates"),
    "dependent not held": (put("dependent", value=["Z", "Y"]), "do not determine Z, Y"),
    "bounds reversed": (put("contact", 0, "bounds", "x", value=[2, 1]), "lower < upper"),
    "no torque limit": (first("actuator", "torque_limit", value=0), f"{TEMPORALIS}.actuator.torq"),
    "force limit on a crank": (first("actuator", "force_limit", value=1), "force_limit: is not"),
}


@pytest.mark.parametrize("case", BROKEN)
def test_a_broken_rule_is_named(raw: Raw, case: str) -> None:
    edit, expected = BROKEN[case]
    edit(raw)
    with pytest.raises(MechanismError) as caught:
        from_data(raw, "jaw.toml")
    (problem,) = caught.value.problems
    assert expected in problem
    assert str(caught.value) == f"jaw.toml: 1 problem\n  - {problem}"


ALLOWED: dict[str, Callable[[Raw], None]] = {
    "without gravity, bounds, actuators, points": lambda r: (
        drop("gravity")(r),
        drop("contact", 0, "bounds")(r),
        drop("chain", 0, "actuator")(r),
        drop("platform", "points")(r),
    ),
    "one bound": drop("contact", 0, "bounds", "y"),
    "rods without mass": lambda r: [
        c.update(coupler={"mass": 0, "com": 0, "transverse": 0, "axial": 0}) for c in r["chain"]
    ],
    "whole numbers": put("platform", "mass", value=1),
    "axis nearly off": tilt_axis(0.4),
    "axis nearly off, other way": tilt_axis(-0.4),
    "off surface a little": off_surface(0.005),
    "rod triangle at its limit": lambda r: r["chain"][0]["coupler"].update(
        transverse=1e-7, axial=2e-7
    ),
    "triangle at its limit": put("platform", "inertia", "zz", value=217.4e-6),
    "four chains": keep_chains(4),
    "other dependents": put("dependent", value=["X", "alpha"]),
    "no dependents of no contacts": lambda r: (drop("contact")(r), put("dependent", value=[])(r)),
    "same name in two kinds": put("chain", 0, "name", value="left_condyle"),
    "letters of any alphabet": put("chain", 0, "name", value="咬肌 ó"),
}


@pytest.mark.parametrize("case", ALLOWED)
def test_what_the_format_allows_is_accepted(raw: Raw, case: str) -> None:
    ALLOWED[case](raw)
    assert isinstance(from_data(raw), Mechanism)


def test_every_problem_is_listed_at_once(raw: Raw) -> None:
    """Rules of entries, of tables, of the whole and of the geometry, in one go."""
    independent = ["unknown key", "negative mass", "triangle", "axis off", "rod triangle"]
    independent += ["same chain names", "contacts coincide"]
    for case in independent:
        BROKEN[case][0](raw)
    put("chain", 2, "base", 0, value=NAN)(raw)
    with pytest.raises(MechanismError) as caught:
        from_data(raw, "jaw.toml")
    problems = caught.value.problems
    for expected in [BROKEN[case][1] for case in independent] + ["base[0]: expected a finite"]:
        assert sum(expected in p for p in problems) == 1, (expected, problems)
    assert len(problems) == len(independent) + 1
    assert str(caught.value).count("\n  - ") == len(problems)


SPOILS = ("text", -1, 1e300, NAN, [], [[]], {"kind": []}, 10**400)


def paths(node: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Every place in the tables; of the chains and contacts, only the first."""
    found = [path] if path else []
    if isinstance(node, dict):
        children = list(node.items())
    elif isinstance(node, list):
        children = list(enumerate(node[:1] if path in (("chain",), ("contact",)) else node))
    else:
        children = []
    for key, child in children:
        found += paths(child, (*path, key))
    return found


def test_nothing_in_a_file_can_crash_the_reader(raw: Raw) -> None:
    """Whatever stands at whatever place: a mechanism or a list of problems."""
    refused = 0
    with np.errstate(all="ignore"):
        for path in paths(raw):
            for value in SPOILS:
                spoiled = copy.deepcopy(raw)
                put(*path, value=value)(spoiled)
                try:
                    from_data(spoiled)
                except MechanismError as error:
                    refused += 1
                    assert all(len(line) < 400 for line in error.problems)
    assert refused > 500
