"""Commands that show results: figures, pages, films, the mechanism to move by hand, sources."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated, Any

import condyle

from ..errors import InputError, UnsupportedError, did_you_mean
from ..extras import require
from .answer import Answer, command_line, files_line
from .command import command
from .options import FOLDER, PAGE, output_folder, written

MECHANISM = "masticatory"  # that view shows if none is named
RESULT = Path("results/masticatory.nc")  # of `condyle run` as it stands


@command(f"plot {RESULT} --figure effort --figure load")
def plot(
    solution: Path | None = None,
    *,
    figure: list[str] | None = None,
    out: Annotated[Path, FOLDER] = Path("figures"),
    style: str = "screen",
    title: bool = True,
    letters: bool = False,
) -> Answer:
    """Figures of a run, for screen or print.

    Args:
        solution: Results (.nc) of a run. Without it: list the figures.
        figure: Figure to draw; repeat for more. Default: all.
        out: Folder for PNG and SVG files, and PDF for print.
        style: screen; for print journal (85 mm wide, 8 pt font) or journal-wide (175 mm).
        title: Draw title and source of the data.
        letters: Label panels (a), (b) ...
    """
    require("matplotlib", "figures")
    from ..report.figures import PLOTS, save_drawn
    from ..report.figures.saving import FOR_PRINT, FORMATS

    for name in figure or ():
        if name not in PLOTS:
            raise InputError(f'no figure "{name}".{did_you_mean(name, PLOTS)}')
    if solution is None:
        if figure or style != "screen" or letters or not title:
            raise UnsupportedError(
                "condyle plot without results lists the figures; to draw them name the results, as "
                f"in condyle plot {RESULT} --figure effort"
            )
        shows = {name: (draw.__doc__ or "").strip().splitlines()[0] for name, draw in PLOTS.items()}
        text = "\n".join(f"{name:<14} {what}" for name, what in shows.items())
        then = command_line("plot", RESULT) if RESULT.is_file() else "condyle run --figures"
        return Answer(text, {"figures": shows}, then, "result")
    data = condyle.open_solution(solution)
    wishes = {"style": style, "title": title, "letters": letters}
    plots = {name: partial(PLOTS[name], data, **wishes) for name in figure or PLOTS}
    formats = FORMATS if style == "screen" else FOR_PRINT
    files = save_drawn(plots, output_folder(out), formats, every=bool(figure))
    text = "\n".join(f"Wrote {path}" for path in files)
    return Answer(text, {"files": files}, command_line("report", solution))


@command("report results/masticatory.nc")
def report(
    solution: Path,
    *,
    out: Annotated[Path | None, PAGE] = None,
    measured: Path | None = None,
    file: list[Path] | None = None,
    sweep: Path | None = None,
    pdf: Annotated[Path | None, written(".pdf")] = None,
) -> Answer:
    """Report of a run: one HTML file to send.

    It opens without a network: the moving mechanism, linked plots, tables and every warning.

    Args:
        out: HTML file. Default: next to the results.
        file: Input file of the run, to be listed with its hash; repeat for more.
        sweep: Folder of a sweep, to be shown too.
        pdf: Also print the page to this file, by Chromium, Chrome or Edge.
    """
    require("plotly", "report")
    if sweep is not None:
        require("matplotlib", "figures")
    rows = None if sweep is None else condyle.open_sweep(sweep)
    page = out or solution.parent / f"{solution.stem}.html"
    inputs = [solution, *([measured] if measured else []), *(file or ())]
    given: dict[str, Any] = {"files": inputs, "measured": measured, "sweep": rows, "pdf": pdf}
    page = condyle.write_report(solution, page, **given)
    size = page.stat().st_size
    text = f"Wrote {page} ({size / 1e6:.1f} MB); open it in a browser"
    text += f"\nWrote {pdf}" * (pdf is not None)
    then = command_line("view", solution=solution)
    return Answer(text, {"files": [page, *([pdf] if pdf else [])], "bytes": size}, then)


@command("video results/masticatory.nc --out chewing.gif", "report.video:video")
def video(solution: Path, *, out: Annotated[Path, written(".gif", ".mp4")], **given: Any) -> Answer:
    condyle.video(solution, out, **given)
    return Answer(files_line([out]), {"files": [out]}, command_line("report", solution))


@command("view jaw.toml", serves=True)
def view(
    mechanism: str = MECHANISM,
    *,
    solution: Path | None = None,
    map: Path | None = None,
    simulate: Path | None = None,
    port: int = 8080,
    browser: bool = True,
) -> Answer:
    """Interactive 3D view in the browser.

    A page that only this machine can open: move the platform and read efforts, contact forces and
    reach, play back a run, or simulate live. It runs until Ctrl-C.

    Args:
        solution: Results (.nc) to play back; they contain their mechanism.
        map: Map over two or three coordinates (.nc) to rotate and to click; it contains its
            mechanism.
        simulate: Scenario (TOML) to simulate live: change gains and food while it runs, and pull
            the platform with the mouse.
        port: Port on 127.0.0.1.
        browser: Open the page in a browser.
    """
    require("viser", "view")
    own = mechanism if solution is None and map is None else None
    if own is None and mechanism != MECHANISM:
        shown = "--map" if solution is None else "--solution"
        raise InputError(f"{shown} contains its mechanism: leave {mechanism} out")
    condyle.serve_view(own, solution, port=port, open_browser=browser, map=map, scenario=simulate)
    then = command_line("report", solution) if solution else ""
    if simulate is not None:
        then = command_line("simulate", mechanism, scenario=simulate)
    return Answer("", {}, then)


@command("cite results/masticatory.nc > used.bib", "analysis.cite:cite")
def cite(solution: Path | None = None) -> Answer:
    entries = condyle.cite(solution)
    return Answer(entries, {"bibtex": entries}, kind="result")
