"""A snapshot as the words and tables of the page."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

import numpy as np

from ..kinematics.chain import FAMILIES
from ..mechanism import COORDINATES, Mechanism
from ..mechanism.chain import limits
from ..mechanism.vocabulary import words_of
from ..results.contacts import joint_loads
from .live_player import LivePlayer
from .session import Directions
from .snapshot import Snapshot

COLOURS = {"ok": "#2b8a3e", "warning": "#b35c00", "unreachable": "#c92a2a"}
SIGNS = {"ok": "✓", "warning": "⚠", "unreachable": "✕"}
_CELL = "padding:1px 5px;text-align:right;white-space:nowrap;font-variant-numeric:tabular-nums"
EVENTS = 8  # that the page lists
DIGITS = 6  # most significant digits
_HEAD = "opacity:.65;font-weight:400"
_NAME = "padding:1px 6px 1px 0;text-align:left;font-weight:500"  # may break after a "_"


def status_html(snapshot: Snapshot) -> str:
    """The status of the pose, with its messages."""
    when = "" if snapshot.time is None else f"t = {snapshot.time:.3f} s. "
    lines = snapshot.messages or ("Within reach and bounds.",)
    items = "<br>".join(map(escape, lines))
    colour, sign = COLOURS[snapshot.level], SIGNS[snapshot.level]
    return (
        f'<div role="status" data-level="{snapshot.level}" style="border-left:4px solid {colour};'
        f'margin:4px 10px;padding:4px 8px;font-size:13px;line-height:1.4">'
        f'<b style="color:{colour}">{sign} {when}</b>{items}</div>'
    )


def tables_html(snapshot: Snapshot) -> str:
    """Pose, chains, contacts and singularity in numbers."""
    parts = [_pose(snapshot), _chains(snapshot)]
    if len(snapshot.contact_force):
        parts.append(_contacts(snapshot))
    parts.append(_singularity(snapshot))
    body = "".join(parts)
    return f'<div style="margin:4px 10px;font-size:12px;overflow-x:auto">{body}</div>'


def internal_text(count: int, sliders: int) -> str:
    """What the sliders of internal efforts are."""
    if not count:
        return "No actuation redundancy: this mechanism has no internal efforts."
    text = "1 direction" if count == 1 else f"{count} directions"
    more = (
        f", of which {sliders} have a slider, those that load the contacts most"
        if sliders < count
        else ""
    )
    return (
        f"{text} of internal efforts{more}. They balance each other: nothing moves, but efforts "
        "and contact forces change. A slider sets the largest effort of its direction."
    )


def effects_html(
    mechanism: Mechanism, directions: Directions, amount: np.ndarray, sliders: int
) -> str:
    """Contact forces per unit of each direction, and the efforts added now."""
    heads = ["Direction", "now", *(f"{name}, N per unit" for name in mechanism.contact_names)]
    loads = joint_loads(mechanism, directions.contact.T)
    rows = [
        [str(i + 1), number(amount[i], 3), *(number(v, 3) for v in loads[i])]
        for i in range(min(directions.count, sliders))
    ]
    added = directions.effort @ amount
    names = mechanism.chain_names
    changed = [[name, number(v, 3)] for name, v in zip(names, added, strict=True) if v]
    say = words_of(mechanism)
    tables = _table(heads, rows, "directions")
    if changed:
        tables += _table([say("Chain"), say("added effort")], changed, "internal")
    return f'<div style="margin:4px 10px;font-size:12px;overflow-x:auto">{tables}</div>'


def live_html(player: LivePlayer) -> str:
    """Tracking error, load forces and events of a simulation, the newest first."""
    now, parts = player.state, []
    if now.error is not None:
        heads, cells = ["Tracking error"], [""]
        for name, error in zip(player.independent, now.error, strict=True):
            length = name in COORDINATES[:3]
            heads.append(f"{name} {'mm' if length else '°'}")
            cells.append(number(error * 1e3 if length else np.degrees(error), 3))
        parts.append(_table(heads, [cells], "errors"))
    names = [*player.load_names, "mouse"]
    rows = [
        [name, number(float(np.linalg.norm(force)), 2, "N")]
        for name, force in zip(names, now.forces, strict=True)
    ]
    if now.bite is not None:
        rows.append(["measured by the controller", number(now.bite, 2, "N")])
    parts.append(_table(["Load", "force"], rows, "loads"))
    lines = map(str, player.live.events[: -EVENTS - 1 : -1])
    items = "<br>".join(map(escape, lines)) or "No events yet."
    parts.append(f'<div data-table="events" style="line-height:1.4">{items}</div>')
    return f'<div style="margin:4px 10px;font-size:12px;overflow-x:auto">{"".join(parts)}</div>'


def _pose(s: Snapshot) -> str:
    values = [*s.pose[:3] * 1e3, *np.degrees(s.pose[3:])]
    units = ["mm"] * 3 + ["°"] * 3
    say = words_of(s.mechanism)
    rows = [
        [say(name), number(value, 2, unit)]
        for name, value, unit in zip(COORDINATES, values, units, strict=True)
    ]
    return _table(["Pose", ""], rows, "pose")


def _chains(s: Snapshot) -> str:
    rows = []
    units = {FAMILIES[chain.kind].joint_unit for chain in s.mechanism.chains}
    for i, chain in enumerate(s.mechanism.chains):
        family = FAMILIES[chain.kind]
        angle = family.joint_unit == "rad"
        unit, scale = ("°", 180 / np.pi) if angle else ("mm", 1e3)
        use = limits(chain).use(s.effort[i])
        row = [
            chain.name,
            number(s.joint[i] * scale, 2, unit),
            number(s.effort[i], 4, family.effort_unit),
            (f"{SIGNS['warning']} " if chain.name in s.over else "")
            + ("" if use is None else "slack" if np.isinf(use) else number(100 * use, 0, "%")),
        ]
        if s.rate is not None:
            row.append(number(s.rate[i], 3, "" if len(units) == 1 else f"{family.joint_unit}/s"))
        if s.reach is not None:
            row.append(number(s.reach[i], 3))
        rows.append(row)
    speed = f"{units.pop()}/s" if len(units) == 1 else "speed"
    last = speed if s.reach is None else "reach"
    heads = map(words_of(s.mechanism), ["Chain", "joint", "effort", "of limit", last])
    return _table(list(heads), rows, "chains")


def _contacts(s: Snapshot) -> str:
    rows = []
    for name, force, margin in zip(
        s.mechanism.contact_names, joint_loads(s.mechanism, s.contact_force), s.margin, strict=True
    ):
        room = "no bounds" if np.isposinf(margin) else number(margin * 1e3, 3, "mm")
        rows.append([name, number(force, 3, "N"), room])
    heads = map(words_of(s.mechanism), ["Contact", "force", "to the bounds"])
    return _table(list(heads), rows, "contacts")


def _singularity(s: Snapshot) -> str:
    row = ["", number(s.ratio, 4), number(s.condition, 2), s.near]
    return _table(
        [words_of(s.mechanism)("Singularity"), "ratio", "condition", "near"], [row], "singularity"
    )


def number(value: float, decimals: int, unit: str = "") -> str:
    """A number with its unit, or a dash where there is none; large ones have fewer decimals."""
    if not np.isfinite(value):
        return "–"
    decimals = min(decimals, max(DIGITS - 1 - int(np.log10(max(abs(value), 1.0))), 0))
    text = f"{value:.{decimals}f}"
    return f"{text if float(text) else text.replace('-', '')} {unit}".rstrip()


def _table(header: Sequence[str], rows: Sequence[Sequence[str]], name: str) -> str:
    head = "".join(
        f'<th scope="col" style="{_CELL if i else _NAME};{_HEAD};white-space:normal">'
        f"{escape(h)}</th>"
        for i, h in enumerate(header)
    )
    body = "".join(
        "<tr>"
        + "".join(
            f'<td style="{_CELL}">{escape(cell)}</td>'
            if i
            else f'<td style="{_NAME}">{escape(cell).replace("_", "_<wbr>")}</td>'
            for i, cell in enumerate(row)
        )
        + "</tr>"
        for row in rows
    )
    return (
        f'<table data-table="{name}" style="border-collapse:collapse;width:100%;margin-bottom:6px">'
        f"<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"
    )
