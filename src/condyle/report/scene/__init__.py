"""Where everything of a mechanism stands, as numbers: the geometry that every picture draws."""

from .colours import DARK, DASHES, LIGHT, MARKERS, ROLES, Style, styles
from .parts import VIEWS, Bar, Parts, cloud, parts_of, platform_hull
from .patches import Patch, contact_normals, contact_patch, contact_profile
from .place import DRAWINGS, ChainDrawing, Rod, Scene, drawing_points, place, rotations

__all__ = [
    "DARK",
    "DASHES",
    "DRAWINGS",
    "LIGHT",
    "MARKERS",
    "ROLES",
    "VIEWS",
    "Bar",
    "ChainDrawing",
    "Parts",
    "Patch",
    "Rod",
    "Scene",
    "Style",
    "cloud",
    "contact_normals",
    "contact_patch",
    "contact_profile",
    "drawing_points",
    "parts_of",
    "place",
    "platform_hull",
    "rotations",
    "styles",
]
