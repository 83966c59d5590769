"""Target `ros2`: a package for ros2_control around the C of the target `controller`.

A controller plugin, hardware that simulates the machine by its exported forward dynamics, and on
request a plugin for inverse_dynamics_solver. The texts are in `ros2_package`.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Iterable, Iterator, Mapping
from itertools import chain
from typing import Any

import numpy as np

from ..errors import InputError, UnsupportedError, as_flag, as_name
from ..files.atomic import make_folder
from ..kinematics.chain import FAMILIES
from ..mechanism import Mechanism
from ..model.model import Model
from ..motion.table_writer import write_table
from ..simulation.simulating import ScenarioLike
from ..version import __version__
from .c_context import CODES, WHY
from .c_names import PREFIX_LENGTH
from .c_source import export
from .controller import MEASURED, ControllerSource, controller_source
from .controller_states import CAUSES, STATES
from .exported import Exported
from .syntax import (
    RESERVED,
    c_string,
    file_text,
    filled,
    identifier,
    identifiers,
    literal,
    packaged,
)
from .written import Written, write_texts

SENSOR = "load"  # of forces
INTERFACES = {"joint": "position", "joint_rate": "velocity", "acted": "effort"}  # by measurement
STEP = 1e-4  # [s], of the loop-back, where the scenario's method chooses its own
AT_START = 1e-3  # rad or m: the machine is where the scenario starts
USED = ("std", "rclcpp", "rclcpp_lifecycle", "pluginlib", "std_msgs", "diagnostic_msgs",
        "controller_interface", "hardware_interface", "inverse_dynamics_solver",
        "controller_manager")  # fmt: skip
SOLVER_NEEDS = ("eigen", "inverse_dynamics_solver")
WIDE = 1e6  # stands for no limit in URDF
PLUGINS = {
    "controller": ("Controller", "controller_interface::ControllerInterface",
                   "The controller of a scenario."),
    "loopback": ("Loopback", "hardware_interface::SystemInterface",
                 "The machine, simulated by forward dynamics."),
    "solver": ("Solver", "inverse_dynamics_solver::InverseDynamicsSolver",
               "Inverse dynamics of a parallel mechanism."),
}  # fmt: skip


def export_ros2(
    model: Model | Mechanism | str | os.PathLike[str],
    scenario: ScenarioLike,
    path: str | os.PathLike[str],
    *,
    package: str | None = None,
    prefix: str | None = None,
    solver: bool = False,
) -> Written:
    """Write a scenario's controller as a package for ros2_control, with simulated hardware.

        condyle.export_ros2("masticatory", "chew.toml", "src/jaw", package="jaw")

    The package was compiled against declared headers of ros2_control, and not run under ROS.

    Args:   model: a model, a mechanism, its file, or the name of a bundled one.
            scenario: as of `condyle.export_controller`; its rate is a whole number of Hz.
            path: a folder;  package: name of the package; default: the mechanism's, and `_ros2`.
            prefix: of all names in C; default: the mechanism's name.
            solver: whether a plugin for the package inverse_dynamics_solver is included.
    Returns: the files. Its `notes` say what of the scenario the simulated hardware lacks, and which
             names were changed.
    Raises: InputError, UnsupportedError: as of `condyle.export_controller`, and for a name that is
            none of a package.
    """
    solver = as_flag(solver, "solver")
    source = controller_source(model, scenario, prefix)
    name = _package(source.exported.mechanism.name, package)
    texts = _texts(source, name, solver)
    folder = make_folder(path)
    for part in {os.path.dirname(file) for file in texts}:
        make_folder(folder / part)
    files = write_texts(folder, texts)
    files.append(folder / "config" / "path.csv")
    write_table(files[-1], source.in_time.reference)
    data = {
        "mechanism": source.exported.mechanism.name,
        "package": name,
        "law": source.plan.scenario.controller.kind,
        "period": source.drive.period,
        "plugins": [f"{name}/{PLUGINS[kind][0]}" for kind in _kinds(solver)],
    }
    return Written(files, _notes(source), data)


def _package(mechanism: str, given: str | None) -> str:
    """A valid name of a package. Raises: InputError: for one given that is not."""
    if given is None:
        stem = re.sub("_+", "_", identifier(mechanism).lower()).strip("_") or "x"
        return f"{stem}_ros2"
    as_name(given, "package")
    if not re.fullmatch("[a-z](_?[a-z0-9])+", given) or given in RESERVED or given in USED:
        raise InputError(
            f'package "{given:.60}": expected a name that ROS and C++ take: small letters, digits '
            "and single _, a letter first, at least two, and none of a package that it uses"
        )
    return given


def _kinds(solver: bool) -> list[str]:
    return [kind for kind in PLUGINS if solver or kind != "solver"]


def _joints(e: Exported) -> list[str]:
    """The chains' names as ROS takes them, none that of the sensor or, with `_link`, the base's."""
    return list(identifiers(e.mechanism.chain_names, ("base", SENSOR)).values())


def _measured(source: ControllerSource) -> dict[str, list[str]]:
    """What the controller measures, in turn -> the names of its state interfaces."""
    joints, interfaces = _joints(source.exported), dict[str, list[str]]()
    for name in (a.name for a in source.exported["tick"].inputs if a.name in MEASURED):
        if name == "force":
            interfaces[name] = [f"{SENSOR}/force.{axis}" for axis in "xyz"]
        elif name in INTERFACES:
            interfaces[name] = [f"{joint}/{INTERFACES[name]}" for joint in joints]
        else:
            raise UnsupportedError(f"ros2: the law measures {name}, which no state interface has")
    return interfaces


def _rate(source: ControllerSource) -> int:
    """The rate of the ticks [Hz]."""
    exact = 1 / (source.drive.period or 1.0)
    if abs(round(exact) / exact - 1) > 1e-9:
        raise UnsupportedError(
            f"{source.plan.source}: controller.rate: ros2_control takes whole numbers of Hz, got "
            f"{exact:g}"
        )
    return round(exact)


def _texts(source: ControllerSource, name: str, solver: bool) -> dict[str, str]:
    """All files but the path."""
    e, plan, drive, rate = source.exported, source.plan, source.drive, _rate(source)
    if plan.activation.size:
        raise UnsupportedError(
            f"{plan.source}: the simulated hardware has no activation of muscles; export the "
            "controller alone, by `condyle export controller`"
        )
    if plan.drives is not None:
        raise UnsupportedError(
            f"{plan.source}: the simulated hardware takes drives as rigid; remove [drives], or "
            "export the controller alone, by `condyle export controller`"
        )
    search = plan.scenario.safety.search
    if search is not None and search.until == "index":
        raise UnsupportedError(
            f'{plan.source}: safety.search.until = "index": no state interface has index marks; '
            'take "stop", or export the controller alone, by `condyle export controller`'
        )
    joints, measured = _joints(e), _measured(source)
    steps = max(math.ceil(1 / rate / (plan.settings.step or STEP) - 1e-9), 1)
    plant = _functions(e.recipe, plan.model.mechanism, e.prefix, "plant", "forward", "joints")
    exports = [plant]
    if solver:
        asked = ("state", "joints", "joints_derivative", "inverse")
        smooth = _without_friction(plan.model.mechanism)
        exports.append(_functions(e.recipe, smooth, e.prefix, "solver", *asked))
    pushed = sum(a.size for a in plant["forward"].outputs if a.name == "contact_force")
    names = {"name": e.mechanism.name}
    words: dict[str, object] = {
        "solver_depend": "".join(f"  <depend>{d}</depend>\n" for d in SOLVER_NEEDS) * solver,
        "solver_row": f"| `{name}/Solver` | for the package inverse_dynamics_solver |\n" * solver,
        "package": name,
        "version": __version__,
        "prefix": e.prefix,
        "PREFIX": e.prefix.upper(),
        "law": plan.scenario.controller.kind,
        "rate": rate,
        "delay": drive.delay,
        "step": f"{1 / rate / steps:g}",
        "joint_names": ", ".join(f"`{joint}`" for joint in joints),
        "measured": ", ".join(f"`{names[0]}` and the like" for names in measured.values()),
        "read": "".join(f"    for (auto & one : m.{field}) one = value();\n" for field in measured),
        "sense": "".join(f'    set_state("{to}", 0.0);\n' for to in measured.get("force", ())),
        "pushed": f"    double contact_force[{pushed}];\n" * bool(pushed),
        "contact": ", contact_force" * bool(pushed),
        "joints": "\n".join(_urdf_joints(source)),
        "interfaces": "".join(_INTERFACES.format(joint=joint) for joint in joints),
        "sensor": _SENSOR * ("force" in measured),
        "numbers": "\n".join(_numbers(source, rate, steps, measured)),
    }
    texts = {f"src/{file}": text for file, text in source.texts.items()}
    for one in exports:
        kind = one.prefix.rpartition("_")[2]
        words |= {kind: one.prefix, kind.upper(): one.prefix.upper()}
        texts |= {f"src/{one.prefix}.h": one.header, f"src/{one.prefix}.c": one.source}
    files = {f: f for f in ("package.xml", "CMakeLists.txt", "README.md")}
    files |= {f"src/{kind}.{suffix}": f"{kind}.{suffix}" for kind in _kinds(solver)
              for suffix in ("hpp", "cpp")}  # fmt: skip
    files |= {
        "src/numbers.hpp": "numbers.hpp",
        "config/controllers.yaml": "controllers.yaml",
        f"launch/{name}.launch.py": "launch.in",
        f"urdf/{name}.urdf": "robot.urdf",
    }
    build = filled(packaged("ros2_package/solver.cmake"), words) if solver else ""
    words["solver_build"] = build
    for to, template in files.items():
        texts[to] = file_text(to, f"ros2_package/{template}", words, names)
    for kind in _kinds(solver):
        shown = dict(zip(("class", "base", "text"), PLUGINS[kind], strict=True)) | {"kind": kind}
        file = f"{kind}_plugin.xml"
        texts[file] = file_text(file, "ros2_package/plugin.xml", words | shown, {})
    return texts


def _functions(
    recipe: Mapping[str, Any], mechanism: Mechanism, prefix: str, kind: str, *questions: str
) -> Exported:
    """C of a mechanism; names begin with the prefix and the kind."""
    start = f"{prefix[: PREFIX_LENGTH - 1 - len(kind)]}_{kind}"
    return export(mechanism, questions, **recipe, prefix=start, lanes=0)


def _without_friction(mechanism: Mechanism) -> Mechanism:
    """The mechanism with frictionless actuators."""
    still = {"viscous": 0.0, "coulomb": 0.0}
    chains = tuple(
        one.model_copy(update={"actuator": one.actuator.model_copy(update=still)})
        for one in mechanism.chains
    )
    return mechanism.model_copy(update={"chains": chains})


def _numbers(
    source: ControllerSource, rate: int, steps: int, measured: dict[str, list[str]]
) -> list[str]:
    """What the plugins know of the machine and the scenario, in C++."""
    plan, machine = source.plan, source.plan.model.mechanism
    joints, columns = _joints(source.exported), list(source.reference)
    read = [*chain.from_iterable(measured.values())]
    start = plan.model.inverse_kinematics(plan.q).joint + np.array(machine.zeros)
    actuators = [leg.actuator for leg in machine.chains]
    arrays = {"LOW": plan.low, "HIGH": plan.high, "ZERO": machine.zeros, "START": start}
    for loss in ("viscous", "coulomb", "smoothing_speed"):
        arrays[loss.upper()] = [getattr(actuator, loss) for actuator in actuators]
    log = ["t", *(f"{of}_{label}" for of in ("joint", "tau") for label in machine.chain_names)]
    words = {
        "STATES": [name.lower().replace("_", " ") for name in STATES],
        "CAUSES": [cause.text for cause in CAUSES.values()],
        "STATUSES": [WHY[name] if int(code) else "ok" for name, code in CODES.items()],
    }
    return [
        f"constexpr std::size_t N = {len(joints)}, M = {len(plan.q)};  // joints, freedoms",
        f"constexpr unsigned RATE = {rate};  // of ticks [Hz]",
        f"constexpr int DELAY = {source.drive.delay}, STEPS = {steps};  // [ticks], a tick",
        f"constexpr double START_TOLERANCE = {AT_START};  // rad or m",
        f"constexpr const char * JOINTS[] = {{{_quoted(joints)}}};",
        f"constexpr const char * MEASURED[] = {{{_quoted(read)}}};",
        f"constexpr const char * COLUMNS = {_quoted([','.join(columns)])};",
        f"constexpr const char * LOG_COLUMNS = {_quoted([','.join(log)])};",
        *(f"constexpr std::array<double, N> {name} = {{{_row(a)}}};" for name, a in arrays.items()),
        *(f"constexpr std::array<double, M> {name} = {{{_row(a)}}};"
          for name, a in (("Q", plan.q), ("Q1", plan.q1))),
        "// By the numbers of the enumerations in C.",
        *(f"constexpr std::array<const char *, {len(texts)}> {name} = {{{_quoted(texts)}}};"
          for name, texts in words.items()),
    ]  # fmt: skip


def _quoted(names: list[str]) -> str:
    return ", ".join(f'"{c_string(name)}"' for name in names)


def _row(values: Iterable[float]) -> str:
    return ", ".join(literal(float(x), "double") for x in values)


def _urdf_joints(source: ControllerSource) -> Iterator[str]:
    """Links and joints: where each chain begins, turning or sliding as its actuator drives it."""
    plan, chains = source.plan, source.plan.model.mechanism.chains
    for i, (name, leg) in enumerate(zip(_joints(source.exported), chains, strict=True)):
        axis = getattr(leg, "axis", None)
        turns = FAMILIES[leg.kind].joint_unit == "rad"
        direction = np.array(leg.platform) - leg.base if axis is None else np.array(axis)
        limits = {"effort": max(abs(plan.low[i]), abs(plan.high[i])), "velocity": plan.speed[i]}
        limits = {key: x if math.isfinite(x) else WIDE for key, x in limits.items()}
        limits |= {} if turns else {"lower": -WIDE, "upper": WIDE}
        yield _JOINT.format(
            joint=name,
            type="continuous" if turns else "prismatic",
            origin=" ".join(f"{x:.9g}" for x in leg.base),
            axis=" ".join(f"{x:.9g}" for x in direction / np.linalg.norm(direction)),
            limits=" ".join(f'{key}="{x:.9g}"' for key, x in limits.items()),
        )


def _notes(source: ControllerSource) -> list[str]:
    """What the simulated hardware lacks, and names that were changed."""
    chains, lacks = source.exported.mechanism.chain_names, source.lacks
    found = [f"the simulated hardware leaves out: {', '.join(lacks)}"] if lacks else []
    pairs = zip(chains, _joints(source.exported), strict=True)
    changed = [f"{name} is {joint}" for name, joint in pairs if joint != name]
    return found + ([f"names of joints: {', '.join(changed)}"] if changed else [])


_JOINT = """\
  <link name="{joint}_link"/>
  <joint name="{joint}" type="{type}">
    <parent link="base_link"/>
    <child link="{joint}_link"/>
    <origin xyz="{origin}"/>
    <axis xyz="{axis}"/>
    <limit {limits}/>
  </joint>"""
# The controller keeps the limits; nothing cuts its efforts again.
_INTERFACES = """\
    <joint name="{joint}">
      <limits enable="false"/>
      <command_interface name="effort"/>
      <state_interface name="position"/>
      <state_interface name="velocity"/>
      <state_interface name="effort"/>
    </joint>
"""
_SENSOR = f"""\
    <sensor name="{SENSOR}">
      <state_interface name="force.x"/>
      <state_interface name="force.y"/>
      <state_interface name="force.z"/>
    </sensor>
"""
