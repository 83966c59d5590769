"""Contacts of a model of MuJoCo: joints that keep a point on a surface, and balls on planes."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..errors import UnsupportedError
from .mjcf_graph import WORLD, Graph, Step

PARALLEL = 1e-6
PLANE, SPHERE = 0, 2  # geoms of MuJoCo


def contact_of(graph: Graph, steps: tuple[Step, ...], name: str) -> dict[str, Any] | None:
    """The contact that joints from the world to a ball joint are, if they are one."""
    kinds, at = [step.kind for step in steps], steps[-1].point
    named = (n for n, place in graph.sites() if np.linalg.norm(place - at) < graph.near)
    name = next((n.removesuffix("_contact") for n in named if n.endswith("_contact")), name)
    surface: dict[str, Any]
    if kinds == ["slide", "slide", "ball"]:
        n = np.cross(steps[0].axis, steps[1].axis)
        if abs(n[2]) < 1e-6:
            raise UnsupportedError(
                f'contact "{name}": its plane is upright, which z = f(x, y) cannot be; turn the '
                "model"
            )
        surface = _plane(graph, n, at)
    elif sorted(kinds[:2]) == ["hinge", "slide"] and kinds[2:] == ["ball"]:
        hinge, slide = sorted(steps[:2], key=lambda step: step.kind)
        axis, arm = hinge.axis, at - hinge.point
        if np.linalg.norm(np.cross(slide.axis, axis)) > PARALLEL:
            return None
        radius = float(np.linalg.norm(arm - axis * (axis @ arm)))
        surface = {"kind": "cylinder", "point": graph.point(hinge.point)}
        surface |= {"axis": [float(v) for v in axis], "radius": radius}
    elif kinds == ["ball", "ball"]:
        radius = float(np.linalg.norm(at - steps[0].point))
        surface = {"kind": "sphere", "centre": graph.point(steps[0].point), "radius": radius}
    else:
        return None
    return {"name": name, "point": graph.point(at), "surface": surface}


def seat(graph: Graph, platform: int, steps: tuple[Step, ...]) -> list[dict[str, Any]]:
    """Contacts that the platform's own joints stand for; a free joint stands for none.

    Raises: UnsupportedError: for other joints.
    """
    kinds = [step.kind for step in steps]
    turns = [k for k in kinds if k != "slide"]
    free = kinds.count("slide") == 3 and turns in (["ball"], ["hinge"] * 3)
    if kinds == ["free"] or free:
        return []
    if kinds == ["slide", "slide", "hinge", "hinge"]:
        if pair := _pair(graph, platform, steps):
            return pair
    elif turns:
        merged = steps
        if kinds[-3:] == ["hinge"] * 3 and len(kinds) > 3:
            merged = (*steps[:-3], Step("ball", steps[-1].point))
        if [s.kind for s in merged] == ["hinge", "hinge", "ball"]:
            merged = (Step("ball", merged[0].point), merged[2])
        if (made := contact_of(graph, merged, "contact")) is not None:
            return [made]
    raise UnsupportedError(
        f"the platform {graph.name(platform)} has the joints {' '.join(kinds)}; expected a "
        "free joint, or slides, hinges and a ball joint that keep a point on a plane, cylinder or "
        "sphere"
    )


def real_contacts(graph: Graph, platform: int) -> list[dict[str, Any]]:
    """Pairs of a ball of the platform and a plane of the world: one-sided contacts."""
    m, d = graph.model, graph.data
    found = []
    for i in range(m.npair):
        kinds = {int(m.geom_type[g]): int(g) for g in (m.pair_geom1[i], m.pair_geom2[i])}
        if set(kinds) != {PLANE, SPHERE}:
            graph.note(f"contact pair {i + 1} is not of a sphere and a plane; it is left out")
            continue
        wall, ball = kinds[PLANE], kinds[SPHERE]
        if [graph.group(int(m.geom_bodyid[g])) for g in (wall, ball)] != [WORLD, platform]:
            continue
        up, centre = d.geom_xmat[wall].reshape(3, 3)[:, 2], d.geom_xpos[ball]
        name = m.pair(i).name or f"contact_{i + 1}"
        if abs(up[2]) < 1e-6:
            graph.note(f"contact {name}: an upright plane, which a mechanism file cannot have")
            continue
        table = {"name": name, "point": graph.point(centre), "surface": _plane(graph, up, centre)}
        table |= {"side": "above" if up[2] > 0 else "below", "one_sided": True}
        if m.pair_dim[i] > 1 and m.pair_friction[i, 0] > 0:
            table["friction"] = {"coefficient": float(m.pair_friction[i, 0])}
        found.append(table)
    return found


def _pair(graph: Graph, platform: int, steps: tuple[Step, ...]) -> list[dict[str, Any]]:
    """Two contacts on parallel planes: a hinge along their normal, and one along their line.

    The second may be anywhere on that line: a site of the platform whose name ends in _contact.
    """
    u, v, yaw, roll = steps
    n = np.cross(u.axis, v.axis)
    if np.linalg.norm(np.cross(n, yaw.axis)) > PARALLEL:
        return []
    found = [
        {
            "name": name.removesuffix("_contact"),
            "point": graph.point(at),
            "surface": _plane(graph, n, at),
        }
        for name, at in graph.sites(platform)
        if name.endswith("_contact")
        and np.linalg.norm(np.cross(at - roll.point, roll.axis)) < graph.near
    ]
    return found if len(found) == 2 else []


def _plane(graph: Graph, n: np.ndarray, at: np.ndarray) -> dict[str, Any]:
    """The plane through a point with a normal."""
    a, b = (round(float(v), 12) + 0.0 for v in -n[:2] / n[2])
    x, y, z = graph.point(at)
    return {"kind": "plane", "slope": [a, b], "offset": z - a * x - b * y}
