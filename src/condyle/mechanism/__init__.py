"""What the machine is: platform, chains, contacts, surfaces; files in, files out."""

from .files import bundled_mechanisms, bundled_text, dump, dumps, json_schema, load, parse
from .mechanism import COORDINATES, Contact, Mechanism, Platform

__all__ = [
    "COORDINATES",
    "Contact",
    "Mechanism",
    "Platform",
    "bundled_mechanisms",
    "bundled_text",
    "dump",
    "dumps",
    "json_schema",
    "load",
    "parse",
]
