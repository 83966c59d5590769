"""Files that mean harm: deep, huge, with control characters, with names of programs."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import pytest

from condyle.errors import CondyleError, InputError, MechanismError
from condyle.mechanism import Mechanism, bundled_text, dumps, load_mechanism, parse
from condyle.mechanism.files import from_data

TEXT = bundled_text("masticatory")
TEXTS = {
    "digits": ("x = " + "9" * 5000, "an integer has thousands of digits"),
    "deep keys": (".".join("a" * 2000) + " = 1", "more than 20 deep"),
    "deep header": (f"[{'.'.join('a' * 2000)}]", "more than 20 deep"),
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
    ("old", "new"),
    [
        ('name = "masticatory"', 'name = "a\\u001b[2J"'),
        ("mass = 0.2", '"mass\\u001b[2J" = 0.2'),
        ("mass = 0.2", 'mass = "\\u001b[2J"'),
        ('kind = "plane"', 'kind = "\\u001b[2J"'),
        ("incisor", '"\\u202e\\u2028"'),
        ("platform", ESCAPE),
    ],
)
def test_control_characters_do_not_reach_the_terminal(old: str, new: str) -> None:
    with pytest.raises(CondyleError) as caught:
        parse(TEXT.replace(old, new, 1), f"jaw{ESCAPE}.toml")
    assert str(caught.value).replace("\n", "").isprintable()


@pytest.mark.parametrize("name", ["__proto__", "__class__", "model_fields", "kind"])
def test_names_of_programs_are_names(name: str, reference: Mechanism) -> None:
    changes = {"name": name, f"platform.points.{name}": (0, 0, 0)}
    changes |= {"chain.masseter_left.name": name, "contact.left_condyle.name": name}
    machine = reference.set(changes)
    assert parse(dumps(machine)) == machine
    assert machine.get(f"chain.{name}.base") == reference.chains[2].base
    assert name in repr(machine)


LONG = ("n" * 81, "é" * 81, "\U0001f9b7" * 41)
UNSEEN = "\u3164\u2800\u115f\ufe0f\U000e0101"


@pytest.mark.parametrize("name", [*LONG, "a\x7f", "a\u200eb", " a", "a;b", ""])
def test_names_that_cannot_name_a_file_or_a_column(raw: dict[str, Any], name: str) -> None:
    for table in (raw, raw["chain"][0], raw["contact"][0]):
        kept, table["name"] = table["name"], name
        with pytest.raises(MechanismError, match="name"):
            from_data(raw)
        table["name"] = kept
    raw["platform"]["points"][name] = [0, 0, 0]
    with pytest.raises(MechanismError):
        from_data(raw)


@pytest.mark.parametrize("character", UNSEEN)
def test_names_that_nobody_sees(raw: dict[str, Any], character: str) -> None:
    with pytest.raises(CondyleError, match=f"invisible characters.*U.{ord(character):04X}"):
        from_data({**raw, "name": f"jaw{character}"})


def test_messages_are_short(raw: dict[str, Any]) -> None:
    platform = raw["platform"] | {"points": {f"p{k}": [0, 0, 0] for k in range(500)}}
    with pytest.raises(InputError, match="and 490 more") as caught:
        from_data(raw | {"platform": platform}).get("platform.points.none")
    assert len(str(caught.value)) < 300
    raw |= {f"key{k}" * 20: k for k in range(1000)}
    raw["dependent"] = ["Q" * 10_000] * 1000
    with pytest.raises(MechanismError) as broken:
        from_data(raw)
    assert len(str(broken.value)) < 4000 and "more" in str(broken.value)
    assert len(broken.value.problems) == 2001 and max(map(len, broken.value.problems)) < 400


def test_what_follows_from_other_errors_is_left_out() -> None:
    tables = tomllib.loads(TEXT)
    for chain in tables["chain"]:
        chain["colour"] = 1
    with pytest.raises(MechanismError) as caught:
        from_data(tables)
    assert len(caught.value.problems) == len(tables["chain"])
    tables = tomllib.loads(TEXT) | {"dependent": ["Z", "gamma"]}
    tables["contact"] = tables["contact"][0]  # [contact] in the place of [[contact]]
    with pytest.raises(MechanismError) as caught:
        from_data(tables)
    (problem,) = caught.value.problems
    assert "contact: expected tables, each under [[contact]]" in problem
