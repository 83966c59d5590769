"""One self-contained HTML file from a solution."""

from __future__ import annotations

import base64
import hashlib
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext
from importlib.resources import files as package_files
from pathlib import Path, PurePath
from typing import TYPE_CHECKING

from ...errors import InputError, as_path, brief
from ...extras import require
from ...files.atomic import write_text
from ...mechanism.vocabulary import words_of
from ...progress import step
from ...results.failed_samples import longest
from ..panel import panels_of
from ..scene import VIEWS, styles
from .html import Markup, fill, json_for_script, tag, text
from .page_columns import PageColumns, panel_data
from .page_facts import (
    alerts,
    bands_section,
    buttons,
    chain_table,
    contact_lift_table,
    fact_cards,
    failure_table,
    given_tables,
    provenance,
    reaction_tables,
    readout,
    samples_note,
    sweep_section,
    warnings_box,
)
from .pdf import find_browser, write_pdf
from .reduce import ReducedSolution, reduced
from .stage_data import stage, style

if TYPE_CHECKING:
    import xarray as xr

    from ...markers import MeasuredChannels
    from ..tables import ReportTable

_ASSETS = package_files(__package__) / "assets"
# One file an idea, in the order they run.
_SCRIPTS = "data theme clock geometry stage panels fields planes readout controls print main"
# Texts of the template that are said in the words of the machine.
HEADINGS = {
    "chains": "Chains",
    "actuators": "Actuators",
    "contacts": "Contacts and load",
    "tracks": "Contact tracks",
    "singularity": "Singularity",
    "duty": "Effort against speed, the data for choosing a motor.",
}


@contextmanager
def opened(path: str | os.PathLike[str]) -> Iterator[xr.Dataset]:
    """The solution in a NetCDF file, whose arrays stay there until they are read.

    Raises: InputError: if the file is missing or is not a condyle solution.
    """
    from ...results.solution import open_solution

    with open_solution(path, lazy=True) as solution:
        yield solution


def write_report(
    solution: xr.Dataset | str | os.PathLike[str],
    path: str | os.PathLike[str],
    *,
    tables: Sequence[ReportTable] | None = None,
    files: Sequence[str | os.PathLike[str]] | None = None,
    measured: MeasuredChannels | str | os.PathLike[str] | None = None,
    sweep: xr.Dataset | None = None,
    pdf: str | os.PathLike[str] | None = None,
) -> Path:
    """Write the report, completely or not at all.

    Args:   solution: a dataset, or its file (.nc), which is read in chunks, so that a run
                of any length fits into memory. More samples than a screen can show are reduced;
                every peak is kept.
            path: the HTML file.
            tables: of `condyle.report.tables`, to print on it; default: those that the solution
                keeps, which `condyle compare` puts there.
            files: inputs of the run, to be named with their hashes.
            measured: markers and EMG, as of `with_measured`.
            sweep: of `condyle.sweep`, to be shown too.
            pdf: a file for the page as printed on A4, by Chromium, Chrome or Edge.
    Returns: the path.
    Raises: InputError: if a file cannot be read or the report cannot be written, or for a PDF if
            there is no such browser.
    """
    from ...results.solution import as_kind

    as_path(path)
    if pdf is not None:
        as_path(pdf)
        find_browser()  # before the work
    with step("writing the report"):
        with (
            opened(solution)
            if isinstance(solution, str | os.PathLike)
            else nullcontext(solution) as dataset
        ):
            as_kind(dataset, "solution", "solution")
            if measured is not None:
                dataset = dataset.condyle.with_measured(measured)
            page = report_html(dataset, tables=tables, files=files, sweep=sweep)
        write_text(path, page)
        if pdf is not None:
            write_pdf(Path(path), pdf)
    return Path(path)


def report_html(
    solution: xr.Dataset,
    *,
    tables: Sequence[ReportTable] | None = None,
    files: Sequence[str | os.PathLike[str]] | None = None,
    sweep: xr.Dataset | None = None,
) -> str:
    """The report as text; see `write_report`."""
    require("plotly", "report")
    from plotly.offline import get_plotlyjs

    from ...results.solution import as_kind
    from ..tables import ReportTable, stored_tables

    if sweep is not None:
        as_kind(sweep, "sweep", "sweep")
    if tables is None:
        tables = stored_tables(solution)
    elif not isinstance(tables, list | tuple) or not all(
        isinstance(t, ReportTable) for t in tables
    ):
        raise InputError(f"tables: expected tables of condyle.report.tables, got {brief(tables)}")
    if files is not None and not isinstance(files, list | tuple):
        raise InputError(f"files: expected paths of files, got {brief(files)}")
    inputs = [Path(as_path(file, "files")) for file in files or ()]

    bands = bands_section(solution)
    page = reduced(solution)
    solution = page.solution
    scripts = [_lines(get_plotlyjs()), _script()]
    name, options = solution.attrs["mechanism_name"], solution.condyle.options
    what = "Simulation" if options.get("motion_kind") == "simulation" else "Inverse dynamics"
    say = words_of(solution.condyle.mechanism)
    parts = {f"say_{name}": text(say(said)) for name, said in HEADINGS.items()}
    parts |= {
        "policy": text(_policy(scripts)),
        "style": Markup(style() + _asset("page.css")),
        "title": text(f"{name} - condyle report"),
        "name": text(name),
        "subtitle": text(
            f"{what} by {options['formulation']}, route {options['route']}; motion: "
            f"{PurePath(options['motion']).name}; load: {PurePath(options['load']).name}"
        ),
        "version": text(solution.attrs.get("source", "condyle")),
        "warnings": warnings_box(solution.condyle.warnings),
        "facts": fact_cards(page),
        "failures": failure_table(page),
        "chains": chain_table(solution),
        "lifts": contact_lift_table(solution),
        "reactions": reaction_tables(solution),
        "tables": given_tables(tables),
        "bands": bands,
        "sweep": sweep_section(sweep),
        "run": provenance(solution, inputs),
        **_drawn(page),
        "plotly": tag("script", Markup(scripts[0])),
        "script": tag("script", Markup(scripts[1])),
    }
    return fill(_asset("page.html"), parts)


def _drawn(page: ReducedSolution) -> dict[str, Markup]:
    """What the page's script draws from, and the parts of the page that it moves."""
    solution = page.solution
    columns = PageColumns(solution["time"].values)
    picture = stage(solution, columns)
    names = solution.condyle.mechanism.chain_names
    looks = dict(zip(names, styles(names), strict=True))
    panels = [
        panel_data(section, panel, columns, looks)
        for section, panel in panels_of(solution, page.duties)
    ]
    alert_rows = alerts(solution, columns)
    say = words_of(solution.condyle.mechanism)
    data = {
        "machine": picture.data,
        "panels": panels,
        "alerts": alert_rows,
        "failures": [[run.start, run.end, run.text] for run in longest(page.failures)],
        "columns": columns.packed(page.total, page.envelope),  # last, when all are in
    }
    return {
        "payload": json_for_script(data),
        "notes": Markup(samples_note(page) + picture.notes),
        "cameras": buttons("view", list(VIEWS), picture.data["view"]),
        "layers": buttons("layer", {layer: say(layer.capitalize()) for layer in picture.layers}),
        "readout": readout(panels, say),
    }


def _policy(scripts: Sequence[str]) -> str:
    """A content policy that allows these scripts and no network at all."""
    hashes = " ".join(
        f"'sha256-{base64.b64encode(hashlib.sha256(s.encode()).digest()).decode()}'"
        for s in scripts
    )
    return (
        f"default-src 'none'; script-src {hashes}; style-src 'unsafe-inline'; "
        "img-src data: blob:; connect-src 'none'; base-uri 'none'; form-action 'none'"
    )


def _script() -> str:
    body = "\n".join(_asset(f"{name}.js") for name in _SCRIPTS.split())
    return f'"use strict";\n(() => {{\n{body}\n}})();\n'


def _asset(name: str) -> str:
    return _lines((_ASSETS / name).read_text(encoding="utf-8"))


def _lines(content: str) -> str:
    """Line ends as HTML keeps them, so that hashes stay true."""
    return content.replace("\r\n", "\n").replace("\r", "\n")
