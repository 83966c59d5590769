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
NAN, GONE = math.nan, object()


def spoil(raw: Raw, path: str, value: Any) -> None:
    """Put a value at a path such as chain.0.base.1; `GONE` takes away, a function edits itself."""
    if callable(value):
        value(raw)
        return
    node: Any = raw
    *way, last = (int(key) if key.isdigit() else key for key in path.split("."))
    for key in way:
        node = node[key]
    if value is GONE:
        del node[last]
    else:
        node[last] = value


def tilted(degrees: float) -> Callable[[Raw], None]:
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


def lowered(millimetres: float) -> Callable[[Raw], None]:
    """Lower the first contact's plane, measured along its normal."""

    def edit(raw: Raw) -> None:
        surface = raw["contact"][0]["surface"]
        surface["offset"] -= millimetres * math.hypot(*surface["slope"], 1)

    return edit


def chains(count: int, contacts: bool = True) -> Callable[[Raw], None]:
    def edit(raw: Raw) -> None:
        raw["chain"] = raw["chain"][:count]
        if not contacts:
            del raw["contact"]

    return edit


def copied(source: str, target: str) -> Callable[[Raw], None]:
    """One point of the first chain is also another."""
    return lambda raw: raw["chain"][0].update({target: list(raw["chain"][0][source])})


LEVEL = {"kind": "plane", "slope": [0, 0], "offset": 0}
SIX = [{"name": f"c{i}", "point": [30 * i, 7 * i * i % 5, 0], "surface": LEVEL} for i in range(6)]
POINT = [-26.65, 72, 42.53]  # of the first contact
TEMPORALIS, LEFT = 'chain "temporalis_left"', 'contact "left_condyle"'
BROKEN: list[tuple[str, Any, str]] = [
    ("colour", 1, "colour: is not a key"),
    ("platform.colour", 1, "platform.colour: is not"),
    ("chain.0.colour", 1, f"{TEMPORALIS}.colour: is not a key"),
    ("chain.0.actuator.force_limit", 1, "force_limit: is not"),
    ("platform.mass", GONE, "platform.mass: is missing"),
    ("chain.0.kind", GONE, f"{TEMPORALIS}: the key `kind` is missing"),
    ("chain.0.kind", "RSR", f"{TEMPORALIS}: the kind 'RSR' is unknown"),
    ("contact.0.surface.kind", "plain", "'plain' is unknown"),
    ("chain", GONE, "chain: is missing"),
    ("name", GONE, "name: is missing"),
    ("name", 3, "name: expected text"),
    ("chain.0.name", "a,b", "name has no comma"),
    ("chain.1.name", "temporalis_left", '"temporalis_left" is given 2'),
    ("contact.1.name", "left_condyle", '"left_condyle" is given 2'),
    ("platform.mass", NAN, "platform.mass: expected a finite number"),
    ("chain.0.base.1", NAN, f"{TEMPORALIS}.base[1]: expected a finite"),
    ("platform.mass", "0.2", "platform.mass: expected a number, got '0.2'"),
    ("chain.0.base", [1.0, 2.0], f"{TEMPORALIS}.base[2]: is missing"),
    ("length_unit", "cm", 'length_unit: expected "m" or "mm", got'),
    ("crank", copied("base", "crank_tip"), "zero length"),
    ("coupler", copied("crank_tip", "platform"), "zero length"),
    ("chain.0.axis", [0, 0, 0], f"{TEMPORALIS}.axis: a direction cannot be"),
    ("axis", tilted(0.6), "axis is 0.60 degrees off the perpendicular"),
    ("axis", tilted(-0.6), "axis is 0.60 degrees off the perpendicular"),
    ("stretched", in_line(1), "crank and coupler are in line at home"),
    ("folded", in_line(-1), "crank and coupler are in line at home"),
    ("platform.mass", -0.2, "platform.mass: expected a value above"),
    ("platform.mass", 0.0, "platform.mass: expected a value above"),
    ("chain.0.coupler.com", -0.01, f"{TEMPORALIS}.coupler.com"),
    ("chain.0.coupler.axial", -1e-9, f"{TEMPORALIS}.coupler.axial"),
    ("surface", lowered(-0.02), "-0.02 mm off the surface at home"),
    ("chain.0.coupler.mass", -1e-9, f"{TEMPORALIS}.coupler.mass"),
    ("chain.0.crank.inertia", 0.0, f"{TEMPORALIS}.crank.inertia"),
    ("chain.0.coupler.com", 1.01, f"{TEMPORALIS}.coupler.com"),
    ("chain.0.coupler.axial", 2e-6, "more than twice transverse"),
    ("platform.inertia.zz", 217.5e-6, "largest principal moment"),
    ("platform.inertia.yz", 45e-6, "largest principal moment"),  # turned
    ("platform.inertia.xy", 110e-6, "positive definite"),
    ("platform.inertia.xx", -1e-6, "platform.inertia.xx"),
    ("surface", lowered(0.02), "+0.02 mm off the surface at home"),
    ("contact.1.point", POINT, "cannot hold the platform"),
    ("chains", chains(3), "3 actuators cannot drive 4 degrees of freedom"),
    ("chains", chains(5, contacts=False), "5 actuators cannot"),
    ("contact", SIX, "contact: expected at most 5"),
    ("dependent", ["Z", "delta"], "dependent[1]: expected"),
    ("dependent", ["Z", "Z"], "dependent: a coordinate is given"),
    ("dependent", ["Z"], "dependent: names 1 coordinates"),
    ("dependent", ["Z", "Y"], "do not determine Z, Y"),
    ("contact.0.bounds.x", [2, 1], "lower < upper"),
    ("contact.0.bounds.x", [12.5, -33], "got [12.5, -33] mm"),
    ("chain.0.actuator.torque_limit", 0, f"{TEMPORALIS}.actuator.torq"),
    # Out of all proportion.
    ("platform.mass", 1e200, "expected at most 1e+06 kg, got 1e+200"),
    ("platform.mass", 1e-200, "expected at least 1e-18 kg"),
    ("platform.inertia.xx", 1e200, "at most 1e+06 kg m^2"),
    ("chain.0.crank.inertia", 1e7, "at most 1e+06 kg m^2"),
    ("platform.points.incisor.0", 1e9, "at most 1e+08 mm"),
    ("contact.0.surface.offset", 1e200, "at most 1e+08 mm"),
    ("platform.inertia.xy", -1e200, "at most 1e+06 kg m^2"),
    ("chain.0.coupler.mass", 1e7, "at most 1e+06 kg"),
    ("chain.0.coupler.axial", 1e-300, "at least 1e-18 kg m^2"),
    ("chain.0.base.1", -1e200, "at most 1e+08 mm, got -1e+200"),
    ("contact.0.surface.slope.0", 1e200, "at most 1e+06"),
    ("contact.0.ball_radius", 1e-200, "at least 1e-06 mm"),
    ("chain.0.axis", [0, 1e-200, 0], "an entry of at least 1e-06"),
    ("gravity", [0, 0, -1e200], "at most 1e+06 m/s^2"),
    ("chain.0.actuator.torque_limit", 1e200, "at most 1e+12"),
    ("contact.0.bounds.x", [0, 1e200], "at most 1e+08 mm"),
]


@pytest.mark.parametrize(("path", "value", "expected"), BROKEN)
def test_a_broken_rule_is_named(raw: Raw, path: str, value: Any, expected: str) -> None:
    spoil(raw, path, value)
    with pytest.raises(MechanismError) as caught:
        from_data(raw, "jaw.toml")
    (problem,) = caught.value.problems
    assert expected in problem
    assert str(caught.value) == f"jaw.toml: 1 problem\n  - {problem}"


MASSLESS = {"mass": 0, "com": 0, "transverse": 0, "axial": 0}


@pytest.mark.parametrize(
    "changes",
    [
        {f"{key}": GONE for key in ("gravity", "contact.0.bounds", "platform.points")},
        {"chain.0.actuator": GONE, "contact.1.bounds.y": GONE},
        {f"chain.{i}.coupler": MASSLESS for i in range(6)},
        {"platform.mass": 1},
        {"axis": tilted(0.4)},
        {"axis": tilted(-0.4)},
        {"surface": lowered(0.005)},
        {"chain.0.coupler.transverse": 1e-7, "chain.0.coupler.axial": 2e-7},
        {"platform.inertia.zz": 217.4e-6},
        {"chains": chains(4)},
        {"dependent": ["X", "alpha"]},
        {"contact": [], "dependent": []},
        {"chain.0.name": "left_condyle"},
        {"chain.0.name": "咬肌 ó"},
        {"name": "n" * 80},
    ],
    ids=lambda changes: next(iter(changes)),
)
def test_what_the_format_allows_is_accepted(raw: Raw, changes: Raw) -> None:
    for path, value in changes.items():
        spoil(raw, path, value)
    assert isinstance(from_data(raw), Mechanism)


def test_every_problem_is_listed_at_once(raw: Raw) -> None:
    """Rules of entries, of tables, of the whole and of the geometry, in one go; no consequences."""
    edits = [
        ("colour", 1, "colour: is not a key"),
        ("platform.mass", -0.2, "platform.mass: expected a value above"),
        ("platform.inertia.zz", 217.5e-6, "largest principal moment"),
        ("axis", tilted(0.6), "axis is 0.60 degrees off the perpendicular"),
        ("chain.0.coupler.axial", 2e-6, "more than twice transverse"),
        ("chain.1.name", "temporalis_left", '"temporalis_left" is given 2'),
        ("contact.1.point", POINT, "cannot hold the platform"),
        ("chain.2.base.0", NAN, "base[0]: expected a finite"),
    ]
    for path, value, _ in edits:
        spoil(raw, path, value)
    with pytest.raises(MechanismError) as caught:
        from_data(raw, "jaw.toml")
    problems = caught.value.problems
    for *_, expected in edits:
        assert sum(expected in p for p in problems) == 1, (expected, problems)
    assert len(problems) == len(edits) == str(caught.value).count("\n  - ")


SPOILS = ("text", -1, 1e300, NAN, [], [[]], {"kind": []}, 10**400)


def paths(node: Any, path: str = "") -> list[str]:
    """Every place in the tables; of the chains and contacts, only the first."""
    children: list[tuple[Any, Any]] = []
    if isinstance(node, dict):
        children = list(node.items())
    elif isinstance(node, list):
        children = list(enumerate(node[:1] if path in ("chain", "contact") else node))
    inner = [place for key, child in children for place in paths(child, f"{path}.{key}".strip("."))]
    return [path] * bool(path) + inner


def test_nothing_in_a_file_can_crash_the_reader(raw: Raw) -> None:
    """Whatever stands at whatever place: a mechanism or a list of problems."""
    refused = 0
    with np.errstate(all="ignore"):
        for path, value in [(p, v) for p in paths(raw) for v in SPOILS][::3]:
            spoiled = copy.deepcopy(raw)
            spoil(spoiled, path, value)
            try:
                from_data(spoiled)
            except MechanismError as error:
                refused += 1
                assert all(len(line) < 400 for line in error.problems)
    assert refused > 160
