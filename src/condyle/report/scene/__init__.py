"""The scene of a mechanism, described once: what stands where, its solids, forces and paths."""

from .arrows import Force, contact_forces, force_scales, forces_of, trails
from .colours import DARK, LIGHT, MARKERS, ROLES, Style, styles
from .muscles import ACTIVATION, activation_colour, activation_of, band
from .parts import VIEWS, SceneParts, cloud, parts_of, platform_body, platform_hull
from .patches import contact_normals, contact_patch, contact_profile
from .place import Scene, place, rotations
from .solids import Solid
from .still import Camera, Faces, faces_of, rgb, tint_of

__all__ = [
    "ACTIVATION",
    "DARK",
    "LIGHT",
    "MARKERS",
    "ROLES",
    "VIEWS",
    "Camera",
    "Faces",
    "Force",
    "Scene",
    "SceneParts",
    "Solid",
    "Style",
    "activation_colour",
    "activation_of",
    "band",
    "cloud",
    "contact_forces",
    "contact_normals",
    "contact_patch",
    "contact_profile",
    "faces_of",
    "force_scales",
    "forces_of",
    "parts_of",
    "place",
    "platform_body",
    "platform_hull",
    "rgb",
    "rotations",
    "styles",
    "tint_of",
    "trails",
]
