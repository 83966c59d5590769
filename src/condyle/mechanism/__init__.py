"""What the machine is: platform, chains, contacts, surfaces; files in, files out."""

from .files import as_mechanism, load_mechanism, parse
from .library import bundled_mechanisms, bundled_text
from .mechanism import COORDINATES, Contact, Mechanism, Platform
from .writing import dump, dumps

__all__ = [
    "COORDINATES",
    "Contact",
    "Mechanism",
    "Platform",
    "as_mechanism",
    "bundled_mechanisms",
    "bundled_text",
    "dump",
    "dumps",
    "load_mechanism",
    "parse",
]
