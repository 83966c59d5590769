"""A table with its equations is all that a chain family needs, from outside the package too."""

from __future__ import annotations

from collections.abc import Iterator
from types import ModuleType

import numpy as np
import pytest
from support.pages import module_of

import condyle
from condyle.errors import MechanismError
from condyle.export import export
from condyle.export.mjcf import mjcf
from condyle.kinematics.chain import FAMILIES, Family
from condyle.mechanism import Mechanism, dumps, parse
from condyle.mechanism.chain import CHAINS
from condyle.model.model import Model
from condyle.questions import Question
from condyle.questions.structure import structure_of
from condyle.report.scene.place import place

MASS = 0.05  # kg


@pytest.fixture(autouse=True)
def own() -> Iterator[ModuleType]:
    yield module_of("how-to/extend.md", "StrutFamily")
    del CHAINS["strut"], FAMILIES["strut"]


def hexapod(legs: dict[str, object]) -> Mechanism:
    """Six legs with some keys, from a ring to a smaller one."""
    lines = ['name = "legs"', "[platform]", "mass = 1.0"]
    lines += ["inertia = { xx = 1e-3, yy = 1e-3, zz = 2e-3 }"]
    for i in range(6):
        at, up = np.pi / 3 * i, np.pi / 3 * (i + (-1) ** i * 0.7)
        base = [0.2 * np.cos(at), 0.2 * np.sin(at), -0.3]
        joint = [0.1 * np.cos(up), 0.1 * np.sin(up), 0.0]
        lines += ["[[chain]]", f'name = "leg{i}"']
        lines += [f"base = {np.array(base).tolist()}", f"platform = {np.array(joint).tolist()}"]
        lines += [f"{key} = {value}" for key, value in legs.items()]
    return parse("\n".join(lines))


@pytest.fixture
def struts() -> Mechanism:
    return hexapod({"kind": '"strut"', "mass": MASS})


def test_it_is_read_described_and_written(own: ModuleType, struts: Mechanism) -> None:
    assert isinstance(struts.chains[0], own.Strut) and parse(dumps(struts)) == struts
    assert struts.get("chain.leg3.mass") == MASS
    table = condyle.schema()["$defs"]["Strut"]["properties"]
    assert table["mass"]["description"] == "kg, at the platform's joint"
    with pytest.raises(MechanismError, match='Did you mean "strut"'):
        hexapod({"kind": '"strat"', "mass": MASS})
    with pytest.raises(MechanismError, match='Did you mean "mass"'):
        hexapod({"kind": '"strut"', "mas": MASS})


def legs() -> Mechanism:
    """The same of a kind that comes with the package, with its mass at the tip."""
    none = "{ mass = 0.0, com = 0.0, transverse = 0.0, axial = 0.0 }"
    tip = none.replace("mass = 0.0", f"mass = {MASS}")
    return hexapod({"kind": '"SPS"', "cylinder": none, "piston": tip})


def test_efforts_are_those_of_a_leg_with_its_mass_at_the_tip(struts: Mechanism) -> None:
    q = np.array([[0.0] * 6, [0.01, -0.02, 0.015, 0.1, -0.05, 0.08]])
    found, wanted = (
        Model(m, backend="numpy").inverse_dynamics(q, q, 2 * q).effort for m in (struts, legs())
    )
    np.testing.assert_allclose(found, wanted, atol=1e-10 * abs(wanted).max())
    heavier = struts.set("chain.leg0.mass", 2 * MASS)
    varied = Model(struts, backend="numpy").variants({"chain.leg0.mass": [MASS, 2 * MASS]})
    np.testing.assert_allclose(
        varied.inverse_dynamics(q[1], q[1], q[1]).effort[1],
        Model(heavier, backend="numpy").inverse_dynamics(q[1], q[1], q[1]).effort,
        rtol=1e-11,
    )
    # No key of graphs can name it: its equations are not of this package.
    assert Question.about(structure_of(struts), "inverse").key is None


def test_it_is_drawn_and_exported(
    own: ModuleType, struts: Mechanism, monkeypatch: pytest.MonkeyPatch
) -> None:
    def drawn() -> int:
        scene = place(struts, np.zeros((1, 6)), np.zeros((1, 6)))
        assert len(scene.chains) == 6
        return len(scene.chains["leg0"].rods)

    assert drawn() == 2  # as the family that it extends
    header = export(struts, ("joints",), constants="struct").header
    assert "strut[6]" in header and "mass" in header
    assert mjcf(struts).text == mjcf(legs()).text
    monkeypatch.setattr(own.StrutFamily, "drawing", Family.drawing)
    assert drawn() == 1 and 'name="leg5_piston"' in mjcf(struts).text
