"""Which plots stand on the page, and what each draws."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ...mechanism.actuator import Limits
from ...mechanism.chain import limits as actuator_limits
from ..scene import Style, styles
from ..words import part_word, parts_in_use
from .columns import Columns
from .units import Shown, shown

if TYPE_CHECKING:
    from ...results.solution import Solution

# The third with gaps, through which one that it lies on can be seen, as gamma on alpha in chewing.
COMPONENTS = [Style(0, "solid"), Style(1, "dot"), Style(2, "dash")]
MOST_LIMITS = 4  # lines in one plot; more would hide the curves
LIMITS_IN_VIEW = 0.25  # of a limit: peaks above this bring the limit into view
MAX_BOUND = 1e9  # metres; a margin without a bound is infinite

Panel = dict[str, Any]


@dataclass(frozen=True)
class Line:
    """One curve of a panel: a label, its samples (N,) in SI, and how it is drawn."""

    label: str
    column: str
    values: np.ndarray
    style: Style


@dataclass(frozen=True)
class Limit:
    """Levels `low` and `high` (SI; infinite: none), and the lines that they hold for."""

    low: float
    high: float
    label: str
    of: list[str]

    def drawn(self, scale: float) -> dict[str, Any]:
        """As the page has it, null for no level."""
        low, high = (v * scale if np.isfinite(v) else None for v in (self.low, self.high))
        return {"low": low, "high": high, "label": self.label, "of": self.of}


def time_panels(solution: Solution, columns: Columns, every: bool = False) -> list[Panel]:
    """Every plot over time, in the order of the page.

    Args: every: those too in which there is nothing but zeros, as in one piece of a run.
    """
    return [
        *_motion(solution, columns),
        *_chains(solution, columns),
        *_shares(solution, columns, every),
        *_contacts(solution, columns, every),
        *_singularity(solution, columns),
        *_reactions(solution, columns),
    ]


def panel(
    columns: Columns,
    section: str,
    name: str,
    title: str,
    unit: Shown,
    sets: dict[str, list[Line]],
    note: str = "",
    limits: Sequence[Limit] = (),
) -> Panel:
    """A plot over time; several `sets` of lines become a choice."""
    values = np.concatenate([line.values for lines in sets.values() for line in lines])
    finite = np.abs(values[np.isfinite(values)])
    peak = float(finite.max(initial=0.0))
    nearest = min((abs(v) for one in limits for v in (one.low, one.high) if v), default=np.inf)
    return {
        "id": name,
        "section": section,
        "title": title,
        "unit": unit.unit,
        "decimals": unit.decimals(values),
        "note": note,
        "limitsDrawn": len(limits) <= MOST_LIMITS,
        "limits": [one.drawn(unit.scale) for one in limits],
        "limitsInView": len(limits) <= MOST_LIMITS and peak >= LIMITS_IN_VIEW * nearest,
        "sets": [
            {
                "label": label,
                "lines": [
                    {
                        "label": line.label,
                        "column": columns.add_line(line.column, line.values),
                        "scale": unit.scale,
                        "colour": line.style.colour,
                        "dash": line.style.dash,
                    }
                    for line in lines
                ],
            }
            for label, lines in sets.items()
        ],
    }


def variable_lines(solution: Solution, variable: str, dimension: str) -> list[Line]:
    """A line for each entry of `dimension` of a variable (time, dimension)."""
    names = [str(name) for name in solution[dimension].values]
    values = solution[variable].values
    return [
        Line(name, f"{variable}.{name}", values[:, i], style)
        for i, (name, style) in enumerate(zip(names, styles(names), strict=True))
    ]


def _motion(solution: Solution, columns: Columns) -> Iterator[Panel]:
    for variable, word, suffix in (("pose", "", ""), ("pose_rate", " rate", "/s")):
        lines = variable_lines(solution, variable, "coordinate")
        lines = [
            Line(line.label + "′" * bool(suffix), line.column, line.values, style)
            for line, style in zip(lines, COMPONENTS * 2, strict=True)
        ]
        for part, what, unit in ((lines[:3], "position", "m"), (lines[3:], "angles", "rad")):
            people = shown(unit)
            yield panel(
                columns,
                "motion",
                f"{variable}-{what}",
                f"Platform {what}{word}",
                Shown(people.unit + suffix, people.scale),
                {"": part},
            )


def _chains(solution: Solution, columns: Columns) -> Iterator[Panel]:
    titles = {
        "joint": ("Joint angle", "Joint travel", ""),
        "joint_rate": ("Joint speed", "Joint speed", "/s"),
        "torque": ("Actuator torque", "Actuator force", ""),
    }
    for variable, (rotary, sliding, suffix) in titles.items():
        kinds = solution["effort_unit" if variable == "torque" else "joint_unit"].values
        lines = variable_lines(solution, variable, "chain")
        limits = drawn_limits(solution, variable)
        for unit in dict.fromkeys(str(kind) for kind in kinds):
            chosen = [i for i, kind in enumerate(kinds) if kind == unit]
            people = shown(unit) if variable == "joint" else Shown(unit + suffix)
            bounds = [] if variable == "joint" else [limits[i] for i in chosen]
            drawn = _distinct(bounds, [lines[i].label for i in chosen], people)
            yield panel(
                columns,
                "chains",
                f"{variable}-{unit}".replace(" ", ""),
                rotary if unit in ("rad", "N m") else sliding,
                people,
                {"": [lines[i] for i in chosen]},
                limits=drawn,
            )


def drawn_limits(solution: Solution, variable: str) -> list[Limits]:
    """Limits of each chain's torque or force, or of its speed, as those of an effort."""
    found = [actuator_limits(chain) for chain in solution.mechanism.chains]
    return found if variable == "torque" else [one.of_speed for one in found]


def _distinct(limits: Sequence[Limits], names: Sequence[str], unit: Shown) -> list[Limit]:
    """Each limit once, with the chains it is for unless it is for all."""
    found = []
    for low, high in dict.fromkeys((one.low, one.high) for one in limits if one.limited):
        pairs = zip(names, limits, strict=True)
        whose = [(name, one) for name, one in pairs if (one.low, one.high) == (low, high)]
        own = [name for name, _ in whose]
        who = "" if len(own) == len(names) else f" ({', '.join(own)})"
        text = whose[0][1].effort_text(unit.unit, unit.scale)
        found.append(Limit(low, high, f"limit {text}{who}", own))
    return found


def _shares(solution: Solution, columns: Columns, every: bool) -> Iterator[Panel]:
    """What platform, couplers, cranks and load need of each effort."""
    parts = [str(part) for part in solution["part"].values]
    used = [p for p, name in enumerate(parts) if every or name in parts_in_use(solution)]
    chains = [str(chain) for chain in solution["chain"].values]
    units = [str(unit) for unit in solution["effort_unit"].values]
    share = solution["share"].values
    look = styles(parts)
    for unit in dict.fromkeys(units):
        mine = [i for i, u in enumerate(units) if u == unit]
        norm = np.linalg.norm(share[:, :, mine], axis=2)
        sets = {
            "all chains (2-norm)": [
                Line(part_word(parts[p]), f"share.{unit}.{parts[p]}", norm[p], look[p])
                for p in used
            ]
        }
        for i in mine:
            sets[chains[i]] = [
                Line(part_word(parts[p]), f"share.{chains[i]}.{parts[p]}", share[p, :, i], look[p])
                for p in used
            ]
        yield panel(
            columns,
            "shares",
            f"share-{unit}".replace(" ", ""),
            "Share of each part in the effort",
            Shown(unit),
            sets,
            note="The parts of one chain add up to its effort; norms over chains do not add up.",
        )


def _contacts(solution: Solution, columns: Columns, every: bool) -> Iterator[Panel]:
    load = [
        Line(line.label, line.column, line.values, style)
        for line, style in zip(
            variable_lines(solution, "load", "component"), COMPONENTS * 2, strict=True
        )
    ]
    if solution.sizes["contact"]:
        yield panel(
            columns,
            "contacts",
            "contact-force",
            "Contact force along the normal",
            Shown("N"),
            {"": variable_lines(solution, "contact_force", "contact")},
            note="Negative: the surface pushes the ball along -n.",
        )
        margins = [
            line
            for line in variable_lines(solution, "bound_margin", "contact")
            if not np.isposinf(line.values).any()
        ]
        if margins:
            yield panel(
                columns,
                "contacts",
                "bound-margin",
                "Distance to the nearest bound",
                shown("m"),
                {"": margins},
                note="Negative: outside the bounds.",
            )
    point = solution.options.get("load_point")
    at = f" at {point}" if point else ""
    for name, lines, unit in (("load", load[:3], "N"), ("moment", load[3:], "N m")):
        if every or any(np.nan_to_num(line.values).any() for line in lines):
            title = f"{'Load' if name == 'load' else 'Moment of the load'}{at}"
            yield panel(columns, "contacts", name, title, Shown(unit), {"": lines})


def _singularity(solution: Solution, columns: Columns) -> Iterator[Panel]:
    one = Shown("")
    yield panel(
        columns,
        "singularity",
        "transmission",
        "Transmission (J_A, dimensionless)",
        one,
        {"": variable_lines(solution, "transmission", "chain")},
        note="1 is best; 0 is an inverse singularity of that chain.",
    )
    sigma = solution["J_W_sigma"].values
    names = [f"σ{i + 1}" for i in range(sigma.shape[1])]
    yield panel(
        columns,
        "singularity",
        "sigma",
        "Singular values of J_W (dimensionless)",
        one,
        {
            "": [
                Line(name, f"J_W_sigma.{i}", sigma[:, i], style)
                for i, (name, style) in enumerate(zip(names, styles(names), strict=True))
            ]
        },
        note="The smallest at 0 is a direct singularity.",
    )
    look = styles(["ratio", "condition"])
    yield panel(
        columns,
        "singularity",
        "ratio",
        "Distance from a singularity",
        one,
        {"": [Line("ratio", "singularity_ratio", solution["singularity_ratio"].values, look[0])]},
        note="Smallest over largest singular value of J_A or J_W; 0 is singular.",
    )
    condition = solution["condition"].values
    condition = np.where(np.isfinite(condition), condition, np.nan)
    yield panel(
        columns,
        "singularity",
        "condition",
        "Condition number of J_W",
        one,
        {"": [Line("condition", "condition", condition, look[1])]},
    )


def reaction_variables(solution: Solution) -> list[str]:
    """Names of the variables that hold reactions of joints, and contact forces as vectors."""
    names = [str(name) for name in solution.data_vars]
    return [
        name
        for name in names
        if (name.startswith("reaction_") or name == "contact_force_vector")
        and solution[name].dims[:1] == ("time",)
    ]


def reaction_magnitudes(solution: Solution, name: str) -> dict[str, dict[str, np.ndarray]]:
    """Magnitudes (N,) of a reaction: group -> label -> values.

    The dimensions between time and the axes label them; of several, the first makes the groups.
    """
    variable = solution[name]
    values, dimensions = variable.values, list(variable.dims[1:])
    if dimensions and dimensions[-1] == "axis":
        values = np.linalg.norm(values, axis=-1)
        dimensions.pop()
    labels = [[str(v) for v in solution[d].values] for d in dimensions]
    if not labels:
        return {"": {name: values}}
    groups = labels[0] if len(labels) > 1 else [""]
    values = values.reshape(len(values), len(groups), -1)
    inner = [""]
    for names in labels[1:] or labels:
        inner = [f"{before} {name}".strip() for before in inner for name in names]
    return {
        group: {label: values[:, g, i] for i, label in enumerate(inner)}
        for g, group in enumerate(groups)
    }


def _reactions(solution: Solution, columns: Columns) -> Iterator[Panel]:
    for name in reaction_variables(solution):
        sets = {}
        for group, lines in reaction_magnitudes(solution, name).items():
            looks = styles(list(lines))
            sets[group] = [
                Line(label, f"{name}.{group}.{label}", values, look)
                for (label, values), look in zip(lines.items(), looks, strict=True)
            ]
        attributes = solution[name].attrs
        title = str(attributes.get("long_name", name.replace("_", " ")))
        yield panel(
            columns,
            "reactions",
            name,
            title[:1].upper() + title[1:],
            Shown(str(attributes.get("units", ""))),
            sets,
            note="Magnitudes.",
        )
