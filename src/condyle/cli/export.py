"""Code and models for other programs."""

from __future__ import annotations

import shlex
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import condyle

from .answer import Answer, command_line, files_line, warn
from .command import COMPUTE, command, family

if TYPE_CHECKING:
    from ..export.written import Written

export = partial(
    command,
    COMPUTE,
    of=family("export", COMPUTE, "Code and models for controllers and other programs."),
)


def written(made: Written, then: str, text: str = "") -> Answer:
    """What an export says: its notes, its files, and what it knows of them."""
    warn(made.notes)
    return Answer(text or files_line(made), made.data | {"files": list(made)}, then)


@export(
    "export c masticatory --out masticatory-c", "export.c_package:export_c", without="coordinates"
)
def c(
    mechanism: str,
    *,
    out: Path,
    from_: str | None = None,
    outputs: str | None = None,
    inputs: str | None = None,
    formulation: str = "virtual_power",
    route: str = "core",
    **given: Any,
) -> Answer:
    """C99 source and header for a controller.

    No heap, no globals, no input or output, bounded time. Included: an example, recorded test
    vectors, a Makefile whose `make check` compares with them, and a page of measured facts.

    Args:
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
def controller(mechanism: str, *, scenario: Path, out: Path, **given: Any) -> Answer:
    """The controller of a scenario in C, as it is simulated, ready for a machine.

    A tick from encoders to efforts, and around it: off, homing, hold, run and safe stop, a watchdog
    on late ticks and lost encoders, bumpless changes, and a log. No heap, no input or output.

    Args:
        scenario: Scenario file (TOML) with [controller] and [sensors].
    """
    made = condyle.export_controller(mechanism, scenario, out, **given)
    return written(made, command_line("simulate", mechanism, scenario=scenario))


@export("export ros2 masticatory --scenario chew.toml --out src/jaw", "export.ros2:export_ros2")
def ros2(mechanism: str, *, scenario: Path, out: Path, **given: Any) -> Answer:
    """A package for ros2_control: a scenario's controller, and hardware that simulates the machine.

    The controller is that of `export controller`; the hardware integrates the exported forward
    dynamics, so that the launch file runs without a machine. Built by colcon.

    Args:
        scenario: Scenario file (TOML) with [controller] and [sensors]; its rate is whole Hz.
    """
    made = condyle.export_ros2(mechanism, scenario, out, **given)
    return written(made, command_line("simulate", mechanism, scenario=scenario))


@export("export fmu masticatory --out fmu", "export.fmu:export_fmu")
def fmu(mechanism: str, *, out: Path, **given: Any) -> Answer:
    """Functional mock-up units (FMI 2.0 or 3.0), for model exchange and co-simulation.

    The plant (efforts in, motion out), the inverse model, within limits as `bounded`, and a
    computed-torque controller. They contain their sources, and a binary for this machine if there
    is a C compiler.

    Args:
        kind: Unit to export; repeat for more: <names>. Default: the first three.
    """
    return written(condyle.export_fmu(mechanism, out, **given), command_line("check", mechanism))


@export("export acados masticatory --out acados", "export.acados:export_acados", without="prefix")
def acados(mechanism: str, *, out: Path, **given: Any) -> Answer:
    """Discrete dynamics with exact derivatives for acados, as generic external functions in C."""
    return written(condyle.export_acados(mechanism, out, **given), command_line("check", mechanism))


@export("export matlab masticatory --out matlab")
def matlab(mechanism: str, *, out: Path) -> Answer:
    """Functions for MATLAB and Octave (MEX): C, help texts, build.m and an example."""
    return written(condyle.export_matlab(mechanism, out), command_line("check", mechanism))


@export("export mjcf masticatory --out mujoco")
def mjcf(mechanism: str, *, out: Path) -> Answer:
    """A model for MuJoCo (MJCF): loops, contacts, actuators with limits and losses, sensors.

    Controls are efforts in N m or N, joints are zero at home. Approximations are listed on stderr
    and in the file.
    """
    made = condyle.export_mjcf(mechanism, out)
    return written(made, command_line("check", mechanism), f"Wrote {made[0]}")
