"""The JSON schema of the tables of a file, and which keys may stand where."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import lru_cache
from typing import Any

from pydantic import BaseModel

from .quantities import PER_METRE

SIDE_OPTIONS = ("side", "ball_radius", "one_sided")


@lru_cache(maxsize=32)
def schema_of(root: type[BaseModel]) -> dict[str, Any]:
    """The JSON schema of a kind of table, with what may stand in two places."""
    schema = root.model_json_schema(by_alias=True)
    kinds = schema.get("$defs", {})
    contact = kinds.get("Contact", schema)["properties"]
    if {"chain", "controller"} & {*schema["properties"]}:
        unit = {
            "enum": list(PER_METRE),
            "default": "m",
            "description": "unit of every length in the file; all else is SI",
        }
        schema["properties"] = {"length_unit": unit, **schema["properties"]}
    if "discriminator" in contact.get("surface", ()):
        for surface in contact["surface"]["discriminator"]["mapping"].values():
            table = kinds[surface.rpartition("/")[2]]["properties"]
            table |= {key: contact[key] for key in SIDE_OPTIONS}
    return schema


def keys_at(root: type[BaseModel], location: Iterable[Any]) -> list[str]:
    """Keys that a table may have, by its place as pydantic gives it."""
    schema = schema_of(root)
    here: Mapping[str, Any] = schema
    for part in location:
        here = here.get("items", {}) if isinstance(part, int) else _inside(here, part)
        here = _followed(here, schema)
    return list(here.get("properties", {}))


def _inside(here: Mapping[str, Any], part: str) -> Any:
    """The schema of a key, or of one of several kinds."""
    kinds = here.get("discriminator", {}).get("mapping", {})
    return {"$ref": kinds[part]} if part in kinds else here.get("properties", {}).get(part, {})


def _followed(here: Mapping[str, Any], schema: Mapping[str, Any]) -> Any:
    """A schema with its reference, if it is one, looked up."""
    tables = ("$ref", "discriminator")
    here = next((one for one in here.get("anyOf", ()) if any(k in one for k in tables)), here)
    name = str(here.get("$ref", "")).rpartition("/")[2]
    return schema["$defs"][name] if name else here
