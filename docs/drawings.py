"""Drawings of the conventions, by the library's own scene, when the site is built: light and dark.

Each is a function of a `Sheet`; its words are those of the mechanism's file. The alt text stands
in the pages.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from diagrams import DIAGRAMS
from sheet import FRAMES, FROM, GROUNDS, Sheet, chain_sheet


def rss(ground: str) -> Sheet:
    """RSS: crank on a shaft, coupler."""
    sheet, chain, at = chain_sheet(ground, "masticatory", 2, (0.5, -1.0, 0.35))
    axis = np.asarray(chain.axis) / np.linalg.norm(chain.axis)
    G, S, M, arm = at["G"], at["S"], at["M"], 0.2 * at["span"]
    sheet.dot(G, "soft", 6)
    sheet.arrow(G, G + 1.3 * arm * axis)
    sheet.word(G + 1.3 * arm * axis, "axis  $Z_C$", (5, 4))
    sheet.word(G, "base  $G$", (6, -8))
    sheet.word(S, "crank_tip  $S$", (-8, 5))
    sheet.word(M, "platform  $M$", (-8, -4))
    crank = S - G
    turns = [
        0.75 * (np.cos(a) * crank + np.sin(a) * np.cross(axis, crank))
        for a in np.linspace(0, 0.9, 20)
    ]
    arc = G + np.array(turns)
    sheet.line(arc[:-1], "joint", 1.4)
    sheet.arrow(arc[-3], arc[-1], "joint", lw=1.4, mutation_scale=10)
    sheet.word(arc[-1], r"$\theta$, torque", (4, 9), "joint")
    sheet.word(0.5 * (G + S), "crank", (-5, -9), "chain")
    sheet.word(0.5 * (M + S), "coupler", (9, -3), "chain")
    sheet.frame((0, 0, 0), arm, FRAMES, (2, -13))
    return sheet


def pss(ground: str) -> Sheet:
    """PSS: slider on a rail, rod."""
    sheet, chain, at = chain_sheet(ground, "hexaglide", 0, (0.45, -1.0, 0.4))
    axis = np.asarray(chain.axis) / np.linalg.norm(chain.axis)
    S, M, arm = at["S"], at["M"], 0.2 * at["span"]
    sheet.line([S - arm * axis, S + arm * axis], "soft", 3)
    sheet.arrow(S + 0.4 * arm * axis, S + 1.5 * arm * axis)
    sheet.word(S + 1.5 * arm * axis, "axis, travel, force", (0, -13))
    sheet.word(S, "base  $S$ at home", (-4, 13))
    sheet.word(M, "platform  $M$", (6, -14))
    sheet.word(0.5 * (M + S), "rod", (8, -5), "chain")
    sheet.frame((0, 0, 0), arm, FRAMES, (3, -32))
    return sheet


def sps(ground: str) -> Sheet:
    """SPS: a telescopic leg."""
    sheet, _, at = chain_sheet(ground, "gough-stewart", 0, (0.5, -1.0, 0.35))
    B, M, arm = at["B"], at["M"], 0.2 * at["span"]
    sheet.word(B, "base  $B$", (-9, -3))
    sheet.word(M, "platform  $M$", (9, 4))
    sheet.word(0.65 * B + 0.35 * M, "cylinder", (10, 0), "chain")
    sheet.word(0.2 * B + 0.8 * M, "piston", (10, 0), "chain")
    way = (M - B) / np.linalg.norm(M - B)
    aside = 0.32 * arm * np.array([-1.0, 0.0, -0.4])
    sheet.arrow(0.55 * B + 0.45 * M + aside, 0.55 * B + 0.45 * M + aside + arm * way, "joint")
    sheet.word(0.45 * B + 0.55 * M + aside, "length, force", (-9, 0), "joint")
    sheet.frame((0, 0, 0), arm, FRAMES, (8, 30))
    return sheet


def cable(ground: str) -> Sheet:
    """Cable and muscle: a line that only pulls."""
    sheet, _, at = chain_sheet(ground, "human-jaw", 0, (1.0, 0.9, 0.4))
    B, M, arm = at["B"], at["M"], 0.2 * at["span"]
    sheet.dot(B, "soft", 6)
    sheet.dot(M, "soft", 6)
    sheet.word(B, "base  $B$", (7, 3))
    sheet.word(M, "platform  $M$", (8, 2))
    way = (B - M) / np.linalg.norm(B - M)
    sheet.arrow(M, M + 1.4 * arm * way, "force")
    sheet.word(M + 0.9 * arm * way, "tension", (9, 0), "force")
    sheet.frame((0, 0, 0), arm, FRAMES, (2, -14))
    return sheet


def _track(side: str) -> tuple[Any, np.ndarray, np.ndarray, np.ndarray]:
    """A contact on a curved eminence, its line in the plane of home, the centre, and the normal."""
    from condyle.mechanism import Contact
    from condyle.report.scene import contact_normals, contact_profile

    surface = {"kind": "quadratic", "offset": 0.0, "slope": [-0.5, 0.0], "xx": 14.0}
    contact = Contact.model_validate(
        {"name": "ball", "point": (0.0, 0.0, 0.0), "surface": surface, "side": side}
    )
    line = contact_profile(contact, np.array([[-0.016, 0.0, 0.0], [0.016, 0.0, 0.0]]))
    assert line is not None
    return contact, line, np.zeros(3), contact_normals(contact, np.zeros((1, 3)))[0]


def _side_view(ground: str) -> tuple[Sheet, np.ndarray, np.ndarray, float]:
    """Wall, ball below it; the unit normal, the way along the wall, and the ball's radius."""
    _, line, _, n = _track("below")
    sheet, radius = Sheet(ground, (0.0, -1.0, 0.0)), 0.006
    ahead = np.cross((0.0, 1.0, 0.0), n)
    wall = [*line, line[-1] + [0, 0, 0.009], line[0] + [0, 0, 0.005]]
    sheet.area(wall, "surface", 0.35)
    sheet.line(line, "surface", 2.5)
    ring = np.linspace(0, 2 * np.pi, 60)
    centre = -radius * n
    ball = centre + radius * (np.cos(ring)[:, None] * ahead + np.sin(ring)[:, None] * n)
    sheet.area(ball, "body", 0.7)
    sheet.line(ball, "ink", 1.2)
    return sheet, n, ahead, radius


def contact(ground: str) -> Sheet:
    """A unilateral contact: wall, ball, side, normal, and the force that it can bear."""
    sheet, n, ahead, radius = _side_view(ground)
    centre = -radius * n
    sheet.dot(centre, "joint", 6)
    sheet.word(centre, "point", (7, 5))
    rim = centre - 0.82 * radius * ahead - 0.57 * radius * n
    sheet.line([centre, rim], "ink", 1.0)
    sheet.word(rim, "ball_radius", (-7, -2))
    sheet.arrow((0, 0, 0), 1.5 * radius * n, "ink")
    sheet.word(1.5 * radius * n, "unit normal $n$", (6, 4))
    sheet.arrow(centre, centre - 2.1 * radius * n, "force")
    sheet.word(
        centre - 2.1 * radius * n,
        "one_sided: the wall pushes,\nforce along $n$ below 0",
        (6, -8),
        "force",
    )
    sheet.word(np.array([-0.0155, 0, 0.0152]), "surface", (2, 0), "surface")
    sheet.word(
        centre + 1.3 * radius * ahead - 0.35 * radius * n,
        'side = "below":\nthe ball is here',
        (4, 0),
        "soft",
    )
    return sheet


def friction(ground: str) -> Sheet:
    """Friction's cone at a contact."""
    sheet, n, ahead, radius = _side_view(ground)
    size, slope = 3.0 * radius, 0.4
    push, back = -n, -ahead
    edges = [size * (push + s * slope * ahead) for s in (1, -1)]
    sheet.area([np.zeros(3), *edges], "force", 0.16)
    for edge in edges:
        sheet.line([np.zeros(3), edge], "force", 1.0, ls="--")
    total = 0.8 * size * (push + slope * back)
    sheet.arrow(np.zeros(3), total, "force")
    sheet.word(total, "force of\nthe wall", (-6, 0), "force")
    sheet.arrow(np.zeros(3), 0.8 * size * push, "ink", lw=1.2)
    sheet.word(0.8 * size * push, r"$\lambda n$", (7, -2))
    sheet.arrow(np.zeros(3), 0.8 * size * slope * back, "joint")
    sheet.word(0.8 * size * slope * back, r"$f$", (-3, 11), "joint")
    sheet.arrow(radius * ahead, 2.2 * radius * ahead, "chain")
    sheet.word(2.2 * radius * ahead, r"sliding $v$", (2, -10), "chain")
    sheet.word(edges[0], r"half angle $\arctan\mu$", (5, -2), "force")
    return sheet


def landmarks(ground: str) -> Sheet:
    """Points of a platform, and a load at one of them."""
    import condyle
    from condyle.report.scene.parts import platform_body

    mechanism = condyle.load_mechanism("human-jaw")
    body = platform_body(mechanism)
    sheet = Sheet(ground, (1.0, -1.1, 0.75))
    sheet.room = (0.36, 0.26)
    corners = body.vertices[body.faces]
    order = np.argsort((corners @ sheet.away).mean(axis=1))
    sheet.mesh(corners[order], "body", alpha=1.0)
    points = {**mechanism.platform.points, "left_condyle": mechanism.contacts[0].point}
    points["right_condyle"] = mechanism.contacts[1].point
    beside = {"left_canine": (5, 9), "incisor": (9, -3), "chin": (9, -6), "left_molar": (2, 12)}
    beside["right_canine"] = (-2, -11)
    for name, point in points.items():
        sheet.dot(point, "joint", 5)
        sheet.word(point, name, beside.get(name, (-7, 6)), fontsize=8.5)
    at = np.array(points["right_molar"])
    sheet.arrow(at, at - [0.0, 0.0, 0.035], "force")
    sheet.word(at - [0.0, 0.0, 0.035], "load, load_point", (-6, -7), "force")
    sheet.frame((0.0, 0.0, 0.0), 0.018, "{M}", (-7, 5))
    return sheet


def coordinates(ground: str) -> Sheet:
    """X is given, and Z follows on the surfaces: independent and dependent coordinates."""
    from scipy.spatial import ConvexHull

    import condyle
    from condyle.report.scene import contact_profile, platform_hull

    mechanism = condyle.load_mechanism("masticatory")
    one, body = mechanism.contacts[0], platform_hull(mechanism)[0]
    slope = one.surface.slope[0]
    given = np.array([0.014, 0.0, 0.0])
    follows = np.array([0.0, 0.0, slope * given[0]])
    sheet = Sheet(ground, (0.0, -1.0, 0.0))
    sheet.room = (0.3, 0.1)
    outline = body[ConvexHull(sheet.flat(body)).vertices]
    line = contact_profile(one, np.array([one.point, np.add(one.point, given + follows)]))
    sheet.line(line, "surface", 2.5)
    sheet.word(line.mean(axis=0), "surface", (-9, -6), "surface")
    for moved, alpha in ((np.zeros(3), 0.3), (given + follows, 0.7)):
        sheet.area(outline + moved, "body", alpha)
        sheet.dot(one.point + moved)
    start = np.zeros(3)
    sheet.arrow(start, start + given, "chain")
    sheet.word(start + 0.5 * given, "X, given", (0, 10), "chain")
    sheet.arrow(start + given, start + given + follows, "force")
    sheet.word(start + given + 0.6 * follows, "Z, dependent", (8, 0), "force")
    sheet.word(one.point, "home", (8, 6), "soft")
    return sheet


def branches(ground: str) -> Sheet:
    """Two cranks reach the same M: the branch of home, and the other."""
    from condyle.kinematics.chain import FAMILIES

    sheet, chain, at = chain_sheet(ground, "masticatory", 2, (0.05, -1.0, 0.1), rods=False)
    sheet.room = (0.3, 0.24)
    family = FAMILIES["RSS"]
    length = float(family.constants(chain)["L"])
    theta, M = np.linspace(0.3, 2 * np.pi - 0.3, 4000), np.array(chain.platform)
    tips = family.drawing(chain, theta, np.tile(M, (len(theta), 1))).points["S"]
    other = tips[np.argmin(np.abs(np.linalg.norm(tips - M, axis=1) - length))]
    turn = np.linspace(0.0, 2 * np.pi, 90)
    circle = family.drawing(chain, turn, np.tile(M, (90, 1))).points["S"]
    sheet.line(circle, "soft", 0.8, ls=":")
    for tip, tint, name, by in (
        (at["S"], "chain", "branch of home", (-8, 7)),
        (other, "soft", "the other", (8, -9)),
    ):
        sheet.line([at["G"], tip], tint, 4.0)
        sheet.line([tip, M], tint, 2.5)
        sheet.dot(tip)
        sheet.word(tip, name, by, tint)
    sheet.dot(M)
    sheet.dot(at["G"], "soft", 6)
    sheet.word(at["G"], "base  $G$", (5, -10))
    sheet.word(M, "platform  $M$, the same", (9, -6))
    return sheet


# Surface -> its keys (m, rad), a point on it, the side that is drawn, and where one looks from.
SURFACES: dict[str, tuple[dict[str, Any], Any, str, Any]] = {
    "plane": ({"slope": [-0.5, 0.0], "offset": 0.012}, (0.012, 0.0, 0.006), "below", FROM),
    "quadratic": (
        {"slope": [-0.5, 0.0], "offset": 0.012, "xx": 14.0, "yy": -8.0},
        (0.012, 0.0, 0.008016), "below", FROM,
    ),
    "profile": (
        {"direction": [1.0, 0.0],
         "points": [[-0.006, 0.016], [0.004, 0.013], [0.014, 0.006], [0.026, 0.004]]},
        (0.014, 0.0, 0.006), "below", FROM,
    ),
    "sphere": ({"centre": [0.0, 0.0, 0.02], "radius": 0.02}, (0.0, 0.0, 0.0), "inside", FROM),
    "cylinder": (
        {"point": [0.0, 0.0, 0.02], "axis": [0.0, 1.0, 0.0], "radius": 0.02},
        (0.0, 0.0, 0.0), "inside", FROM,
    ),
    "ellipsoid": (
        {"centre": [0.0, 0.0, 0.012], "semi_axes": [0.024, 0.018, 0.012]},
        (0.0, 0.0, 0.0), "inside", FROM,
    ),
}  # fmt: skip


def surface(kind: str, ground: str) -> Sheet:
    """A surface near a contact: its keys, its unit normal, and the ball on its side."""
    from condyle.mechanism import Contact
    from condyle.report.scene import contact_normals, contact_patch

    keys, at, side, away = SURFACES[kind]
    at, radius, arm = np.array(at), 0.004, 0.008
    made = Contact.model_validate(
        {"name": "ball", "point": tuple(at), "surface": {"kind": kind, **keys}, "side": side}
    )
    patch = contact_patch(made, at[None], 0.2 if kind == "profile" else 0.13)
    n = contact_normals(made, at[None])[0]
    sheet = Sheet(ground, away)
    sheet.mesh(patch.vertices[patch.faces], "surface")
    for segment in patch.outline:
        sheet.line(segment, "surface", 1.2)
    sheet.ball(at - radius * n, radius, behind=side == "below")
    sheet.arrow(at, at + 1.4 * arm * n)
    sheet.word(at + 1.4 * arm * n, "$n$", (5, 4))
    sheet.word(at - radius * n, f'side = "{side}"', (20, -42), "soft")
    if "offset" in keys:
        foot, top = np.zeros(3), np.array([0.0, 0.0, keys["offset"]])
        sheet.line([foot, top], "ink", 1.0, ls=":")
        sheet.dot(top, "soft", 4)
        sheet.word(top, "offset, where x = y = 0", (-6, 8), ha="center")
    if "points" in keys:
        for s_, z in keys["points"]:
            sheet.dot((s_, 0.0, z), "joint", 5)
        s_, z = keys["points"][0]
        sheet.word((s_, 0.0, z), "points [s, z]", (-4, 10), "joint", ha="center")
        sheet.arrow((0.0, -0.017, 0.0), (0.014, -0.017, 0.0))
        sheet.word((0.014, -0.017, 0.0), "direction, s", (-14, -9))
    middle = np.array(keys.get("centre", keys.get("point", at)))
    if (middle != at).any():
        sheet.dot(middle, "joint", 5)
        sheet.word(middle, "centre" if "centre" in keys else "point", (7, -5), "joint")
    if "radius" in keys:
        rim = middle + keys["radius"] * np.array([-np.sin(0.6), 0.0, -np.cos(0.6)])
        sheet.line([middle, rim], "ink", 1.0)
        sheet.word(0.5 * (middle + rim), "radius", (-5, 2))
    if kind == "cylinder":
        end = middle + np.array([0.0, 0.016, 0.0])
        sheet.arrow(middle, end)
        sheet.word(end, "axis", (3, 6))
    if "semi_axes" in keys:
        for axis, size in zip(np.eye(3), keys["semi_axes"], strict=True):
            sheet.line([middle, middle - size * axis], "ink", 1.0)
        sheet.word(middle - 0.6 * keys["semi_axes"][0] * np.eye(3)[0], "semi_axes", (0, 9))
    return sheet


DRAWINGS: dict[str, Callable[[str], Sheet]] = {
    "chain-rss": rss,
    "chain-pss": pss,
    "chain-sps": sps,
    "chain-cable": cable,
    "contact": contact,
    "friction": friction,
    "landmarks": landmarks,
    "coordinates": coordinates,
    "branches": branches,
    **{f"surface-{kind}": partial(surface, kind) for kind in SURFACES},
    **DIAGRAMS,
}
FILES = tuple(f"{name}-{ground}.svg" for name in DRAWINGS for ground in GROUNDS)


def draw_all(folder: Path) -> None:
    """Write all of `FILES`."""
    import matplotlib as mpl

    with mpl.rc_context({"svg.hashsalt": "condyle", "mathtext.fontset": "dejavusans"}):
        for name, draw in DRAWINGS.items():
            for ground in GROUNDS:
                draw(ground).save(folder / f"{name}-{ground}.svg")
