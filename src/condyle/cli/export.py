"""Code and models for other programs."""

from __future__ import annotations

import shlex
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import condyle

from .answer import Answer, command_line, files_line, warn
from .command import command, family
from .options import FOLDER

if TYPE_CHECKING:
    from ..export.written import Written

export = partial(
    command,
    of=family("export", "Code and models for controllers and other programs."),
)


def written(made: Written, then: str = "", text: str = "") -> Answer:
    """What an export says: its notes, its files, and what it knows of them."""
    warn(made.notes)
    return Answer(text or files_line(made), made.data | {"files": list(made)}, then)


@export(
    "export c masticatory --out masticatory-c", "export.c_package:export_c", without="coordinates"
)
def c(
    mechanism: str,
    *,
    out: Annotated[Path, FOLDER],
    from_: str | None = None,
    outputs: str | None = None,
    inputs: str | None = None,
    formulation: str = "virtual_power",
    route: str = "core",
    **given: Any,
) -> Answer:
    """Args:
    from_: Coordinates given to closure, such as X,Y,Z,alpha.
    question: What to export; repeat for more: <names>, or NAME_derivative; contact is with
        contact forces, bounded within limits, observer and state from encoders, kalman with
        the load. Default: inverse, contact, forward, motion, pose, computed_torque, and closure
        with --from or --landmark.
    landmark: Platform point whose path is given to closure.
    """
    given |= {"formulation": formulation, "route": route, "coordinates": from_ or ()}
    made = condyle.export_c(mechanism, out, outputs=outputs or (), inputs=inputs or (), **given)
    known = made.data
    lines = [f'"{known["mechanism"]}" in C: {", ".join(known["functions"])}']
    lines += [f"  {name} is {ours}" for name, ours in known["names"].items()]
    lines += [f"Wrote {', '.join(path.name for path in made)} to {out}"]
    return written(made, f"make -C {shlex.quote(str(out))} check", "\n".join(lines))


@export(
    "export controller masticatory --scenario chew.toml --out controller",
    "export.controller:export_controller",
)
def controller(
    mechanism: str, *, scenario: Path, out: Annotated[Path, FOLDER], **given: Any
) -> Answer:
    made = condyle.export_controller(mechanism, scenario, out, **given)
    return written(made, command_line("simulate", mechanism, scenario=scenario))


@export("export ros2 masticatory --scenario chew.toml --out src/jaw", "export.ros2:export_ros2")
def ros2(mechanism: str, *, scenario: Path, out: Annotated[Path, FOLDER], **given: Any) -> Answer:
    made = condyle.export_ros2(mechanism, scenario, out, **given)
    return written(made, command_line("simulate", mechanism, scenario=scenario))


@export("export fmu masticatory --out fmu", "export.fmu:export_fmu")
def fmu(
    mechanism: str,
    *,
    out: Annotated[Path, FOLDER],
    kind: list[str] | None = None,
    scenario: Path | None = None,
    **given: Any,
) -> Answer:
    """Args:
    kind: Unit to export; repeat for more: <names>. Default: the first three.
    scenario: Scenario (TOML) whose controller, with states and watchdog, is the unit controller,
        and where plant begins, whose contacts lift and land as its [contacts] says. Default:
        computed torque, home, and contacts that are kept.
    """
    given |= {"kind": kind} if kind else {}
    then = "" if scenario is None else command_line("simulate", mechanism, scenario=scenario)
    return written(condyle.export_fmu(mechanism, out, scenario=scenario, **given), then)


@export("export acados masticatory --out acados", "export.acados:export_acados", without="prefix")
def acados(mechanism: str, *, out: Annotated[Path, FOLDER], **given: Any) -> Answer:
    return written(condyle.export_acados(mechanism, out, **given))


@export("export matlab masticatory --out matlab", "export.matlab:export_matlab")
def matlab(mechanism: str, *, out: Annotated[Path, FOLDER]) -> Answer:
    return written(condyle.export_matlab(mechanism, out))


@export("export mjcf masticatory --out mujoco", "export.mjcf:export_mjcf")
def mjcf(mechanism: str, *, out: Annotated[Path, FOLDER]) -> Answer:
    made = condyle.export_mjcf(mechanism, out)
    return written(made, text=f"Wrote {made[0]}")
