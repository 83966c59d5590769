"""What an identification found, as one page that needs no network."""

from __future__ import annotations

import html
import os
from io import StringIO
from typing import TYPE_CHECKING, Any

import numpy as np

from ..atomic import write_text
from ..extras import require

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ..identification.identify import Identified

COLUMNS = 3  # of plots beside each other
MOST = 40  # numbers in the picture of correlations

STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; margin: 2rem auto; max-width: 70rem; padding: 0 1rem;
  color: #222; background: #fff }
table { border-collapse: collapse; width: 100% } .wide { overflow-x: auto }
td, th { padding: .25rem .75rem; text-align: right; border-bottom: 1px solid #ddd }
td:first-child, th:first-child, td:last-child, th:last-child { text-align: left }
svg { max-width: 100%; height: auto }
@media (prefers-color-scheme: dark) { body { color: #ddd; background: #181818 }
  td, th { border-color: #444 } svg { background: #fff; border-radius: 4px } }
"""


def write_page(found: Identified, path: str | os.PathLike[str]) -> None:
    """As `Identified.write_report`."""
    require("matplotlib", "figures")
    name = html.escape(found.mechanism.name)
    parts = [
        f"<h1>{name}: identification</h1>",
        f"<p>{html.escape(_summary(found))}</p>",
        *(f"<p><b>{html.escape(words)}</b></p>" for words in map(str, found.lack_of_fit)),
        "<h2>Numbers</h2>",
        f'<div class="wide">{_numbers(found)}</div>',
        _picture(numbers_figure(found), "Numbers with standard deviations, over what they were"),
        "<h2>Residuals</h2>",
        _picture(time_figure(found), "Residuals as efforts over time, by chain"),
        _picture(frequency_figure(found), "Amplitudes of residuals over frequency, by chain"),
        _picture(motion_figure(found), "Residuals over the motion of each joint"),
        "<h2>Correlations</h2>",
        _picture(correlation_figure(found), "Correlations of the numbers"),
    ]
    body = "\n".join(parts)
    page = (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width">'
        f"<title>{name}: identification</title><style>{STYLE}</style></head>"
        f"<body>{body}</body></html>"
    )
    write_text(path, page)


def _summary(found: Identified) -> str:
    told = sum(one.told for one in found.numbers)
    said = f"{told} of {len(found.numbers)} numbers identified. Residual over noise: "
    said += f"fitted {np.sqrt(found.fitted.spread):.3g}"
    if found.validated is not None:
        said += f", validated {np.sqrt(found.validated.spread):.3g}"
    return said + "; 1 where noise is all that is left. " + ". ".join(found.held)


def _numbers(found: Identified) -> str:
    rows = [
        "<tr><th>number</th><th>value</th><th>deviation</th><th>before</th><th>unit</th><th></th></tr>"
    ]
    for one in found.numbers:
        deviation = f"{one.deviation:.2g}" if one.told else "&ndash;"
        said = "" if one.told else html.escape(f"not identified: {one.why}")
        rows.append(
            f"<tr><td>{html.escape(one.name)}</td><td>{one.value:.6g}</td><td>{deviation}</td>"
            f"<td>{one.before:.6g}</td><td>{html.escape(one.unit)}</td><td>{said}</td></tr>"
        )
    return f"<table>{''.join(rows)}</table>"


def _picture(figure: Figure, alt: str) -> str:
    out = StringIO()
    figure.savefig(out, format="svg", bbox_inches="tight", metadata={"Date": None})
    drawn = out.getvalue()
    inner = drawn[drawn.index("<svg") :]
    return inner.replace("<svg", f'<svg role="img" aria-label="{html.escape(alt)}"', 1)


def _figure(width: float, height: float) -> Any:
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def numbers_figure(found: Identified) -> Figure:
    """Fitted numbers and two standard deviations, over what they were."""
    told = [one for one in found.numbers if one.told]
    figure = _figure(8, 0.5 + 0.22 * len(told))
    axes = figure.subplots()
    for place, one in enumerate(reversed(told)):
        size = max(abs(one.before), abs(one.value)) or one.deviation
        change, spread = (one.value - one.before) / size, one.deviation / size
        axes.errorbar(change, place, xerr=2 * spread, fmt="o", color="#1f6fb4", capsize=2, ms=4)
    axes.set_yticks(range(len(told)), [one.name for one in reversed(told)], fontsize=7)
    axes.axvline(0, color="#888", lw=0.8)
    axes.set_xlabel("change over the larger of both values, with two standard deviations")
    return figure


def _grid(found: Identified) -> tuple[Any, list[Any]]:
    count = len(found.chains)
    rows = -(-count // COLUMNS)
    figure = _figure(9, 1.6 * rows + 0.6)
    axes = figure.subplots(rows, COLUMNS, sharex=True, sharey=True, squeeze=False).ravel()
    for axis in axes[count:]:
        axis.set_axis_off()
    for axis, chain in zip(axes, found.chains, strict=False):
        axis.set_title(chain, fontsize=8)
        axis.tick_params(labelsize=7)
    return figure, list(axes[:count])


def time_figure(found: Identified) -> Figure:
    """Efforts and residuals over time, by chain."""
    figure, axes = _grid(found)
    for log, rows in zip(found.logs, found.fit.rows, strict=True):
        measured = log.log.smoothed(log.log.effort)
        for i, axis in enumerate(axes):
            axis.plot(log.log.kept, measured[:, i], color="#bbb", lw=0.7)
            axis.plot(log.log.kept, rows.effort[:, i], color="#c2410c", lw=0.7)
    figure.supxlabel("time [s]", fontsize=8)
    figure.supylabel("effort, and residual (orange)", fontsize=8)
    return figure


def frequency_figure(found: Identified) -> Figure:
    """Amplitudes of efforts and residuals over frequency, by chain."""
    figure, axes = _grid(found)
    log, rows = found.logs[0].log, found.fit.rows[0]
    step = float(np.diff(log.kept).mean())
    frequency = np.fft.rfftfreq(len(log.kept), step)
    for i, axis in enumerate(axes):
        for values, colour in ((log.smoothed(log.effort), "#bbb"), (rows.effort, "#c2410c")):
            own = values[:, i] - values[:, i].mean()
            size = np.abs(np.fft.rfft(own)) / len(own)
            axis.semilogy(frequency[1:], size[1:], color=colour, lw=0.7)
    figure.supxlabel("frequency [Hz]", fontsize=8)
    figure.supylabel("amplitude", fontsize=8)
    return figure


def motion_figure(found: Identified) -> Figure:
    """Residuals as efforts over place, speed and acceleration of their joints, a row a chain.

    A slope is a spring, viscous friction or an inertia that is missing; a step is dry friction.
    """
    figure = _figure(9, 1.2 * len(found.chains) + 0.6)
    axes = figure.subplots(len(found.chains), 3, sharex="col", squeeze=False)
    for log, rows in zip(found.logs, found.fit.rows, strict=True):
        for k, motion in enumerate(log.joint_motion):
            for i, axis in enumerate(axes[:, k]):
                there = np.interp(log.log.kept, log.log.t, motion[:, i])
                axis.plot(there, rows.effort[:, i], ".", color="#c2410c", ms=1.5)
    for row, chain in zip(axes, found.chains, strict=True):
        row[0].set_title(chain, fontsize=8, loc="left")
        for axis in row:
            axis.tick_params(labelsize=7)
    for axis, words in zip(
        axes[-1], ("place about its mean", "speed", "acceleration"), strict=True
    ):
        axis.set_xlabel(f"{words} of the joint", fontsize=8)
    figure.supylabel("residual", fontsize=8)
    return figure


def correlation_figure(found: Identified) -> Figure:
    """Correlations of the fitted numbers."""
    told = [i for i, one in enumerate(found.numbers) if one.told][:MOST]
    size = 1.5 + 0.2 * len(told)
    figure = _figure(size + 2, size)
    axes = figure.subplots()
    image = axes.imshow(found.correlation[np.ix_(told, told)], vmin=-1, vmax=1, cmap="RdBu")
    names = [found.numbers[i].name for i in told]
    axes.set_yticks(range(len(told)), names, fontsize=6)
    axes.set_xticks(range(len(told)), names, fontsize=6, rotation=90)
    figure.colorbar(image, shrink=0.6)
    return figure
