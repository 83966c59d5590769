"""Where everything of a mechanism stands, as numbers: the geometry that every picture draws."""

from .colours import DARK, LIGHT, MARKERS, ROLES, Style, styles
from .muscles import ACTIVATION, Band, activation_colour, activation_of, band_mesh
from .parts import VIEWS, Bar, SceneParts, cloud, parts_of, platform_body, platform_hull
from .patches import contact_normals, contact_patch, contact_profile
from .place import Scene, place, rotations

__all__ = [
    "ACTIVATION",
    "DARK",
    "LIGHT",
    "MARKERS",
    "ROLES",
    "VIEWS",
    "Band",
    "Bar",
    "Scene",
    "SceneParts",
    "Style",
    "activation_colour",
    "activation_of",
    "band_mesh",
    "cloud",
    "contact_normals",
    "contact_patch",
    "contact_profile",
    "parts_of",
    "place",
    "platform_body",
    "platform_hull",
    "rotations",
    "styles",
]
