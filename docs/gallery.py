"""The gallery: a picture of each machine or study, light and dark, its viewer, and the cards.

A page of `gallery` has the words, the command and the asserted number; `SHOWN` has what is drawn.
The viewer is the report's page of a run: one file that opens from a disk, without a network.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from sheet import GROUNDS, TINTS, Sheet

HERE = Path(__file__).parent
EXAMPLES = HERE.parent / "examples"
SIZE = (5.2, 3.6)  # inch
CARDS = "gallery.md"
FOODS = ("bolus", "firm_bolus", "peanut")
STROKE = 1.9  # s; the first food is bitten by then
Draw = Callable[[str], Any]


@dataclass(frozen=True)
class Shown:
    """A run, for the viewer, and the figure on a ground, light or dark."""

    run: Any
    draw: Draw


def machine_sheet(ground: str, mechanism: Any, pose: Any, joint: Any, away: Any) -> Sheet:
    """A mechanism at a pose: platform, rods or muscles, joints, surfaces of contacts."""
    from condyle.mechanism.vocabulary import of_muscles
    from condyle.report.scene import parts_of, place

    sheet = Sheet(ground, away, SIZE)
    sheet.room = 0.06, 0.06
    scene = place(mechanism, np.atleast_2d(pose), np.atleast_2d(joint))
    parts = parts_of(mechanism, scene)
    if {chain.kind for chain in mechanism.chains} == {"cable"} and not mechanism.contacts:
        for edge in box_edges(np.array([chain.base for chain in mechanism.chains])):
            sheet.line(edge, "soft", 1.0)
    body = scene.position[0] + parts.body.vertices @ scene.rotation[0].T
    sheet.mesh(body[parts.body.faces], "body", 0.85)
    for patch in parts.surfaces.values():
        sheet.mesh(patch.vertices[patch.faces], "surface")
    for name, drawing in scene.chains.items():
        at = {key: np.atleast_2d(point)[0] for key, point in drawing.points.items()}
        muscle = name not in mechanism.chain_names or of_muscles(mechanism)
        for rod in drawing.rods:
            tint = "force" if muscle else "chain" if rod.moving else "soft"
            sheet.line([at[rod.start], at[rod.end]], tint, 1.4 if muscle else 1.6 + rod.thickness)
        for ball in () if muscle else drawing.balls:
            sheet.dot(at[ball], size=4.5)
    for name, place_of in scene.contacts.items():
        sheet.ball(place_of[0], parts.balls[name], behind=False)
    return sheet


def box_edges(points: np.ndarray) -> list[np.ndarray]:
    """The twelve edges of the box round points (N, 3): the frame that cables hang from."""
    corners = np.stack(np.meshgrid(*np.stack([points.min(0), points.max(0)]).T), -1).reshape(-1, 3)
    pairs = [(a, b) for a in corners for b in corners if np.sum(a != b) == 1]
    return [np.array(pair) for pair in pairs if tuple(pair[0]) < tuple(pair[1])]


def machine(name: str, away: Any, run: Any = None, at: int = 0) -> Shown:
    """A bundled machine, at a sample of a run; default: along the trial motion, at home."""
    import condyle

    mechanism = condyle.load_mechanism(name)
    if run is None:
        model = condyle.derive(mechanism, backend="numpy")
        run = model.solve(condyle.trial_motion(mechanism, rate=20.0))
    pose, joint = run.pose.values[at], run.joint.values[at]
    return Shown(run, lambda ground: machine_sheet(ground, mechanism, pose, joint, away))


def chewing(name: str) -> Shown:
    """A chewing robot along its bundled path and bite."""
    return machine(name, (0.3, -1.0, 0.3), reference_run(name))


def reference_run(machine: Any) -> Any:
    """A machine along the bundled chewing path, under its bite."""
    import condyle
    from condyle.motion import Motion, bundled_reference

    motion = Motion.from_csv(bundled_reference()[0], rate=50.0)
    model = condyle.derive(machine, backend="numpy")
    return model.solve(motion, condyle.reference_load())


def jaw() -> Shown:
    """The human jaw opens and closes; drawn where it is widest open."""
    import condyle

    motion = condyle.Motion.from_csv(EXAMPLES / "jaw_opens.csv", rate=50.0)
    run = condyle.derive("human-jaw", distribution="cubic", backend="numpy").solve(motion)
    widest = int(np.abs(run.pose.sel(coordinate="beta").values).argmax())
    return machine("human-jaw", (0.55, -1.0, 0.25), run, widest)


def prosthesis() -> Shown:
    """The jaw with a prosthesis opens and tilts; drawn where it is widest open."""
    import condyle

    model = condyle.derive("human-jaw-prosthesis", distribution="cubic", backend="numpy")
    t = np.linspace(0, 2, 101)
    opening = 0.12 * (1 - np.cos(np.pi * t)) / 2
    motion = condyle.Motion.from_arrays(t, {"alpha": 0 * t, "beta": opening})
    run = model.solve(motion)
    return machine("human-jaw-prosthesis", (0.55, 1.0, 0.25), run, 50)


class Chart:
    """Axes in the ink of a ground; saved as a sheet is."""

    def __init__(self, ground: str, across: str, up: str) -> None:
        from matplotlib.figure import Figure

        self.figure = Figure(figsize=SIZE, layout="constrained")
        self.axes = self.figure.add_subplot(facecolor="none")
        self.ink = GROUNDS[ground]
        self.colours = [TINTS[name][ground == "dark"] for name in ("chain", "joint", "force")]
        self.axes.set_xlabel(across, color=self.ink)
        self.axes.set_ylabel(up, color=self.ink)
        self.axes.tick_params(colors=self.ink)
        for side, spine in self.axes.spines.items():
            spine.set(color=self.ink, visible=side in ("left", "bottom"))

    def legend(self, **where: Any) -> None:
        self.axes.legend(frameon=False, labelcolor=self.ink, **where)

    def save(self, path: Path) -> None:
        self.figure.savefig(path, transparent=True)


def scenario(name: str, food: str = "bolus") -> dict[str, Any]:
    """An example up to the end of its first stroke on a food."""
    made = tomllib.loads((EXAMPLES / f"{name}.toml").read_text(encoding="utf-8"))
    made["load"][0]["food"] = food
    return made | {"duration": STROKE}


def on_food(run: Any) -> tuple[np.ndarray, np.ndarray]:
    """Time [s] and force on the food [N]."""
    return run.time.values, np.linalg.norm(run.load_force.sel(source="food").values, axis=1)


def foods() -> Shown:
    """The same stroke on three foods."""
    import condyle

    runs = condyle.simulate("masticatory", [scenario("chew", food) for food in FOODS])

    def draw(ground: str) -> Chart:
        chart = Chart(ground, "time [s]", "force on the food [N]")
        for run, food, colour in zip(runs, FOODS, chart.colours, strict=True):
            chart.axes.plot(*on_food(run), color=colour, lw=2, label=food.replace("_", " "))
        chart.axes.set_xlim(1.4, STROKE)
        chart.legend()
        return chart

    return Shown(runs[-1], draw)


def bite_control() -> Shown:
    """Chewing as the path wants, and with the bite held at 20 N."""
    import condyle

    soft, bite = scenario("chew"), scenario("bite")
    soft["controller"]["stiffness"] = bite["controller"]["stiffness"]
    labels = "computed torque", "bite force of 20 N"
    runs = [condyle.simulate("masticatory", one) for one in (soft, bite)]

    def draw(ground: str) -> Chart:
        chart = Chart(ground, "time [s]", "force on the food [N]")
        for run, label, colour in zip(runs, labels, chart.colours, strict=False):
            chart.axes.plot(*on_food(run), color=colour, lw=2, label=label)
        chart.axes.axhline(20.0, color=chart.ink, lw=1, ls=":")
        chart.axes.set_xlim(1.4, STROKE)
        chart.legend(loc="lower right")
        return chart

    return Shown(runs[-1], draw)


def front() -> Shown:
    """Variants of the example study, and those that no other beats in both measures."""
    import condyle
    from condyle.analysis.sweep.effects import pareto

    table = condyle.sweep(EXAMPLES / "study.toml", workers=1)
    effort, load = table.peak_effort.values, -table.joint_load.values
    on = np.isin(table.variant.values, pareto(table).variant.values)

    def draw(ground: str) -> Chart:
        chart = Chart(ground, "peak torque [N m]", "greatest load of the left joint [N]")
        chart.axes.plot(effort[~on], load[~on], "o", color=chart.colours[0], alpha=0.55, ms=5)
        order = np.argsort(effort[on])
        x, y = effort[on][order], load[on][order]
        chart.axes.plot(x, y, "o-", color=chart.colours[2], lw=2, ms=6, label="Pareto front")
        chart.legend()
        return chart

    best = table.isel(row=int(effort.argmin()))
    height = best["chain.masseter_left.base[2]"].item()
    numbers = {f"chain.masseter_{side}.base[2]": height for side in ("left", "right")}
    numbers["platform.mass"] = best["platform.mass"].item()
    return Shown(reference_run(condyle.load_mechanism("masticatory").set(numbers)), draw)


def workspace() -> Shown:
    """Nearness to singularities over travel and opening, and the chewing path."""
    import condyle

    model = condyle.derive("masticatory", backend="numpy")
    axes = ["X=-5:15:120 mm", "beta=-15:25:120 deg"]
    found = condyle.workspace_map(model, axes, "ratio")
    run = reference_run("masticatory")
    x, beta = 1e3 * found.X.values, np.degrees(found.beta.values)
    path = run.pose.sel(coordinate=["X", "beta"]).values * (1e3, np.degrees(1.0))

    def draw(ground: str) -> Chart:
        chart = Chart(ground, "X [mm]", "opening beta [deg]")
        shade = chart.axes.pcolormesh(
            x, beta, found.ratio.values.T, cmap="viridis", rasterized=True
        )
        bar = chart.figure.colorbar(shade)
        bar.set_label("singularity ratio", color=chart.ink)
        bar.ax.tick_params(colors=chart.ink)
        chart.axes.plot(*path.T, color="#ffffff", lw=2.5)
        chart.axes.plot(*path.T, color="#c2185b", lw=1.2)
        return chart

    return Shown(run, draw)


SHOWN: dict[str, Callable[[], Shown]] = {
    "gough-stewart": lambda: machine("gough-stewart", (0.6, -1.0, 0.4)),
    "epfl-jaw": lambda: machine("epfl-jaw", (0.6, -1.0, 0.4)),
    "hexaglide": lambda: machine("hexaglide", (0.6, -1.0, 0.45)),
    "cable-robot": lambda: machine("cable-robot", (0.45, -1.0, 0.3)),
    "eight-leg": lambda: machine("eight-leg", (0.6, -1.0, 0.4)),
    "sphere-in-cylinder": lambda: machine("sphere-in-cylinder", (0.75, -1.0, 0.35)),
    "chewing-robot": lambda: chewing("masticatory"),
    "chewing-robot-curved": lambda: chewing("masticatory-curved"),
    "human-jaw": jaw,
    "human-jaw-prosthesis": prosthesis,
    "foods": foods,
    "pareto": front,
    "workspace": workspace,
    "bite-control": bite_control,
}
FILES = (
    *(f"gallery-{name}-{ground}.png" for name in SHOWN for ground in GROUNDS),
    *(f"gallery-{name}.html" for name in SHOWN),
)


def draw_gallery(folder: Path) -> None:
    """Write all of `FILES`."""
    import matplotlib as mpl

    import condyle

    for name, make in SHOWN.items():
        shown = make()
        for ground in GROUNDS:
            with mpl.rc_context({"savefig.dpi": 160}):
                shown.draw(ground).save(folder / f"gallery-{name}-{ground}.png")
        condyle.moving_scene(shown.run).save(folder / f"gallery-{name}.html")


def cards() -> str:
    """A card for each page of the gallery: its picture, title and first paragraph."""
    made = []
    for name in SHOWN:
        text = (HERE / "gallery" / f"{name}.md").read_text(encoding="utf-8")
        title, line = re.findall(r"^# (.+)\n\n((?:.+\n)+)", text)[0]
        images = "".join(
            f'<img src="../generated/gallery-{name}-{ground}.png#only-{ground}" alt="{alt}">'
            for alt, ground in re.findall(r"^!\[(.+)\]\(.+#only-(\w+)\)", text, re.MULTILINE)
        )
        words = f"<b>{escape(title)}</b><span>{escape(' '.join(line.split()))}</span>"
        made.append(f'<a href="{name}.html">{images}{words}</a>')
    return '<div class="cards">\n' + "\n".join(made) + "\n</div>\n"
