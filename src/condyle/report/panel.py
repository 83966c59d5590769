"""What a panel is: one plot as data, that figures draw by matplotlib and the page by plotly."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial, update_wrapper
from importlib import import_module
from importlib.metadata import entry_points
from inspect import signature
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np

from ..mechanism.actuator import Limits
from ..mechanism.vocabulary import words_of
from ..quantities import variables
from .naming import by_unit

if TYPE_CHECKING:
    import xarray as xr

    from .actuators import Duty

GROUP = "condyle.panels"
NORM = "all chains (2-norm)"  # a set's label


class DisplayUnit(NamedTuple):
    """How people see an SI unit: theirs, and the factor to it."""

    unit: str
    scale: float = 1.0


_PEOPLE = {
    "m": DisplayUnit("mm", 1e3),
    "rad": DisplayUnit("°", 180 / math.pi),
    "m²/rad": DisplayUnit("mm²/rad", 1e6),
    "m²/m": DisplayUnit("mm", 1e3),
    "m²": DisplayUnit("mm²", 1e6),
    "Pa": DisplayUnit("MPa", 1e-6),
    "J/m³": DisplayUnit("kJ/m³", 1e-3),
}


def display_unit(unit: str, order: int = 0) -> DisplayUnit:
    """Millimetres and degrees for people, SI for the rest; also of derivatives over time."""
    found = _PEOPLE.get(unit, DisplayUnit(unit))
    return DisplayUnit(found.unit + ("", "/s", "/s²")[order], found.scale)


TOPS = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0)


@dataclass(frozen=True)
class Series:
    """One curve: a name of the file, its samples (N,) in SI, and the column that holds them.

    across: column and samples (N,) of what it runs over, where that is not time.
    bands: quantiles over variants, (Q, N), from the least.   scale: its own, in place of the
    panel's.   text: what a legend adds.
    """

    label: str
    column: str
    values: np.ndarray
    across: tuple[str, np.ndarray] | None = None
    bands: np.ndarray | None = None
    scale: float | None = None
    text: str = ""


@dataclass(frozen=True)
class Levels:
    """Levels `low` and `high` (SI; infinite: none), in words, and the curves that they hold for."""

    low: float
    high: float
    text: str
    of: tuple[str, ...] = ()

    def label(self, names: Sequence[str]) -> str:
        """'limit ±3 N m', with the curves that have it unless all of `names` do."""
        own = [name for name in names if name in self.of]
        return self.text + ("" if len(own) == len(names) or not own else f" ({', '.join(own)})")


@dataclass(frozen=True)
class Panel:
    """One plot as data.

    axis: what is drawn, in a word;  unit: of the values in SI, of derivative `order` over time.
    sets: curves by the label of their set; several sets are a choice.
    kind: "time": curves over time;  "field": rows of colour, |value| from 0 to `top` and beyond;
          "plane": curves over `across`, with fixed `lines`;  "track": likewise on equal scales.
    place: row and column within its group; None: a row of its own.   components: of a vector.
    lines: fixed ones, (x, y) each.   bounds: intervals across and up, of a track, in SI.
    outside: samples of a track, (N,), that are out of them.
    """

    id: str
    title: str
    axis: str
    unit: str
    sets: Mapping[str, Sequence[Series]] | Sequence[Series]
    kind: str = "time"
    order: int = 0
    place: tuple[str, str] | None = None
    note: str = ""
    limits: Sequence[Levels] = ()
    log: bool = False
    components: bool = False
    across: str = ""
    lines: Sequence[Any] = ()
    bounds: Sequence[tuple[float, float] | None] = (None, None)
    outside: np.ndarray | None = None

    @property
    def display(self) -> DisplayUnit:
        return display_unit(self.unit, self.order)

    @property
    def choices(self) -> Mapping[str, Sequence[Series]]:
        return self.sets if isinstance(self.sets, Mapping) else {"": self.sets}

    @property
    def curves(self) -> list[Series]:
        return [curve for curves in self.choices.values() for curve in curves]

    @property
    def top(self) -> float:
        """Where the colours of a field end: 1, or a round number below it that all values reach
        no further than, so that small ones can be seen too."""
        sizes = [np.abs(c.values) * (c.scale or 1.0) for c in self.curves]
        most = max((float(np.nanmax(s, initial=0.0)) for s in sizes), default=0.0)
        return next((round_one for round_one in TOPS if most <= round_one), 1.0) if most else 1.0


Give = TypeVar("Give", bound=Callable[..., Iterator[Panel]])


@dataclass(frozen=True)
class PanelGroup:
    """Panels that belong together: one figure, or a part of the page's `section`.

    name: of its figure;  heading: of that.   panels: gives them for a solution.
    split: maximum number of chains in one panel; beyond it a figure has a panel a pair; None:
    never.   same: then all of one unit have one scale.   empty: said where there are no panels.
    """

    name: str
    section: str
    heading: str | Callable[[xr.Dataset], str]
    panels: Callable[..., Iterator[Panel]]
    split: int | None = None
    same: bool = False
    empty: str = "this solution has nothing of it"

    def title(self, solution: xr.Dataset) -> str:
        text = self.heading if isinstance(self.heading, str) else self.heading(solution)
        return words_of(solution.condyle.mechanism)(text)

    def of(self, solution: xr.Dataset, *given: Any, **named: Any) -> Iterator[Panel]:
        """The panels, in the words of the solution's machine."""
        say = words_of(solution.condyle.mechanism)
        missing = missing_variables(solution)
        for panel in self.panels(with_blanks(solution, missing), *given, **named):
            if all(curve.column.split(".")[0] in missing for curve in panel.curves):
                continue
            # Of planes and tracks titles are names, and a name stays as it is.
            title = panel.title if panel.kind in ("plane", "track") else say(panel.title)
            note, axis = say(panel.note), say(panel.axis)
            sets = panel.sets
            if isinstance(sets, Mapping):
                sets = {say(label) if label == NORM else label: c for label, c in sets.items()}
            yield replace(panel, title=title, axis=axis, note=note, sets=sets)


# What panels draw of every solution, and a file need not have.
DRAWN = (
    *("pose_rate", "pose_acceleration", "joint_acceleration", "share", "contact_point"),
    *("transmission", "J_A", "J_W_sigma"),
)


def missing_variables(solution: xr.Dataset) -> list[str]:
    """Names of `DRAWN` that a solution lacks, as one of another program may."""
    return [name for name in DRAWN if name not in solution]


def with_blanks(solution: xr.Dataset, missing: Sequence[str]) -> xr.Dataset:
    """The solution with NaN for missing variables, so that those that are there can be drawn."""
    sizes = {"part": 0, "independent": 0} | {str(dim): n for dim, n in solution.sizes.items()}
    blanks = {}
    for name in missing:
        dims = variables()[name].dims
        shape = tuple(sizes.get(dim, 0) for dim in dims)
        blanks[name] = (dims, np.broadcast_to(np.nan, shape))
    labels = {"part": list[str]()} if "part" not in solution.coords else {}
    return solution.assign_coords(labels).assign(blanks) if blanks else solution


PANEL_GROUPS: dict[str, PanelGroup] = {}
listeners: list[Callable[[PanelGroup], Any]] = []


def panels(
    section: str, heading: str | Callable[[xr.Dataset], str], **options: Any
) -> Callable[[Give], Give]:
    """Register a function that gives panels of a solution; see `PanelGroup` for the options."""

    def register(give: Give) -> Give:
        group = PanelGroup(give.__name__, section, heading, give, **options)
        PANEL_GROUPS[group.name] = group
        for listener in listeners:
            listener(group)
        return give

    return register


def known_groups() -> list[PanelGroup]:
    """All that are registered, other packages' last, and those of quantities with a figure."""
    import_module(".panel_list", __package__)
    for point in entry_points(group=GROUP):
        point.load()
    for name, quantity in variables().items():
        if quantity.figure and name not in PANEL_GROUPS:
            give = partial(quantity_panels, name=name)
            update_wrapper(give, quantity_panels).__name__ = name
            panels(quantity.figure, quantity.title)(give)
    return list(PANEL_GROUPS.values())


def quantity_panels(solution: xr.Dataset, name: str, **more: Any) -> Iterator[Panel]:
    """A quantity over time, as its row says: a panel for each unit of its entries.

    Args: more: of `Panel`, in the place of what the row says.
    """
    if name not in solution:
        return
    quantity, dims = variables()[name], [str(dim) for dim in solution[name].dims[1:]]
    curves = [Series(name, name, solution[name].values)]
    if dims:
        curves = of_names(solution, name, dims[0])
    if dims[:1] == ["chain"]:
        efforts, joints = solution["effort_unit"].values, solution["joint_unit"].values
        pairs = zip(efforts, joints, strict=True)
        units = tuple(quantity.unit.format(effort=effort, joint=joint) for effort, joint in pairs)
    else:
        units = quantity.units(solution.condyle.mechanism)
    axis = quantity.symbol or name.replace("_", " ")
    given: dict[str, Any] = {"title": quantity.title, "axis": axis} | more
    groups = by_unit(units if len(units) > 1 else units * len(curves))
    for number, (unit, members) in enumerate(groups.items()):
        own, suffix = [curves[i] for i in members], f"-{number}" * (len(groups) > 1)
        yield Panel(id=f"{name}{suffix}", unit=unit.replace("^2", "²"), sets=own, **given)


def panels_of(
    solution: xr.Dataset, duties: Sequence[Duty] | None = None, every: bool = False
) -> Iterator[tuple[str, Panel]]:
    """Every panel of a solution with its section of the page, in the page's order.

    Args: duties: of every sample, where the solution has fewer.
          every: those too in which there is nothing but zeros, as in one piece of a run.
    """
    given = {"duties": duties, "every": every}
    for group in known_groups():
        takes = given.keys() & signature(group.panels).parameters
        for panel in group.of(solution, **{name: given[name] for name in takes}):
            yield group.section, panel


def of_names(
    solution: xr.Dataset, variable: str, dimension: str, values: np.ndarray | None = None
) -> list[Series]:
    """A curve for each entry of `dimension` of a variable (time, dimension), with its bands."""
    values = solution[variable].values if values is None else values
    name = f"{variable}_quantile"
    bands = np.moveaxis(solution[name].values, -1, 0) if name in solution else None
    return [
        Series(
            str(entry),
            f"{variable}.{entry}",
            values[:, i],
            bands=None if bands is None else bands[i],
        )
        for i, entry in enumerate(solution[dimension].values)
    ]


def distinct(bounds: Sequence[Limits], names: Sequence[str], people: DisplayUnit) -> list[Levels]:
    """Each limit once, with the chains it is for."""
    pairs = {(box.low, box.high): box for box in bounds if box.limited}
    return [
        Levels(
            *pair,
            f"limit {box.effort_text(people.unit, people.scale, 4)}",
            tuple(n for n, b in zip(names, bounds, strict=True) if (b.low, b.high) == pair),
        )
        for pair, box in pairs.items()
    ]
