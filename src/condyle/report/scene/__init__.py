"""Where everything of a mechanism stands, as numbers: the geometry that every picture draws."""

from .chains import DRAWINGS, ChainDrawing, Rod, drawing_points
from .colours import DARK, DASHES, LIGHT, Style, styles
from .hull import platform_hull
from .place import Scene, place, rotations
from .surface import Patch, contact_normals, contact_patch, contact_profile

__all__ = [
    "DARK",
    "DASHES",
    "DRAWINGS",
    "LIGHT",
    "ChainDrawing",
    "Patch",
    "Rod",
    "Scene",
    "Style",
    "contact_normals",
    "contact_patch",
    "contact_profile",
    "drawing_points",
    "place",
    "platform_hull",
    "rotations",
    "styles",
]
