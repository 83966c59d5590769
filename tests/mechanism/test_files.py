"""Files in and out: units, round trips, the bundled file and its starter."""

from __future__ import annotations

import tomllib
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from oracles.random_mechanism import random_mechanism, toml_text

import condyle
from condyle import InputError
from condyle.kinematics.chain import FAMILIES
from condyle.mechanism import Mechanism, bundled_text, dump, dumps, load_mechanism, parse
from condyle.mechanism.files import from_data
from condyle.mechanism.home import home_warnings
from condyle.mechanism.library import starter_text

ORACLES = Path(__file__).parents[1] / "oracles"
TEXT = bundled_text("masticatory")
LENGTHS = {"base", "crank_tip", "platform", "point", "offset", "x", "y", "z"}


def in_metres(node: Any, length: bool = False) -> Any:
    """The tables of a file in mm, in m, each number rounded once."""
    if isinstance(node, dict):
        points = "incisor" in node
        return {key: in_metres(v, points or key in LENGTHS) for key, v in node.items()}
    if isinstance(node, list):
        return [in_metres(v, length) for v in node]
    if isinstance(node, Decimal | int):
        return float(Decimal(node) / 1000 if length else Decimal(node))
    return node


def leaves(node: Any) -> list[Any]:
    if isinstance(node, dict | list | tuple):
        inner = node.values() if isinstance(node, dict) else node
        return [leaf for child in inner for leaf in leaves(child)]
    return [node]


def test_millimetres_and_metres_are_the_same() -> None:
    metres = in_metres(tomllib.loads(TEXT, parse_float=Decimal))
    del metres["length_unit"]  # metres are the default
    found = from_data(metres)
    assert found == from_data(metres | {"length_unit": "m"})
    for got, wanted in zip(
        *map(leaves, (found.model_dump(), parse(TEXT).model_dump())), strict=True
    ):
        assert got == (pytest.approx(wanted, rel=3e-16) if isinstance(wanted, float) else wanted)


@pytest.mark.parametrize("seed", range(6))
def test_a_written_mechanism_is_read_back_bit_for_bit(seed: int, tmp_path: Path) -> None:
    families = (("RSS",), ("PSS",), ("SPS",), ("cable",), ("muscle",), ("RSS", "PSS", "SPS"))[seed]
    rng = np.random.default_rng(seed)
    raw = random_mechanism(rng, families, contacts=seed, tilted_gravity=True)
    mechanism = parse(toml_text(raw))
    again = parse(dumps(mechanism))
    assert again == mechanism and dumps(again) == dumps(mechanism)
    dump(mechanism, tmp_path / "jaw.toml")
    assert load_mechanism(tmp_path / "jaw.toml") == mechanism
    assert load_mechanism(str(tmp_path / "jaw.toml")) == mechanism


def test_bundled_files() -> None:
    assert (ORACLES / "masticatory.toml").read_text() == TEXT
    assert all(mark in TEXT for mark in ("[P]", "[H]", "[D]", "[A]", "[C]"))
    assert {"masticatory", "gough-stewart", "hexaglide"} <= {*condyle.bundled_mechanisms()}
    for name in condyle.bundled_mechanisms():
        mechanism = load_mechanism(name)
        assert parse(dumps(mechanism)) == mechanism
    with pytest.raises(InputError, match='Did you mean "masticatory"'):
        load_mechanism("mastikatory")


def test_a_tilted_axis_is_projected(raw: dict[str, Any]) -> None:
    chain = raw["chain"][0]
    crank = np.subtract(chain["crank_tip"], chain["base"])
    exact = np.array(chain["axis"]) - crank * (np.dot(chain["axis"], crank) / (crank @ crank))
    chain["axis"] = list(exact + 0.4 * np.pi / 180 * crank / np.linalg.norm(crank))
    shaft = FAMILIES["RSS"].constants(from_data(raw).chains[0])["C"][:, 2]
    assert abs(shaft @ crank) < 1e-14 * np.linalg.norm(crank)
    np.testing.assert_allclose(shaft, exact / np.linalg.norm(exact), atol=1e-15)


@pytest.mark.parametrize("millimetres, warned", [(1e-7, False), (1e-3, True)])
def test_a_contact_a_little_off_its_surface_is_mentioned(
    raw: dict[str, Any], millimetres: float, warned: bool
) -> None:
    raw["contact"][1]["surface"]["offset"] += millimetres
    warnings = home_warnings(from_data(raw))
    assert [("right_condyle" in w) for w in warnings] == [True] * warned


def test_the_starter_is_a_mechanism() -> None:
    text = starter_text("my-robot")
    mechanism = parse(text)
    assert mechanism.name == "my-robot" and not home_warnings(mechanism)
    assert text.count("#") > 15
    home = np.zeros((1, mechanism.degrees_of_freedom))
    found = condyle.derive(mechanism, backend="numpy").inverse_dynamics(home, home, home)
    assert found.status[0] == 0 and np.isfinite(found.effort).all()


@pytest.mark.parametrize(
    "content, message",
    [
        (b"", "name: is missing"),
        (b"mass is 3 kg\n", "is not TOML: .*line 1"),
        (b'name = "a"\nname = "b"\n', "is not TOML: .*line 2"),
        (bytes(range(256)), "is not a text file"),
        ('name = "a"'.encode("utf-16"), "is not a text file"),
        (None, 'does not exist.*Did you mean "jaws.toml"'),
    ],
)
def test_what_is_no_mechanism_file(tmp_path: Path, content: bytes | None, message: str) -> None:
    (tmp_path / "jaws.toml").write_text(TEXT)
    if content is not None:
        (tmp_path / "jaw.toml").write_bytes(content)
    with pytest.raises(InputError, match=f"(?s)jaw.toml.*{message}"):
        load_mechanism(tmp_path / "jaw.toml")
    with pytest.raises(InputError, match="cannot be read: Is a directory"):
        load_mechanism(tmp_path)


def test_a_byte_order_mark_does_no_harm(tmp_path: Path, reference: Mechanism) -> None:
    (tmp_path / "jaw.toml").write_text("\ufeff" + TEXT, encoding="utf-8")
    assert load_mechanism(tmp_path / "jaw.toml") == reference
