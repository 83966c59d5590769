"""Figures of an identification: numbers and their correlations, residuals."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ...identification.identify import Identified

COLUMNS = 3  # of plots beside each other
MOST = 40  # numbers in the picture of correlations


def _figure(width: float, height: float) -> Any:
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def numbers_figure(found: Identified) -> Figure:
    """Fitted numbers and two standard deviations, over what they were."""
    identified = [one for one in found.numbers if one.identified]
    figure = _figure(8, 0.5 + 0.22 * len(identified))
    axes = figure.subplots()
    for place, one in enumerate(reversed(identified)):
        size = max(abs(one.before), abs(one.value)) or one.deviation
        change, spread = (one.value - one.before) / size, one.deviation / size
        axes.errorbar(change, place, xerr=2 * spread, fmt="o", color="#1f6fb4", capsize=2, ms=4)
    axes.set_yticks(range(len(identified)), [one.name for one in reversed(identified)], fontsize=7)
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
    identified = [i for i, one in enumerate(found.numbers) if one.identified][:MOST]
    size = 1.5 + 0.2 * len(identified)
    figure = _figure(size + 2, size)
    axes = figure.subplots()
    image = axes.imshow(
        found.correlation[np.ix_(identified, identified)], vmin=-1, vmax=1, cmap="RdBu"
    )
    names = [found.numbers[i].name for i in identified]
    axes.set_yticks(range(len(identified)), names, fontsize=6)
    axes.set_xticks(range(len(identified)), names, fontsize=6, rotation=90)
    figure.colorbar(image, shrink=0.6)
    return figure


FIGURES = {
    "Numbers with standard deviations, over what they were": numbers_figure,
    "Residuals as efforts over time, by chain": time_figure,
    "Amplitudes of residuals over frequency, by chain": frequency_figure,
    "Residuals over the motion of each joint": motion_figure,
    "Correlations of the numbers": correlation_figure,
}
