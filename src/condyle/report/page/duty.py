"""What is asked of the actuators: efforts against speeds, activations, and the joints' loads."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ...mechanism.chain import limits
from ..actuators import EMG_ROW, Duty, activations, edges, emg, joint_loads, limits_text
from ..scene import styles
from ..words import side, stem
from .columns import Columns
from .panels import Line, Panel, panel
from .units import Shown

if TYPE_CHECKING:
    from ...results.solution import Solution

SECTION = "actuators"


def plane_panels(
    solution: Solution, columns: Columns, duties: Sequence[Duty]
) -> list[dict[str, Any]]:
    """Effort against speed: a plot for each chain, left and right together, with its limits."""
    chains = solution.mechanism.chains
    speeds, efforts = solution["joint_rate"].values, solution["torque"].values
    units = [
        (one.unit, f"{u}/s") for one, u in zip(duties, solution["joint_unit"].values, strict=True)
    ]
    keys = [(stem(c.name), unit) for c, unit in zip(chains, units, strict=True)]
    panels = []
    for number, key in enumerate(dict.fromkeys(keys)):
        mine = [i for i, k in enumerate(keys) if k == key]
        boxes = list(dict.fromkeys(limits(chains[i]) for i in mine))
        size = [
            float(np.nanmax(np.abs(values[:, mine]), initial=0.0)) for values in (speeds, efforts)
        ]
        told = [limits_text(box, *key[1]) or "none" for box in boxes]
        name = key[0].replace("_", " ").strip() if len(mine) > 1 else chains[mine[0]].name
        panels.append(
            {
                "id": f"plane-{number}",
                "title": name or ", ".join(chains[i].name for i in mine),
                "units": [key[1][1], key[1][0]],
                "limits": "; ".join(told),
                "edges": [list(edge) for box in boxes for edge in edges(box, *size)],
                "lines": [
                    {
                        "label": (side(chains[i].name) if len(mine) > 1 else "") or chains[i].name,
                        "columns": [
                            columns.add_line(f"joint_rate.{chains[i].name}", speeds[:, i]),
                            columns.add_line(f"torque.{chains[i].name}", efforts[:, i]),
                        ],
                        "colour": n,
                        "dash": "solid" if n == 0 else "dot",
                        "text": duties[i].text,
                    }
                    for n, i in enumerate(mine)
                ],
            }
        )
    return panels


def activation_panels(solution: Solution, columns: Columns) -> Iterator[Panel]:
    """Activations as rows of colour, and under them the loads on the joints."""
    found, loads = activations(solution), joint_loads(solution)
    measured = emg(solution)
    names = [*found, *(name for name in measured if name not in found)]
    if not names:
        return
    numbers = {c.name: i for i, c in enumerate(solution.mechanism.chains)}
    effort = solution["torque"].values
    rows = []
    for name, style in zip(names, styles(names), strict=True):
        if name in found:
            rows.append(Line(name, f"torque.{name}", effort[:, numbers[name]], style))
        if name in measured:
            rows.append(Line(f"{name}{EMG_ROW}", f"emg.{name}", measured[name], style))
    field = panel(
        columns,
        SECTION,
        "activation",
        "Activation",
        Shown(""),
        {"": rows},
        note="Effort over greatest effort; orange: beyond 1, a limit is exceeded."
        + (" EMG: its measured envelope over its greatest." if measured else ""),
    )
    # The page has the efforts already: an activation is |effort| times a scale.
    for line in field["sets"][0]["lines"]:
        if line["label"] in found:
            line["scale"] = 1.0 / limits(solution.mechanism.chains[numbers[line["label"]]]).greatest
    yield field | {"kind": "field", "decimals": 3}
    if loads:
        names = list(loads)
        lines = [
            Line(name, f"joint_load.{name}", values, style)
            for (name, values), style in zip(loads.items(), styles(names), strict=True)
        ]
        yield panel(columns, SECTION, "load-on-joints", "Joint load", Shown("N"), {"": lines},
                    note="Along the normal; negative: the joint would have to pull.")  # fmt: skip
