"""Where everything of a mechanism stands, as numbers: the geometry that every picture draws."""

from .colours import DARK, LIGHT, MARKERS, ROLES, Style, styles
from .parts import VIEWS, Bar, Parts, cloud, parts_of, platform_hull
from .patches import contact_normals, contact_patch, contact_profile
from .place import Scene, place, rotations

__all__ = [
    "DARK",
    "LIGHT",
    "MARKERS",
    "ROLES",
    "VIEWS",
    "Bar",
    "Parts",
    "Scene",
    "Style",
    "cloud",
    "contact_normals",
    "contact_patch",
    "contact_profile",
    "parts_of",
    "place",
    "platform_hull",
    "rotations",
    "styles",
]
