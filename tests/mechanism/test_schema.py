"""The JSON schema accepts what the reader accepts, and refuses what an editor can see."""

from __future__ import annotations

import copy
import json
import tomllib
from typing import Any

import numpy as np
import pytest
from oracles.random_mechanism import SURFACES, random_mechanism, random_surface

from condyle.mechanism import bundled_text, json_schema
from condyle.mechanism.files import from_data
from condyle.mechanism.library import starter_text

Schema = dict[str, Any]
TYPES: dict[str, Any] = {"object": dict, "array": list, "string": str, "boolean": bool}
TYPES |= {"null": type(None), "number": int | float, "integer": int}
NOTES = {"title", "description", "default", "$defs", "discriminator", "examples"}


def is_of(value: Any, kind: str) -> bool:
    return isinstance(value, TYPES[kind]) and (kind == "boolean" or not isinstance(value, bool))


class Validator:
    """The words of JSON Schema that our schema uses, one method each; any other is an error."""

    def __init__(self, root: Schema) -> None:
        self.root = root

    def fits(self, value: Any, schema: Schema) -> bool:
        words = sorted(schema.keys() - NOTES, key=lambda word: word != "type")  # type first
        return all(getattr(self, word.strip("$"))(value, schema[word], schema) for word in words)

    def ref(self, value: Any, rule: str, _: Schema) -> bool:
        return self.fits(value, self.root["$defs"][rule.removeprefix("#/$defs/")])

    def anyOf(self, value: Any, rule: list[Schema], _: Schema) -> bool:
        return any(self.fits(value, option) for option in rule)

    def oneOf(self, value: Any, rule: list[Schema], _: Schema) -> bool:
        return sum(self.fits(value, option) for option in rule) == 1

    def type(self, value: Any, rule: str, _: Schema) -> bool:
        return is_of(value, rule)

    def const(self, value: Any, rule: Any, _: Schema) -> bool:
        return value == rule

    def enum(self, value: Any, rule: list[Any], _: Schema) -> bool:
        return value in rule

    def required(self, value: Any, rule: list[str], _: Schema) -> bool:
        return isinstance(value, dict) and set(rule) <= set(value)

    def properties(self, value: Any, rule: dict[str, Schema], _: Schema) -> bool:
        return all(self.fits(value[key], rule[key]) for key in rule if key in value)

    def propertyNames(self, value: Any, rule: Schema, _: Schema) -> bool:
        return all(self.fits(key, rule) for key in value)

    def additionalProperties(self, value: Any, rule: Any, schema: Schema) -> bool:
        others = value.keys() - schema.get("properties", {}).keys()
        return all(rule and self.fits(value[key], rule) for key in others)

    def items(self, value: Any, rule: Schema, _: Schema) -> bool:
        return all(self.fits(entry, rule) for entry in value)

    def prefixItems(self, value: Any, rule: list[Schema], _: Schema) -> bool:
        return all(map(self.fits, value, rule))

    def minItems(self, value: Any, rule: int, _: Schema) -> bool:
        return len(value) >= rule

    def maxItems(self, value: Any, rule: int, _: Schema) -> bool:
        return len(value) <= rule

    minLength = minItems

    def minimum(self, value: Any, rule: float, _: Schema) -> bool:
        return is_of(value, "number") and value >= rule

    def maximum(self, value: Any, rule: float, _: Schema) -> bool:
        return is_of(value, "number") and value <= rule

    def exclusiveMinimum(self, value: Any, rule: float, _: Schema) -> bool:
        return is_of(value, "number") and value > rule


@pytest.fixture(scope="module")
def schema() -> Schema:
    return json.loads(json.dumps(json_schema(), allow_nan=False))


def test_the_schema_accepts_good_files(schema: Schema, raw: dict[str, Any]) -> None:
    accepts = Validator(schema).fits
    assert accepts(raw, schema)
    assert accepts(tomllib.loads(starter_text("new")), schema)
    for contacts in range(6):
        described = random_mechanism(np.random.default_rng(contacts), contacts=contacts)
        assert accepts(described, schema)


@pytest.mark.parametrize("kind", SURFACES)
def test_options_of_a_ball_may_stand_with_the_surface(
    schema: Schema, raw: dict[str, Any], kind: str
) -> None:
    """Reader and schema agree on both places, for every kind."""
    accepts = Validator(schema).fits
    side = "outside" if kind in ("sphere", "cylinder", "ellipsoid") else "above"
    options = {"side": side, "ball_radius": 3.0, "one_sided": True}
    contact = raw["contact"][0]
    table = random_surface(np.random.default_rng(0), kind, np.array(contact["point"]), np.zeros(2))
    for where in ({"surface": table} | options, {"surface": table | options}):
        raw["contact"][0] = contact | where
        assert accepts(raw, schema)
        found = from_data(raw, at_home=False).contacts[0]
        assert (found.side, found.ball_radius, found.one_sided) == (side, 0.003, True)
    raw["contact"][0]["surface"]["one_sided"] = "yes"
    assert not accepts(raw, schema)


@pytest.mark.parametrize(
    "path, value",
    [
        (("colour",), 1),
        (("length_unit",), "cm"),
        (("dependent",), ["Q"]),
        (("platform", "mass"), 0),
        (("platform", "mass"), "heavy"),
        (("platform", "inertia", "zx"), 0.0),
        (("contact", 0, "point"), [1, 2]),
        (("contact", 0, "surface", "kind"), "plain"),
        (("chain", 0, "kind"), "RSR"),
        (("chain", 0, "coupler", "com"), 1.5),
        (("chain", 0, "bass"), [0, 0, 0]),
        (("chains",), []),
    ],
)
def test_the_schema_refuses_what_an_editor_can_see(
    schema: Schema, raw: dict[str, Any], path: tuple[Any, ...], value: Any
) -> None:
    spoiled = node = copy.deepcopy(raw)
    for key in path[:-1]:
        node = node[key]
    node[path[-1]] = value
    assert not Validator(schema).fits(spoiled, schema)


def test_the_unit_of_lengths_is_described(schema: Schema) -> None:
    assert schema["properties"]["length_unit"]["enum"] == ["m", "mm"]
    assert set(tomllib.loads(bundled_text("masticatory"))) <= set(schema["properties"])
