"""The page on families quotes the sources as they are, and knows every family and reaction."""

from __future__ import annotations

import re
from pathlib import Path

from support.families import case

import condyle
from condyle.kinematics.chain import FAMILIES
from condyle.questions.reactions import reaction_places

PAGE = Path(__file__).parents[3] / "docs" / "chains.md"
SOURCES = ("mechanism/chain.py", "kinematics/chain/pss.py")


def test_quotes_are_in_the_sources() -> None:
    package = Path(condyle.__file__).parent
    sources = [(package / name).read_text() for name in SOURCES]
    quotes = re.findall(r"```python\n(.*?)```", PAGE.read_text(), re.DOTALL)
    assert len(quotes) == 5
    for quote in quotes:
        assert any(quote in source for source in sources), quote


def test_the_table_names_every_family_and_its_reactions() -> None:
    rows = {row.split("`")[1]: row for row in PAGE.read_text().splitlines() if row[:3] == "| `"}
    mechanism = case("every_family").mechanism
    kinds = {chain.name: chain.kind for chain in mechanism.chains}
    places = [p for p in reaction_places(mechanism) if p.owner in kinds]
    for kind, family in FAMILIES.items():
        row = rows[kind]
        assert all(body.removesuffix("s") in row for body in family.bodies)
        assert f"[{family.joint_unit}]" in row and f"[{family.effort_unit}]" in row
        quantities = {p.quantity for p in places if kinds[p.owner] == kind}
        assert all(f"`{q}`" in row for q in quantities - {"platform_joint", "guide_moment"})
