"""Every rule of the file format: a file that breaks one is told so, by name, and once."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from support.families import case

from condyle import MechanismError
from condyle.mechanism import Mechanism
from condyle.mechanism.files import from_data

Raw = dict[str, Any]
Rows = list[tuple[str, Any, str]]
NAN, INF, GONE = math.nan, math.inf, object()


def spoiled(raw: Raw, *changes: tuple[str, Any]) -> Raw:
    """A copy with values at paths such as chain.0.base.1; `GONE` takes away, a function edits."""
    raw = copy.deepcopy(raw)
    for path, value in changes:
        if callable(value):
            value(raw)
            continue
        node: Any = raw
        *way, last = (int(key) if key.isdigit() else key for key in path.split("."))
        for key in way:
            node = node[key]
        node.pop(last) if value is GONE else node.__setitem__(last, value)
    return raw


def problems(raw: Raw) -> tuple[str, ...]:
    with pytest.raises(MechanismError) as caught:
        from_data(raw, "jaw.toml")
    found = tuple(caught.value.problems)
    head = f"jaw.toml: {len(found)} problem{'s' * (len(found) > 1)}"
    assert str(caught.value) == "\n  - ".join([head, *found])
    return found


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
        base, tip = (np.array(raw["chain"][0][key], float) for key in ("base", "crank_tip"))
        raw["chain"][0]["platform"] = list(tip + sign * 2.5 * (tip - base))

    return edit


def lowered(millimetres: float) -> Callable[[Raw], None]:
    """Lower the first contact's plane, measured along its normal."""

    def edit(raw: Raw) -> None:
        surface = raw["contact"][0]["surface"]
        surface["offset"] -= millimetres * math.hypot(*surface["slope"], 1)

    return edit


def chains(count: int, contacts: bool = True) -> Callable[[Raw], None]:
    return lambda raw: raw.update(chain=raw["chain"][:count], **({} if contacts else NO_CONTACT))


def copied(source: str, target: str) -> Callable[[Raw], None]:
    """One point of the first chain is also another."""
    return lambda raw: raw["chain"][0].update({target: list(raw["chain"][0][source])})


NO_CONTACT: Raw = {"contact": []}
LEVEL = {"kind": "plane", "slope": [0, 0], "offset": 0}
SIX = [{"name": f"c{i}", "point": [30 * i, 7 * i * i % 5, 0], "surface": LEVEL} for i in range(6)]
POINT = [-26.65, 72, 42.53]  # of the first contact
TEMPORALIS = 'chain "temporalis_left"'
# What an editor sees by the schema, too.
SEEN: Rows = [
    ("colour", 1, "colour: is not a key"),
    ("platform.colour", 1, "platform.colour: is not"),
    ("chain.0.colour", 1, f"{TEMPORALIS}.colour: is not a key"),
    ("chain.0.actuator.force_limit", 1, "force_limit: is not"),
    ("platform.mass", GONE, "platform.mass: is missing"),
    ("chain.0.kind", GONE, f"{TEMPORALIS}: the key `kind` is missing"),
    ("chain.0.kind", "RSR", f"{TEMPORALIS}: the kind 'RSR' is unknown"),
    ("contact.0.surface.kind", "plain", "'plain' is unknown"),
    ("contact.0.friction", {"coefficient": -0.1}, "friction.coefficient"),
    ("chain", GONE, "chain: is missing"),
    ("name", 3, "name: expected text"),
    ("platform.mass", "0.2", "platform.mass: expected a number, got '0.2'"),
    ("platform.mass", 0.0, "platform.mass: expected a value above"),
    ("platform.inertia.zx", 0.0, "platform.inertia.zx: is not a key"),
    ("chain.0.base", [1.0, 2.0], f"{TEMPORALIS}.base[2]: is missing"),
    ("length_unit", "cm", 'length_unit: expected "m" or "mm", got'),
    ("chain.0.coupler.com", 1.01, f"{TEMPORALIS}.coupler.com"),
    ("chain.0.coupler.com", -0.01, f"{TEMPORALIS}.coupler.com"),
    ("contact", SIX, "contact: expected at most 5"),
    ("dependent", ["Z", "delta"], "dependent[1]: expected"),
]
UNSEEN: Rows = [
    ("chain.0.name", "a,b", "name has no comma"),
    ("chain.1.name", "temporalis_left", '"temporalis_left" is given 2'),
    ("contact.1.name", "left_condyle", '"left_condyle" is given 2'),
    ("chain.0.base.1", NAN, f"{TEMPORALIS}.base[1]: expected a finite"),
    ("crank", copied("base", "crank_tip"), "zero length"),
    ("coupler", copied("crank_tip", "platform"), "zero length"),
    ("chain.0.axis", [0, 0, 0], f"{TEMPORALIS}.axis: a direction cannot be"),
    ("axis", tilted(0.6), "axis is 0.60 degrees off the perpendicular"),
    ("axis", tilted(-0.6), "axis is 0.60 degrees off the perpendicular"),
    ("stretched", in_line(1), "crank and coupler are in line at home"),
    ("folded", in_line(-1), "crank and coupler are in line at home"),
    ("chain.0.coupler.axial", 2e-6, "more than twice transverse"),
    ("platform.inertia.zz", 217.5e-6, "largest principal moment"),
    ("platform.inertia.yz", 45e-6, "largest principal moment"),  # turned
    ("platform.inertia.xy", 110e-6, "positive definite"),
    ("surface", lowered(0.02), "+0.02 mm off the surface at home"),
    ("surface", lowered(-0.02), "-0.02 mm off the surface at home"),
    ("contact.1.point", POINT, "cannot hold the platform"),
    ("chains", chains(3), "3 actuators cannot drive 4 degrees of freedom"),
    ("chains", chains(5, contacts=False), "5 actuators cannot"),
    ("dependent", ["Z", "Z"], "dependent: a coordinate is given"),
    ("dependent", ["Z"], "dependent: names 1 coordinates"),
    ("dependent", ["Z", "Y"], "do not determine Z, Y"),
    ("contact.0.bounds.x", [2, 1], "lower < upper"),
    ("contact.0.bounds.x", [12.5, -33], "got [12.5, -33] mm"),
    # Out of all proportion: one of each quantity and end.
    ("platform.mass", 1e200, "expected at most 1e+06 kg, got 1e+200"),
    ("platform.mass", 1e-200, "expected at least 1e-18 kg"),
    ("chain.0.coupler.mass", 1e7, "at most 1e+06 kg"),
    ("platform.inertia.xx", 1e200, "at most 1e+06 kg m^2"),
    ("platform.inertia.xy", -1e200, "at most 1e+06 kg m^2"),
    ("chain.0.coupler.axial", 1e-300, "at least 1e-18 kg m^2"),
    ("chain.0.base.1", -1e200, "at most 1e+08 mm, got -1e+200"),
    ("contact.0.surface.slope.0", 1e200, "at most 1e+06"),
    ("contact.0.ball_radius", 1e-200, "at least 1e-06 mm"),
    ("chain.0.axis", [0, 1e-200, 0], "an entry of at least 1e-06"),
    ("gravity", [0, 0, -1e200], "at most 1e+06 m/s^2"),
    ("chain.0.actuator.torque_limit", 1e200, "at most 1e+12"),
    ("contact.0.bounds.x", [0, 1e200], "at most 1e+08 mm"),
]


def test_a_broken_rule_is_named(raw: Raw) -> None:
    for path, value, expected in SEEN + UNSEEN:
        (problem,) = problems(spoiled(raw, (path, value)))
        assert expected in problem, path


NO_BODY, NOT_A_KEY = "no rigid body has such moments", "is not a key of the file"
ROD = {"mass": 0.1, "com": 0.5, "transverse": 0, "axial": 0}
TABLES: list[tuple[str, Raw, str]] = [
    ("PSS", {"axis": "across"}, "the rod is perpendicular to the rail at home"),
    ("PSS", {"axis": GONE}, "axis: is missing"),
    ("PSS", {"slider": {"mass": -1}}, "slider.mass: expected a value"),
    ("PSS", {"rod": ROD | {"com": 1.2}}, "rod.com: expected a value of at"),
    ("PSS", {"rod": ROD | {"axial": 1.0}}, NO_BODY),
    ("PSS", {"crank": {"inertia": 1.0}}, NOT_A_KEY),
    ("PSS", {"actuator": {"torque_limit": 3}}, "torque_limit: is not a key"),
    ("PSS", {"base": "platform"}, "zero length: base and platform"),
    ("SPS", {"cylinder": GONE}, "cylinder: is missing"),
    ("SPS", {"piston": ROD | {"com": -3}}, "piston.com: expected a value"),
    ("SPS", {"piston": ROD | {"axial": 1.0}}, NO_BODY),
    ("SPS", {"axis": [0, 0, 1]}, NOT_A_KEY),
    ("SPS", {"kind": "SPR"}, "'SPR' is unknown. Did you mean"),
    ("SPS", {"base": "platform"}, "zero length: base and platform"),
    ("cable", {"rod": ROD}, "has no rod;"),
    ("cable", {"coupler": ROD, "crank": {"inertia": 1}}, "has no coupler, crank;"),
    ("cable", {"cylinder": ROD, "piston": ROD}, "a cable is a massless line"),
    ("cable", {"slider": {"mass": 1}, "axis": [0, 0, 1]}, "has no slider, axis;"),
    ("cable", {"mass": 1}, ".mass: is not a key of the file format"),
    ("cable", {"base": "platform"}, "the cable has zero length"),
    ("cable", {"base": None}, ".base: expected a list"),
    ("cable", {"actuator": {"torque_limit": 1}}, "torque_limit: is not a key"),
    ("cable", {"actuator": {"force_limit": [-1, 5]}}, "a cable can only pull"),
    ("cable", {"actuator": {"force_limit": [-5, -1]}}, "a cable can only pull"),
    ("cable", {"actuator": {"force_limit": 0}}, "force_limit: expected a value above"),
    ("cable", {"actuator": {"force_limit": [5, 5]}}, "least < greatest"),
]


def test_each_family_has_rules_of_its_own() -> None:
    """A chain is told what it may not have, in one line that names it."""
    raw = case("every_family").raw
    for kind, changes, message in TABLES:
        found = copy.deepcopy(raw)
        chain = next(one for one in found["chain"] if one["kind"] == kind)
        for key, value in changes.items():
            if value == "across":
                rod = np.subtract(chain["platform"], chain["base"])
                value = np.cross(rod, [0.3, -0.8, 0.4]).tolist()
            value = chain["platform"] if isinstance(value, str) and value == "platform" else value
            chain.pop(key) if value is GONE else chain.update({key: value})
        (line,) = problems(found)
        assert line.startswith(f'chain "{chain["name"]}"') and message in line, (changes, line)


SPHERE = {"kind": "sphere", "centre": [0, 0, 0], "radius": 30}
PROFILE = {"kind": "profile", "direction": [1.0, 0.0], "points": [[0, 0], [1, 1], [2, 3]]}
ELLIPSOID = {"kind": "ellipsoid", "centre": [0, 0, 0], "semi_axes": [1, 2, 3]}
CYLINDER = {"kind": "cylinder", "point": [0, 0, 0], "axis": [0, 0, 0], "radius": 1}
TIGHT = {"kind": "quadratic", "offset": 38.53 + 0.2 * 26.65**2, "slope": [10.66, 0], "xx": 0.2}
SURFACE_RULES: list[tuple[dict[str, Any], dict[str, Any], str]] = [
    (SPHERE | {"radius": -1}, {}, "surface.radius: expected a value above"),
    (SPHERE | {"colour": 1}, {}, "surface.colour: is not a key"),
    ({"kind": "torus"}, {}, "'torus' is unknown. Available: coordinate, cylinder, ellipsoid"),
    ({"slope": [0, 0], "offset": 1}, {}, "`kind` is missing"),
    (SPHERE, {"side": "below"}, 'expected "inside" or "outside" for a sphere, got "below"'),
    (ELLIPSOID, {"side": "below"}, 'expected "inside" or "outside" for an ellipsoid'),
    (PROFILE, {"side": "inside"}, 'expected "below" or "above" for a profile, got "inside"'),
    (SPHERE, {"side": "left"}, "side: expected"),
    (SPHERE, {"ball_radius": 3}, "side is missing"),
    (SPHERE, {"one_sided": True}, "side is missing"),
    (SPHERE, {"one_sided": "yes", "side": "inside"}, "one_sided: expected true or false"),
    (SPHERE, {"ball_radius": -3, "side": "inside"}, "ball_radius: expected a value above"),
    (SPHERE, {"ball_radius": 30, "side": "inside"}, "no room inside a sphere of radius 30 mm"),
    (SPHERE | {"side": "inside"}, {"side": "inside"}, "is given twice: in [[contact]]"),
    (PROFILE | {"direction": [1.0, 0.1]}, {}, "direction: expected a unit vector"),
    (PROFILE | {"direction": [0.0, 0.6, 0.8]}, {}, "X-Y plane has no z"),
    (PROFILE | {"points": [[0, 0], [1, 1]]}, {}, "points: expected at least 3"),
    (PROFILE | {"points": [[0, 0], [1, 1], [1, 2]]}, {}, "s must rise"),
    (CYLINDER, {}, "zero"),
    (SPHERE, {}, "mm off the surface at home"),
    ({"kind": "coordinate", "axis": "u", "offset": 0}, {}, "axis: expected 'x', 'y' or 'z'"),
    (TIGHT, {"side": "above", "ball_radius": 4.0}, 'radius 4 mm on the side "above" cannot'),
]


def test_each_surface_has_rules_of_its_own(raw: Raw) -> None:
    for surface, options, message in SURFACE_RULES:
        contact = raw["contact"][0] | {"surface": surface, **options}
        found = problems(spoiled(raw, ("contact.0", contact)))
        assert any(p.startswith('contact "left_condyle"') and message in p for p in found), found


MASSLESS = {"mass": 0, "com": 0, "transverse": 0, "axial": 0}
ALLOWED: list[Raw] = [
    dict.fromkeys(("gravity", "contact.0.bounds", "platform.points", "chain.0.actuator"), GONE),
    {f"chain.{i}.coupler": MASSLESS for i in range(6)},
    {"platform.mass": 1, "contact.1.bounds.y": GONE},
    {"axis": tilted(0.4)},
    {"axis": tilted(-0.4)},
    {"surface": lowered(0.005)},
    {"chain.0.coupler.transverse": 1e-7, "chain.0.coupler.axial": 2e-7},
    {"platform.inertia.zz": 217.4e-6, "chains": chains(4)},
    {"dependent": ["X", "alpha"]},
    {"contact": [], "dependent": []},
    {"chain.0.name": "left_condyle", "chain.1.name": "咬肌 ó", "name": "n" * 80},
]


def test_what_the_format_allows_is_accepted(raw: Raw) -> None:
    for changes in ALLOWED:
        assert isinstance(from_data(spoiled(raw, *changes.items())), Mechanism)
    assert from_data(spoiled(raw, ("gravity", GONE))).gravity == (0.0, 0.0, -9.81)


def test_every_problem_is_listed_at_once(raw: Raw) -> None:
    """Rules of entries, of tables, of the whole and of the geometry, in one go; no consequences."""
    named = ("colour", "platform.mass", "platform.inertia.zz", "axis", "chain.1.name")
    edits = {row[0]: row for row in [*SEEN, *UNSEEN][::-1] if row[0] in named}
    edits["axial"] = ("chain.0.coupler.axial", 2e-6, "more than twice transverse")
    edits["point"] = ("contact.1.point", POINT, "cannot hold the platform")
    edits["base"] = ("chain.2.base.0", NAN, "base[0]: expected a finite")
    edits["platform.mass"] = ("platform.mass", -0.2, "platform.mass: expected a value above")
    found = problems(spoiled(raw, *(row[:2] for row in edits.values())))
    assert len(found) == len(edits) == 8
    for *_, expected in edits.values():
        assert sum(expected in p for p in found) == 1, (expected, found)
    every = spoiled(raw, *((f"chain.{k}.colour", 1) for k in range(6)))
    assert len(problems(every)) == 6  # none of what follows from them
    alone = raw | {"dependent": ["Z", "gamma"], "contact": raw["contact"][0]}  # [contact], once
    (line,) = problems(alone)
    assert line.startswith("contact: expected tables, each under [[contact]]")


SPOILS = ("text", -1, 1e300, NAN, [], [[]], {"kind": []}, 10**400)


def places(node: Any, path: str = "") -> Iterator[str]:
    """Every place in the tables; of the chains and contacts, only the first."""
    if path:
        yield path
    children = list(node.items() if isinstance(node, dict) else enumerate(node))
    for key, child in children[:1] if path in ("chain", "contact") else children:
        inside = places(child, f"{path}.{key}".strip("."))
        yield from inside if isinstance(child, dict | list) else [f"{path}.{key}".strip(".")]


def test_nothing_in_a_file_can_crash_the_reader(raw: Raw) -> None:
    """Whatever stands at whatever place: a mechanism or a list of problems."""
    refused = 0
    with np.errstate(all="ignore"):
        for change in [(path, value) for path in places(raw) for value in SPOILS][::5]:
            try:
                from_data(spoiled(raw, change))
            except MechanismError as error:
                refused += 1
                assert all(len(line) < 400 for line in error.problems)
    assert refused > 90
