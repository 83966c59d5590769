"""The JSON schema accepts what the reader accepts, and refuses what an editor can see."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from mechanism.test_rules import GONE, spoil
from oracles.random_mechanism import SURFACES, random_mechanism, random_surface

from condyle.kinematics.chain import FAMILIES
from condyle.mechanism import json_schema
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
    return json.loads(json.dumps(json_schema(), allow_nan=False))


@pytest.fixture(scope="module")
def accepts(schema: Schema) -> Callable[[Any], bool]:
    return lambda value: Validator(schema).fits(value, schema)


def test_good_files_are_accepted(schema: Schema, accepts: Any, raw: dict[str, Any]) -> None:
    assert accepts(raw) and accepts(tomllib.loads(starter_text("new")))
    for contacts in range(6):
        assert accepts(random_mechanism(np.random.default_rng(contacts), contacts=contacts))
    assert schema["properties"]["length_unit"]["enum"] == ["m", "mm"]
    assert all(f"'const': '{kind}'" in str(schema) for kind in FAMILIES)


@pytest.mark.parametrize("kind", SURFACES)
def test_options_of_a_ball_may_stand_with_the_surface(
    accepts: Any, raw: dict[str, Any], kind: str
) -> None:
    """Reader and schema agree on both places, for every kind."""
    side = "outside" if kind in ("sphere", "cylinder", "ellipsoid") else "above"
    options = {"side": side, "ball_radius": 3.0, "one_sided": True}
    contact = raw["contact"][0]
    table = random_surface(np.random.default_rng(0), kind, np.array(contact["point"]), np.zeros(2))
    for where in ({"surface": table} | options, {"surface": table | options}):
        raw["contact"][0] = contact | where
        assert accepts(raw)
        found = from_data(raw, at_home=False).contacts[0]
        assert (found.side, found.ball_radius, found.one_sided) == (side, 0.003, True)
    raw["contact"][0]["surface"]["one_sided"] = "yes"
    assert not accepts(raw)


LINE = {"name": "cable", "kind": "cable", "base": [1, 2, 3], "platform": [4, 5, 6]}


@pytest.mark.parametrize("limit", [3.0, [0.0, 3.0], -1.0, [1.0], [1.0, 2.0, 3.0], "3"])
def test_cables_limits_and_friction(accepts: Any, raw: dict[str, Any], limit: Any) -> None:
    actuator = {"force_limit": limit, "gear": 14.0, "rotor_inertia": 1e-6}
    raw["contact"][0]["friction"] = {"coefficient": 0.1}
    raw["chain"][0] = LINE | {"actuator": actuator}
    assert accepts(raw) == (limit in (3.0, [0.0, 3.0]))


@pytest.mark.parametrize(
    "path, value",
    [
        ("colour", 1),
        ("length_unit", "cm"),
        ("dependent", ["Q"]),
        ("platform.mass", 0),
        ("platform.mass", "heavy"),
        ("platform.mass", GONE),
        ("platform.inertia.zx", 0.0),
        ("contact.0.point", [1, 2]),
        ("contact.0.surface.kind", "plain"),
        ("contact.0.friction", {"coefficient": -0.1}),
        ("chain.0", LINE | {"rod": {"mass": 0.1, "com": 0.5, "transverse": 0, "axial": 0}}),
        ("chain.0.kind", "RSR"),
        ("chain.0.coupler.com", 1.5),
        ("chain.0.bass", [0, 0, 0]),
        ("chains", []),
    ],
)
def test_what_an_editor_can_see_is_refused(
    accepts: Any, raw: dict[str, Any], path: str, value: Any
) -> None:
    spoil(raw, path, value)
    assert not accepts(raw)
