"""The bundled Gough-Stewart platform is the published one; the page of the families is right."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from support.families import case, close

import condyle
from condyle.kinematics.chain import FAMILIES
from condyle.questions.reactions import reaction_places

PAGE = Path(__file__).parents[3] / "docs" / "chains.md"


def test_published_numbers() -> None:
    """Radii 3 and 1 m, height 2 m, 2.5 and 10 degrees; steel tubes and bars of 3/4 the length."""
    mechanism, density = condyle.load_mechanism("gough-stewart"), 76000 / 9.81

    def ring(radius: float, height: float, degrees: list[float]) -> np.ndarray:
        a = np.radians(degrees)
        return np.stack([radius * np.cos(a), radius * np.sin(a), 0 * a + height], axis=1)

    base = ring(3.0, -2.0, [-2.5, 2.5, 117.5, 122.5, 237.5, 242.5])
    top = ring(1.0, 0.0, [-50, 50, 70, 170, 190, 290])
    close([c.base for c in mechanism.chains], base, 1e-9)
    close([c.platform for c in mechanism.chains], top, 1e-9)
    size = 0.75 * np.linalg.norm(top - base, axis=1)[0]
    outer, inner = 0.05, 0.03
    for body, (a, b) in {"cylinder": (outer, inner), "piston": (inner, 0.0)}.items():
        mass = density * np.pi * (a**2 - b**2) * size
        transverse, axial = (3 * (a**2 + b**2) + size**2) / 12, (a**2 + b**2) / 2
        wanted = [mass, size / 2, mass * transverse, mass * axial]
        for chain in mechanism.chains:
            table = getattr(chain, body)
            got = [table.mass, table.com, table.transverse, table.axial]
            np.testing.assert_allclose(got, wanted, rtol=1e-4)
    plate, inertia = density * np.pi * 0.05, mechanism.platform.inertia
    got = [mechanism.platform.mass, inertia.zz, inertia.xx]
    wanted = [plate, plate / 2, plate * (3 + 0.05**2) / 12]
    np.testing.assert_allclose(got, wanted, rtol=1e-6)


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
