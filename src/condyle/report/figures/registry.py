"""The figures by name."""

from __future__ import annotations

from collections.abc import Callable

from matplotlib.figure import Figure

from .contact import contact_force, contact_track
from .joint import joint
from .load import load
from .motion import motion, path
from .share import share
from .singularity import jacobian, singularity
from .torque import torque

# Name -> function of a solution; the first line of its docstring says what it shows.
PLOTS: dict[str, Callable[..., Figure]] = {
    "motion": motion,
    "path": path,
    "joint": joint,
    "load": load,
    "torque": torque,
    "share": share,
    "contact_force": contact_force,
    "contact_track": contact_track,
    "jacobian": jacobian,
    "singularity": singularity,
}
