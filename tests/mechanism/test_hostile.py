"""Files that mean harm: deep, huge, with control characters, with names of programs."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import condyle
from condyle.errors import CondyleError, InputError, MechanismError
from condyle.mechanism import Mechanism, bundled_text, dumps, load_mechanism, parse
from condyle.mechanism.files import from_data

TEXT = bundled_text("masticatory")

TEXTS = {
    "digits": ("x = " + "9" * 5000, "an integer has thousands of digits"),
    "deep keys": (".".join("a" * 2000) + " = 1", "more than 20 deep"),
    "deep header": (f"[{'.'.join('a' * 2000)}]", "more than 20 deep"),
    "deep list": ("x = " + "[" * 3000 + "]" * 3000, "more than 20 deep"),
    "deep table": ("x = " + "{a = " * 3000 + "1" + "}" * 3000, "more than 20 deep"),
    "twenty-one": ("x = " + "[" * 21 + "]" * 21, "more than 20 deep"),
    "long": ("#" + "x" * 1_000_001, "more than a megabyte"),
    "key twice": ("k" * 9000 + " = 1\n" + "k" * 9000 + " = 2", "is not TOML"),
}


@pytest.mark.parametrize("case", TEXTS)
def test_texts_that_mean_harm(case: str, tmp_path: Path) -> None:
    text, message = TEXTS[case]
    (tmp_path / "jaw.toml").write_text(text + "\n" + TEXT)
    for read in (lambda: parse(text + "\n" + TEXT), lambda: load_mechanism(tmp_path / "jaw.toml")):
        with pytest.raises(InputError) as caught:
            read()
        assert message in str(caught.value) and len(str(caught.value)) < 1000


def test_a_megabyte_is_counted_in_bytes(tmp_path: Path) -> None:
    """A file is never cut and then read as if it were whole."""
    (tmp_path / "jaw.toml").write_text(TEXT + "\n# " + "é" * 600_000, encoding="utf-8")
    with pytest.raises(InputError, match="more than a megabyte"):
        load_mechanism(tmp_path / "jaw.toml")


@pytest.mark.parametrize("source", [3, None, b"masticatory", "a\0b", "x" * 5000, {}])
def test_what_is_no_path(source: Any) -> None:
    with pytest.raises(InputError) as caught:
        load_mechanism(source)
    assert str(caught.value).isprintable() and len(str(caught.value)) < 1000
    with pytest.raises(InputError):
        from_data(source)


ESCAPE = "\x1b[2J"


@pytest.mark.parametrize(
    "change",
    [
        lambda t: t.replace('name = "masticatory"', 'name = "a\\u001b[2J"'),
        lambda t: t.replace("mass = 0.2", '"mass\\u001b[2J" = 0.2', 1),
        lambda t: t.replace("mass = 0.2", 'mass = "\\u001b[2J"', 1),
        lambda t: t.replace('kind = "plane"', 'kind = "\\u001b[2J"', 1),
        lambda t: t.replace('name = "masseter_left"', 'name = "m\\u001b[2J"') + "\ncolour = 1",
        lambda t: t.replace("incisor", '"\\u202e\\u2028"'),
        lambda t: t.replace("platform", ESCAPE, 1),
    ],
)
def test_control_characters_do_not_reach_the_terminal(change: Callable[[str], str]) -> None:
    with pytest.raises(CondyleError) as caught:
        parse(change(TEXT), f"jaw{ESCAPE}.toml")
    assert str(caught.value).replace("\n", "").isprintable()


@pytest.mark.parametrize("name", ["constructor", "__proto__", "__class__", "model_fields", "kind"])
def test_names_of_programs_are_names(name: str, reference: Mechanism) -> None:
    machine = reference.set(
        {"name": name, f"platform.points.{name}": (0, 0, 0), "chain.masseter_left.name": name}
    ).set("contact.left_condyle.name", name)
    assert parse(dumps(machine)) == machine
    assert machine.get(f"chain.{name}.base") == reference.chains[2].base
    assert name in repr(machine)


@pytest.mark.parametrize(
    "name", ["n" * 81, "é" * 81, "\U0001f9b7" * 41, "a\x7f", "a\u200eb", " a", "a;b", ""]
)
def test_names_that_cannot_name_a_file_or_a_column(raw: dict[str, Any], name: str) -> None:
    for table in (raw, raw["chain"][0], raw["contact"][0]):
        kept, table["name"] = table["name"], name
        with pytest.raises(MechanismError, match="name"):
            from_data(raw)
        table["name"] = kept
    raw["platform"]["points"][name] = [0, 0, 0]
    with pytest.raises(MechanismError):
        from_data(raw)
    raw["platform"]["points"].pop(name)
    raw["name"] = "n" * 80
    assert from_data(raw).name == "n" * 80


def test_messages_are_short(raw: dict[str, Any]) -> None:
    raw |= {f"key{k}" * 20: k for k in range(1000)}
    raw["dependent"] = ["Q" * 10_000] * 1000
    with pytest.raises(MechanismError) as caught:
        from_data(raw)
    assert len(str(caught.value)) < 4000 and "more" in str(caught.value)
    assert len(caught.value.problems) == 2001 and max(map(len, caught.value.problems)) < 400
    many = from_data({**raw_of(TEXT), "platform": {**raw_of(TEXT)["platform"], "points": POINTS}})
    with pytest.raises(InputError, match="and 490 more") as caught:
        many.get("platform.points.none")
    assert len(str(caught.value)) < 300


POINTS = {f"p{k}": [0, 0, 0] for k in range(500)}


def raw_of(text: str) -> dict[str, Any]:
    import tomllib

    return tomllib.loads(text)


LARGE: dict[str, tuple[tuple[Any, ...], Any, str]] = {
    "mass": (("platform", "mass"), 1e200, "expected at most 1e+06 kg, got 1e+200"),
    "small mass": (("platform", "mass"), 1e-200, "expected at least 1e-18 kg"),
    "inertia": (("platform", "inertia", "xx"), 1e200, "at most 1e+06 kg m^2"),
    "product": (("platform", "inertia", "xy"), -1e200, "at most 1e+06 kg m^2"),
    "crank": (("chain", 0, "crank", "inertia"), 1e7, "at most 1e+06 kg m^2"),
    "rod": (("chain", 0, "coupler", "mass"), 1e7, "at most 1e+06 kg"),
    "nearly no rod": (("chain", 0, "coupler", "mass"), 1e-300, "at least 1e-18 kg"),
    "nearly no moment": (("chain", 0, "coupler", "axial"), 1e-300, "at least 1e-18 kg m^2"),
    "point": (("chain", 0, "base", 1), -1e200, "at most 1e+08 mm, got -1e+200"),
    "landmark": (("platform", "points", "incisor", 0), 1e9, "at most 1e+08 mm"),
    "offset": (("contact", 0, "surface", "offset"), 1e200, "at most 1e+08 mm"),
    "slope": (("contact", 0, "surface", "slope", 0), 1e200, "at most 1e+06"),
    "ball": (("contact", 0, "ball_radius"), 1e-200, "at least 1e-06 mm"),
    "direction": (("chain", 0, "axis"), [0, 1e-200, 0], "an entry of at least 1e-06"),
    "gravity": (("gravity",), [0, 0, -1e200], "at most 1e+06 m/s^2"),
    "limit": (("chain", 0, "actuator", "torque_limit"), 1e200, "at most 1e+12"),
    "bounds": (("contact", 0, "bounds", "x"), [0, 1e200], "at most 1e+08 mm"),
}


@pytest.mark.parametrize("case", LARGE)
def test_no_number_is_out_of_all_proportion(raw: dict[str, Any], case: str) -> None:
    path, value, message = LARGE[case]
    node: Any = raw
    for key in path[:-1]:
        node = node[key]
    node[path[-1]] = value
    with pytest.raises(MechanismError) as caught:
        from_data(raw)
    assert any(message in problem for problem in caught.value.problems)


def test_reversed_bounds_are_in_the_unit_of_the_file(raw: dict[str, Any]) -> None:
    raw["contact"][0]["bounds"]["x"] = [12.5, -33]
    with pytest.raises(MechanismError, match=r"got \[12\.5, -33\] mm"):
        from_data(raw)


def test_what_follows_from_other_errors_is_left_out(raw: dict[str, Any]) -> None:
    for chain in raw["chain"]:
        chain["colour"] = 1
    with pytest.raises(MechanismError) as caught:
        from_data(raw)
    assert len(caught.value.problems) == len(raw["chain"])
    raw["contact"] = raw["contact"][0]  # [contact] in the place of [[contact]]
    for chain in raw["chain"]:
        del chain["colour"]
    raw["dependent"] = ["Z", "gamma"]
    with pytest.raises(MechanismError) as caught:
        from_data(raw)
    (problem,) = caught.value.problems
    assert "contact: expected tables, each under [[contact]]" in problem


def test_the_room_imports_little() -> None:
    """Outside itself errors, atomic and names of what later rooms add; circles: test_house.py."""
    room = Path(condyle.__file__).parent / "mechanism"
    for path in room.rglob("*.py"):
        above = r"\." * (len(path.relative_to(room).parts) + 1)
        used = re.findall(rf"^\s*from {above}([\w.]*) import", path.read_text(), re.MULTILINE)
        assert {*used} <= {"errors", "atomic", "accessors"}, path
    assert any("from ..errors import" in path.read_text() for path in room.glob("*.py"))


@pytest.mark.parametrize("character", "\u3164\u2800\u115f\ufe0f\U000e0101")
def test_names_that_nobody_sees(character: str) -> None:
    table = tomllib.loads(bundled_text("hexaglide"))
    with pytest.raises(CondyleError, match=f"invisible characters.*U.{ord(character):04X}"):
        from_data({**table, "name": f"jaw{character}"})
