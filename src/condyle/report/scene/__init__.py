"""Where everything of a mechanism stands, as numbers: the geometry that every picture draws."""

from .chain_drawings import DRAWINGS, ChainDrawing, Rod, drawing_points
from .colours import DARK, DASHES, LIGHT, MARKERS, ROLES, Style, styles
from .hull import platform_hull
from .parts import VIEWS, Bar, Parts, cloud, parts_of
from .patches import Patch, contact_normals, contact_patch, contact_profile
from .place import Scene, place, rotations

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
