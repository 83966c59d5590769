"""A mechanism for MuJoCo: one file of MJCF, its home the mechanism's and its controls our efforts.

Loops are closed by `connect`, contacts by what carries the platform (`mjcf_platform`). Joints and
actuators are called as their chains, so that `data.actuator("masseter_left").ctrl` is an effort
in N m or N, and joint coordinates are zero at home.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from xml.etree.ElementTree import Comment, Element

import numpy as np

from ..atomic import write_text
from ..errors import CondyleError
from ..mechanism import Mechanism
from ..mechanism.home import characteristic_length
from ..model.evaluator import Evaluator
from ..results.accessors import extend
from .mjcf_chains import ChainWriter
from .mjcf_platform import PlatformWriter
from .mjcf_xml import child, element, name_problems, rgba, written

TIMESTEP = 5e-4  # s
# Equations between bodies: as stiff as the step allows, and as hard as MuJoCo has them.
SOLREF, SOLIMP = (2 * TIMESTEP, 1.0), (0.9999, 0.9999, 0.001, 0.5, 2.0)
PLATFORM, WALL, BALL, FIXED = "#b0becd", "#e5b567", "#c2185b", "#7d8894"
PAPER, GROUND = "#ffffff", "#dfe5ea"


@dataclass(frozen=True)
class Mjcf:
    """text: the document;  notes: what of the mechanism is approximate in it, or left out."""

    text: str
    notes: tuple[str, ...]


def write_mjcf(mechanism: Mechanism, path: str | os.PathLike[str]) -> Mjcf:
    """Write the document, whole or not at all.

    Raises: InputError: if the file cannot be written;  as of `mjcf`.
    """
    made = mjcf(mechanism)
    write_text(path, made.text)
    return made


def mjcf(mechanism: Mechanism) -> Mjcf:
    """A mechanism as MJCF.

    Raises: UnsupportedError: where a surface cannot be followed, or names would meet.
    """
    size = characteristic_length(mechanism)
    look = extend("mechanism.look", mechanism)
    root = Element("mujoco", model=mechanism.name)
    fixed = [point for chain in mechanism.chains for point in chain.fixed_points]
    _settings(root, mechanism, np.vstack([look.hull, *fixed]), size)
    for tag in ("asset", "worldbody", "equality", "tendon", "actuator", "sensor", "custom"):
        element(root, tag)
    sky = {"type": "skybox", "builtin": "gradient", "width": 64, "height": 64}
    element(child(root, "asset"), "texture", rgb1=rgba(PAPER)[:3], rgb2=rgba(GROUND)[:3], **sky)
    light = {"pos": [0, 0, 4 * size], "dir": [0, 0, -1], "diffuse": [0.3] * 3}
    element(child(root, "worldbody"), "light", directional=True, **light)
    platform = PlatformWriter(root, mechanism, look, size)
    platform.write()
    chains = ChainWriter(root, mechanism, look.colours, size)
    for chain in mechanism.chains:
        chains.write(chain)
    notes = [*platform.notes, *chains.notes, *_home(root, mechanism)]
    for node in list(root):
        if not len(node) and not node.attrib:
            root.remove(node)
    name_problems(root)
    root.insert(0, Comment(_preface(mechanism, notes)))
    return Mjcf(written(root), tuple(notes))


def _settings(root: Element, mechanism: Mechanism, cloud: np.ndarray, size: float) -> None:
    """Options, defaults and the look; `cloud` is what a camera should see, (N, 3)."""
    element(root, "compiler", angle="radian", inertiafromgeom="false", autolimits="true")
    element(
        root,
        "option",
        timestep=TIMESTEP,
        gravity=mechanism.gravity,
        integrator="implicitfast",
        solver="Newton",
        iterations=100,
        tolerance=1e-12,
        cone="elliptic",
    )
    low, high = cloud.min(axis=0), cloud.max(axis=0)
    extent = float(np.linalg.norm(high - low))
    element(root, "statistic", center=(low + high) / 2, extent=0.75 * extent, meansize=0.1 * size)
    visual = element(root, "visual")
    element(visual, "global", azimuth=130, elevation=-15)
    element(visual, "headlight", ambient=[0.45] * 3, diffuse=[0.4] * 3, specular=[0.1] * 3)
    default = element(root, "default")
    element(default, "equality", solref=SOLREF, solimp=SOLIMP)
    element(default, "pair", solref=SOLREF, solimp=SOLIMP)
    element(default, "site", size=[0.02 * size], rgba=rgba(BALL), group=4)
    drawn = element(default, "default", class_="drawn")
    element(drawn, "geom", contype=0, conaffinity=0, group=1, rgba=rgba(FIXED))
    for name, colour, alpha in (
        ("fixed", FIXED, 1.0),
        ("platform", PLATFORM, 0.7),
        ("wall", WALL, 0.6),
        ("ball", BALL, 1.0),
    ):
        kind = element(drawn, "default", class_=name)
        element(kind, "geom", rgba=rgba(colour, alpha))


def _home(root: Element, mechanism: Mechanism) -> list[str]:
    """A keyframe with the efforts that hold the mechanism at home, if there are such."""
    try:
        model = Evaluator(mechanism, backend="numpy")
        rest = np.zeros((1, mechanism.degrees_of_freedom))
        efforts = model.torques(rest, rest, rest, np.zeros((1, 9)))
        if efforts.status[0]:
            raise CondyleError
    except CondyleError:
        return ["no efforts hold it at home, so there is no keyframe with them"]
    element(element(root, "keyframe"), "key", name="home", ctrl=efforts.effort[0])
    return []


def _preface(mechanism: Mechanism, notes: list[str]) -> str:
    lines = [
        f"{mechanism.name}, written by condyle. SI; home is qpos0, and controls are efforts.",
        "Joints, tendons and actuators are called as the chains; keyframe home holds it there.",
        *(f"Note: {note}." for note in notes),
    ]
    return "\n" + "\n".join(lines).replace("--", "- -") + "\n"
