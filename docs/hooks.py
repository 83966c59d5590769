"""What the code itself writes for the documentation, when the site is built.

Figures of the reference case, an example report, the table of a solution's variables, the count of
operations by model, and the help of every command.
"""

from __future__ import annotations

import inspect
import os
import runpy
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from types import UnionType
from typing import Any, get_args, get_origin, get_type_hints

from drawings import FILES as DRAWINGS
from drawings import draw_all
from formulas import with_formulas
from gallery import CARDS, cards, draw_gallery
from gallery import FILES as GALLERY
from notebooks import FILES as NOTEBOOKS
from notebooks import with_download, write_notebooks
from page_pictures import draw_pages, pages_with_pictures
from paper_index import FILE as SOURCES
from paper_index import sources, with_frame, with_links
from structure import structure

os.environ.setdefault("MPLBACKEND", "agg")
GENERATED = Path(__file__).parent / "generated"
EXAMPLES = Path(__file__).parents[1] / "examples"
FIGURES = ("motion", "path", "effort", "share", "contact_force", "contact_track", "singularity")
MAPS = ("map-ratio", "map-singular", "map-frequency")
STUDIES = ("sweep-scatter", "sweep-effects", "bands", "pressure-bands")
IDENTIFIED = ("identified", "identified-time", "identified-correlation")
RELEASED = "unloading"
SESSION = ("session-cycle", "session-markers")
PICTURES = ("mechanism", *FIGURES, *MAPS, *STUDIES, *IDENTIFIED, RELEASED, *SESSION, "design")
# Pieces that pages take in.
PAGES = ("cli.md", "operations.md", "structure.md", "variables.md")
PAGES += ("quantities.md", "dimensions.md", "statuses.md", "warnings.md", "literature.md")
PAGES += (
    "tendons.md",
    "results.md",
    "limits.md",
    "controller-states.md",
    "safety.md",
    CARDS,
    SOURCES,
)
REPORT = "report.html"
FILES = (*(f"{name}.png" for name in PICTURES), *DRAWINGS, *GALLERY, *NOTEBOOKS, *PAGES, REPORT)
FILES += tuple(name for names in pages_with_pictures().values() for name in names)


def on_pre_build(config: Any) -> None:
    """MkDocs calls this before it collects files; an example that fails ends the build."""
    run_examples()
    generate(GENERATED)


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """MkDocs calls this with each page's text."""
    return with_links(with_download(markdown, page.file.src_uri), page.file.src_uri)


def on_page_content(html: str, page: Any, **_: Any) -> str:
    """MkDocs calls this with each page; a formula that cannot be set ends the build."""
    return with_frame(with_formulas(html), page.file.src_uri)


def run_examples(folder: Path = EXAMPLES) -> None:
    """Run every example of the repository; raises what one raises."""
    for path in sorted(folder.glob("*.py")):
        with redirect_stdout(StringIO()):
            runpy.run_path(str(path), run_name="__main__")


def generate(folder: Path) -> None:
    """Write all of `FILES`."""
    import matplotlib.pyplot as plt

    import condyle
    from condyle.report.figures import PLOTS
    from condyle.report.page import write_report

    folder.mkdir(exist_ok=True)
    text_pages(folder)
    draw_all(folder)
    draw_pages(folder)
    draw_gallery(folder)
    write_notebooks(folder)
    solution = reference_solution(1000.0)
    for name in FIGURES:
        PLOTS[name](solution).savefig(folder / f"{name}.png", dpi=110)
    draw_mechanism(condyle.load_mechanism("masticatory")).savefig(folder / "mechanism.png", dpi=110)
    draw_maps(folder, solution)
    draw_released(folder)
    draw_session(folder)
    draw_studies(folder)
    draw_identification(folder)
    draw_design(folder)
    plt.close("all")
    write_report(reference_solution(100.0, reactions=True), folder / REPORT)


def draw_identification(folder: Path) -> None:
    """What a log of ten seconds tells about a chewing robot that is not quite as drawn."""
    import tempfile

    import condyle
    from condyle.report.figures.identification_figures import (
        correlation_figure,
        numbers_figure,
        time_figure,
    )

    drawn = condyle.load_mechanism("masticatory")
    actuators = [f"chain.{name}.actuator" for name in drawn.chain_names]
    friction = {"viscous": 2e-3, "coulomb": 4e-3, "smoothing_speed": 0.1}
    drawn = drawn.set({f"{own}.{k}": x for own in actuators for k, x in friction.items()})
    built = drawn.set(
        {"platform.mass": 0.23, "platform.com": (3e-3, -2e-3, 2e-3)}
        | {f"{own}.{k}": 1.3 * friction[k] for own in actuators for k in ("viscous", "coulomb")}
    )
    numbers = ["platform.mass", "platform.com"]
    numbers += [f"chain.*.actuator.{key}" for key in ("viscous", "coulomb")]
    noise = {"effort": 5e-4, "encoder": 1e-5}
    run = condyle.derive(built).solve(condyle.trial_motion(built, rate=250.0))
    with tempfile.TemporaryDirectory() as place:
        log = Path(place) / "log.csv"
        condyle.write_log(run, log, encoder_noise=1e-5, effort_noise=5e-4)
        found = condyle.identify(drawn, log, {"numbers": numbers, "noise": noise})
    figures = numbers_figure, time_figure, correlation_figure
    for name, figure in zip(IDENTIFIED, figures, strict=True):
        figure(found).savefig(folder / f"{name}.png", dpi=110)


def draw_design(folder: Path) -> None:
    """The example: motors moved so that the peak torque falls."""
    import condyle
    from condyle.report.figures.design_figures import design_figure

    design_figure(condyle.design(EXAMPLES / "design.toml")).savefig(folder / "design.png", dpi=110)


def draw_released(folder: Path) -> None:
    """The unloading test with muscles and with rigid cables, and what was published."""
    import numpy as np
    from matplotlib.figure import Figure

    import condyle
    from condyle.analysis.literature import HELD, unloading
    from condyle.report.figures.style import house, new_figure

    tip = condyle.load_mechanism("human-jaw").platform.points["incisor"]

    @house
    def drawn() -> Figure:
        caption = "Mechanisms human-jaw-muscles and human-jaw; a bite of 100 N let go."
        figure = new_figure("Unloading test", caption, 9, 3.6, 2)
        travel, force = figure.subplots(1, 2)
        for name, label in (("human-jaw-muscles", "muscles"), ("human-jaw", "rigid cables")):
            found = unloading(name)
            t = 1e3 * (found.time.values - HELD)
            pose = found.pose.values
            x = pose[:, 0] + np.cos(pose[:, 4]) * tip[0] + np.sin(pose[:, 4]) * tip[2]
            z = pose[:, 2] - np.sin(pose[:, 4]) * tip[0] + np.cos(pose[:, 4]) * tip[2]
            travel.plot(t, 1e3 * np.hypot(x - x[0], z - z[0]), label=label)
            force.plot(t, found.effort.values.sum(axis=1), label=label)
        travel.plot(
            12, 4.5, "k*", ms=10, ls="", clip_on=False, label="published: 4.5 mm, no net force"
        )
        travel.set(
            title="Travel of the incisors", xlabel="time after release [ms]", ylabel="travel [mm]"
        )
        travel.set_ylim(0, 40)
        force.set(
            title="Sum of muscle forces", xlabel="time after release [ms]", ylabel="force [N]"
        )
        force.set_ylim(0, None)
        travel.legend(loc="upper left")
        return figure

    drawn().savefig(folder / f"{RELEASED}.png", dpi=110)


def draw_session(folder: Path) -> None:
    """The example's session: its mean cycle, and the markers of one trial."""
    import tempfile
    from contextlib import chdir

    from matplotlib.figure import Figure

    from condyle.report.figures import PLOTS
    from condyle.report.figures.style import house, new_figure

    with tempfile.TemporaryDirectory() as place, chdir(place), redirect_stdout(StringIO()):
        found = runpy.run_path(str(EXAMPLES / "session.py"))["found"]
    mean = found.mean.sel(group="chew")

    @house
    def drawn() -> Figure:
        caption = "examples/session.py; mean and standard deviation over all cycles."
        figure = new_figure("Joint loads over the chewing cycle", caption, 8, 3.4)
        axis = figure.subplots()
        phase = 100 * mean["phase"]
        for contact in mean["contact"].values:
            one = mean.sel(contact=contact)
            middle, spread = (abs(one[f"contact_force_group_{k}"]) for k in ("mean", "sd"))
            (line,) = axis.plot(phase, middle, label=str(contact).replace("_", " "))
            axis.fill_between(
                phase, middle - spread, middle + spread, alpha=0.2, color=line.get_color()
            )
        axis.set(xlabel="chewing cycle [%]", ylabel="joint load [N]")
        axis.legend()
        return figure

    drawn().savefig(folder / f"{SESSION[0]}.png", dpi=110)
    PLOTS["marker"](found.solutions["chewing-right"]).savefig(folder / f"{SESSION[1]}.png", dpi=110)


def draw_studies(folder: Path) -> None:
    """Pictures of a small sweep, and of the bands of the example with the jaw."""
    import condyle
    from condyle.analysis.sweep import Study, with_bands
    from condyle.motion import Motion, bundled_reference
    from condyle.report.figures import PLOTS

    base = "chain.masseter_{}.base[2]"
    own = {"what": base.format("left"), "mirror": base.format("right"), "scale": [0.97, 1.03]}
    study = {
        "motion": {"file": "reference", "rate": 20.0},
        "vary": [own, {"what": "platform.mass", "range": [0.2, 0.3]}],
        "sampling": {"kind": "sobol", "count": 64},
        "measure": {
            "peak_effort": {"of": "effort", "take": "max_abs"},
            "joint_load": {"of": "contact_force", "take": "min", "contact": "left_condyle"},
        },
    }
    table = condyle.sweep(study, workers=1)
    plots = table.condyle.plot
    plots.scatter().savefig(folder / "sweep-scatter.png", dpi=110)
    plots.effects().savefig(folder / "sweep-effects.png", dpi=110)
    motion = Motion.from_csv(bundled_reference()[0], rate=20)
    load = condyle.reference_load()
    jaw = condyle.derive(condyle.load_mechanism("human-jaw"), distribution="weighted")
    known = Study.read(EXAMPLES / "studies" / "human-jaw.toml")
    banded = with_bands(jaw.solve(motion, load), known, motion, load, workers=1)
    PLOTS["contact_force"](banded).savefig(folder / "bands.png", dpi=110)
    draw_pressure(folder)


def draw_pressure(folder: Path) -> None:
    """The jaw's joints under a bite that grows, with the bands of published numbers."""
    import re

    import numpy as np

    import condyle
    from condyle.analysis.sweep import Study, with_bands
    from condyle.mechanism import bundled_text, parse
    from condyle.report.figures import PLOTS

    text = re.sub(r"^# (compliance = .*)$", r"\1", bundled_text("human-jaw"), flags=re.MULTILINE)
    jaw = condyle.derive(parse(text), distribution="cubic")
    t = np.linspace(0, 1, 21)
    rest = condyle.Motion.from_arrays(t, np.zeros((21, 4)), names=jaw.independent)
    bite = condyle.Load.from_arrays(t, np.outer(t, [0, 0, -200.0]), point="right_molar")
    study = Study.read(EXAMPLES / "studies" / "cartilage.toml")
    banded = with_bands(jaw.solve(rest, bite), study, rest, bite, workers=1)
    PLOTS["pressure"](banded).savefig(folder / "pressure-bands.png", dpi=110)


def text_pages(folder: Path) -> None:
    """Write `PAGES`."""
    import condyle
    from condyle.export.controller_states import states_page

    pages = {"cli.md": command_help(), "operations.md": operation_counts()}
    pages["structure.md"] = structure()
    pages |= {"variables.md": variable_table(), "dimensions.md": dimension_table()}
    pages |= {"quantities.md": quantity_table(), "results.md": result_table()}
    pages |= {"statuses.md": status_table(), "warnings.md": warning_table()}
    pages["literature.md"] = condyle.literature().markdown
    pages["tendons.md"], pages["limits.md"] = tendon_table(), limit_table()
    pages |= {"controller-states.md": states_page(), "safety.md": safety_table()}
    pages |= {CARDS: cards(), SOURCES: sources()}
    for name, text in pages.items():
        (folder / name).write_text(text, encoding="utf-8")


def safety_table() -> str:
    """Keys of `[safety]`, `[safety.trips]` and `[safety.search]`, with their defaults."""
    from condyle.simulation.safety import Safety, Search, Trips

    lines = ["| key | meaning | default |", "|---|---|---|"]
    for start, table in (("", Safety), ("trips.", Trips), ("search.", Search)):
        for name, field in table.model_fields.items():
            if name != "trips":
                default = "off" if field.default is None else f"`{field.default}`"
                default = "none: give it" if field.is_required() else default
                lines.append(f"| `{start}{name}` | {field.description} | {default} |")
    return "\n".join(lines) + "\n"


def tendon_table() -> str:
    """The largest bite over gape, by the length of fibres at home that tendons are set for."""
    import condyle

    jaw = condyle.load_mechanism("human-jaw-muscles")
    lines = [
        "| fibres at home, of the optimal | 0 mm | 10 mm | 20 mm | 30 mm | 40 mm |",
        "|---|---|---|---|---|---|",
    ]
    for fraction in (None, 0.6, 0.7, 0.8, 0.9, 1.0):
        changed, without = jaw, 0
        for chain in jaw.chains if fraction else ():
            tendon = chain.lengths["line"] - fraction * chain.muscle.optimal_length
            without += tendon <= 0
            length = max(tendon, 1e-6)
            changed = changed.set(f"chain.{chain.name}.muscle.tendon_length", length)
        bites = condyle.largest_bite(changed, "right_molar", over="opening=0:40:5").force[:, 0]
        note = f" ({without} muscles have no tendon)" if without else ""
        cells = " | ".join(f"{force:.0f} N" for force in bites)
        lines.append(f"| {fraction or 'as in the file'}{note} | {cells} |")
    return "\n".join(lines) + "\n"


def reference_solution(rate: float, reactions: bool = False) -> Any:
    """The reference case at `rate` samples a second."""
    import condyle
    from condyle.motion import Motion, bundled_reference

    motion = Motion.from_csv(bundled_reference()[0], rate=rate)
    model = condyle.derive(condyle.load_mechanism("masticatory"), backend="numpy")
    return model.solve(motion, condyle.reference_load(), reactions=reactions)


def draw_maps(folder: Path, solution: Any) -> None:
    """Write `MAPS`: the chewing robot under the reference run, and a platform's singular curves."""
    import condyle
    from condyle.report.figures.map_figures import map_plots

    jaw = ["X=-5:15:120 mm", "beta=-15:25:120 deg"]
    legs = ["X=-2500:2500:100 mm", "gamma=-140:140:100 deg"]
    for picture, name, over, hold, stroke, run in (
        ("map-ratio", "masticatory", jaw, "", "", solution),
        ("map-singular", "gough-stewart", legs, "alpha=10 deg", "*=-1500:1500 mm", None),
    ):
        model = condyle.derive(condyle.load_mechanism(name), backend="numpy")
        found = condyle.workspace_map(model, over, "ratio", hold, stroke=stroke or ())
        map_plots(found, model).ratio(run).savefig(folder / f"{picture}.png", dpi=110)
    robot = condyle.load_mechanism("masticatory")
    soft = robot.set({f"chain.{name}.actuator.stiffness": 400.0 for name in robot.chain_names})
    model = condyle.derive(soft, backend="numpy")
    found = condyle.workspace_map(model, ["X=-5:15:30 mm", "beta=-15:25:30 deg"], "frequency")
    map_plots(found, model).frequency().savefig(folder / "map-frequency.png", dpi=110)


def quantity_table() -> str:
    """What can be mapped."""
    from condyle.analysis.map import QUANTITIES
    from condyle.quantities import QUANTITIES as ROWS

    rows = [
        f"| `{name}` | {q.meaning} | "
        f"{', '.join(f'`{ROWS[own].variable}`' for own in q.values) or '`cause`'} |"
        for name, q in QUANTITIES.items()
    ]
    return "\n".join(["| quantity | what it is | variables |", "|---|---|---|", *rows]) + "\n"


def variable_table() -> str:
    """Every variable of a solution: dimensions, unit and meaning."""
    import condyle
    from condyle.quantities import variables

    mechanism = condyle.load_mechanism("masticatory")
    lines = ["| variable | dimensions | unit | what it is |", "|---|---|---|---|"]
    for name, variable in variables().items():
        about = variable.attributes(mechanism)
        meaning = about["long_name"]
        if flags := about.get("flag_meanings"):
            meaning += ": " + ", ".join(f"{i} {f}" for i, f in enumerate(flags.split()))
        dims = ", ".join(variable.dims)
        lines.append(f"| `{name}` | {dims} | {about['units']} | {meaning} |")
    return "\n".join(lines) + "\n"


def result_table() -> str:
    """What results of models have by attribute."""
    from condyle.model import forward_dynamics, inverse_dynamics
    from condyle.quantities import QUANTITIES

    names = ["effort", "contact_force", "acceleration", "bound", "status"]
    names += [*(inverse_dynamics.OUTPUTS | forward_dynamics.OUTPUTS)]
    rows = [(name, QUANTITIES[name]) for name in names if name in QUANTITIES]
    lines = ["| result | unit | what it is |", "|---|---|---|"]
    lines += [f"| `{name}` | {one.any_unit()} | {one.meaning} |" for name, one in rows]
    return "\n".join(lines) + "\n"


def dimension_table() -> str:
    """What stands along each dimension of a solution."""
    from condyle.quantities.entries import DIMENSIONS, OF_RESULTS

    rows = [f"| `{name}` | {DIMENSIONS[name].text} |" for name in OF_RESULTS]
    return "\n".join(["| dimension | entries |", "|---|---|", *rows]) + "\n"


def status_table() -> str:
    """Every status of a sample."""
    from condyle.status import Status

    rows = [f"| {s.value} | {s.name} | {s.meaning} | {s.owner} |" for s in Status]
    head = ["| status | name | meaning | the cause names |", "|---|---|---|---|"]
    return "\n".join([*head, *rows]) + "\n"


def warning_table() -> str:
    """Every kind of warning, and what to do."""
    from condyle.results.warnings import KINDS

    rows = [f"| `{name}` | {kind.meaning} | {kind.advice} |" for name, kind in KINDS.items()]
    return "\n".join(["| kind | warning | what to do |", "|---|---|---|", *rows]) + "\n"


def limit_table() -> str:
    """The most that each door for files and arguments takes."""
    from condyle.files import limits

    found = [one for one in vars(limits).values() if isinstance(one, limits.WorkLimit)]
    rows = [f"| `{one.name}` | {one.most:,} {one.counted} |" for one in found]
    return "\n".join(["| limit | at most |", "|---|---|", *rows]) + "\n"


def operation_counts() -> str:
    """Operations a sample of Models 1 and 2: every subexpression once, and written out."""
    import condyle
    from condyle.dynamics import FORMULATIONS
    from condyle.questions.file_numbers import numbers_of
    from condyle.questions.inverse import motion
    from condyle.questions.numbers import specialised
    from condyle.questions.platform import closed, given
    from condyle.questions.structure import structure_of

    mechanism = condyle.load_mechanism("masticatory")
    lines = [
        "| formulation | shared, Model 1 | shared, Model 2 | ratio "
        "| written out, Model 1 | written out, Model 2 | ratio |",
        "|---|---|---|---|---|---|---|",
    ]
    for name in FORMULATIONS:
        counts = []
        for route, platform in (("direct", closed), ("core", given)):
            structure = structure_of(mechanism, name, route)
            structure = specialised(structure, numbers_of(structure, mechanism))
            counts.append(count(_model(structure, platform)))
        closure = count(motion(structure))
        one, two = counts[0], [counts[1][i] + closure[i] for i in range(2)]
        lines.append(
            f"| `{name}` | {one[0]} | {two[0]} | {two[0] / one[0]:.0%} "
            f"| {one[1]:.1e} | {two[1]:.1e} | {two[1] / one[1]:.1%} |"
        )
    return "\n".join(lines) + "\n"


def _model(structure: Any, platform: Any) -> Any:
    """A and b of the equations of motion, with the platform from q or as a whole pose."""
    from condyle.questions.builder import Builder
    from condyle.questions.equations import Wrench, equations

    b = Builder(structure)
    eq = equations(b, platform(b), Wrench.of(b))
    b.output("A", eq.A, "")
    b.output("b", eq.basis.generalized_force(eq.Q), "")
    return b.finish()


def count(program: Any) -> tuple[int, int]:
    """Operations of a sample: as the graph has them, and with nothing shared."""
    nodes, counts = program.graph.nodes, program.counts
    size: dict[int, int] = {}
    shared = 0
    for v in program.order:
        node = nodes[v]
        own = 0 if node.group is None else node.group
        lanes = 1 if node.group is None else counts[own]
        each = [1] * len(node.args)
        if node.op in ("sum", "least"):  # one term a group
            each = list(counts)
        operations = (sum(each) - 1 if node.op in ("sum", "least") else 1) if node.args else 0
        shared += lanes * operations * node.varies
        size[v] = node.varies * (
            operations + sum(k * size[a] for k, a in zip(each, node.args, strict=True))
        )
    written_out = 0
    for output in program.outputs:
        for entry in output.entries:
            for group, v in enumerate(entry):
                if v is not None:
                    written_out += (counts[group] if output.lanes else 1) * size[v]
    return shared, written_out


def command_help() -> str:
    """Arguments and options of every command, from the functions that the terminal calls."""
    from condyle.cli import commands  # noqa: F401 - registers them
    from condyle.cli.command import registered

    return "\n\n".join(_section(c.callback, name, c.epilog) for name, c in registered())


def _section(function: Any, name: str, epilog: str | None) -> str:
    text = inspect.getdoc(function) or ""
    lines = [f"## condyle {name}", "", text]
    hints = get_type_hints(function, include_extras=True)
    parameters = inspect.signature(function).parameters.values()
    rows = [_row(p.name, hints[p.name], p.default) for p in parameters]
    if rows:
        lines += ["", "| argument or option | value | what it does |", "|---|---|---|", *rows]
    if epilog:
        label, _, example = epilog.partition(": ")
        lines += ["", f"{label}: `{example}`"]
    return "\n".join(lines)


def _row(name: str, hint: Any, default: Any) -> str:
    kind, info = get_args(hint)[:2]
    one = next((k for k in get_args(kind) if k is not type(None)), kind)
    one = one if get_origin(kind) is UnionType else kind
    repeated = get_origin(one) is list
    one = get_args(one)[0] if repeated else one
    if type(info).__name__ == "ArgumentInfo":
        label, value = f"`{name.upper()}`", ""
    else:
        # Typer takes the first spelling for a default where a default may stand.
        spelled = [d for d in (info.default, *(info.param_decls or ())) if isinstance(d, str)]
        flag = name.replace("_", "-")
        spelled = spelled or [f"--{flag}", *([f"--no-{flag}"] if one is bool else [])]
        label = ", ".join(f"`{o}`" for o in spelled)
        value = "" if one is bool else one.__name__.lower() + (" (repeatable)" if repeated else "")
    text = info.help or ""
    if default is inspect.Parameter.empty:
        text += " Required."
    elif default not in (None, False, True) and "Default" not in text:
        text += f" Default: `{default}`."
    return f"| {label} | {value} | {text} |"


def readme_picture() -> Any:
    """The mechanism at home, and motion and torques of the reference case."""
    import matplotlib.pyplot as plt

    import condyle

    solution = reference_solution(1000.0)
    t, chains = solution["time"], solution["chain"].values
    figure = plt.figure(figsize=(11, 4.2))
    draw_on(
        figure.add_axes((0.03, 0.08, 0.38, 0.92), projection="3d"),
        condyle.load_mechanism("masticatory"),
    )
    motion, torque = (figure.add_axes((0.51, bottom, 0.31, 0.33)) for bottom in (0.6, 0.12))
    for name in ("X", "Z"):
        motion.plot(t, 1e3 * solution["pose"].sel(coordinate=name), label=f"{name} [mm]")
    motion.plot(t, 57.29578 * solution["pose"].sel(coordinate="beta"), label="beta [deg]")
    for i, name in enumerate(chains):
        style = {"color": f"C{i // 2}", "linestyle": ("-", "--")[i % 2]}
        torque.plot(t, solution["effort"].sel(chain=name), label=name.replace("_", " "), **style)
    motion.set(title="motion", xlim=(0, 5), xticklabels=[])
    torque.set(title="torques [N m]", xlabel="time [s]", xlim=(0, 5))
    for axes in (motion, torque):
        axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False, fontsize=8)
        axes.spines[["top", "right"]].set_visible(False)
    return figure


def draw_mechanism(mechanism: Any) -> Any:
    """The mechanism at home, in space."""
    import matplotlib.pyplot as plt

    figure = plt.figure(figsize=(6.4, 5.2))
    draw_on(figure.add_axes((0.0, 0.0, 1.0, 1.0), projection="3d"), mechanism)
    return figure


def draw_on(axes: Any, mechanism: Any) -> None:
    """Draw the mechanism at home on axes in space."""
    import numpy as np

    from condyle.report.scene import contact_patch, place, platform_hull

    home = place(mechanism, np.zeros((1, 6)), np.zeros((1, len(mechanism.chains))))
    vertices, faces = platform_hull(mechanism)  # {M} is {S} at home
    axes.plot_trisurf(*(1e3 * vertices.T), triangles=faces, color="#e4d5b5", alpha=0.4)
    for drawing in home.chains.values():
        at = {name: 1e3 * np.atleast_2d(point)[0] for name, point in drawing.points.items()}
        for rod in drawing.rods:
            ends = np.array([at[rod.start], at[rod.end]]).T
            color = "#0072b2" if rod.moving else "#555555"
            axes.plot(*ends, color=color, linewidth=1.5 + 1.5 * rod.thickness)
        for ball in drawing.balls:
            axes.scatter(*at[ball], color="#d55e00", s=18)
    for contact in mechanism.contacts:
        patch = contact_patch(contact, home.contacts[contact.name], 0.06)
        axes.plot_trisurf(
            *(1e3 * patch.vertices.T), triangles=patch.faces, color="#009e73", alpha=0.45
        )
    for name, point in home.contacts.items():
        axes.scatter(*(1e3 * point[0]), color="#009e73", s=60, label=name)
    axes.set(xlabel="X [mm]", ylabel="Y [mm]", zlabel="Z [mm]", aspect="equal")
    axes.set(xticks=[-20, 20, 60], yticks=[-80, -40, 0, 40, 80], zticks=[0, 40, 80])
    axes.view_init(elev=18, azim=-50)


if __name__ == "__main__":  # the picture of the README, which is kept in the repository
    images = Path(__file__).parent / "images"
    images.mkdir(exist_ok=True)
    readme_picture().savefig(images / "reference.png", dpi=100)
