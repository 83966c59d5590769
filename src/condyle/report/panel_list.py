"""The panels of a solution, each stated once; figures and the page draw them.

A function that gives panels is all that another one needs: it is a figure and a part of the page.

@panels("actuators", "Power of the actuators")
def power(solution: xr.Dataset) -> Iterator[Panel]:
    '''Power of each actuator over time.'''
    watts = solution["effort"].values * solution["joint_rate"].values
    curves = of_names(solution, "power", "chain", watts)
    yield Panel("power", "Actuator power", "power", "W", curves)

A package elsewhere names its module as an entry point of the group `condyle.panels`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from ..analysis.session.incisor import PATHS, POINT, has_incisor, way_of
from ..errors import InputError, did_you_mean
from ..kinematics.singularities import NEAR_SINGULAR
from ..mechanism.chain import limits as actuator_limits
from ..mechanism.vocabulary import words_of
from ..results.accuracy import FEW_DIGITS
from ..results.contacts import joint_loads, load_sign
from ..results.emg_followed import emg_lags
from .actuators import (
    EMG_ROW,
    Duty,
    activations,
    drawn_limits,
    duty,
    edges,
    emg,
    limits_text,
)
from .naming import (
    LOAD_PARTS,
    bite_sides,
    by_unit,
    groups,
    heading,
    part_word,
    parts_in_use,
    readable,
)
from .panel import (
    NORM,
    DisplayUnit,
    Levels,
    Panel,
    Series,
    display_unit,
    distinct,
    of_names,
    panels,
    quantity_panels,
)
from .scene import contact_profile

if TYPE_CHECKING:
    import xarray as xr

MOST = 8  # chains in one panel of a figure; beyond, no curve can be followed
INCISAL = ("protrusion", "excursion to the left", "gape")  # of `PATHS`
ORDERS = ("", "_rate", "_acceleration")  # of a variable's derivatives
STRAIGHT = {"SPS", "cable", "muscle"}  # chains that act along their line: their transmission is ±1
VIEWS = {"above": (0, 1), "side": (0, 2)}  # of a track: the coordinates across and up
BODIES = {"fixed": "base", "platform": "platform"}
DISTANCES = {
    "marker_residual": "residual in the body",
    "marker_offset": "from the computed motion",
}


def effort_word(unit: str) -> str:
    """What an effort in this unit is."""
    return "force" if unit == "N" else "torque"


def chains_of(solution: xr.Dataset) -> tuple[list[str], list[str], list[str]]:
    """Names of the chains, and units of their efforts and joints."""
    keys = ("chain", "effort_unit", "joint_unit")
    names, efforts, joints = ([str(value) for value in solution[key].values] for key in keys)
    return names, efforts, joints


@panels("motion", "Motion of the platform")
def motion(solution: xr.Dataset) -> Iterator[Panel]:
    """Pose coordinates, their rates and accelerations over time; of a jaw gape and the like too."""
    mechanism = solution.condyle.mechanism
    say = words_of(mechanism)
    if mechanism.vocabulary == "jaw" and has_incisor(mechanism):
        way = way_of(mechanism.platform.points[POINT], solution["pose"].values)
        yield Panel(
            "incisal-point",
            "Movement of the incisal point",
            "position",
            "m",
            [
                Series(label, f"movement.{path}", values)
                for path, label, values in zip(PATHS, INCISAL, way.T, strict=True)
            ],
            place=("incisal", "position"),
            components=True,
        )
    words = (
        ("position", "velocity", "acceleration"),
        ("angle", "angular rate", "angular acceleration"),
    )
    for order, suffix in enumerate(ORDERS):
        curves = of_names(solution, f"pose{suffix}", "coordinate")
        curves = [replace(curve, label=say(curve.label) + "′" * order) for curve in curves]
        for k, (what, unit) in enumerate((("position", "m"), ("angles", "rad"))):
            yield Panel(
                f"pose{suffix}-{what}",
                f"Platform {what}{suffix.replace('_', ' ')}",
                words[k][order],
                unit,
                curves[3 * k : 3 * k + 3],
                order=order,
                place=(suffix, what),
                components=True,
            )


@panels("chains", "Joint coordinates", split=MOST, same=True)
def joint(solution: xr.Dataset) -> Iterator[Panel]:
    """Joint coordinates from home, their rates with the limits, and accelerations."""
    names, _, units = chains_of(solution)
    for order, (suffix, word) in enumerate(
        zip(ORDERS, ("coordinate", "rate", "acceleration"), strict=True)
    ):
        curves = of_names(solution, f"joint{suffix}", "chain")
        for unit, group in by_unit(units).items():
            own = [names[i] for i in group]
            bounds = [drawn_limits(solution, "joint_rate")[i] for i in group] if order == 1 else []
            titles = (
                "Joint angle" if unit == "rad" else "Joint travel",
                "Joint speed",
                "Joint acceleration",
            )
            yield Panel(
                f"joint{suffix}-{unit}",
                titles[order],
                word,
                unit,
                [curves[i] for i in group],
                order=order,
                place=(word, unit),
                limits=distinct(bounds, own[: len(bounds)], display_unit(unit, order)),
            )


@panels("chains", "Efforts of the actuators", split=0, same=True)
def effort(solution: xr.Dataset) -> Iterator[Panel]:
    """Effort of each chain over time, with its actuator's limit."""
    names, units, _ = chains_of(solution)
    curves, bounds = of_names(solution, "effort", "chain"), drawn_limits(solution, "effort")
    for unit, group in by_unit(units).items():
        own = [names[i] for i in group]
        yield Panel(
            f"effort-{unit}".replace(" ", ""),
            f"Actuator {effort_word(unit)}",
            effort_word(unit),
            unit,
            [curves[i] for i in group],
            limits=distinct([bounds[i] for i in group], own, DisplayUnit(unit)),
        )


NO_LIMITS = "no actuator of this mechanism has an effort limit"


_OVER = "Effort over greatest effort"


@panels("actuators", "Activation", empty=NO_LIMITS)
def activation(solution: xr.Dataset) -> Iterator[Panel]:
    """Activation of each actuator or muscle; joint loads below.

    Of muscles with lengths and speeds their activation, and in a panel of its own their force over
    the greatest, max_force; of others effort over greatest effort.

    Where EMG was measured (`with_measured`), its envelope stands under its muscle's row.
    """
    rows, measured = activation_rows(solution), emg(solution)
    if not rows:
        return
    fibres = "fibre_length" in solution
    what = "Of a muscle, by its length and speed" if fibres else _OVER
    note = f"{what}; orange: beyond 1, a limit is exceeded."
    if measured:
        note += " EMG: its measured envelope over its greatest."
        behind = ", ".join(f"{row.label} {row.text}" for row in rows if row.text)
        note += f" Activation behind it: {behind}." if behind else ""
    yield Panel("activation", "Activation", "activation", "1", rows, "field", note=note)
    if fibres:
        names, effort = chains_of(solution)[0], solution["effort"].values
        chains = solution.condyle.mechanism.chains
        used = [
            Series(names[i], f"effort.{names[i]}", effort[:, i], scale=1.0 / c.muscle.max_force)
            for i, c in enumerate(chains)
            if c.kind == "muscle"
        ]
        note = "Tension, passive force included, over max_force; above 1 where fibres lengthen."
        yield Panel(
            "force-used", "Force over greatest force", "share", "1", used, "field", note=note
        )
    if solution.sizes["contact"]:
        loads, note = _joint_loads(solution)
        yield Panel("load-on-joints", "Joint load", "joint load", "N", loads, note=note)


@panels("actuators", "Efforts against speeds, with limits")
def effort_speed(solution: xr.Dataset, duties: Sequence[Duty] | None = None) -> Iterator[Panel]:
    """Effort of each actuator against its speed, in the box of its limits; rms and peak power."""
    names, efforts, joints = chains_of(solution)
    duties = duties or duty(solution)
    rates, values = solution["joint_rate"].values, solution["effort"].values
    boxes = [actuator_limits(chain) for chain in solution.condyle.mechanism.chains]
    for number, group in enumerate(groups(names, efforts)):
        unit, speed = efforts[group[0]], f"{joints[group[0]]}/s"
        size = [float(np.nanmax(np.abs(v[:, group]), initial=0.0)) for v in (rates, values)]
        within = list(dict.fromkeys(boxes[i] for i in group))
        curves = [
            Series(
                names[i],
                f"effort.{names[i]}",
                values[:, i],
                across=(f"joint_rate.{names[i]}", rates[:, i]),
                text=duties[i].text,
            )
            for i in group
        ]
        yield Panel(
            f"plane-{number}",
            heading([names[i] for i in group]),
            effort_word(unit),
            unit,
            curves,
            "plane",
            across=f"speed [{speed}]",
            note="; ".join(limits_text(box, unit, speed) or "none" for box in within),
            lines=[edge for box in within for edge in edges(box, *size)],
        )


@panels("shares", "Efforts by part of the mechanism", split=0, same=True)
def share(
    solution: xr.Dataset, parts: Sequence[str] | None = None, every: bool = False
) -> Iterator[Panel]:
    """Efforts by part: a column a part, a row a pair of chains.

    Args: parts: names; by default all that there are.
    """
    there = [str(part) for part in solution["part"].values]
    in_use = there if every else parts_in_use(solution)
    wanted = [there.index(named_part(solution, part)) for part in parts or in_use]
    names, units, _ = chains_of(solution)
    values, say = solution["share"].values, words_of(solution.condyle.mechanism)

    def curves(owner: str, of: np.ndarray) -> list[Series]:
        return [
            Series(say(part_word(there[p])), f"share.{owner}.{there[p]}", of[p]) for p in wanted
        ]

    for unit, group in by_unit(units).items():
        norms = curves(unit, np.linalg.norm(values[:, :, group], axis=2))
        yield Panel(
            f"share-{unit}".replace(" ", ""),
            "Share of each part in the effort",
            effort_word(unit),
            unit,
            {NORM: norms} | {names[i]: curves(names[i], values[:, :, i]) for i in group},
            note="The parts of one chain add up to its effort; norms over chains do not add up.",
        )


def activation_rows(solution: xr.Dataset) -> list[Series]:
    """A row for each chain with an activation, and under it its EMG where that was measured."""
    computed, measured = activations(solution), emg(solution)
    chains = {chain.name: i for i, chain in enumerate(solution.condyle.mechanism.chains)}
    effort, rows, lags = solution["effort"].values, list[Series](), emg_lags(solution)
    for name in dict.fromkeys([*computed, *measured]):
        if name in computed and "fibre_length" in solution:
            rows.append(Series(name, f"activation.{name}", computed[name]))
        elif name in computed:  # |effort| times a scale: the page has the efforts already
            scale = 1.0 / actuator_limits(solution.condyle.mechanism.chains[chains[name]]).greatest
            rows.append(Series(name, f"effort.{name}", effort[:, chains[name]], scale=scale))
        if name in measured:
            late = f"{1e3 * lags[name]['lag']:+.0f} ms" if name in lags else ""
            row = Series(f"{name}{EMG_ROW}", f"emg.{name}", measured[name], text=late)
            rows.append(row)
    return rows


def activation_top(solution: xr.Dataset) -> float:
    """Where the colours of activations end, in rows and in space."""
    return Panel("", "", "", "1", activation_rows(solution)).top


def colour_values(solution: xr.Dataset) -> dict[str, np.ndarray]:
    """Activations (N,) by chain for their colours: over the top of the scale; beyond 1 as is."""
    top, by_column = activation_top(solution), dict[str, np.ndarray]()
    for row in activation_rows(solution):
        value = np.abs(row.values) * (row.scale or 1.0)
        by_column[row.label] = np.where(value > 1.0, value, value / top)
    return by_column


def named_part(solution: xr.Dataset, part: str) -> str:
    """The part in the solution that a caller means; the load has two names."""
    there = [str(name) for name in solution["part"].values]
    meant = [name for name in there if name == part or {name, part} <= set(LOAD_PARTS)]
    if not meant:
        raise InputError(f'no part "{part}".{did_you_mean(part, there)}')
    return meant[0]


NO_CONTACTS = "this mechanism has no contacts"
FORCES = "Contact forces on the platform, along the unit normals"


@panels("contacts", FORCES, empty=NO_CONTACTS)
def contact_force(solution: xr.Dataset) -> Iterator[Panel]:
    """Force of each contact on the platform along the unit normal, and how far its bounds are."""
    if not solution.sizes["contact"]:
        return
    (forces, note), title = _joint_loads(solution), "Contact force along the normal"
    yield Panel("contact-force", title, "force", "N", forces, note=note)
    margins = of_names(solution, "bound_margin", "contact")
    margins = [curve for curve in margins if not np.isposinf(curve.values).any()]
    if margins:
        note, title = "Negative: outside the bounds.", "Distance to the nearest bound"
        yield Panel("bound-margin", title, "to a bound", "m", margins, note=note)


def _joint_loads(solution: xr.Dataset) -> tuple[list[Series], str]:
    """Curves of the joint loads, with their bands, and what they mean."""
    mechanism = solution.condyle.mechanism
    signs = joint_loads(mechanism, np.ones(len(mechanism.contacts))).astype(int)
    curves = [
        replace(
            curve,
            column=f"joint_load.{curve.label}",
            values=sign * curve.values,
            bands=None if curve.bands is None else sign * curve.bands[::sign],
        )
        for sign, curve in zip(signs, of_names(solution, "contact_force", "contact"), strict=True)
    ]
    note = f"{load_sign(mechanism).capitalize()}."
    sides = ", ".join(f"{name}: {side}" for name, side in bite_sides(solution).items())
    return curves, note + (f" {sides}." if sides else "")


RIGID = "no contact of this mechanism has compliance"
PATCHES = {
    "indentation": ("Indentation", "indentation", "m"),
    "contact_area": ("Contact area", "area", "m²"),
    "mean_pressure": ("Mean pressure", "mean pressure", "Pa"),
    "peak_pressure": ("Peak pressure", "peak pressure", "Pa"),
    "energy_density": ("Largest energy density", "energy density", "J/m³"),
}


@panels("contacts", "Indentation, area and pressure of the contacts", empty=RIGID)
def pressure(solution: xr.Dataset) -> Iterator[Panel]:
    """Indentation, area, pressures and energy density of contacts with compliance."""
    for name, (title, axis, unit) in PATCHES.items():
        curves = of_names(solution, name, "contact") if name in solution else []
        if known := [one for one in curves if np.isfinite(one.values).any()]:
            yield Panel(name.replace("_", "-"), title, axis, unit, known)


def _load_heading(solution: xr.Dataset) -> str:
    point = solution.condyle.options.get("load_point")
    return "Load on the platform" + (f" at {readable(point)}" if point else "")


@panels("contacts", _load_heading, empty="nothing loads the platform in this solution")
def load(solution: xr.Dataset, every: bool = False) -> Iterator[Panel]:
    """Force on the platform over time, and its moment, where they are not 0 throughout.

    Args: every: also what is.
    """
    point = solution.condyle.options.get("load_point")
    curves = of_names(solution, "load", "component")
    some = [any(np.nan_to_num(c.values).any() for c in part) for part in (curves[:3], curves[3:])]
    at = f" at {point}" if point else ""
    if every or some[0]:
        yield Panel("load", f"Load{at}", "force", "N", curves[:3], components=True)
    if every or some[1]:
        title = f"Moment of the load{at}"
        yield Panel("moment", title, "moment", "N m", curves[3:], components=True)


@panels("tracks", "Tracks of the contact points", empty=NO_CONTACTS)
def contact_track(solution: xr.Dataset) -> Iterator[Panel]:
    """Track of each contact point, from above and from the side, against its bounds."""
    points, outside = solution["contact_point"].values, solution["bound_margin"].values < 0
    mechanism = solution.condyle.mechanism
    say = words_of(mechanism)
    for k, contact in enumerate(mechanism.contacts):
        track, own = points[:, k], [contact.bounds.x, contact.bounds.y, contact.bounds.z]
        columns = [(f"contact_point.{contact.name}.{i}", track[:, i]) for i in range(3)]
        for view, (across, up) in VIEWS.items():
            line = contact_profile(contact, track) if view == "side" else None
            less = "" if contact.ball_radius is None else ", less the ball's radius"
            yield Panel(
                f"track-{k}-{view}",
                f"{contact.name}, from {'the ' * (view == 'side')}{view}",
                "xyz"[up],
                "m",
                [Series(say("contact point"), *columns[up], across=columns[across])],
                "track",
                place=(view, contact.name),
                across="xyz"[across],
                note=f"surface at the home y{less}",
                lines=[] if line is None else [(line[:, 0], line[:, 2])],
                bounds=(own[across], own[up]),
                outside=outside[:, k],
            )


@panels("singularity", "Distance from singularities")
def singularity(solution: xr.Dataset) -> Iterator[Panel]:
    """Dimensionless measures: transmission of each chain, singular values of J_W, their ratio."""
    condition = solution["condition"].values
    sigma = solution["J_W_sigma"].values
    near = Levels(NEAR_SINGULAR, math.inf, f"near: {NEAR_SINGULAR:g}")
    if {chain.kind for chain in solution.condyle.mechanism.chains} - STRAIGHT:
        note = "±1 is best; 0 is an inverse singularity of that chain."
        title = "Transmission (J_A, dimensionless)"
        yield from quantity_panels(solution, "transmission", title=title, note=note)
    title = "Singular values of J_W (dimensionless)"
    note = "The smallest at 0 is a direct singularity."
    values = [Series(f"σ{i + 1}", f"J_W_sigma.{i}", v) for i, v in enumerate(sigma.T)]
    yield Panel("sigma", title, "σ", "1", values, note=note, log=True)
    note = "Smallest over largest singular value of J_A or J_W; 0 is singular."
    ratio = [Series("ratio", "singularity_ratio", solution["singularity_ratio"].values)]
    title = "Distance from a singularity"
    yield Panel("ratio", title, "ratio", "1", ratio, note=note, log=True, limits=[near])
    finite = np.where(np.isfinite(condition), condition, np.nan)
    one, title = [Series("condition", "condition", finite)], "Condition number of J_W"
    note = "Largest over smallest singular value of J_W."
    yield Panel("condition", title, "condition", "1", one, note=note, log=True)


@panels("singularity", "Bound of the relative error", empty="this solution has no bounds")
def accuracy(solution: xr.Dataset) -> Iterator[Panel]:
    """Bound of the relative error of each sample, and above which digits are few."""
    if "bound" not in solution:
        return
    values = solution["bound"].values
    few = Levels(-math.inf, FEW_DIGITS, f"few digits: {FEW_DIGITS:g}")
    limits = [few] if (values > FEW_DIGITS).any() else []  # else it is far off
    note = "By rounding, on the safe side, of the largest entry or term of a sample."
    one, title = [Series("bound", "bound", values)], "Bound of the relative error"
    yield Panel("accuracy", title, "bound", "1", one, note=note, log=True, limits=limits)


@panels("singularity", "Diagonal of J_A", split=0)
def jacobian(solution: xr.Dataset) -> Iterator[Panel]:
    """Diagonal of J_A, eq. (26): a chain is at an inverse singularity where its entry is zero."""
    yield from quantity_panels(solution, "J_A", title="Diagonal of J_A")


@panels("markers", "Distances of the markers", empty="no markers were measured")
def marker(solution: xr.Dataset) -> Iterator[Panel]:
    """Distances of measured markers from where the body and the computed motion have them."""
    if "marker_place" not in solution:
        return
    bodies = [str(body) for body in solution["marker_body"].values]
    sets = {}
    for variable, meaning in DISTANCES.items():
        curves = of_names(solution, variable, "marker")
        for body, word in BODIES.items():
            own = [c for c, of in zip(curves, bodies, strict=True) if of == body]
            if own:
                sets[f"{word}: {meaning}"] = own
    if sets:
        yield Panel(
            "marker-residual",
            "Distances of the markers",
            "distance",
            "m",
            sets,
            note="Residual in the body: its rigidity, and the error of measurement. From the "
            "computed motion: the effect of smoothing and of the contacts too.",
        )


@panels("reactions", "Reactions", empty="this solution has no reactions; run it with --reactions")
def reaction(solution: xr.Dataset) -> Iterator[Panel]:
    """Magnitudes of joint reactions and contact forces, where a run was asked for them."""
    for name in map(str, solution.data_vars):
        if not (name.startswith("reaction_") or name == "contact_force_vector"):
            continue
        if solution[name].dims[:1] != ("time",):
            continue
        about = solution[name].attrs
        title = str(about.get("long_name", name.replace("_", " ")))
        yield Panel(
            name,
            title[:1].upper() + title[1:],
            "magnitude",
            str(about.get("units", "")),
            [
                Series(label, f"{name}.{label}", v)
                for label, v in magnitudes(solution, name).items()
            ],
        )


def magnitudes(solution: xr.Dataset, name: str) -> dict[str, np.ndarray]:
    """Magnitudes (N,) of a reaction by the labels of the dimensions between time and axes."""
    variable = solution[name]
    values, dimensions = variable.values, list(variable.dims[1:])
    if dimensions and dimensions[-1] == "axis":
        values = np.linalg.norm(values, axis=-1)
        dimensions.pop()
    labels = product(*([str(v) for v in solution[d].values] for d in dimensions))
    columns = values.reshape(len(values), -1).T
    return {" ".join(label) or name: c for label, c in zip(labels, columns, strict=True)}
