"""condyle export: code and models for other programs."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from . import completion, options
from .answer import Answer, command_line, files_line
from .command import COMPUTE, command, group
from .inputs import warn

if TYPE_CHECKING:
    from ..export.written import Written

export = group("export", COMPUTE, "Code and models for controllers and other programs.")


def answer(made: Written, then: str, text: str = "") -> Answer:
    """What an export says: its notes, its files, and what it knows of them."""
    warn(made.notes)
    return Answer(text or files_line(made), made.data | {"files": list(made)}, then)


@command(COMPUTE, example="condyle export c masticatory --out masticatory-c", of=export, name="c")
def c(
    mechanism: options.Mechanism,
    out: Path,
    question: list[str] | None = None,
    coordinates: Annotated[str | None, options.option("", "--from")] = None,
    landmark: options.Landmark = None,
    outputs: str | None = None,
    inputs: str | None = None,
    precision: str = "double",
    constants: str = "inside",
    prefix: str | None = None,
    lanes: int = 8,
    formulation: options.Formulation = "virtual_power",
    route: options.Route = "core",
) -> Answer:
    """C99 source and header for a controller.

    No heap, no globals, no input or output, bounded time. Included: an example, recorded test
    vectors, a Makefile whose `make check` compares with them, and a page of measured facts.

    Options:
        coordinates: Coordinates given to closure, such as X,Y,Z,alpha.
        out: Folder for source, header, example and tests.
        question: What to export; repeat for more: inverse, contact (with contact forces), bounded
            (within limits), forward (accelerations), motion, closure, joints, pose, observer and
            state (from encoders), kalman (with the load), NAME_derivative, and controllers:
            computed_torque, impedance, joint_pd, bite_force, hybrid. Default: inverse, contact,
            forward, motion, pose, computed_torque, and closure with --from or --landmark.
        landmark: Platform point whose path is given to closure.
        outputs: bound: inverse, contact, bounded and forward also return the bound of their
            relative error.
        inputs: gravity, base or gravity,base: dynamics take gravity, and the base's acceleration,
            angular velocity and angular acceleration, at every call.
        precision: double, or float for single-precision processors.
        constants: inside: compiled in; struct: in a structure that the program fills at run time.
        prefix: Prefix of all names in C. Default: the mechanism's name.
        lanes: Width of GCC's vector types: 2, 4 or 8 doubles; 0: none.
    """
    import condyle

    made = condyle.export_c(
        mechanism,
        out,
        question=question,
        coordinates=coordinates or (),
        landmark=landmark,
        outputs=outputs or (),
        inputs=inputs or (),
        precision=precision,  # type: ignore[arg-type]
        constants=constants,
        prefix=prefix,
        lanes=lanes,
        formulation=formulation,  # type: ignore[arg-type]
        route=route,  # type: ignore[arg-type]
    )
    known = made.data
    lines = [f'"{known["mechanism"]}" in C: {", ".join(known["functions"])}']
    lines += [f"  {name} is {ours}" for name, ours in known["names"].items()]
    lines += [f"Wrote {', '.join(path.name for path in made)} to {out}"]
    then = f"make -C {shlex.quote(str(out))} check"
    return answer(made, then, "\n".join(lines))


@command(
    COMPUTE,
    example="condyle export controller masticatory --scenario chew.toml --out controller",
    of=export,
    name="controller",
)
def controller(
    mechanism: options.Mechanism,
    scenario: Path,
    out: Path,
    prefix: str | None = None,
) -> Answer:
    """The controller of a scenario in C, as it is simulated, ready for a machine.

    A tick from encoders to efforts, and around it: off, homing, hold, run and safe stop, a watchdog
    on late ticks and lost encoders, bumpless changes, and a log. No heap, no input or output.

    Options:
        scenario: Scenario file (TOML) with [controller] and [sensors].
        out: Folder for source and header, and the path that the scenario follows.
        prefix: Prefix of all names in C. Default: the mechanism's name.
    """
    import condyle

    made = condyle.export_controller(mechanism, scenario, out, prefix=prefix)
    return answer(made, command_line("simulate", mechanism, scenario=scenario))


@command(
    COMPUTE,
    example="condyle export ros2 masticatory --scenario chew.toml --out src/jaw",
    of=export,
    name="ros2",
)
def ros2(
    mechanism: options.Mechanism,
    scenario: Path,
    out: Path,
    package: str | None = None,
    prefix: str | None = None,
    solver: bool = False,
) -> Answer:
    """A package for ros2_control: a scenario's controller, and hardware that simulates the machine.

    The controller is that of `export controller`; the hardware integrates the exported forward
    dynamics, so that the launch file runs without a machine. Built by colcon.

    Options:
        scenario: Scenario file (TOML) with [controller] and [sensors]; its rate is whole Hz.
        out: Folder of the package.
        package: Name of the package. Default: the mechanism's name and _ros2.
        prefix: Prefix of all names in C. Default: the mechanism's name.
        solver: Include a plugin for the package inverse_dynamics_solver.
    """
    import condyle

    made = condyle.export_ros2(
        mechanism, scenario, out, package=package, prefix=prefix, solver=solver
    )
    return answer(made, command_line("simulate", mechanism, scenario=scenario))


@command(COMPUTE, example="condyle export fmu masticatory --out fmu", of=export, name="fmu")
def fmu(
    mechanism: options.Mechanism,
    out: Path,
    kind: list[str] | None = None,
    fmi: int = 3,
) -> Answer:
    """Functional mock-up units (FMI 2.0 or 3.0), for model exchange and co-simulation.

    The plant (efforts in, motion out), the inverse model, within limits as `bounded`, and a
    computed-torque controller. They contain their sources, and a binary for this machine if there
    is a C compiler.

    Options:
        kind: Unit to export; repeat for more: plant, inverse, controller, bounded,
            pose, joints. Default: the
            first three.
        out: Folder for the files.
        fmi: Version of the standard: 2 or 3.
    """
    import condyle

    kinds = kind or completion.FMUS[:3]
    made = condyle.export_fmu(mechanism, out, kind=kinds, fmi=fmi)  # type: ignore[arg-type]
    return answer(made, command_line("check", mechanism))


@command(
    COMPUTE, example="condyle export acados masticatory --out acados", of=export, name="acados"
)
def acados(
    mechanism: options.Mechanism,
    out: Path,
    *,
    step: float = 0.01,
) -> Answer:
    """Discrete dynamics with exact derivatives for acados, as generic external functions in C.

    Options:
        out: Folder for the files.
        step: Of time [s].
    """
    import condyle

    made = condyle.export_acados(mechanism, out, step=step)
    return answer(made, command_line("check", mechanism))


@command(
    COMPUTE, example="condyle export matlab masticatory --out matlab", of=export, name="matlab"
)
def matlab(
    mechanism: options.Mechanism,
    out: Path,
) -> Answer:
    """Functions for MATLAB and Octave (MEX): C, help texts, build.m and an example.

    Options:
        out: Folder for the files.
    """
    import condyle

    made = condyle.export_matlab(mechanism, out)
    return answer(made, command_line("check", mechanism))


@command(COMPUTE, example="condyle export mjcf masticatory --out mujoco", of=export, name="mjcf")
def mjcf(
    mechanism: options.Mechanism,
    out: Path,
) -> Answer:
    """A model for MuJoCo (MJCF): loops, contacts, actuators with limits and losses, sensors.

    Controls are efforts in N m or N, joints are zero at home. Approximations are listed on stderr
    and in the file.

    Options:
        out: Folder for the file.
    """
    import condyle

    made = condyle.export_mjcf(mechanism, out)
    return answer(made, command_line("check", mechanism), f"Wrote {made[0]}")
