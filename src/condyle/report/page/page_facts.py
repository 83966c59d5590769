"""Text and tables of the page, which need no script."""

from __future__ import annotations

import base64
import hashlib
import json
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...extras import require
from ...files.reading import digest, require_file
from ...mechanism.vocabulary import words_of
from ...results.accuracy import FEW_DIGITS
from ...results.contacts import BOUND_TOLERANCE, joint_loads
from ...results.failed_samples import longest
from ...results.summary import peak, summarize
from ...results.vibrations import mostly, softness, solution_modes
from ..actuators import drawn_limits
from ..naming import bite_sides
from ..panel import missing_variables
from ..panel_list import reaction
from .html import Markup, table, tag
from .page_columns import PageColumns

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

    from ...mechanism.actuator import Limits
    from ..tables import ReportTable
    from .reduce import ReducedSolution

_WORDS = {
    "characteristic_length": "characteristic length [m]",
    "contact_fit": "moved onto the contacts: RMS, at most [m]",
    "contact_residual_of_given_pose": "contact residual of the given pose [m]",
}


FAILURES = 30  # spans without a result that are listed
SOURCES = ("motion", "load")  # options that may be paths


def warnings_box(warnings: Sequence[str]) -> Markup:
    """Every warning of the run."""
    if not warnings:
        return tag("p", "✓ The run gave no warnings.", class_="calm", id="warnings")
    count = "1 warning" if len(warnings) == 1 else f"{len(warnings)} warnings"
    return tag(
        "section",
        tag("h2", f"⚠ {count}"),
        tag("ul", *(tag("li", warning) for warning in warnings)),
        class_="warnings",
        id="warnings",
        role="status",
    )


def fact_cards(page: ReducedSolution) -> Markup:
    """Numbers worth knowing at once: what, how much, and where."""
    return tag("dl", *(_card(*fact) for fact in _facts(page)), class_="facts")


def _card(what: str, value: str, where: str, alarm: bool = False) -> Markup:
    parts = tag("dt", what), tag("dd", value, tag("small", where))
    return tag("div", *parts, class_="fact alarm" if alarm else "fact")


def _facts(page: ReducedSolution) -> Iterator[tuple[Any, ...]]:
    """Peaks come from the samples kept, where every curve's largest is; counts from all."""
    solution, failed = page.solution, page.failed
    mechanism = solution.condyle.mechanism
    say, loads = words_of(mechanism), joint_loads(mechanism, solution["contact_force"].values)
    data = summarize(solution).data
    start, end = page.time[[0, -1]]
    time = solution["time"].values
    where = f"{failed} without a result" if failed else f"{start:g} to {end:g} s"
    yield "Samples", f"{page.total:,}".replace(",", "\u202f"), where, bool(failed)
    units = [str(unit) for unit in solution["effort_unit"].values]
    for unit in dict.fromkeys(units):
        mine = [i for i, u in enumerate(units) if u == unit]
        if (largest := peak(solution["effort"].values[:, mine])) is not None:
            sample, i, value = largest
            name = solution["chain"].values[mine[i]]
            word = "Largest torque" if unit == "N m" else "Largest force"
            yield word, f"{value:.4g} {unit}", f"{name}, t = {time[sample]:g} s"
    if (largest := peak(loads)) is not None:
        sample, i, value = largest
        name = str(solution["contact"].values[i])
        side = f" ({sides[name]})" if (sides := bite_sides(solution)) else ""
        where = f"{name}{side}, t = {time[sample]:g} s"
        yield say("Largest contact force"), f"{value:.4g} N", where
    if pressures := data["peak_pressure"]:
        name = max(pressures, key=lambda n: pressures[n]["pressure"])
        most = pressures[name]
        where = f"{name}, {most['area'] * 1e6:.3g} mm², t = {most['time']:g} s"
        yield "Largest pressure", f"{most['pressure'] * 1e-6:.4g} MPa", where
    bounds = data["closest_to_bounds"]
    if bounds:
        name = min(bounds, key=lambda n: bounds[n]["margin"])
        margin = bounds[name]["margin"]
        word = "Closest to the bounds" if margin >= 0 else "Outside the bounds"
        where = f"{name}, t = {bounds[name]['time']:g} s"
        yield word, f"{margin * 1e3:.4g} mm", where, margin < 0
    near = data["closest_to_singularity"]
    if near is not None:
        where = f"ratio, t = {near['time']:g} s"
        yield say("Closest to a singularity"), f"{near['ratio']:.4g}", where, bool(page.near)
    if "bound" in solution and (worst := peak(solution["bound"].values[:, None])) is not None:
        sample, _, value = worst
        where = f"largest, t = {time[sample]:g} s"
        yield "Bound of the relative error", f"{value:.1e}", where, value > FEW_DIGITS
    if (vibrating := solution_modes(solution)) is not None:
        yield from _softness(vibrating[1].data)


def _softness(d: Mapping[str, Any]) -> Iterator[tuple[Any, ...]]:
    """Small vibrations at home: the lowest mode, and the softest direction of O_M."""
    if (hertz := d["frequency"][0]) is not None:
        yield "Lowest frequency", f"{hertz:.4g} Hz", f"at home, {mostly(d, 0)}", hertz < 0
    for direction, size, other in softness(d):
        yield "Softest at home", size, f"{d['at']} {direction}; {other}"


def failure_table(page: ReducedSolution) -> Markup:
    """When there is no result, and why."""
    failures = page.failures
    if not failures:
        return Markup("")
    rows = [
        [f"{run.start:g} to {run.end:g} s", f"{run.count}", run.status, run.cause or "not stated"]
        for run in longest(failures, FAILURES)
    ]
    more = len(failures) - len(rows)
    notes = [f"The longest of {len(failures)} intervals."] if more else []
    header = ["Time", "Samples", "Status", "Cause"]
    return table(header, rows, "Without a result", notes)


def chain_table(solution: xr.Dataset) -> Markup:
    """Peak effort and speed of each chain beside its limits."""
    rows = []
    efforts, speeds = (drawn_limits(solution, v) for v in ("effort", "joint_rate"))
    for i, chain in enumerate(solution.condyle.mechanism.chains):
        effort_unit = str(solution["effort_unit"].values[i])
        speed_unit = f"{solution['joint_unit'].values[i]}/s"
        rows.append(
            [
                chain.name,
                chain.kind,
                *_peak_cells(solution, "effort", i, effort_unit, efforts[i]),
                *_peak_cells(solution, "joint_rate", i, speed_unit, speeds[i]),
            ]
        )
    say = words_of(solution.condyle.mechanism)
    header = ["Chain", "Kind", "Peak effort", "at", "of limit", "Peak speed", "at", "of limit"]
    return table(list(map(say, header)), rows, say("Peaks of each chain"))


def contact_lift_table(solution: xr.Dataset) -> Markup:
    """Contacts that lift in this run: how often, how long, when, where, and how fast they land."""
    if not (lifts := solution.condyle.contact_lifts):
        return Markup("")
    rows = []
    for name, lift in lifts.items():
        place = ", ".join(f"{1e3 * x:.2f}" for x in lift["point"])
        speed = "-" if lift["landing_speed"] is None else f"{lift['landing_speed']:.4g} m/s"
        times = f"{lift['first']:.6g} s", f"{lift['last']:.6g} s"
        rows.append([name, f"{lift['count']}", f"{lift['open']:.4g} s", *times, place, speed])
    say = words_of(solution.condyle.mechanism)
    header = [
        "Contact",
        "Times open",
        "Open in all",
        "First",
        "Last",
        "First at [mm]",
        "Fastest landing",
    ]
    return table(list(map(say, header)), rows, say("Contacts that lift"))


def _peak_cells(
    solution: xr.Dataset, variable: str, chain: int, unit: str, limit: Limits
) -> list[str]:
    if (largest := peak(solution[variable].values[:, [chain]])) is None:
        return ["-", "-", "-"]
    sample, _, value = largest
    use = limit.use(value)
    if use is None:
        used = "no limit"
    elif np.isinf(use):
        used = f"beyond {limit.effort_text(unit)}"
    else:
        used = f"{use:.0%} of {abs(value / use) if use else limit.greatest:g} {unit}"
    return [f"{value:.4g} {unit}", f"{solution['time'].values[sample]:g} s", used]


def reaction_tables(solution: xr.Dataset) -> Markup:
    """Largest magnitude of every reaction: a table for each kind, a row for each joint."""
    by_kind, time = [], solution["time"].values
    for panel in reaction(solution):
        rows = []
        for curve in panel.curves:
            if np.isfinite(curve.values).any():
                k = int(np.nanargmax(curve.values))
                rows.append([curve.label, f"{curve.values[k]:.4g} {panel.unit}", f"{time[k]:g} s"])
        if rows:
            caption = f"Largest {panel.title[:1].lower() + panel.title[1:]}"
            by_kind.append(table(["Where", "Largest", "at"], rows, caption))
    return tag("div", *by_kind, class_="grid tables") if by_kind else Markup("")


def samples_note(page: ReducedSolution) -> Markup:
    """What the file lacks, that the page has fewer samples, and what grey means, if it is so."""
    notes, count = [], len(page.samples)
    if missing := missing_variables(page.solution):
        notes.append(
            f"Not in this file: {', '.join(missing)}; plots and tables of them are left out."
        )
    if page.envelope is not None:
        span = (page.time[-1] - page.time[0]) / (len(page.envelope.edges) - 1)
        notes.append(
            f"The page has {count} of {page.total} samples; plots show the smallest and largest "
            f"value of every {span:.2g} s."
        )
    if page.failures:
        notes.append("Grey in the plots: no result.")
    return tag("p", " ".join(notes), class_="note") if notes else Markup("")


def buttons(what: str, labels: Iterable[str] | Mapping[str, str], chosen: str = "") -> Markup:
    """Buttons for a choice, one pressed, or for what can be shown and hidden, all pressed.

    Args: labels: by value of their `data-<what>`, or such values that are labels too.
    """
    texts = labels if isinstance(labels, Mapping) else {one: one for one in labels}
    made = (
        tag("button", label, type="button", aria_pressed=str(chosen in ("", value)).lower(),
            **{f"data_{what}": value})
        for value, label in texts.items()
    )  # fmt: skip
    return Markup("".join(made))


READOUTS = (
    ("Chain", (("joint-", "joint"), ("joint_rate-", "speed"), ("effort-", "effort"))),
    ("Contact", (("contact-force", "force"), ("bound-margin", "to the bounds"))),
)


def readout(panels: Sequence[Mapping[str, Any]], say: Callable[[str], str]) -> Markup:
    """Tables of chains and contacts, whose cells say to the script what stands in them."""
    readings = []
    for word, columns in READOUTS:
        header, cells = [say(word)], []
        for prefix, name in columns:
            own = [panel for panel in panels if panel["id"].startswith(prefix)]
            if not own:
                continue
            units = ", ".join(dict.fromkeys(panel["unit"] for panel in own))
            header.append(f"{say(name)} [{units}]")
            lines = [(panel, line) for panel in own for line in panel["sets"][0]["lines"]]
            cells.append({line["label"]: _cell(panel, line) for panel, line in lines})
        if not cells:
            continue
        rows = [
            tag("tr", tag("th", name, scope="row"), *(tag("td", *c.get(name, ())) for c in cells))
            for name in cells[0]
        ]
        head = tag("tr", *(tag("th", heading, scope="col") for heading in header))
        parts = tag("thead", head), tag("tbody", *rows)
        readings.append(tag("table", *parts, aria_label=say(f"{word}s at the cursor")))
    return Markup("".join(readings))


def _cell(panel: Mapping[str, Any], line: Mapping[str, Any]) -> list[Markup]:
    """A value, and of an effort with a limit a bar of how much of it is used."""
    where = {key: line[key] for key in ("column", "scale")} | {"decimals": panel["decimals"]}
    value = tag("span", class_="value", **{f"data_{key}": n for key, n in where.items()})
    limits = panel["limits"] if panel["id"].startswith("effort-") else ()
    own = [one for one in limits if line["label"] in one["of"] and (one["low"] or one["high"])]
    if not own:
        return [value]
    ends = {f"data_{end}": own[0][end] for end in ("low", "high")}
    return [value, tag("span", tag("i"), class_="use", title=own[0]["label"], **ends)]


def given_tables(tables: Sequence[ReportTable]) -> Markup:
    """Tables of `condyle.report.tables`, such as Tables 1 and 2 of the paper."""
    parts = [table(t.columns, t.rows, t.title, t.notes) for t in tables]
    return tag("section", tag("h2", "Tables"), *parts, id="tables") if parts else Markup("")


def provenance(solution: xr.Dataset, files: Sequence[Path]) -> Markup:
    """What was run: options, files and their hashes, version, and the mechanism itself."""
    text = solution.attrs["mechanism"]
    chosen, say = solution.condyle.options, words_of(solution.condyle.mechanism)
    listed = [["mechanism as solved (below)", hashlib.sha256(text.encode()).hexdigest()]]
    listed += [
        [file_name(chosen[name]), chosen[f"{name}_sha256"]]
        for name in SOURCES
        if chosen.get(f"{name}_sha256")
    ]
    known = {row[1] for row in listed}
    listed += [row for file in files if (row := _file_row(Path(file)))[1] not in known]
    rows = [[name, tag("code", sha256)] for name, sha256 in listed]
    options = [
        [say(_words(key)), file_name(value) if key in SOURCES else _as_text(value)]
        for key, value in chosen.items()
        if not key.endswith("_sha256")
    ]
    return tag(
        "section",
        tag("h2", "What was run"),
        tag("p", f"{solution.attrs.get('title', '')}, by {solution.attrs.get('source', '')}."),
        table(["Option", "Value"], options, "Options"),
        table(["File", "SHA-256"], rows, "Files"),
        tag("details", tag("summary", "The mechanism, in SI (TOML)"), tag("pre", text)),
        id="run",
    )


def _file_row(path: Path) -> list[str]:
    require_file(path)
    return [path.name, digest(path) or ""]


def file_name(source: Any) -> str:
    """A file's name without its folders, which are the sender's own; words stay."""
    return re.split(r"[/\\](?=[^/\\]*$)", str(source))[-1]


def _words(key: str) -> str:
    return _WORDS.get(key) or key.replace("_", " ").replace(" seconds", " time [s]")


def _as_text(value: Any) -> str:
    if isinstance(value, list):
        return ", ".join(map(_as_text, value)) or "none"
    if isinstance(value, dict):
        return "; ".join(f"{name}: {_as_text(one)}" for name, one in value.items())
    if isinstance(value, float):
        return f"{value:.6g}"
    return "none" if value is None else str(value)


NEAR_SINGULAR = "near a singularity"


def alerts(solution: xr.Dataset, columns: PageColumns) -> list[dict[str, Any]]:
    """Texts, each with the number of a column that is 1 where the text holds.

    `failed`: there is nothing to draw at such samples.
    """
    status = solution["status"]
    words = status.attrs["flag_meanings"].split()
    texts = [
        (f"no result: {word}", status.values == code, True)
        for code, word in enumerate(words)
        if code
    ]
    texts += [(text, where, False) for text, where in _warnings(solution)]
    return [
        {"text": text, "column": columns.add(f"alert.{text}", where), "failed": failed}
        for text, where, failed in texts
        if where.any()
    ]


def _warnings(solution: xr.Dataset) -> Iterator[tuple[str, np.ndarray]]:
    say, status = words_of(solution.condyle.mechanism), solution["status"].values
    with np.errstate(invalid="ignore"):
        for i, name in enumerate(solution["contact"].values):
            margin = solution["bound_margin"].values[:, i]
            yield f"{name} is outside its bounds", margin < -BOUND_TOLERANCE
            yield f"{name} {say('loses contact')}", solution["contact_loss"].values[:, i]
            if "contact_active" in solution:
                is_open = (status == 0) & ~solution["contact_active"].values[:, i].astype(bool)
                yield f"{name} is open", is_open
        for variable, word in (("effort", "effort"), ("joint_rate", "speed")):
            values, limits = solution[variable].values, drawn_limits(solution, variable)
            for i, name in enumerate(solution["chain"].values):
                yield f"{name} is beyond its {say(word)} limit", limits[i].beyond(values[:, i])
    yield say(NEAR_SINGULAR), solution["singularity"].values != 0


def sweep_section(sweep: xr.Dataset | None) -> Markup:
    """Pictures and tables of a sweep; nothing without one."""
    if sweep is None:
        return Markup("")
    require("matplotlib", "figures")
    from ..figures.style import EmptyFigureError
    from ..figures.sweep_figures import SWEEP_PLOTS
    from ..tables.sweep_tables import sweep_tables

    pictures = []
    for draw in SWEEP_PLOTS.values():
        with suppress(EmptyFigureError):
            pictures.append(tag("p", _image(draw(sweep), (draw.__doc__ or "").splitlines()[0])))
    tables = [table(t.columns, t.rows, t.title, t.notes) for t in sweep_tables(sweep)]
    return tag("section", tag("h2", "Sweep"), *pictures, *tables, id="sweep")


def bands_section(solution: xr.Dataset) -> Markup:
    """Efforts and contact forces with their bands, where the solution has some.

    Of a mean over cycles first those over cycles, then those over variants.
    """
    if "bands" not in solution.attrs:
        return Markup("")
    require("matplotlib", "figures")
    from ..figures import PLOTS

    names = ["effort"] + ["contact_force"] * bool(solution.sizes["contact"])
    banded = [solution]
    if "variant_bands" in solution.attrs:
        of_variants = {f"{n}_quantile": solution[f"{n}_variant_quantile"] for n in names}
        attrs = {"bands": solution.attrs["variant_bands"]}
        banded.append(solution.assign(of_variants).assign_attrs(attrs))
    sections = []
    for one in banded:
        of = json.loads(one.attrs["bands"]).get("of", "variants")
        pictures = [tag("p", _image(PLOTS[n](one), f"Bands of {n} over {of}")) for n in names]
        where = "bands" if one is solution else "bands-of-variants"
        sections.append(tag("section", tag("h2", f"Bands over {of}"), *pictures, id=where))
    return Markup("".join(sections))


def _image(figure: Figure, meaning: str) -> Markup:
    """A picture within the page: it needs no file of its own."""
    from ..figures.style import png

    data = base64.b64encode(png(figure)).decode()
    source = Markup(f"data:image/png;base64,{data}")
    return Markup(f'<img src="{source}" alt="{meaning}" style="max-width:100%">')
