"""Files that mean harm, or are none: deep, huge, with control characters or odd names."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest

from condyle.errors import CondyleError, InputError, MechanismError
from condyle.mechanism import Mechanism, bundled_text, dumps, load_mechanism, parse
from condyle.mechanism.files import from_data

TEXT = bundled_text("masticatory")
DEEP = "more than 20 deep"
TEXTS = {
    "x = " + "9" * 5000: "an integer has thousands of digits",
    ".".join("a" * 300) + " = 1": DEEP,
    f"[{'.'.join('a' * 2000)}]": DEEP,
    "a." * 30_000 + "a = 1": DEEP,  # 4 GB and 30 s of a parser that is asked
    "x = {" + "'a' . " * 9000 + "a = 1}": DEEP,
    "x = " + "{a = " * 3000 + "1" + "}" * 3000: DEEP,
    "x = " + "[" * 21 + "]" * 21: DEEP,
    "#" + "x" * 1_000_001: "(limit TOML)",
    "# " + "é" * 600_000: "(limit TOML)",  # of bytes
    "k" * 9000 + " = 1\n" + "k" * 9000 + " = 2": "is not TOML",
}


def test_texts_that_mean_harm(tmp_path: Path) -> None:
    """Refused in words, in a text and in a file, which is never cut and then read as if whole."""
    for text, message in TEXTS.items():
        (tmp_path / "jaw.toml").write_text(text + "\n" + TEXT, encoding="utf-8")
        reads = [lambda: load_mechanism(tmp_path / "jaw.toml")]
        reads += [lambda text=text: parse(text + "\n" + TEXT)] if text.isascii() else []
        for read in reads:
            with pytest.raises(InputError) as caught:
                read()
            assert message in str(caught.value) and len(str(caught.value)) < 1000, text[:80]


def test_what_is_no_mechanism_file(tmp_path: Path) -> None:
    (tmp_path / "jaws.toml").write_text(TEXT)
    with pytest.raises(InputError, match=r'jaw\.toml.*does not exist.*Did you mean "jaws\.toml"'):
        load_mechanism(tmp_path / "jaw.toml")
    with pytest.raises(InputError, match="is a folder; expected a file"):
        load_mechanism(tmp_path)
    os.mkfifo(tmp_path / "pipe.toml")
    with pytest.raises(InputError, match="is a device or a pipe; expected a file"):
        load_mechanism(tmp_path / "pipe.toml")
    for content, message in {
        b"": "name: is missing",
        b"mass is 3 kg\n": "is not TOML: .*line 1",
        b'name = "a"\nname = "b"\n': "is not TOML: .*line 2",
        bytes(range(256)): "is not a text file",
        'name = "a"'.encode("utf-16"): "is not a text file",
    }.items():
        (tmp_path / "jaw.toml").write_bytes(content)
        with pytest.raises(InputError, match=f"(?s)jaw.toml.*{message}"):
            load_mechanism(tmp_path / "jaw.toml")
    for source in (3, None, b"masticatory", "a\0b", "x" * 5000, {}):
        with pytest.raises(InputError) as caught:
            load_mechanism(source)  # type: ignore[arg-type]
        assert str(caught.value).isprintable() and len(str(caught.value)) < 1000
        with pytest.raises(InputError):
            from_data(source)  # type: ignore[arg-type]
    with pytest.raises(InputError, match='Did you mean "masticatory"'):
        load_mechanism("mastikatory")


ESCAPE = "\x1b[2J"


def test_control_characters_do_not_reach_the_terminal() -> None:
    for old, new in {
        'name = "masticatory"': 'name = "a\\u001b[2J"',
        "mass = 0.2": '"mass\\u001b[2J" = 0.2',
        'kind = "plane"': 'kind = "\\u001b[2J"',
        "incisor": '"\\u202e\\u2028"',
        "platform": ESCAPE,
    }.items():
        with pytest.raises(CondyleError) as caught:
            parse(TEXT.replace(old, new, 1), f"jaw{ESCAPE}.toml")
        assert str(caught.value).replace("\n", "").isprintable()


def test_names_of_programs_are_names(reference: Mechanism) -> None:
    for name in ("__proto__", "__class__", "model_fields", "kind"):
        changes = {"name": name, f"platform.points.{name}": (0, 0, 0)}
        changes |= {"chain.masseter_left.name": name, "contact.left_condyle.name": name}
        machine = reference.set(changes)
        assert parse(dumps(machine)) == machine
        assert machine.get(f"chain.{name}.base") == reference.chains[2].base
        assert name in repr(machine)


LONG = ("n" * 81, "é" * 81, "\U0001f9b7" * 41)
UNSEEN = "\u3164\u2800\u115f\ufe0f\U000e0101"


def test_names_that_cannot_name_a_file_or_a_column(raw: dict[str, Any]) -> None:
    points = raw["platform"]["points"]
    for name in (*LONG, "a\x7f", "a\u200eb", " a", "a;b", ""):
        for table in (raw, raw["chain"][0], raw["contact"][0]):
            kept, table["name"] = table["name"], name
            with pytest.raises(MechanismError, match="name"):
                from_data(raw)
            table["name"] = kept
        raw["platform"]["points"] = points | {name: [0, 0, 0]}
        with pytest.raises(MechanismError):
            from_data(raw)
    raw["platform"]["points"] = points
    for unseen in UNSEEN:
        with pytest.raises(CondyleError, match=f"invisible characters.*U.{ord(unseen):04X}"):
            from_data({**raw, "name": f"jaw{unseen}"})


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
