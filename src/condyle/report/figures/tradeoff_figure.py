"""The curve between least effort and least load on the contacts."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from ...mechanism.vocabulary import words_of
from ..naming import readable
from .style import DARK, caption, house, look, new_figure

if TYPE_CHECKING:
    from ...analysis.weight_curve import Tradeoff


@house
def tradeoff_figure(tradeoff: Tradeoff) -> Figure:
    """Load on the contacts over effort, and each contact's mean force over the weight."""
    mechanism = tradeoff.solution.condyle.mechanism
    say = words_of(mechanism)
    title = say("Effort against load on the contacts")
    figure = new_figure(title, caption(tradeoff.solution), 8.5, 4.0, 2)
    left, right = figure.subplots(1, 2)
    left.plot(tradeoff.effort, tradeoff.load, marker="o", markersize=4, color=DARK)
    for p in apart(tradeoff):
        text = f"W = {tradeoff.weights[p]:.3g}"
        place = tradeoff.effort[p], tradeoff.load[p]
        left.annotate(text, place, (5, 4), textcoords="offset points", fontsize=7, color=DARK)
    left.margins(x=0.15, y=0.08)
    left.set_title(say("from least effort to least load"))
    left.set_xlabel(say("effort: root of mean sum (effort/limit)²"))
    left.set_ylabel(say("load on the contacts, root mean square [N]"))
    for k, name in enumerate(mechanism.contact_names):
        right.plot(tradeoff.weights, tradeoff.mean[:, k], label=readable(name), **look(k))
    right.set_xscale("symlog", linthresh=tradeoff.weights[tradeoff.weights > 0].min(initial=1.0))
    right.set_title(say("mean force at each contact"))
    right.set_xlabel(say("weight of the contacts W"))
    right.set_ylabel("force [N]")
    right.legend(loc="upper right")
    return figure


def apart(tradeoff: Tradeoff, least: float = 0.08) -> list[int]:
    """Points of the curve whose labels do not stand on each other, the first among them."""
    curve = np.column_stack([tradeoff.effort, tradeoff.load])
    extent = np.ptp(curve, axis=0)
    curve = curve / np.where(extent > 0, extent, 1.0)
    labelled_points = [0]
    for p in range(1, len(curve)):
        if np.abs(curve[p] - curve[labelled_points[-1]]).max() > least:
            labelled_points.append(p)
    return labelled_points
