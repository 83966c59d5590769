"""The JSON schema accepts what the reader accepts, and refuses what an editor can see."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from mechanism.test_rules import SEEN, spoiled
from oracles.random_mechanism import SURFACES, random_mechanism, random_surface
from support.surfaces import ball_options

from condyle import schema as schema_of
from condyle.kinematics.chain import FAMILIES
from condyle.mechanism.files import from_data
from condyle.mechanism.library import starter_text

Schema = dict[str, Any]
TYPES: dict[str, Any] = {"object": dict, "array": list, "string": str, "boolean": bool}
TYPES |= {"null": type(None), "number": int | float, "integer": int}
NOTES = {"title", "description", "default", "$defs", "discriminator", "examples"}


def is_of(value: Any, kind: str) -> bool:
    return isinstance(value, TYPES[kind]) and (kind == "boolean" or not isinstance(value, bool))


class Validator:
    """The words of JSON Schema that our schema uses; any other is an error."""

    def __init__(self, root: Schema) -> None:
        fits = self.fits
        self.words: dict[str, Callable[[Any, Any, Schema], bool]] = {
            "$ref": lambda v, r, _: fits(v, root["$defs"][r.removeprefix("#/$defs/")]),
            "anyOf": lambda v, r, _: any(fits(v, option) for option in r),
            "oneOf": lambda v, r, _: sum(fits(v, option) for option in r) == 1,
            "const": lambda v, r, _: v == r,
            "enum": lambda v, r, _: v in r,
            "required": lambda v, r, _: isinstance(v, dict) and set(r) <= set(v),
            "properties": lambda v, r, _: all(fits(v[key], r[key]) for key in r if key in v),
            "propertyNames": lambda v, r, _: all(fits(key, r) for key in v),
            "additionalProperties": lambda v, r, schema: all(
                r and fits(v[key], r) for key in v.keys() - schema.get("properties", {}).keys()
            ),
            "items": lambda v, r, _: all(fits(entry, r) for entry in v),
            "prefixItems": lambda v, r, _: all(map(fits, v, r)),
            "minItems": lambda v, r, _: len(v) >= r,
            "maxItems": lambda v, r, _: len(v) <= r,
            "minLength": lambda v, r, _: len(v) >= r,
            "minimum": lambda v, r, _: is_of(v, "number") and v >= r,
            "maximum": lambda v, r, _: is_of(v, "number") and v <= r,
            "exclusiveMinimum": lambda v, r, _: is_of(v, "number") and v > r,
        }

    def fits(self, value: Any, schema: Schema) -> bool:
        if "type" in schema and not is_of(value, schema["type"]):
            return False
        words = schema.keys() - NOTES - {"type"}
        return all(self.words[word](value, schema[word], schema) for word in words)


@pytest.fixture(scope="module")
def schema() -> Schema:
    return json.loads(json.dumps(schema_of(), allow_nan=False))


@pytest.fixture(scope="module")
def accepts(schema: Schema) -> Callable[[Any], bool]:
    return lambda value: Validator(schema).fits(value, schema)


def test_good_files_are_accepted(schema: Schema, accepts: Any, raw: dict[str, Any]) -> None:
    assert accepts(raw) and accepts(tomllib.loads(starter_text("new")))
    for contacts in range(6):
        assert accepts(random_mechanism(np.random.default_rng(contacts), contacts=contacts))
    assert schema["properties"]["length_unit"]["enum"] == ["m", "mm"]
    assert all(f"'const': '{kind}'" in str(schema) for kind in FAMILIES)
    kinds = schema["$defs"]["Contact"]["properties"]["surface"]["discriminator"]["mapping"]
    assert set(kinds) == {*SURFACES, "coordinate"}


def test_options_of_a_ball_may_stand_with_the_surface(accepts: Any, raw: dict[str, Any]) -> None:
    """Reader and schema agree on both places, for every kind."""
    contact = raw["contact"][0]
    for kind in SURFACES:
        options = ball_options(kind, first=False) | {"one_sided": True}
        point, rng = np.array(contact["point"]), np.random.default_rng(0)
        table = random_surface(rng, kind, point, np.zeros(2))
        for where in ({"surface": table} | options, {"surface": table | options}):
            raw["contact"][0] = contact | where
            assert accepts(raw)
            found = from_data(raw, at_home=False).contacts[0]
            assert (found.side, found.ball_radius) == (options["side"], 0.004) and found.one_sided
        raw["contact"][0]["surface"]["one_sided"] = "yes"
        assert not accepts(raw)


def test_what_an_editor_can_see_is_refused(accepts: Any, raw: dict[str, Any]) -> None:
    line = {"name": "cable", "kind": "cable", "base": [1, 2, 3], "platform": [4, 5, 6]}
    cases: list[tuple[str, Any]] = [(path, value) for path, value, _ in SEEN]
    cases += [("chain.0", line | {"rod": {"mass": 0.1, "com": 0.5}}), ("chains", [])]
    for path, value in cases:
        assert not accepts(spoiled(raw, (path, value))), (path, value)
    rubbing = spoiled(raw, ("contact.0.friction", {"coefficient": 0.1}))
    for limit in (3.0, [0.0, 3.0], -1.0, [1.0], [1.0, 2.0, 3.0], "3"):
        actuator = {"force_limit": limit, "gear": 14.0, "rotor_inertia": 1e-6}
        found = spoiled(rubbing, ("chain.0", line | {"actuator": actuator}))
        assert accepts(found) == (limit in (3.0, [0.0, 3.0])), limit
