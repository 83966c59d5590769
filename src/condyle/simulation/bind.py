"""A scenario on a mechanism: the plan of a run, with all that does not fit said at once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from ..backends.kernel import AGAIN
from ..errors import InputError, ScenarioError, UnsupportedError
from ..kinematics.chain.muscle import MuscleState, muscles
from ..kinematics.constraints import indices
from ..mechanism import load_mechanism
from ..mechanism.chain import limits
from ..mechanism.coordinates import rotations
from ..mechanism.home import characteristic_length, independent_coordinates, usable_sets
from ..model.distributing import Distribution
from ..model.model import Model, model_with_load_point, model_with_mechanism
from ..motion import Load, Motion, read_table, resolve_load_point
from ..quantities import QUANTITIES
from ..questions.entries import Machine, each
from ..questions.law import Law
from ..questions.load import ActingLoad, LoadTable
from ..questions.load.acting import WRENCH
from ..questions.load.given import Constant
from ..questions.load.penalty import Penalty
from ..questions.observer import KALMAN
from ..questions.tick_limits import TickLimits
from ..status import Status
from .drives import Drives, drive_numbers, motors_of, static_friction, without_rotors
from .integrators import SHORTEST, Settings
from .plan import WORKS, ClosedLoop, FreedContacts, Misses, OpenLoop, Plan, Sensing
from .plant import WIDE
from .reference_path import default_motion, instants, path_of
from .scenario import Observer, Scenario

ABSOLUTE = 1e-3  # of the mechanism's size, radians or joules: what rtol is of, at the least
AXES = 3  # of a force
EXCITATION = "excitation_"  # columns of efforts that are excitations of muscles
SLACK = 1e-9  # of an excitation beyond 0 and 1: rounding
NONE = 1e-14  # m, rad or per s: rounding of home
OVERLAP = 1e-6  # of the mechanism's size: contacts that begin deeper are an error
LANDING_STEP = 1e-11  # seconds: the shortest of a run whose contacts, or drives, give
KEPT = 0.01  # margin of bounds that are kept: of their span, and of the largest rates
PERIOD = 1e-3  # seconds, of a controller in Python where the scenario says none
LoadFunction = Callable[..., Any]
# Without the contacts that lift, by the model that each is of.
FREED: WeakKeyDictionary[Model, Model] = WeakKeyDictionary()


def bind(
    model: Model,
    scenario: Scenario,
    *,
    controller: Callable[..., Any] | None = None,
    loads: Sequence[LoadFunction] = (),
    motion: Motion | None = None,
    stop_at_bounds: bool = False,
    source: str = "scenario",
    shared: dict[Any, Any] | None = None,
) -> Plan:
    """The plan of a scenario.

    Args:   controller: a function in the place of the scenario's law;  loads: functions besides.
            motion: to follow, instead of the controller's.
            shared: paths and models, which plans of one call have in common.
    Raises: ScenarioError: with everything that does not fit the mechanism.
    """
    problems = _Problems()
    with problems:
        model, tables = _placed(model, scenario)
        bound, functions = _loads(model, tables, loads)
    with problems:
        drive = _drive(model, scenario, controller, motion, {} if shared is None else shared)
    start, freed, kind = None, None, scenario.contacts.kind
    driven, plant, static = None, model, np.zeros(0)
    with problems:
        if scenario.drives is not None:
            driven = drive_numbers(model, scenario.drives)
            static = static_friction(model, scenario.drives)
            plant = without_rotors(model, driven, {} if shared is None else shared)
            held = any(c.friction.static_coefficient for c in model.mechanism.contacts)
            if static.any() and (held or kind != "kept"):
                raise InputError(
                    "drives.static_friction: not beside contacts that stick, or lift; remove "
                    "friction.static_coefficient, and [contacts] kind"
                )
    with problems:
        freed = None if kind == "kept" else freed_model(plant, kind)
    with problems:
        start = _start(model, scenario, drive if not problems.lines else None, freed)
    if problems.lines or start is None:
        raise ScenarioError(source, problems.lines)
    q, q1 = start
    own = [limits(chain) for chain in model.mechanism.chains]
    low, high, speed = (np.array([getattr(x, n) for x in own]) for n in ("low", "high", "speed"))
    activation = _activation(model, drive, q, q1)
    drives = None
    if driven is not None:
        motor = _motors(model, driven, drive, q, q1)
        drives = Drives(driven, motor, scenario.drives.encoders, static)  # type: ignore[union-attr]
    plan = Plan(
        plant,
        q,
        q1,
        scenario.duration,
        _times(scenario),
        drive,
        bound,
        tuple(load.begin(_moved(model, q, load)) for load in bound),
        low,
        high,
        speed,
        scenario.method,
        _settings(model, scenario, activation.size, drives),
        stop_at_bounds,
        scenario,
        source,
        activation,
        functions,
        drives,
        tuple(i for i, c in enumerate(plant.mechanism.contacts) if c.friction.static_coefficient),
    )
    if freed is None:
        return plan
    with problems:
        return replace(plan, freed=_freed(plan, freed))
    raise ScenarioError(source, problems.lines)


def _settings(
    model: Model, scenario: Scenario, lags: int, drives: Drives | None = None
) -> Settings:
    length = characteristic_length(model.mechanism)
    scale = np.array([length if n in "XYZ" else 1.0 for n in model.independent])
    rest = np.ones(len(WORKS) + lags + (0 if drives is None else drives.motor.size))
    atol = scenario.rtol * ABSOLUTE * np.concatenate([scale, scale, rest])
    # A light rotor turns round against Coulomb friction, or meets a flank, in far less than 1e-7 s.
    gives = drives is not None and bool(drives.elastic.any())
    return Settings(scenario.rtol, atol, scenario.step, LANDING_STEP if gives else SHORTEST)


def freed_model(model: Model, kind: str) -> Model:
    """The model without the contacts that lift: their coordinates are independent too.

    It is kept as long as the model that it is of, with its kernels.

    Raises: InputError: where there are none, or what is left cannot be simulated.
    """
    machine = model.mechanism
    bilateral = tuple(c for c in machine.contacts if not c.faces)
    if len(bilateral) == len(machine.contacts):
        raise InputError(
            f'contacts.kind: "{kind}" is for unilateral contacts and for clearance, and there are '
            "none: set one_sided = true or clearance at those that may lift"
        )
    stiff = [c.name for c in machine.contacts if c.faces and c.compliance is None]
    if kind == "compliant" and stiff:
        raise InputError(
            f'contacts.kind: with "compliant", contacts that lift need compliance; give it to '
            f"{', '.join(stiff)}"
        )
    if sticking := [c.name for c in machine.contacts if c.friction.static_coefficient]:
        raise InputError(
            f'contacts.kind: with "{kind}", contacts slide by Coulomb\'s law and do not stick; '
            f"remove friction.static_coefficient from {', '.join(sticking)}"
        )
    if rubbing := [c.name for c in bilateral if c.friction.coefficient]:
        raise InputError(
            f'contacts.kind: with "{kind}", bilateral contacts have no friction; remove it from '
            f"{', '.join(rubbing)}, or set one_sided = true or clearance there"
        )
    freedoms = 6 - len(bilateral)
    if len(machine.chains) < freedoms:
        raise InputError(
            f'contacts.kind: "{kind}" frees {freedoms} coordinates, and the {len(machine.chains)} '
            "chains are fewer; cables of no mass and no effort change no motion"
        )
    if model not in FREED:
        bare = machine.model_copy(update={"contacts": bilateral, "dependent": None})
        dependent = next(
            names for names in usable_sets(bare) if {*names} <= {*model.dependent}
        ) if bilateral else None  # fmt: skip
        without = machine.replace(contacts=bilateral, dependent=dependent)
        FREED[model] = model_with_mechanism(model, without, model.distribution.name)
    return FREED[model]


def _freed(plan: Plan, model: Model) -> Plan:
    """A plan in which contacts lift and land."""
    held_model, names = plan.model, model.independent
    q, q1 = _freed_start(plan, model)
    rows = np.array([names.index(name) for name in held_model.independent])
    lifting = FreedContacts(plan, rows)
    settings = _settings(model, plan.scenario, plan.activation.size, plan.drives)
    if lifting.compliant:
        settings = replace(settings, shortest=LANDING_STEP)
    return replace(plan, model=model, q=q, q1=q1, settings=settings, lifting=lifting)


def _freed_start(plan: Plan, model: Model) -> tuple[np.ndarray, np.ndarray]:
    """q and q' of all that is free, (m,) each: with the contacts closed where a coordinate that
    they determine is not given."""
    at = instants(plan.model, plan.q[None], plan.q1[None]).values
    rows = indices(model.independent)
    given = plan.scenario.start.given
    q, q1 = (at[name][rows, 0] for name in ("pose", "pose_rate"))
    for i, name in enumerate(model.independent):
        q[i], q1[i] = given.get(name, q[i]), given.get(f"d{name}", q1[i])
    for state in (q, q1):  # steps begin by its size, and rounding of home is none
        state[np.abs(state) < NONE] = 0.0
    pose = instants(model, q[None], q1[None]).values["pose"][:, 0]
    R = rotations(pose[3:])
    for contact in plan.model.mechanism.contacts:
        if not contact.faces or plan.scenario.contacts.kind == "compliant":
            continue
        gap = contact.gap(pose[:3] + R @ contact.point)
        if gap < -OVERLAP * characteristic_length(model.mechanism):
            raise InputError(
                f'start: contact "{contact.name}" is {-gap * 1e3:.4g} mm beyond its surface; give '
                f"other {' or '.join(sorted({*model.independent} - {*plan.model.independent}))}"
            )
    return q, q1


class _Problems:
    """Collects what does not fit, part by part."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    def __enter__(self) -> None: ...

    def __exit__(self, kind: Any, error: BaseException | None, trace: Any) -> bool:
        if isinstance(error, InputError):
            self.lines += getattr(error, "problems", None) or [str(error)]
            return True
        return False


def _times(scenario: Scenario) -> np.ndarray:
    """Times of the results, (N,) [s]: i / rate, and the end."""
    count = int(np.floor(scenario.duration * scenario.rate + 1e-9)) + 1
    times = np.arange(count) / scenario.rate
    if scenario.duration - times[-1] > 1e-9 / scenario.rate:
        return np.append(times, scenario.duration)
    times[-1] = min(times[-1], scenario.duration)
    return times


def machine_of(model: Model) -> Machine:
    """What tables of a scenario are bound to."""
    points = model.mechanism.platform.points

    def tabled(file: str) -> tuple[np.ndarray, np.ndarray]:
        load = Load.from_csv(file)
        return load.t, load.wrench

    return Machine(
        model.mechanism, model.independent, lambda name: resolve_load_point(name, points), tabled
    )


def _placed(model: Model, scenario: Scenario) -> tuple[Model, list[tuple[LoadTable, int]]]:
    """The model with a platform point wherever a load acts, and a table for each of these points
    with the number of those that share the load; the controller's place first."""
    model, _ = model_with_load_point(model, getattr(scenario.controller, "point", None))
    tables = []
    for load in scenario.loads:
        places = [None] if load.point is None else load.point.split(";")
        for place in places:
            model, name = model_with_load_point(model, place and place.strip())
            tables.append((load.model_copy(update={"point": name}), len(places)))
    return model, tables


def _loads(
    model: Model, tables: Sequence[tuple[LoadTable, int]], functions: Sequence[LoadFunction]
) -> tuple[tuple[ActingLoad, ...], dict[int, LoadFunction]]:
    """Loads, walls after them, and which are functions in Python."""
    names = _names([load.name or load.kind for load, _ in tables])
    machine = machine_of(model)
    loads = [
        load.bind(machine, name).part(count)
        for (load, count), name in zip(tables, names, strict=True)
    ]
    by_function = {}
    for i, given in enumerate(functions):
        function, point = given if isinstance(given, tuple) else (given, None)
        if not callable(function):
            raise InputError(
                "loads: expected functions (t, s, v) -> force, or (function, point), got "
                f"{type(function).__name__}"
            )
        points = model.mechanism.platform.points
        at = np.zeros(3) if point is None else np.array(points[resolve_load_point(point, points)])
        by_function[len(loads)] = function
        none, name = {WRENCH: np.zeros(6)}, f"function_{i + 1}"
        loads.append(ActingLoad(Constant, name, at, point, none))
    walls = [Penalty.of(wall) for wall in model.mechanism.enabled_walls]
    return (*loads, *walls), by_function


def _names(wanted: Sequence[str]) -> list[str]:
    """Each once: food, food_2, food_3."""
    names: list[str] = []
    for name in wanted:
        k, unique = 1, name
        while unique in names:
            k += 1
            unique = f"{name}_{k}"
        names.append(unique)
    return names


def _drive(
    model: Model,
    scenario: Scenario,
    function: Callable[..., Any] | None,
    motion: Motion | None,
    shared: dict[Any, Any],
) -> OpenLoop | ClosedLoop:
    if scenario.closed_loop:
        return _closed(model, scenario, function, motion, shared)
    if function is not None:
        path = path_of(model, motion or default_motion(model), None, None)
        law = Law(None)
        sensing = _sensing(model, scenario, PERIOD, law)
        return ClosedLoop(model, law, path, PERIOD, 0, sensing, function)
    if motion is not None and motion.given:
        raise UnsupportedError(
            f"{motion.source}: nothing follows its columns of {' and '.join(motion.given)} in open "
            "loop; give a controller, or leave the motion out"
        )
    n = len(model.mechanism.chains)
    if scenario.efforts is None:
        return OpenLoop(np.zeros(1), np.zeros((1, n)))
    return _open(model, scenario.efforts.file)


def _open(model: Model, file: str) -> OpenLoop:
    chains = model.mechanism.chains
    efforts_known = QUANTITIES["effort"].dimensions(model.mechanism)
    names, known = [*efforts_known], {"t": ("time", 0)} | efforts_known
    muscle_of = {f"{EXCITATION}{chains[i].name}": i for i in muscles(chains)}
    table = read_table(file, known=known | dict.fromkeys(muscle_of, ("ratio", 0)))
    excited = not muscle_of.keys().isdisjoint(table.columns)
    if excited:
        for name, i in muscle_of.items():
            names[i] = name
    times, efforts = table.times(), table.require(names)
    own = efforts[:, list(muscle_of.values())]
    if excited and (np.abs(own - 0.5) > 0.5 + SLACK).any():
        raise InputError(
            f"{file}: excitations must be from 0 to 1, got {own.min():g} to {own.max():g}; for "
            f"tensions [N] use columns such as tau_{chains[next(iter(muscle_of.values()))].name}"
        )
    return OpenLoop(times, efforts, excited)


def _activation(
    model: Model, drive: OpenLoop | ClosedLoop, q: np.ndarray, q1: np.ndarray
) -> np.ndarray:
    """Activations to begin with, (n,): in open loop as the first commands would hold them, else as
    muscles hold the platform where it starts, without loads."""
    chains = model.mechanism.chains
    if not (driven := muscles(chains)):
        return np.zeros(0)
    if isinstance(drive, OpenLoop):
        effort = np.array([np.interp(0.0, drive.times, one) for one in drive.efforts.T])
    else:
        effort = np.nan_to_num(model.inverse_dynamics(q, q1, 0.0 * q).effort)
    at = instants(model, q[None], q1[None]).values
    state = MuscleState.of(chains, at["joint"].T, at["joint_rate"].T)
    activation = np.zeros(len(chains))
    if isinstance(drive, OpenLoop) and drive.excited:
        activation[driven] = effort[driven]
        return activation
    with np.errstate(divide="ignore", invalid="ignore"):
        wanted = np.nan_to_num((effort - state.passive[0]) / state.active[0])
    activation[driven] = np.clip(wanted, 0.0, 1.0)[driven]
    return activation


def _motors(
    model: Model,
    numbers: np.ndarray,
    drive: OpenLoop | ClosedLoop,
    q: np.ndarray,
    q1: np.ndarray,
) -> np.ndarray:
    """Position and rate of motors, (2, n), whose gears bear to begin with, in open loop, the first
    efforts, else those that hold the platform where it starts, without loads."""
    if isinstance(drive, OpenLoop):
        effort = np.array([np.interp(0.0, drive.times, one) for one in drive.efforts.T])
    else:
        effort = np.nan_to_num(model.inverse_dynamics(q, q1, 0.0 * q).effort)
    at = instants(model, q[None], q1[None]).values
    joint = np.array([at["joint"][:, 0], at["joint_rate"][:, 0]])
    return motors_of(numbers, joint, effort)


def _closed(
    model: Model,
    scenario: Scenario,
    function: Callable[..., Any] | None,
    motion: Motion | None,
    shared: dict[Any, Any],
) -> ClosedLoop:
    table = scenario.controller
    place = getattr(table, "point", None)
    key = table.model or id(model), table.distribution, table.preload, table.contact_weight, place
    if key not in shared:
        shared[key] = model_with_load_point(_own_model(model, table), place)
    own: Model = shared[key][0]
    if place is not None:
        table = table.model_copy(update={"point": shared[key][1]})
    law = table.bind(machine_of(own)) if function is None else Law(None)
    force, file = (getattr(table, name, None) for name in ("force", "force_file"))
    followed = id(own), id(motion), table.motion, table.units, table.landmark, force, file
    if followed not in shared:
        shared[followed] = path_of(own, motion or _motion(table, own), force, file)
    path = shared[followed]
    limits, numbers = (TickLimits(), {}) if function else _tick_limits(own, table)
    if table.ideal:
        return ClosedLoop(own, law, path, None, function=function, limits=limits, numbers=numbers)
    period = 1.0 / table.rate
    sensing = _sensing(own, scenario, period, law)
    timing = scenario.timing
    misses = None if timing is None else Misses(timing.jitter, timing.missed, timing.seed)
    return ClosedLoop(
        own, law, path, period, table.delay, sensing, function, misses, limits, numbers
    )


def _tick_limits(model: Model, table: Any) -> tuple[TickLimits, dict[str, np.ndarray]]:
    """Parts of the tick's last stage that a controller has, and their numbers."""
    machine = model.mechanism
    contacts = machine.contacts
    asked, ports = model.distributor.question(True)
    chooses = bool(asked) and asked[0] == "limited"
    weighs = chooses and asked[2]
    own = ports if chooses else {}
    numbers = {name: x for name, x in own.items() if name not in ("low", "high")}
    if table.contact_force is not None and not weighs:
        raise InputError(
            'controller.contact_force: requires contact_weight, with distribution = "weighted"'
        )
    if weighs:
        wanted = 0.0 if table.contact_force is None else table.contact_force
        names = machine.contact_names
        numbers["contact_wanted"] = each(wanted, names, "controller.contact_force")
    if table.effort_rate is not None:
        numbers["effort_rate"] = each(
            table.effort_rate, machine.chain_names, "controller.effort_rate"
        )
    faces = None
    if table.keep_bounds and model.chooses_efforts and not chooses:
        raise InputError(
            f"controller.keep_bounds: distribution {model.distribution.name} chooses outside "
            "the tick; take minimum_norm, bounded or weighted"
        )
    if table.keep_bounds:
        ends = {
            (i, axis, sign): end - sign * KEPT * (own[1] - own[0])
            for i, contact in enumerate(contacts)
            for axis, own in enumerate(getattr(contact.bounds, name) for name in "xyz")
            if own is not None
            for sign, end in zip((-1, 1), own, strict=True)
        }
        faces = tuple(ends)
        speed = (1 - KEPT) * np.array([limits(chain).speed for chain in machine.chains])
        numbers |= {"speed": np.clip(speed, 0, WIDE), "bound_rate": np.array(table.bound_rate)}
        numbers["bounds"] = np.array(list(ends.values()), dtype=float)
    return TickLimits(chooses, weighs, table.effort_rate is not None, faces), numbers


def _own_model(model: Model, table: Any) -> Model:
    """What the controller computes with."""
    chosen = Distribution(table.distribution, table.preload, table.contact_weight)
    if table.model is None:
        asked = table.distribution is not None or table.preload or table.contact_weight
        return model.with_distribution(chosen) if asked else model
    other = load_mechanism(table.model)
    _same_machine(model, other, table.model)
    return model_with_mechanism(model, other, chosen)


def _same_machine(model: Model, other: Any, file: str) -> None:
    machine = model.mechanism
    if machine.chain_names != other.chain_names:
        raise InputError(
            f"controller.model: {file} has the chains {', '.join(other.chain_names)}, and the "
            f"plant {', '.join(machine.chain_names)}; they must have the same, in the same order"
        )
    if model.independent != (names := independent_coordinates(other)):
        raise InputError(
            f"controller.model: {file} has the independent coordinates {', '.join(names)}, and "
            f"the plant {', '.join(model.independent)}; set `dependent` in one of the files"
        )


def _motion(table: Any, model: Model) -> Motion:
    if table.motion is None:
        return default_motion(model)
    return Motion.from_csv(table.motion, units=table.units, landmark=table.landmark)


def _sensing(model: Model, scenario: Scenario, period: float, law: Law) -> Sensing | None:
    sensors = scenario.sensors
    if sensors is None:
        return None
    every = np.ones(len(model.mechanism.chains))
    kind: str = sensors.velocity
    numbers = {"resolution": sensors.encoder_resolution * every}
    if scenario.observer is None:
        cutoff = sensors.velocity_cutoff
        smoothing = 0.0 if cutoff is None else float(np.exp(-2 * np.pi * cutoff * period))
        numbers["smoothing"] = np.array(smoothing)
    else:
        kind = KALMAN
        counts = np.hypot(sensors.encoder_noise, sensors.encoder_resolution / np.sqrt(12.0))
        numbers |= {"encoder_std": counts * every, **_filter(model, scenario.observer, law)}
    return Sensing(kind, numbers, sensors.encoder_noise, sensors.seed)


def _filter(model: Model, observer: Observer, law: Law) -> dict[str, np.ndarray]:
    """Numbers of the ports of a filter of state and load."""
    names, machine = model.independent, machine_of(model)
    if len(names) < AXES:
        raise InputError(
            f"observer: {len(names)} degrees of freedom do not determine the {AXES} components of "
            "a load; remove it"
        )
    if found := muscles(model.mechanism.chains):
        raise InputError(
            "observer: it takes commands for the efforts, which tensions of muscles follow with a "
            f"lag ({model.mechanism.chain_names[found[0]]}, ...); remove it"
        )
    place, point = machine.point(observer.point or law.place)
    if law.place is not None and place != law.place:
        raise InputError(
            f'observer.point: the controller measures at "{law.place}", not at "{place}"'
        )
    length = characteristic_length(model.mechanism)
    noise = each(observer.acceleration_noise, names, "observer.acceleration_noise")
    if isinstance(observer.acceleration_noise, float):
        noise *= [length if n in "XYZ" else 1.0 for n in names]
    force = np.array(observer.force_noise)
    return {"acceleration_std": noise, "force_std": force, "load_point": point}


def _start(
    model: Model,
    scenario: Scenario,
    drive: OpenLoop | ClosedLoop | None,
    freed: Model | None = None,
) -> tuple[np.ndarray, np.ndarray] | None:
    """q and q' to begin with, (m,) each; None where the path is not known."""
    names = model.independent
    given = scenario.start.given
    free = names if freed is None else freed.independent
    strange = [n for n in given if n.removeprefix("d") not in free]
    if strange:
        raise InputError(
            f"start: {', '.join(strange)} is not free: the independent coordinates are "
            f"{', '.join(free)} (and their rates, {', '.join(f'd{n}' for n in free)})"
        )
    q = np.array([given.get(n, 0.0) for n in names])
    q1 = np.array([given.get(f"d{n}", 0.0) for n in names])
    if scenario.start.on_motion:
        if not isinstance(drive, ClosedLoop):
            return None
        q, q1 = (a[0] for a in drive.path.states(np.zeros(1))[:2])
    if status := instants(model, q[None], q1[None]).status[0]:
        pose = ", ".join(f"{n} = {x:g}" for n, x in zip(names, q, strict=True))
        if status == AGAIN and model.inverse_kinematics(q).status == Status.ok:
            raise InputError(
                f"start: {pose} is beyond what a simulation can close its contacts for, though "
                "inverse dynamics can; begin nearer home"
            )
        raise InputError(f"start: the pose cannot be reached: {pose}")
    return q, q1


def _moved(model: Model, q: np.ndarray, load: ActingLoad) -> np.ndarray:
    """How far the load's point is from home at q, (3,) [m]."""
    at = instants(model, q[None], np.zeros((1, len(q)))).values
    return at["pose"][:3, 0] + at["R"][..., 0] @ load.point - load.point
