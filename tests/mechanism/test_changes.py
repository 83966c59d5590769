"""Changes in Python are checked like files: by path, by table, and into nested tables."""

from __future__ import annotations

import copy
import pickle
import tomllib
import warnings
from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np
import pytest
from support.machines import model

import condyle
from condyle.errors import CondyleWarning, InputError, MechanismError
from condyle.mechanism import Mechanism, bundled_text, dumps, parse
from condyle.mechanism.bodies import Platform
from condyle.mechanism.files import from_data
from condyle.mechanism.home import home_residuals
from condyle.mechanism.paths import parsed, written
from condyle.mechanism.surface import Expression, Sphere


def every_number(node: Any, path: str = "") -> list[tuple[str, float]]:
    """Paths of a file's numbers, written by hand from its tables."""
    if isinstance(node, dict):
        return [f for k, v in node.items() for f in every_number(v, f"{path}.{k}".strip("."))]
    if isinstance(node, list):
        named = [(e["name"] if isinstance(e, dict) else None) for e in node]
        steps = [f".{n}" if n else f"[{k}]" for k, n in enumerate(named)]
        return [f for s, v in zip(steps, node, strict=True) for f in every_number(v, path + s)]
    return [(path, node)] if isinstance(node, float | int) else []


def test_every_number_of_a_file_has_its_path() -> None:
    """`get` and `set` at each place agree with the file written in SI."""
    for name in ("masticatory", "hexaglide", "gough-stewart"):
        machine = parse(bundled_text(name))
        numbers = every_number(tomllib.loads(dumps(machine)))
        assert len(numbers) > 80
        for k, (path, value) in enumerate(numbers):
            assert machine.get(path) == value, path
            assert k % 9 or machine.set(path, value) == machine, path
        assert machine.set(dict(numbers)) == machine


def test_a_change_changes_that_and_nothing_else(reference: Mechanism) -> None:
    assert reference.chain_names[0] == "temporalis_left"  # cached from here on
    heavy = reference.set("platform.mass", 0.25)
    assert heavy.get("platform.mass") == 0.25 and reference.get("platform.mass") == 0.2
    tables = tomllib.loads(dumps(reference))
    tables["platform"]["mass"] = 0.25
    assert heavy == from_data(tables)
    moved = heavy.set({"chain.masseter_left.platform[1]": 0.04, "gravity[2]": -9.82})
    x, _, z = reference.chains[2].platform
    assert moved.chains[2].platform == (x, 0.04, z)
    assert moved.gravity == (0.0, 0.0, -9.82) and moved.contacts == reference.contacts
    assert moved.chain_names == reference.chain_names
    renamed = reference.set("chain.temporalis_left.name", "first")
    assert renamed.chain_names[0] == "first"
    with pytest.raises(ValueError, match="frozen"):
        reference.gravity = (0.0, 0.0, 0.0)  # type: ignore[misc]
    surface = "contact.left_condyle.surface"  # and its offset: what must agree, together
    z, x = reference.get("contact.left_condyle.point[2]"), reference.contacts[0].point[0]
    with pytest.raises(MechanismError, match=r'"left_condyle": the point is .* mm off the surface'):
        reference.set(f"{surface}.slope[0]", -0.8)
    steep = {f"{surface}.slope[0]": -0.8, f"{surface}.offset": z + 0.8 * x}
    assert reference.set(steep).contacts[0].surface.slope == (-0.8, 0.0)


def test_tables_lists_and_nothing(reference: Mechanism) -> None:
    actuator, set_ = "chain.masseter_left.actuator", reference.set
    centre = np.array(reference.contacts[0].point) - [0, 0, 0.02]
    ball = {"kind": "sphere", "centre": centre, "radius": 0.02}
    assert isinstance(set_("contact.left_condyle.surface", ball).contacts[0].surface, Sphere)
    assert set_(actuator, {}).chains[2].actuator.torque_limit is None
    free = set_(f"{actuator}.torque_limit", None)
    assert free.get(f"{actuator}.torque_limit") is None
    assert free.get(f"{actuator}.speed_limit") == 6.0
    chin = set_("platform.points.chin", np.array([0.05, 0, -0.01]))
    assert chin.get("platform.points.chin") == (0.05, 0.0, -0.01)
    assert set(chin.platform.points) == {*reference.platform.points, "chin"}
    assert set_({"contact": [], "dependent": None}).degrees_of_freedom == 6
    assert set_('chain "masseter_left".base[0]', 0.05).get("chain[2].base[0]") == 0.05


WRONG: list[tuple[Any, Any, str]] = [
    ("platform.mas", 1, 'platform has no "mas". Did you mean "mass"?'),
    ("chain.maseter_left.base", 1, 'Did you mean "masseter_left"'),
    ("platfrom.mass", 1, 'a mechanism has no "platfrom". Did you mean "platform"'),
    ("gravity[3]", 1, r"gravity has 3 entries, [0] to [2]"),
    ("gravity.z", 1, "gravity is a list"),
    ("platform[0]", 1, "platform is a table, not a list"),
    ("platform.mass.kg", 1, "platform.mass is 0.2, which has no entries"),
    ("length_unit", "mm", "Values in Python are SI"),
    ("contact.left_condyle.surface.side", "below", "contact.left_condyle.side"),
    ("platform..mass", 1, "path: expected one such as"),
    ("[0]", 1, "path: expected one such as"),
    (3, 1, "path: expected text"),
    ({"platform": {"mass": 1}, "platform.mass": 1}, ..., "is within platform"),
    ("platform.mass", ..., "a path and a value"),
    ({"platform.mass": 1.0}, 2.0, "a path and a value"),
    ("platform.mass", -1, "platform.mass: expected a value above 0"),
    ("chain.masseter_left.base[0]", 1e9, "at most 100000 m, got 1e+09"),
    ("platform.inertia.zz", 2.0, "triangle inequality"),
    ("chain", (), "expected at least 1 entries"),
]


def test_what_is_wrong_is_said(reference: Mechanism) -> None:
    for path, value, message in WRONG:
        with pytest.raises(InputError) as caught:
            reference.set(path) if value is ... else reference.set(path, value)
        assert message in str(caught.value)
        if value == 1:  # the place is wrong: reading says the same
            with pytest.raises(InputError) as same:
                reference.get(path)
            assert str(same.value) == str(caught.value)
    for path in ("platform.mass", 'chain."a.b".base[2]', "contact.a b.x[0][1]"):
        assert written(parsed(path)) == path


def shifted(m: Mechanism) -> list[Any]:
    """The left contact a millimetre above its surface, and the right one."""
    left, right = m.contacts
    return [left.model_copy(update={"point": (*left.point[:2], left.point[2] + 1e-3)}), right]


FAR = {"base": (1e9, 0.0, 0.0)}
OFF = 'contact "left_condyle": the point is +0.67'
BENT: list[tuple[Callable[[Mechanism], Any], str]] = [
    (lambda m: m.platform.model_copy(update={"mass": -1}), "mass: expected a value above"),
    (lambda m: m.platform.model_copy(update={"mas": 1}), "mas"),
    (lambda m: m.platform.copy(update={"mass": -1}), "mass: expected a value above"),
    (lambda m: m.platform.inertia.model_copy(update={"zz": 1.0}), "triangle"),
    (lambda m: m.chains[0].model_copy(update={"crank_tip": m.chains[0].base}), "zero length"),
    (lambda m: m.model_copy(update={"chains": m.chains[:3]}), "3 actuators cannot drive 4"),
    (lambda m: m.replace(contacts=m.contacts[::-1] + m.contacts), "is given 2 times"),
    (lambda m: m.replace(platfrom=m.platform), "platfrom"),
    (lambda m: m.replace(gravity=(0.0, 0.0, float("nan"))), "gravity"),
    (lambda m: m.replace(platform=Platform.model_construct(mass=-1)), "mass: expected a value"),
    (lambda m: m.replace(chains=(m.chains[0].derived(**FAR), *m.chains[1:])), "at most 100000 m"),
    (lambda m: m.replace(contacts=shifted(m)), OFF),
    (lambda m: Mechanism(**{**m.entries(), "contact": shifted(m)}), OFF),
    (
        lambda m: m.replace(contacts=[c.model_copy(update={"point": POINT}) for c in m.contacts]),
        "cannot hold the platform",
    ),
]
POINT = condyle.load_mechanism("masticatory").contacts[0].point


def test_no_table_is_bent_past_its_checks(reference: Mechanism) -> None:
    """And landmarks are frozen too."""
    for bent, message in BENT:
        with pytest.raises(MechanismError) as caught:
            bent(reference)
        assert message in str(caught.value)
    points: Any = reference.platform.points
    for bend in (
        lambda: points.update(tip=(0, 0, 0)),
        lambda: points.pop("incisor"),
        lambda: points.__setitem__("incisor", "here"),
        lambda: points.__ior__({"tip": 1}),
    ):
        with pytest.raises(TypeError, match=r"mechanism\.set"):
            bend()
    assert points == dict(points)


def wave(p: ca.SX) -> ca.SX:
    return p[2] + 1.1 * p[0] - 0.013215 - 1e-4 * ca.sin(60 * (p[0] + 0.02665))


def test_mechanisms_and_errors_travel(reference: Mechanism) -> None:
    """Pickled and copied they are the same, a surface from Python too."""
    waved = reference.set("contact.left_condyle.surface", Expression(lambda p: wave(p)))
    for machine in (reference, waved):
        pickled = pickle.loads(pickle.dumps(machine))
        for other in (pickled, copy.deepcopy(machine), copy.copy(machine)):
            assert other == machine and hash(other) == hash(machine)
            surfaces = (m.contacts[0].surface for m in (other, machine))
            values = [float(surface.phi((-0.02, 0.07, 0.03))) for surface in surfaces]
            assert values[0] == values[1]
            assert other.set("platform.mass", 0.3) == machine.set("platform.mass", 0.3)
    assert Expression(wave) == Expression(lambda p: wave(p))  # where equations are
    assert Expression(wave) != Expression(wave, closed=True)
    assert Expression(wave) != Expression(lambda p: p[2])
    with pytest.raises(MechanismError) as caught:
        parse("name = 3")
    again = pickle.loads(pickle.dumps(caught.value))
    assert (str(again), again.problems) == (str(caught.value), caught.value.problems)


@pytest.mark.parametrize(
    ("name", "path", "by"),
    [
        ("masticatory", "contact[0].point", (2e-3, -1e-3, 3e-3)),
        ("masticatory-curved", "contact[0].surface.xx", 1.0),
        ("human-jaw-curved", "contact[1].point", (1e-3, 0.0, 0.0)),
    ],
)
def test_home_kept(name: str, path: str, by: object) -> None:
    """A surface follows with its offset, and misses home by as much as before."""
    machine = condyle.load_mechanism(name)
    new = np.add(machine.get(path), by).tolist()
    with pytest.raises(MechanismError, match="off the surface at home"):
        machine.set(path, new)
    kept = machine.set(path, new, keep="home")
    assert np.array_equal(kept.get(path), new)
    np.testing.assert_allclose(home_residuals(kept), home_residuals(machine), rtol=0, atol=1e-17)
    i = int(path[8])
    before, after = (m.contacts[i].surface for m in (machine, kept))
    if before.kind == "profile":
        moved = np.array(after.points) - np.array(before.points)
        assert (moved[:, 0] == 0).all() and np.ptp(moved[:, 1]) < 1e-17
    else:
        changed = {key for key, x in after.entries().items() if x != before.entries()[key]}
        assert changed == {"offset"} | ({"xx"} if path.endswith("xx") else set())
    assert kept.contacts[1 - i] == machine.contacts[1 - i]
    assert machine.set("platform.mass", 0.3, keep="home") == machine.set("platform.mass", 0.3)


def test_home_kept_by_a_centre(reference: Mechanism) -> None:
    """A sphere's centre goes along the normal; one that is set itself stays."""
    surface, point = "contact.left_condyle.surface", np.array(POINT)
    centre = point - 0.03 * np.array([0.6, 0.0, 0.8])
    ball = reference.set(surface, {"kind": "sphere", "centre": centre, "radius": 0.03})
    kept = ball.set(f"{surface}.radius", 0.04, keep="home")
    wanted = point - 0.04 * np.array([0.6, 0.0, 0.8])
    np.testing.assert_allclose(kept.contacts[0].surface.centre, wanted, rtol=0, atol=1e-16)
    off = np.add(centre, (0, 0, 1e-3)).tolist()
    with pytest.raises(MechanismError, match="off the surface at home"):
        ball.set(f"{surface}.centre", off, keep="home")
    with pytest.raises(InputError, match='keep: expected "home" or "all", got'):
        ball.set("platform.mass", 0.2, keep="some")


def test_set_warns_of_new_slips_alone(reference: Mechanism) -> None:
    with pytest.warns(CondyleWarning, match="gravity") as told:
        moon = reference.set("gravity", (0.0, 0.0, -1.62))
    assert len(told) == 1
    assert told[0].filename == __file__, "the line that calls set"
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        reference.set("platform.mass", 0.25)
        moon.set("gravity", (0.0, 0.0, -1.63))  # known already
        moon.set("gravity", (0.0, 0.0, -9.81))
        variants = model("masticatory").variants({"gravity[2]": [-1.6, -9.8]})
        assert variants.mechanism(0).gravity[2] == -1.6
