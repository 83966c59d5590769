"""Files in and out: units, round trips, the bundled files; what the geometry at home decides."""

from __future__ import annotations

import tomllib
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from oracles.closure import dependent_coordinates as expected_dependents
from oracles.random_mechanism import random_mechanism, random_surface, toml_text
from support.families import case
from support.surfaces import CLOSED, KINDS

import condyle
from condyle.kinematics.chain import FAMILIES
from condyle.mechanism import Mechanism, bundled_text, dump, dumps, load_mechanism, parse
from condyle.mechanism.files import from_data
from condyle.mechanism.home import (
    characteristic_length,
    dependent_coordinates,
    home_residuals,
    home_warnings,
    independent_coordinates,
)
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
    pairs = zip(*(leaves(m.model_dump()) for m in (found, parse(TEXT))), strict=True)
    for got, wanted in pairs:
        assert got == (pytest.approx(wanted, rel=3e-16) if isinstance(wanted, float) else wanted)


def test_lengths_of_links_become_metres_and_fractions_stay() -> None:
    raw = case("every_family").raw
    found = {chain.kind: chain for chain in from_data(raw).chains[::-1]}
    given = {chain["kind"]: chain for chain in raw["chain"][::-1]}
    np.testing.assert_allclose(found["PSS"].base, np.array(given["PSS"]["base"]) / 1000)
    assert found["PSS"].rod.com == given["PSS"]["rod"]["com"]
    assert found["SPS"].cylinder.com == pytest.approx(given["SPS"]["cylinder"]["com"] / 1000)
    assert found["SPS"].piston.transverse == given["SPS"]["piston"]["transverse"]


def test_a_written_mechanism_is_read_back_bit_for_bit(tmp_path: Path) -> None:
    """And its dependent coordinates are those of the rule, of any number of contacts."""
    groups = (("RSS",), ("PSS",), ("SPS",), ("cable",), ("muscle",), ("RSS", "PSS", "SPS"))
    for seed, families in enumerate(groups):
        rng = np.random.default_rng(seed)
        raw = random_mechanism(rng, families, contacts=seed, tilted_gravity=True)
        mechanism = parse(toml_text(raw))
        again = parse(dumps(mechanism))
        assert again == mechanism and dumps(again) == dumps(mechanism)
        dump(mechanism, tmp_path / "jaw.toml")
        assert load_mechanism(tmp_path / "jaw.toml") == mechanism
        for drawn in range(4):
            raw = random_mechanism(np.random.default_rng(drawn), contacts=seed)
            mechanism = parse(toml_text(raw))
            assert dependent_coordinates(mechanism) == expected_dependents(raw)
            assert len(independent_coordinates(mechanism)) == 6 - seed
    assert load_mechanism(str(tmp_path / "jaw.toml")) == again
    (tmp_path / "jaw.toml").write_text("\ufeff" + TEXT, encoding="utf-8")  # a byte order mark
    assert load_mechanism(tmp_path / "jaw.toml") == parse(TEXT)


def test_surfaces_of_every_kind_go_round(raw: dict[str, Any]) -> None:
    """File in mm, mechanism in SI, file in m, the same mechanism to the last bit."""
    for kind in KINDS:
        side = "inside" if kind in CLOSED else "below"
        point, slope = np.array(raw["contact"][0]["point"]), np.array([-1.1, 0.0])
        given = random_surface(np.random.default_rng(2), kind, point, slope)
        first = raw["contact"][0] | {"surface": given, "side": side, "one_sided": True}
        mechanism = from_data(raw | {"contact": [first, *raw["contact"][1:]]})
        contact = mechanism.contacts[0]
        assert (contact.surface.kind, contact.side, contact.one_sided) == (kind, side, True)
        assert np.abs(home_residuals(mechanism)).max() < 1e-15
        assert parse(dumps(mechanism)) == mechanism
        if kind == "quadratic":
            assert contact.surface.xx == pytest.approx(given["xx"] * 1e3, rel=1e-15)  # to 1/m
            assert contact.surface.slope == tuple(given["slope"])
        if kind == "profile":
            first["surface"] = given | {"direction": [*given["direction"], 0.0]}
            assert from_data(raw | {"contact": [first, *raw["contact"][1:]]}) == mechanism


def test_bundled_files_and_the_starter() -> None:
    assert (ORACLES / "masticatory.toml").read_text() == TEXT
    assert all(mark in TEXT for mark in ("[P]", "[H]", "[D]", "[A]", "[C]"))
    assert {"masticatory", "gough-stewart", "hexaglide"} <= {*condyle.bundled_mechanisms()}
    for name in condyle.bundled_mechanisms():
        mechanism = load_mechanism(name)
        assert parse(dumps(mechanism)) == mechanism
    text = starter_text("my-robot")
    mechanism = parse(text)
    assert mechanism.name == "my-robot" and not home_warnings(mechanism)
    assert text.count("#") > 15
    home = np.zeros((1, mechanism.degrees_of_freedom))
    found = condyle.derive(mechanism, backend="numpy").inverse_dynamics(home, home, home)
    assert found.status[0] == 0 and np.isfinite(found.effort).all()


def test_a_tilted_axis_is_projected(raw: dict[str, Any]) -> None:
    chain = raw["chain"][0]
    crank = np.subtract(chain["crank_tip"], chain["base"])
    exact = np.array(chain["axis"]) - crank * (np.dot(chain["axis"], crank) / (crank @ crank))
    chain["axis"] = list(exact + 0.4 * np.pi / 180 * crank / np.linalg.norm(crank))
    shaft = FAMILIES["RSS"].constants(from_data(raw).chains[0])["C"][:, 2]
    assert abs(shaft @ crank) < 1e-14 * np.linalg.norm(crank)
    np.testing.assert_allclose(shaft, exact / np.linalg.norm(exact), atol=1e-15)


def test_a_contact_a_little_off_its_surface(raw: dict[str, Any]) -> None:
    """By nanometres nothing is said, by a micrometre it is mentioned; residuals are distances."""
    surface = raw["contact"][1]["surface"]
    for millimetres, warned in ((1e-7, False), (1e-3, True)):
        surface["offset"] += millimetres
        warnings = home_warnings(from_data(raw))
        assert [("right_condyle" in w) for w in warnings] == [True] * warned
        surface["offset"] -= millimetres
    surface["offset"] -= 3e-3 * np.hypot(surface["slope"][0], 1)
    np.testing.assert_allclose(home_residuals(from_data(raw)), [0, 3e-6], atol=1e-15)


def test_coordinates_of_the_reference(reference: Mechanism) -> None:
    assert dependent_coordinates(reference) == ("Z", "gamma")
    assert independent_coordinates(reference) == ("X", "Y", "alpha", "beta")
    points = [c.platform for c in reference.chains] + [c.point for c in reference.contacts]
    length = np.mean([np.linalg.norm(p) for p in points])
    assert characteristic_length(reference) == pytest.approx(length, rel=1e-15)


def test_a_badly_determined_set_is_passed_over_unless_the_file_decides(raw: dict[str, Any]) -> None:
    """Level planes leave gamma free; a slope of 1e-4 gives condition numbers about 1e4."""
    chosen = from_data(raw | {"dependent": ["alpha", "X"]})
    assert set(dependent_coordinates(chosen)) == {"X", "alpha"}
    assert independent_coordinates(chosen) == ("Y", "Z", "beta", "gamma")
    for slope, angle in ((0.0, "alpha"), (0.5e-4, "alpha"), (3e-4, "gamma")):
        for contact in raw["contact"]:
            offset = contact["point"][2] - slope * contact["point"][0]
            contact["surface"] = {"kind": "plane", "slope": [slope, 0], "offset": offset}
        assert dependent_coordinates(from_data(raw)) == ("Z", angle) == expected_dependents(raw)
