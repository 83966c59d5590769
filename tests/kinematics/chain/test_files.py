"""The tables of rails and legs: what they mean, and what is wrong with others; their page."""

from __future__ import annotations

import copy
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.families import MIXED, case

import condyle
from condyle.errors import MechanismError
from condyle.kinematics.chain import FAMILIES
from condyle.mechanism.files import from_data
from condyle.questions.reactions import reaction_places

PAGE = Path(__file__).parents[3] / "docs" / "chains.md"
GONE = object()


@pytest.fixture
def tables() -> dict[str, Any]:
    """A mechanism with a chain of each family, in mm."""
    return copy.deepcopy(case("every_family").raw)


def chain(raw: dict[str, Any], kind: str) -> dict[str, Any]:
    return next(c for c in raw["chain"] if c["kind"] == kind)


def test_lengths_become_metres_and_fractions_stay(tables: dict[str, Any]) -> None:
    chains = {c.kind: c for c in from_data(tables).chains[::-1]}
    rail, leg = (chain(tables, kind) for kind in ("PSS", "SPS"))
    np.testing.assert_allclose(chains["PSS"].base, np.array(rail["base"]) / 1000)
    assert chains["PSS"].rod.com == rail["rod"]["com"]
    assert chains["SPS"].cylinder.com == pytest.approx(leg["cylinder"]["com"] / 1000)
    assert chains["SPS"].piston.transverse == leg["piston"]["transverse"]


NO_BODY, NOT_A_KEY = "no rigid body has such moments", "is not a key of the file"


@pytest.mark.parametrize(
    ("kind", "path", "value", "message"),
    [
        ("PSS", "axis", "upright", "the rod is perpendicular to the rail at home"),
        ("PSS", "axis", GONE, "axis: is missing"),
        ("PSS", "axis", [0, 0, 0], "a direction cannot be the zero vector"),
        ("PSS", "slider", GONE, "slider: is missing"),
        ("PSS", "slider.mass", -1, "slider.mass: expected a value"),
        ("PSS", "rod.com", 1.2, "rod.com: expected a value of at"),
        ("PSS", "rod.axial", 1.0, NO_BODY),
        ("PSS", "crank", {"inertia": 1.0}, NOT_A_KEY),
        ("PSS", "actuator", {"torque_limit": 3}, "torque_limit: is not a key"),
        ("SPS", "cylinder", GONE, "cylinder: is missing"),
        ("SPS", "piston.com", -3, "piston.com: expected a value"),
        ("SPS", "piston.axial", 1.0, NO_BODY),
        ("SPS", "cylinder.mass", float("inf"), "expected a finite"),
        ("SPS", "axis", [0, 0, 1], NOT_A_KEY),
        ("SPS", "kind", "SPR", "'SPR' is unknown. Did you mean"),
        *((kind, "base", "platform", "zero length: base and platform") for kind in MIXED[1:]),
    ],
)
def test_problems_are_named(
    tables: dict[str, Any], kind: str, path: str, value: Any, message: str
) -> None:
    table = chain(tables, kind)
    if value == "upright":
        value = np.cross(np.subtract(table["platform"], table["base"]), [0.3, -0.8, 0.4]).tolist()
    elif value == "platform":
        value = table["platform"]
    *way, last = path.split(".")
    for key in way:
        table = table[key]
    table.pop(last) if value is GONE else table.update({last: value})
    with pytest.raises(MechanismError, match="chain") as caught:
        from_data(tables)
    assert message in str(caught.value)


def test_massless_links_are_allowed(tables: dict[str, Any]) -> None:
    nothing = {"mass": 0, "transverse": 0, "axial": 0}
    for kind, bodies in (("PSS", ("rod",)), ("SPS", ("cylinder", "piston"))):
        for body in bodies:
            chain(tables, kind)[body] |= nothing
    tables["chain"] = [c for c in tables["chain"] if c["kind"] != "cable"]  # never has a mass
    q, model = np.zeros((1, 4)), condyle.derive(from_data(tables), backend="numpy")
    assert np.isfinite(model.inverse_dynamics(q, q, q).effort).all()


def test_the_page_quotes_the_sources_and_names_every_reaction() -> None:
    package, page = Path(condyle.__file__).parent, PAGE.read_text()
    names = ("mechanism/chain.py", "kinematics/chain/pss.py")
    sources = [(package / name).read_text() for name in names]
    quotes = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    assert len(quotes) == 5
    for quote in quotes:
        assert any(quote in source for source in sources), quote
    rows = {row.split("`")[1]: row for row in page.splitlines() if row[:3] == "| `"}
    mechanism = case("every_family").mechanism
    kinds = {chain.name: chain.kind for chain in mechanism.chains}
    places = [p for p in reaction_places(mechanism) if p.owner in kinds]
    for kind, family in FAMILIES.items():
        row = rows[kind]
        assert all(body.removesuffix("s") in row for body in family.bodies)
        assert f"[{family.joint_unit}]" in row and f"[{family.effort_unit}]" in row
        quantities = {p.quantity for p in places if kinds[p.owner] == kind}
        assert all(f"`{q}`" in row for q in quantities - {"platform_joint", "guide_moment"})
