"""Figures of an identification: numbers and their correlations, residuals."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure

from ...kinematics.chain import FAMILIES
from ..naming import readable
from .style import ALERT, GREY, PALETTE, TIME, house, labelled, new_figure

if TYPE_CHECKING:
    from ...identification.identify import Identified

COLUMNS = 3  # of plots beside each other
MOST = 40  # numbers in the picture of correlations
MEASURED: dict[str, Any] = {"color": "#BBBBBB", "lw": 0.8, "label": "measured effort"}
RESIDUAL: dict[str, Any] = {"color": ALERT, "lw": 0.8, "label": "residual"}


@house
def numbers_figure(result: Identified) -> Figure:
    """Fitted numbers and two standard deviations, over what they were."""
    identified = [number for number in result.numbers if number.identified]
    figure = _figure(
        "Numbers with two standard deviations", result, 8, 1.1 + 0.22 * len(identified)
    )
    axes = figure.subplots()
    size = [max(abs(number.before), abs(number.value)) or number.deviation for number in identified]
    change = np.divide([number.value - number.before for number in identified], size)
    spread = np.divide([2 * number.deviation for number in identified], size)
    rows = range(len(identified))
    axes.errorbar(change, rows, xerr=spread, fmt="o", color=PALETTE[0], capsize=2, ms=4)
    axes.set_yticks(rows, [number.name for number in identified], fontsize=7)
    axes.invert_yaxis()
    axes.axvline(0, color=GREY, lw=0.8)
    axes.margins(x=0.05)
    axes.set_xlabel("change over the larger of both values")
    return figure


@house
def time_figure(found: Identified) -> Figure:
    """Efforts and residuals over time, by chain."""
    figure, axes = _grid("Residuals over time", found, TIME)
    for log, rows in zip(found.logs, found.fit.rows, strict=True):
        measured = log.log.smoothed(log.log.effort)
        for i, axis in enumerate(axes):
            axis.plot(log.log.equation_times, measured[:, i], **MEASURED)
            axis.plot(log.log.equation_times, rows.effort[:, i], **RESIDUAL)
    _explain(figure, axes)
    return figure


@house
def frequency_figure(found: Identified) -> Figure:
    """Amplitudes of efforts and residuals over frequency, by chain."""
    figure, axes = _grid("Amplitudes over frequency", found, "frequency [Hz]")
    log, rows = found.logs[0].log, found.fit.rows[0]
    step = float(np.diff(log.equation_times).mean())
    frequency = np.fft.rfftfreq(len(log.equation_times), step)
    for i, axis in enumerate(axes):
        for values, look in ((log.smoothed(log.effort), MEASURED), (rows.effort, RESIDUAL)):
            own = values[:, i] - values[:, i].mean()
            size = np.abs(np.fft.rfft(own)) / len(own)
            axis.semilogy(frequency[1:], size[1:], **look)
    _explain(figure, axes)
    return figure


@house
def motion_figure(result: Identified) -> Figure:
    """Residuals as efforts over place, speed and acceleration of their joints, a row a chain.

    A slope is a spring, viscous friction or an inertia that is missing; a step is dry friction.
    """
    height = 1.2 * len(result.chains) + 1.1
    figure = _figure("Residuals over the motion of the joints", result, 9, height, 3)
    axes = figure.subplots(len(result.chains), 3, sharex="col", sharey="row", squeeze=False)
    for log, rows in zip(result.logs, result.fit.rows, strict=True):
        for k, motion in enumerate(log.joint_motion):
            for i, axis in enumerate(axes[:, k]):
                there = np.interp(log.log.equation_times, log.log.t, motion[:, i])
                axis.plot(there, rows.effort[:, i], ".", color=ALERT, ms=1.5)
    for [first, *_], chain, unit in zip(axes, result.chains, _units(result), strict=True):
        first.set_title(readable(chain))
        first.set_ylabel(labelled("residual", unit))
    words = ("place about its mean", "speed", "acceleration")
    for axis, word in zip(axes[-1], words, strict=True):
        axis.set_xlabel(f"{word} of the joint [SI]")
    return figure


@house
def correlation_figure(result: Identified) -> Figure:
    """Correlations of the fitted numbers."""
    identified = [i for i, number in enumerate(result.numbers) if number.identified][:MOST]
    size = 2.0 + 0.2 * len(identified)
    figure = _figure("Correlations of the numbers", result, size + 2, size)
    axes = figure.subplots()
    image = axes.imshow(
        result.correlation[np.ix_(identified, identified)], vmin=-1, vmax=1, cmap="RdBu"
    )
    names = [result.numbers[i].name for i in identified]
    axes.set_yticks(range(len(identified)), names, fontsize=6)
    axes.set_xticks(range(len(identified)), names, fontsize=6, rotation=90)
    axes.grid(False)
    figure.colorbar(image, shrink=0.6)
    return figure


FIGURES = {
    "Numbers with standard deviations, over what they were": numbers_figure,
    "Residuals as efforts over time, by chain": time_figure,
    "Amplitudes of residuals over frequency, by chain": frequency_figure,
    "Residuals over the motion of each joint": motion_figure,
    "Correlations of the numbers": correlation_figure,
}


def _figure(title: str, found: Identified, *size: Any) -> Figure:
    return new_figure(title, f"Mechanism {found.mechanism.name}; {found.header}.", *size)


def _units(found: Identified) -> list[str]:
    """Units of the efforts, by chain."""
    return [FAMILIES[chain.kind].effort_unit for chain in found.mechanism.chains]


def _grid(title: str, result: Identified, across: str) -> tuple[Figure, list[Any]]:
    """Axes for each chain; those of one unit have one scale."""
    rows, units = -(-len(result.chains) // COLUMNS), _units(result)
    figure = _figure(title, result, 9, 1.6 * rows + 1.2, COLUMNS)
    one_scale = len({*units}) == 1
    grid = figure.subplots(rows, COLUMNS, sharex=True, sharey=one_scale, squeeze=False)
    axes = list(grid.ravel())
    for axis in axes[len(result.chains) :]:
        axis.remove()
    for i, (axis, chain, unit) in enumerate(zip(axes, result.chains, units, strict=False)):
        axis.set_title(readable(chain))
        if not one_scale or i % COLUMNS == 0:
            axis.set_ylabel(labelled("effort", unit))
        if i + COLUMNS >= len(result.chains):
            axis.tick_params(labelbottom=True)
            axis.set_xlabel(across)
    return figure, axes[: len(result.chains)]


def _explain(figure: Figure, axes: list[Any]) -> None:
    """One legend for all axes."""
    handles, names = axes[0].get_legend_handles_labels()
    figure.legend(handles[:2], names[:2], loc="outside lower right", ncols=2)
