"""The scene for the page's 3D view: its solids, and where the page finds what moves them.

A point is one of {"fixed": [x, y, z]} in {S}, {"platform": [x, y, z]} in {M}, or
{"columns": [i, j, k]}: numbers of the columns with its coordinates in {S}. Metres throughout.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from ...mechanism.vocabulary import words_of
from ..panel_list import activation_rows, activation_top
from ..scene import (
    ACTIVATION,
    DARK,
    LIGHT,
    MARKERS,
    ROLES,
    VIEWS,
    Force,
    Scene,
    SceneParts,
    Solid,
    cloud,
    force_scales,
    forces_of,
    parts_of,
    place,
    trails,
)
from ..scene.arrows import SHAFT, TINTS
from ..scene.place import PLATFORM_JOINT, of_ligament
from ..scene.solids import ARROWHEAD, HEAD, HEAD_PART, arrow
from ..scene.solids import SHAFT as UNIT_SHAFT
from .html import Markup, tag
from .page_columns import PageColumns

if TYPE_CHECKING:
    import xarray as xr

TRIAD = 0.4  # arms of the coordinate triad, before they are rounded
TRIAD_SHAFT = 0.02
ROUND = (1.0, 2.0, 5.0, 10.0)
WIDE = (1.0, 99.0)  # percent of its samples that the picture must hold of each marker
# Groups of solids in the order in which the page holds them, and the layer that shows each.
MOVING = {"platform": "platform", "chains": "chains", "joints": "chains", "balls": "platform"}
STILL = {"surfaces": "surfaces", "axes": "axes"}
LAYERS = ("platform", "chains", "surfaces", "forces", "traces", "markers", "labels", "axes")


@dataclass(frozen=True)
class StageData:
    """What the page draws of a mechanism: `data` for its script, `notes` below the picture."""

    data: dict[str, Any]
    notes: Markup

    @property
    def layers(self) -> list[str]:
        """What can be shown and hidden: of those that may be empty, what there is."""
        there = {solid["group"] for solid in self.data["solids"]}
        optional = {"surfaces": "surfaces" in there}
        optional |= {layer: bool(self.data[layer]) for layer in ("forces", "markers")}
        return [layer for layer in LAYERS if optional.get(layer, True)]


def stage(solution: xr.Dataset, columns: PageColumns) -> StageData:
    """Everything the 3D view draws."""
    mechanism = solution.condyle.mechanism
    scene = place(mechanism, solution["pose"].values, solution["joint"].values)
    parts = parts_of(mechanism, scene)
    forces = forces_of(solution, scene, parts)
    scales = force_scales(forces, parts.size)
    ends = [end for force in forces for end in force.ends(scene, scales[force.kind])]
    everything = np.vstack([cloud(scene, parts.body.vertices), reach(solution), *ends])
    spare = 0.15 * parts.size
    low, high = np.nanmin(everything, axis=0) - spare, np.nanmax(everything, axis=0) + spare
    arm = _rounded(TRIAD * parts.size)
    tips = low + arm * np.eye(3)
    axes = [Solid("axes", "", *arrow(low, tip, TRIAD_SHAFT * parts.size), "soft") for tip in tips]
    solids = [s for s in (*parts.solids, *axes) if s.group in MOVING | STILL]
    at = _chain_points(solution, scene, columns)
    rows = {row.label: row for row in activation_rows(solution)}
    patches = list(parts.surfaces.values())
    data = {
        "views": {name: {"from": away, "up": up} for name, (away, up) in VIEWS.items()},
        "view": parts.view,
        "pose": [
            columns.add(f"pose.{name}", solution["pose"].values[:, i])
            for i, name in enumerate(solution["coordinate"].values)
        ],
        "layers": MOVING | {"forces": "forces"} | STILL,
        "solids": [_solid(s, at, rows, columns) for s in solids],
        "activationTop": activation_top(solution),
        "forces": [_force(f, scales[f.kind], columns) for f in forces],
        "arrow": {
            "pieces": [_mesh(*UNIT_SHAFT), _mesh(*ARROWHEAD)],
            "radius": SHAFT * parts.size,
            "head": HEAD,
            "headPart": HEAD_PART,
        },
        "balls": _named((c.name, c.point) for c in mechanism.contacts),
        "landmarks": _named(mechanism.platform.points.items()),
        "markers": markers(solution, columns),
        "markerStyles": {
            body: {"colour": colour, "symbol": symbol}
            for body, (colour, symbol, *_) in MARKERS.items()
        },
        "borders": [line for patch in patches if patch.bounded for line in patch.outline.tolist()],
        "hatch": [line for patch in patches for line in patch.hatch.tolist()],
        "traces": _named(trails(solution)),
        "range": [[float(a), float(b)] for a, b in zip(low, high, strict=True)],
        "axisNames": (low + 1.22 * (tips - low)).tolist(),
        "extent": _extremes(np.vstack([everything, tips])).tolist(),
    }
    return StageData(data, _notes(solution, parts, forces, scales, arm))


def _chain_points(
    solution: xr.Dataset, scene: Scene, columns: PageColumns
) -> dict[tuple[str, str], dict[str, Any]]:
    """Where the page finds each point of a chain or ligament."""
    mechanism = solution.condyle.mechanism
    held = {chain.name: chain.platform for chain in mechanism.chains}
    held |= {of_ligament(one.name): one.platform for one in mechanism.ligaments}
    at: dict[tuple[str, str], dict[str, Any]] = {}
    for chain, insertion in held.items():
        for name, point in scene.chains[chain].points.items():
            if name == PLATFORM_JOINT:
                at[chain, name] = {"platform": list(insertion)}
            elif point.ndim == 1:
                at[chain, name] = {"fixed": point.tolist()}
            else:
                numbers = columns.add_vector(f"point.{chain}.{name}", point)
                at[chain, name] = {"columns": numbers}
    return at


def _solid(
    solid: Solid, at: dict[tuple[str, str], Any], rows: dict[str, Any], columns: PageColumns
) -> dict[str, Any]:
    keys = ("group", "owner", "colour", "opacity", "motion")
    entry = {key: getattr(solid, key) for key in keys} | _mesh(solid.vertices, solid.faces)
    entry["points"] = [at[solid.owner, name] for name in solid.points]
    if (row := rows.get(solid.owner)) is not None and solid.colour == "activation":
        entry["column"] = columns.add(row.column, row.values, line=True)
        entry["scale"] = 1.0 if row.scale is None else row.scale
    return entry


def _mesh(vertices: np.ndarray, faces: np.ndarray) -> dict[str, Any]:
    return {"vertices": np.round(vertices, 9).tolist(), "faces": faces.tolist()}


def _force(force: Force, scale: float, columns: PageColumns) -> dict[str, Any]:
    numbers = columns.add_vector(f"{force.kind}_vector.{force.owner}", force.vector)
    return {
        "kind": force.kind,
        "into": force.into,
        "gap": force.gap,
        "colour": TINTS[force.kind],
        "at": {"platform": list(force.at)},
        "columns": numbers,
        "metresPerNewton": scale,
    }


def _named(points: Any) -> list[dict[str, Any]]:
    return [{"name": name, "at": {"platform": list(point)}} for name, point in points]


def _notes(
    solution: xr.Dataset,
    parts: SceneParts,
    forces: Sequence[Force],
    scales: dict[str, float],
    arm: float,
) -> Markup:
    """Scales of the picture and legends of its colours."""
    mechanism, lines = solution.condyle.mechanism, []
    say = words_of(mechanism)
    if any(solid.colour == "activation" for solid in parts.solids) and activation_rows(solution):
        top = activation_top(solution)
        stops = ", ".join(f"var(--activation-{k})" for k in range(len(ACTIVATION[0]) - 1))
        ramp = tag("span", class_="ramp", style=f"background:linear-gradient(90deg, {stops})")
        more: list[Any] = []
        if top == 1.0:
            beyond = f"color:var(--activation-{len(ACTIVATION[0]) - 1})"
            more = ["; beyond: ", tag("span", "■", style=beyond)]
        widths = ". Widths by the root of the greatest force."
        lines.append(["Muscles by activation: 0 ", ramp, f" {top:g}", *more, widths])
    there = set(map(str, solution["marker_body"].values)) if "marker_place" in solution else ()
    signs = [
        [tag("span", sign, style=f"color:var(--colour-{colour})"), f" {text}"]
        for body, (colour, _, sign, text) in MARKERS.items()
        if body in there
    ]
    if signs:
        lines.append([part for n, sign in enumerate(signs) for part in ([", "] * (n > 0) + sign)])
    text = [f"Arms of the axes: {_length(arm)}."]
    words = {"load": "load", "contact": say("contact forces")}
    arrows = [
        f"{words[kind]} {_length(arm)} for {arm / scale:.2g} N, at most "
        f"{max(f.largest for f in forces if f.kind == kind):.4g} N"
        for kind, scale in scales.items()
        if scale
    ]
    if arrows:
        text.append(f"Arrows: {'; '.join(arrows)}.")
    if any(len(patch.hatch) for patch in parts.surfaces.values()):
        text.append(say("Strokes at a surface point away from the side of the contact."))
    drawn = {solid.owner for solid in parts.of_group("surfaces") if len(solid.faces)}
    if undrawn := [name for name in mechanism.contact_names if name not in drawn]:
        text.append(
            "Not drawn, because the surface's equation is not in the solution: "
            f"{', '.join(undrawn)}."
        )
    lines.append([" ".join(text)])
    return Markup("".join(tag("p", *line, class_="note") for line in lines))


def _length(metres: float) -> str:
    return f"{1e3 * metres:.3g} mm" if metres < 1 else f"{metres:.3g} m"


def style() -> Markup:
    """Colours of both grounds, as properties that the page and its script read."""

    def block(selector: str, dark: bool) -> str:
        found = {f"colour-{k}": c for k, c in enumerate(DARK if dark else LIGHT)}
        found |= {f"role-{name}": pair[dark] for name, pair in ROLES.items()}
        found |= {f"activation-{k}": c for k, c in enumerate(ACTIVATION[dark])}
        return f"{selector} {{ {' '.join(f'--{n}: {c};' for n, c in found.items())} }}"

    return Markup(f"{block(':root', False)}\n{block(':root[data-theme=dark]', True)}\n")


def _extremes(cloud: np.ndarray) -> np.ndarray:
    """The points that lie furthest out in 26 directions, (E, 3): what a camera must see."""
    points = cloud[np.isfinite(cloud).all(axis=1)]
    steps = np.array(list(product((-1.0, 0.0, 1.0), repeat=3)))
    return points[np.unique(np.argmax(points @ steps.T, axis=0))]


def _rounded(length: float) -> float:
    """The nearest of 1, 2, 5 times a power of ten."""
    power = 10.0 ** np.floor(np.log10(length))
    return float(power * min(ROUND, key=lambda digit: abs(digit - length / power)))


def markers(solution: xr.Dataset, columns: PageColumns) -> list[dict[str, Any]]:
    """Measured markers: name, body, and the numbers of the columns of its place."""
    if "marker_place" not in solution:
        return []
    places, names = solution["marker_place"].values, solution["marker"].values
    return [
        {
            "name": str(name),
            "body": str(body),
            "columns": columns.add_vector(f"marker.{name}", places[:, i]),
        }
        for i, (name, body) in enumerate(zip(names, solution["marker_body"].values, strict=True))
    ]


def reach(solution: xr.Dataset) -> np.ndarray:
    """Corners, (2 m, 3) [m], between which each marker mostly is."""
    if "marker_place" not in solution:
        return np.empty((0, 3))
    places = solution["marker_place"].values
    seen = [p[np.isfinite(p).all(axis=1)] for p in places.transpose(1, 0, 2)]
    corners = [c for p in seen if len(p) for c in np.percentile(p, WIDE, axis=0)]
    return np.array(corners).reshape(-1, 3)
