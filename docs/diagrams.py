"""Drawings of what has no single place in the scene: bodies, limits, lines, and two schemes."""

from __future__ import annotations

from typing import Any

import numpy as np
from sheet import FROM, Sheet, chain_sheet

FLAT = (0.0, -1.0, 0.0)  # a sheet seen from the front: X to the right, Z up


def _box(sheet: Sheet, at: tuple[float, float], text: str, tint: str = "ink") -> None:
    frame = {"boxstyle": "round,pad=0.35", "fc": "none", "ec": sheet.tint(tint), "lw": 1.3}
    sheet.word((at[0], 0.0, at[1]), text, (0, 0), tint, bbox=frame)
    _take_in(sheet, at)


def _take_in(sheet: Sheet, *places: tuple[float, float]) -> None:
    """The limits of the sheet take in places (x, z)."""
    for x, z in places:
        sheet.line([(x, 0.0, z)] * 2, alpha=0)


def _lead(sheet: Sheet, start: Any, end: Any, text: str = "", by: Any = (0, 7)) -> None:
    """An arrow between two places (x, z), and what it means."""
    start, end = ((x, 0.0, z) for x, z in (start, end))
    sheet.arrow(start, end, "soft", lw=1.3, mutation_scale=10)
    if text:
        sheet.word(np.mean([start, end], axis=0), text, by, "soft", fontsize=8)


def controller_states(ground: str) -> Sheet:
    """States of the exported controller, and what leads from one to the other."""
    sheet = Sheet(ground, FLAT, (6.2, 3.0))
    sheet.room = (0.1, 0.1)
    off, homing, hold, run, stop = (0, 0), (0.06, 0), (0.12, 0), (0.12, 0.03), (0.06, -0.032)
    for at, text, tint in (
        (off, "off", "ink"), (homing, "homing", "chain"), (hold, "hold", "chain"),
        (run, "run", "chain"), (stop, "safe stop", "force"),
    ):  # fmt: skip
        _box(sheet, at, text, tint)
    _lead(sheet, (0.008, 0), (0.045, 0), "asked for")
    _lead(sheet, (0.075, 0), (0.111, 0), "home reached")
    _lead(sheet, (0.117, 0.006), (0.117, 0.025), "run", (-14, 0))
    _lead(sheet, (0.123, 0.025), (0.123, 0.006), "hold", (14, 0))
    _lead(sheet, (0.06, -0.006), (0.06, -0.026))
    sheet.word((0.06, 0.0, -0.043), "ticks late or readings lost", (0, 0), "soft", fontsize=8)
    _take_in(sheet, (0.06, -0.046))
    _lead(sheet, (0.115, -0.006), (0.074, -0.03))
    _lead(sheet, (0.046, -0.032), (0.004, -0.006), "off asked for", (-34, -6))
    return sheet


def formulations(ground: str) -> Sheet:
    """Five ways to the forces of the mechanism, two routes, one reduction."""
    sheet = Sheet(ground, FLAT, (6.6, 3.6))
    sheet.room = (0.13, 0.06)
    names = ("virtual_power", "momentum", "lagrange", "hessian", "newton_euler")
    for i, name in enumerate(names):
        z = 0.05 - 0.025 * i
        _box(sheet, (0.0, z), name, "chain")
        _lead(sheet, (0.02, z), (0.055, 0.03 - 0.01 * i * 0.5 if i < 5 else 0))
    sheet.word((0.0, 0.0, 0.07), "how forces are found", (0, 0), "soft")
    _box(sheet, (0.078, 0.022), "forces $Q$\nwithout contacts", "joint")
    sheet.word((0.078, 0.0, 0.07), "route", (0, 0), "soft")
    sheet.word((0.078, 0.0, 0.048), "core: six coordinates\ndirect: q alone", (0, 0), "soft")
    _lead(sheet, (0.1, 0.022), (0.124, 0.022), "$M_J^T$")
    _box(sheet, (0.148, 0.022), "$M_J^T Q =$\n$(J_\\theta M_J)^T \\tau$", "force")
    sheet.word((0.148, 0.0, 0.07), "contacts drop out", (0, 0), "soft")
    _lead(sheet, (0.148, 0.008), (0.148, -0.02), "distribution", (32, 0))
    _box(sheet, (0.148, -0.03), "efforts $\\tau$", "force")
    _lead(sheet, (0.13, -0.03), (0.102, -0.03))
    _box(sheet, (0.078, -0.03), "contact forces\n$Q - J_\\theta^T \\tau$", "surface")
    _take_in(sheet, (0.0, 0.075))
    return sheet


def actuator(ground: str) -> Sheet:
    """From the rotor through the gear to the joint, whose reading has a zero of its own."""
    from matplotlib.patches import Arc

    sheet = Sheet(ground, FLAT, (5.2, 2.7))
    sheet.room = (0.19, 0.2)
    for at, text, tint in (
        ((0.0, 0.0), "rotor\nrotor_inertia", "chain"), ((0.05, 0.0), "gear", "joint"),
    ):  # fmt: skip
        _box(sheet, at, text, tint)
    _lead(sheet, (0.018, 0), (0.041, 0))
    _lead(sheet, (0.059, 0), (0.092, 0), "viscous,\ncoulomb", (0, 13))
    hub, arm = np.array([0.1, 0.0, 0.0]), 0.032
    angles = {"encoder's 0": -0.5, "home": 0.0, "now": 0.7}
    for (name, angle), tint in zip(angles.items(), ("soft", "soft", "chain"), strict=True):
        end = hub + arm * np.array([np.cos(angle), 0.0, np.sin(angle)])
        sheet.line(
            [hub, end], tint, 4.0 if name == "now" else 1.0, ls="-" if name == "now" else "--"
        )
        sheet.word(end, name, (5, 0), tint, fontsize=8.5)
    sheet.dot(hub)
    centre = tuple(sheet.flat(hub))
    for radius, start, end, text, tint in (
        (15, 0.0, 0.7, "joint  $\\theta$", "chain"), (22, -0.5, 0.0, "zero", "joint"),
    ):  # fmt: skip
        span = {"theta1": np.degrees(start), "theta2": np.degrees(end)}
        sheet.axes.add_patch(Arc(centre, 2 * radius, 2 * radius, color=sheet.tint(tint), **span))
        middle = 0.5 * (start + end)
        place = hub + 1e-3 * radius * np.array([np.cos(middle), 0.0, np.sin(middle)])
        sheet.word(place, text, (4, 2), tint, fontsize=8.5)
    sheet.word(hub, "effort at the joint,\nwithin torque_limit", (-4, -26), "force", ha="center")
    sheet.word(
        hub + np.array([0.016, 0, 0.04]), "reading = joint + zero", (0, 6), "soft", ha="center"
    )
    return sheet


def bodies(ground: str) -> Sheet:
    """Mass centres along a chain, and the moments of a rod along and across it."""
    sheet, _, at = chain_sheet(ground, "masticatory", 2, (0.05, -1.0, 0.1))
    sheet.room = (0.34, 0.22)
    for start, end, share, text, by in (
        (at["G"], at["S"], 0.45, "crank com", (8, 10)),
        (at["S"], at["M"], 0.5, "coupler com", (10, 4)),
    ):
        sheet.dot((1 - share) * start + share * end, "body", 9)
        sheet.word((1 - share) * start + share * end, text, by, fontsize=8.5)
    along = (at["M"] - at["S"]) / np.linalg.norm(at["M"] - at["S"])
    middle, across = 0.5 * (at["S"] + at["M"]), np.cross(along, (0.05, -1.0, 0.1))
    across /= np.linalg.norm(across)
    size = 0.22 * np.linalg.norm(at["M"] - at["S"])
    for axis, text, by in ((along, "axial", (8, -4)), (across, "transverse", (-4, 10))):
        sheet.arrow(middle, middle + size * axis, "force", lw=1.3, mutation_scale=10)
        sheet.word(middle + size * axis, text, by, "force", fontsize=8.5)
    for name, by in (("G", (-8, -8)), ("S", (-8, 8)), ("M", (8, -8))):
        sheet.word(at[name], f"${name}$", by)
    return sheet


def bounds(ground: str) -> Sheet:
    """The part of a surface on which its contact may be."""
    from condyle.mechanism import Contact
    from condyle.report.scene import contact_patch

    keys = {"kind": "plane", "slope": [-0.5, 0.0], "offset": 0.012}
    at, x, y = np.array([0.012, 0.0, 0.006]), (0.004, 0.022), (-0.008, 0.008)
    made = Contact.model_validate(
        {"name": "ball", "point": tuple(at), "surface": keys, "side": "below"}
        | {"bounds": {"x": x, "y": y}}
    )
    patch = contact_patch(made, at[None], 0.2)
    sheet = Sheet(ground, FROM)
    sheet.mesh(patch.vertices[patch.faces], "surface")
    height = 0.012 - 0.5 * np.array([x[0], x[1], x[1], x[0], x[0]])
    corners = np.column_stack(
        [[x[0], x[1], x[1], x[0], x[0]], [y[0], y[0], y[1], y[1], y[0]], height]
    )
    sheet.line(corners, "force", 1.8)
    low = corners * [1.0, 1.0, 0.0] + [0.0, 0.0, -0.004]
    sheet.line(low, "soft", 0.9, ls=":")
    for corner, foot in zip(corners[:4], low[:4], strict=True):
        sheet.line([corner, foot], "soft", 0.6, ls=":")
    sheet.word(0.5 * (low[0] + low[1]), "bounds.x", (-4, -10), ha="center")
    sheet.word(0.5 * (low[1] + low[2]), "bounds.y", (4, -8))
    sheet.room = (0.27, 0.14)
    sheet.ball(at - 0.004 * np.array([0.447, 0.0, 0.894]), 0.004, behind=True)
    sheet.frame((-0.001, -0.01, -0.004), 0.005, "{S}", (8, -12))
    return sheet


def lines(ground: str) -> Sheet:
    """A muscle by way of a point of the skull, and a ligament beside it, slack and taut."""
    sheet = Sheet(ground, FLAT, (4.6, 3.0))
    sheet.room = (0.2, 0.2)
    base, via, end = (0.0, 0.0, 0.05), (0.022, 0.0, 0.046), (0.05, 0.0, 0.008)
    sheet.line([base, via, end], "chain", 4.0)
    for at, text, by in ((base, "base, in {S}", (-4, 10)), (via, "via, in {S}", (4, 9))):
        sheet.dot(at)
        sheet.word(at, text, by, ha="center" if at is base else "left")
    around = np.array([(-0.012, 0, -0.012), (0.02, 0, -0.014), (0.02, 0, 0.004), (0, 0, 0.004)])
    sheet.area(end + around, "body", 0.8)
    sheet.dot(end)
    sheet.word(end, "platform, in {M}", (8, -4))
    sheet.word(np.mean([via, end], axis=0), "muscle", (8, 4), "chain")
    root, low = np.array([0.0, 0.0, 0.02]), np.array([0.042, 0.0, -0.003])
    reach = np.linspace(0, 1, 40)[:, None]
    slack = root + reach * (low - root) - [0, 0, 0.008] * np.sin(np.pi * reach)
    sheet.line(slack, "force", 2.0, ls="--")
    sheet.dot(root, "force", 6)
    sheet.dot(low, "force", 6)
    sheet.word(slack[20], "ligament, slack:\nno force up to slack_length", (14, 26), "force",
               ha="center", fontsize=8.5)  # fmt: skip
    return sheet


def assembly_modes(ground: str) -> Sheet:
    """Two poses of a platform on the same lengths of its legs."""
    import condyle
    from condyle.mechanism.coordinates import rotations
    from condyle.model.forward_kinematics import ForwardKinematics

    machine = condyle.load_mechanism("gough-stewart")
    found = ForwardKinematics(machine).modes(np.zeros(6))
    order = np.argsort(found.distance)
    sheet = Sheet(ground, (0.7, -1.0, 0.25), (5.4, 2.4))
    sheet.room = (0.05, 0.25)
    base = np.array([chain.base for chain in machine.chains])
    on = np.array([chain.platform for chain in machine.chains])
    apart = np.cross(sheet.away, (0.0, 0.0, 1.0)) * -1.5 * np.ptp(base[:, 0])
    for place, number, name in ((0, order[0], "home"), (1, order[1], "another assembly mode")):
        pose = found.pose[number]
        tips = pose[:3] + on @ rotations(pose[None, 3:])[0].T
        shift = place * apart
        ring = base[np.argsort(np.arctan2(*(base - base.mean(axis=0))[:, :2].T))]
        sheet.area(ring + shift, "soft", 0.25)
        sheet.area(tips[np.argsort(np.arctan2(*on[:, :2].T))] + shift, "body", 0.8)
        for foot, tip in zip(base, tips, strict=True):
            sheet.line([foot + shift, tip + shift], "chain", 2.2)
            sheet.dot(foot + shift, "soft", 4)
            sheet.dot(tip + shift, "joint", 5)
        sheet.word(base.mean(axis=0) + shift, name, (0, -46), ha="center")
    return sheet


DIAGRAMS = {
    "controller-states": controller_states,
    "formulations": formulations,
    "actuator": actuator,
    "bodies": bodies,
    "bounds": bounds,
    "lines": lines,
    "assembly-modes": assembly_modes,
}
