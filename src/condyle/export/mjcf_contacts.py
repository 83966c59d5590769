"""Contacts of a model of MuJoCo: joints that keep a point on a surface, and balls on planes."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..errors import UnsupportedError
from .mjcf_graph import WORLD, Step
from .mjcf_parts import Parts

SAME, PARALLEL = 1e-6, 1e-6


def contact_of(parts: Parts, steps: tuple[Step, ...], name: str) -> dict[str, Any] | None:
    """The contact that joints from the world to a ball joint are, if they are one."""
    kinds = [step.kind for step in steps]
    if kinds == ["slide", "slide", "ball"]:
        return _plane(parts, _called(parts, steps[2].point, name), steps)
    if kinds in (["slide", "hinge", "ball"], ["hinge", "slide", "ball"]):
        slide, hinge = sorted(steps[:2], key=lambda step: step.kind, reverse=True)
        if np.linalg.norm(np.cross(slide.axis, hinge.axis)) > PARALLEL:
            return None
        point, axis = steps[2].point, hinge.axis
        arm = point - hinge.point
        arm = arm - axis * (axis @ arm)
        surface: dict[str, Any] = {"kind": "cylinder", "point": parts.point(hinge.point)}
        surface |= {"axis": [float(v) for v in axis], "radius": float(np.linalg.norm(arm))}
        return _contact(parts, _called(parts, point, name), point, surface)
    if kinds == ["ball", "ball"]:
        centre, point = steps[0].point, steps[1].point
        ball: dict[str, Any] = {"kind": "sphere", "centre": parts.point(centre)}
        ball |= {"radius": float(np.linalg.norm(point - centre))}
        return _contact(parts, _called(parts, point, name), point, ball)
    return None


def seat(parts: Parts, platform: int, steps: tuple[Step, ...]) -> list[dict[str, Any]]:
    """Contacts that the platform's own joints stand for; a free joint stands for none.

    Raises: UnsupportedError: for other joints.
    """
    kinds = [step.kind for step in steps]
    round_ = [step for step in steps if step.kind in ("hinge", "ball")]
    if kinds == ["free"] or _all_free(kinds):
        return []
    if kinds == ["slide", "slide", "hinge", "hinge"]:
        pair = _pair(parts, platform, steps)
        if pair:
            return pair
    else:
        merged = steps
        if kinds[-3:] == ["hinge"] * 3 and len(kinds) > 3:
            merged = (*steps[:-3], Step("ball", steps[-1].point, np.zeros(3)))
        if [s.kind for s in merged] == ["hinge", "hinge", "ball"]:
            merged = (Step("ball", merged[0].point, np.zeros(3)), merged[2])
        if round_ and (made := contact_of(parts, merged, "contact")) is not None:
            return [made]
    raise UnsupportedError(
        f"the platform {parts.graph.name(platform)} has the joints {' '.join(kinds)}; expected a "
        "free joint, or slides, hinges and a ball joint that keep a point on a plane, cylinder or "
        "sphere"
    )


def real_contacts(parts: Parts, platform: int) -> list[dict[str, Any]]:
    """Pairs of a ball of the platform and a plane of the world: one-sided contacts."""
    m, d = parts.graph.model, parts.graph.data
    found = []
    for i in range(m.npair):
        pair = [int(m.pair_geom1[i]), int(m.pair_geom2[i])]
        kinds = {int(m.geom_type[g]): g for g in pair}
        if set(kinds) != {0, 2}:  # plane, sphere
            parts.note(f"contact pair {i + 1} is not of a sphere and a plane; it is left out")
            continue
        wall, ball = kinds[0], kinds[2]
        owners = [parts.graph.group(int(m.geom_bodyid[g])) for g in (wall, ball)]
        if owners != [WORLD, platform]:
            continue
        up, centre = d.geom_xmat[wall].reshape(3, 3)[:, 2], d.geom_xpos[ball]
        name = m.pair(i).name or f"contact_{i + 1}"
        if abs(up[2]) < 1e-6:
            parts.note(f"contact {name}: an upright plane, which a mechanism file cannot have")
            continue
        table = _contact(parts, name, centre, _slopes(parts, up, centre))
        table |= {"side": "above" if up[2] > 0 else "below", "one_sided": True}
        if m.pair_dim[i] > 1 and m.pair_friction[i, 0] > 0:
            table["friction"] = {"coefficient": float(m.pair_friction[i, 0])}
        found.append(table)
    return found


def _all_free(kinds: list[str]) -> bool:
    turns = [k for k in kinds if k != "slide"]
    return kinds.count("slide") == 3 and turns in (["ball"], ["hinge"] * 3)


def _pair(parts: Parts, platform: int, steps: tuple[Step, ...]) -> list[dict[str, Any]]:
    """Two contacts on parallel planes: a hinge along their normal, and one along their line.

    The second may be anywhere on that line: a site of the platform whose name ends in _contact.
    """
    u, v, yaw, roll = steps
    m, d = parts.graph.model, parts.graph.data
    n = np.cross(u.axis, v.axis)
    if np.linalg.norm(np.cross(n, yaw.axis)) > PARALLEL:
        return []
    found = []
    for s in range(m.nsite):
        name, at = m.site(s).name, d.site_xpos[s]
        on_line = np.linalg.norm(np.cross(at - roll.point, roll.axis)) < SAME * m.stat.extent
        mine = parts.graph.group(int(m.site_bodyid[s])) == platform
        if mine and on_line and name.endswith("_contact"):
            surface = _slopes(parts, n, at)
            found.append(_contact(parts, name.removesuffix("_contact"), at, surface))
    return found if len(found) == 2 else []


def _plane(parts: Parts, name: str, steps: tuple[Step, ...]) -> dict[str, Any]:
    n = np.cross(steps[0].axis, steps[1].axis)
    if abs(n[2]) < 1e-6:
        raise UnsupportedError(
            f'contact "{name}": its plane is upright, which z = f(x, y) cannot be; turn the model'
        )
    return _contact(parts, name, steps[2].point, _slopes(parts, n, steps[2].point))


def _slopes(parts: Parts, n: np.ndarray, at: np.ndarray) -> dict[str, Any]:
    """The plane through a point with a normal."""
    a, b = (round(float(v), 12) + 0.0 for v in -n[:2] / n[2])
    x, y, z = parts.point(at)
    return {"kind": "plane", "slope": [a, b], "offset": z - a * x - b * y}


def _contact(parts: Parts, name: str, at: np.ndarray, surface: dict[str, Any]) -> dict[str, Any]:
    return {"name": name, "point": parts.point(at), "surface": surface}


def _called(parts: Parts, at: np.ndarray, name: str) -> str:
    """As the site that marks it, if there is one."""
    m, d = parts.graph.model, parts.graph.data
    for s in range(m.nsite):
        near = np.linalg.norm(d.site_xpos[s] - at) < SAME * m.stat.extent
        if near and m.site(s).name.endswith("_contact"):
            return m.site(s).name.removesuffix("_contact")
    return name
