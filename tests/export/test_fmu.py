"""FMUs: fmpy finds nothing to warn of, and they compute what condyle does."""

from __future__ import annotations

import shutil
import zipfile
from collections.abc import Callable, Iterator
from functools import cache, partial
from pathlib import Path
from typing import Any

import casadi as ca
import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu
from scipy.integrate import solve_ivp
from support.machines import model as shared_model
from support.tools import need, run

import condyle
from condyle.errors import InputError
from condyle.export import fmu as target
from condyle.export.controller_states import CAUSES
from condyle.export.fmu import exponents

Array = np.ndarray
VERSIONS = (2, 3)
Fmu = Callable[[str, int], Path]
ci = pytest.mark.ci
Q = ("X", "Y", "alpha", "beta")
POINT = np.array([0.02, 0.01, 0.005])
FORCE, MOMENT = np.array([3.0, -2.0, 10.0]), np.array([0.01, 0.02, -0.03])
EXACT = 1e-9  # of the largest entry

pytestmark = pytest.mark.skipif(shutil.which("gcc") is None, reason="no C compiler")


@cache
def model(distribution: str = "minimum_norm") -> condyle.Model:
    return shared_model("masticatory").with_distribution(distribution)


@pytest.fixture(scope="module")
def fmu(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str, int], Path]:
    """The reference mechanism by kind and version, compiled without optimising: quicker."""
    folder, real = tmp_path_factory.mktemp("fmu"), cache(target.fmu_model)

    @cache
    def made(kind: str, version: int) -> Path:
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(target, "FLAGS", tuple(f for f in target.FLAGS if f != "-O2"))
            patch.setattr(
                target, "fmu_model", lambda mechanism, kind, *_: real(model().mechanism, kind)
            )
            path = folder / f"{kind}{version}.fmu"
            assert condyle.export_fmu("masticatory", path, kind=kind, fmi=version).data["binary"]
        assert validate_fmu(str(path)) == []
        names = zipfile.ZipFile(path).namelist()
        assert "sources/fmu.c" in names and any(name.startswith("binaries/") for name in names)
        return path

    return made


def row(name: str, labels: Any, values: Any) -> dict[str, float]:
    return {f"{name}.{label}": float(v) for label, v in zip(labels, values, strict=True)}


STATE = np.array([0.001, 0.0005, 0.01, 0.05]), np.array([0.01, -0.02, 0.1, 0.4])
AHEAD = np.array([0.3, 0.1, 1.0, -2.0])
LOAD = row("force", ("Fx", "Fy", "Fz"), FORCE) | row("moment", ("Mx", "My", "Mz"), MOMENT)
HERE = row("q", Q, STATE[0]) | row("q1", Q, STATE[1]) | row("point", "xyz", POINT)
WRENCH = np.concatenate([FORCE, MOMENT]), POINT


def asked(path: Path, given: dict[str, float], wanted: list[str], how: str, **options: Any) -> Any:
    """Results of the last moment of a short simulation with inputs held."""
    options = {"stop_time": 1e-3, "output_interval": 1e-3} | options
    found = fmpy.simulate_fmu(str(path), start_values=given, output=wanted, fmi_type=how, **options)
    return np.array([found[name][-1] for name in wanted])


def close(got: Any, right: Any, bound: float = EXACT) -> None:
    np.testing.assert_allclose(got, right, rtol=0, atol=bound * np.abs(right).max())


def efforts_of(model: condyle.Model) -> list[str]:
    return [f"effort.{c}" for c in model.mechanism.chain_names]


@pytest.mark.parametrize(
    "kind, version", [("inverse", 2), ("inverse", 3), pytest.param("bounded", 3, marks=ci)]
)
def test_inverse(fmu: Fmu, kind: str, version: int) -> None:
    """Within limits where a load makes them count.

    Masses can be tuned, as in a mechanism that has them. No value is made up: `status` says what is
    wrong.
    """
    path, bounded = fmu(kind, version), kind == "bounded"
    scale, of = (26.0, model("bounded")) if bounded else (1.0, model())
    found = of.inverse_dynamics(*STATE, AHEAD, scale * WRENCH[0], POINT, outputs="all")
    names = [*efforts_of(of), *(f"contact_force.{c}" for c in of.mechanism.contact_names)]
    given = HERE | {name: scale * v for name, v in LOAD.items()} | row("q2", Q, AHEAD)
    for how in ("ModelExchange", "CoSimulation"):
        if how == "CoSimulation" or not bounded:
            got = asked(path, given, names, how)
            close(got, np.concatenate([found.effort, found.contact_force]))
    assert bounded == (np.abs(found.effort).max() > 2.99)
    if bounded:
        return
    tuned = {"platform.mass": 0.3, "platform.inertia.xx": 2e-4}
    cranks = ("masseter_left", "masseter_right")
    changes = tuned | {"gravity[2]": -9.5} | {f"chain.{c}.crank.inertia": 1e-4 for c in cranks}
    changed = condyle.derive(of.mechanism.set(changes), backend="numpy")
    tuned |= {"gravity.z": -9.5} | {f"crank_inertia.{c}": 1e-4 for c in cranks}
    got = asked(path, given | tuned, efforts_of(of), "CoSimulation")
    close(got, changed.inverse_dynamics(*STATE, AHEAD, *WRENCH).effort)
    far = row("q", Q, [0.5, 0, 0, 0])
    with pytest.raises(Exception, match=r"(?i)discard|failed"):
        asked(path, far, names[:1], "ModelExchange")
    assert asked(path, far, ["status"], "ModelExchange") == [1]


@ci
def test_a_controller_and_joints_and_back(fmu: Fmu) -> None:
    """A law's efforts; joints of a state, and the pose that these joints give."""
    gains, damping = np.array([100.0, 200, 300, 400]), np.array([10.0, 20, 30, 40])
    wanted = STATE[0] + 0.001, STATE[1] + 0.02
    q2 = AHEAD + damping * (wanted[1] - STATE[1]) + gains * (wanted[0] - STATE[0])
    given = HERE | LOAD | row("q_d", Q, wanted[0]) | row("q1_d", Q, wanted[1])
    given |= row("q2_d", Q, AHEAD) | row("kp", Q, gains) | row("kd", Q, damping)
    got = asked(fmu("controller", 3), given, efforts_of(model()), "CoSimulation")
    close(got, model().inverse_dynamics(*STATE, q2, *WRENCH).effort)
    chains, found = model().mechanism.chain_names, model().inverse_kinematics(*STATE, 0 * AHEAD)
    state = row("q", Q, STATE[0]) | row("q1", Q, STATE[1])
    got = asked(fmu("joints", 2), state, [f"joint.{c}" for c in chains], "CoSimulation")
    np.testing.assert_allclose(got, found.joint, rtol=0, atol=1e-12)
    poses = [f"pose.{c}" for c in ("X", "Y", "Z", "alpha", "beta", "gamma")]
    back = asked(fmu("pose", 3), row("joint", chains, got), poses, "CoSimulation")
    np.testing.assert_allclose(back, found.pose, rtol=0, atol=1e-10)


def integrated(effort: Array, x: Array, seconds: float, wrench: Any = ()) -> Array:
    """Where scipy brings a state under efforts and a load that are held."""

    def rate(_: float, x: Array) -> Array:
        found = model().forward_dynamics(x[:4], x[4:], effort, *wrench)
        return np.concatenate([x[4:], found.acceleration])

    return solve_ivp(rate, (0, seconds), x, method="DOP853", rtol=1e-11, atol=1e-13).y[:, -1]


@pytest.mark.parametrize("version", VERSIONS)
def test_plant(fmu: Fmu, version: int) -> None:
    """Where it begins the accelerations are forward's; 20 ms later it is where scipy brings it.

    In co-simulation, also under other efforts from half of the time on.
    """
    effort = model().inverse_dynamics(*STATE, AHEAD, *WRENCH).effort
    chains, path = efforts_of(model()), fmu("plant", version)
    given = HERE | LOAD | dict(zip(chains, effort, strict=True))
    names = [f"q.{c}" for c in Q] + [f"q1.{c}" for c in Q]
    start = np.concatenate(STATE)
    at_first = {"solver": "Euler", "stop_time": 1e-15, "output_interval": 1e-15}
    rates = [f"acceleration.{c}" for c in Q]
    close(asked(path, given, rates, "ModelExchange", **at_first), AHEAD)
    right = integrated(effort, start, 0.02, WRENCH)
    assert np.abs(right - start).max() > 1e-3
    exchange = {"solver": "CVode", "relative_tolerance": 1e-10}
    for how, options in (("ModelExchange", exchange), ("CoSimulation", {})):
        got = asked(path, given, names, how, stop_time=0.02, **options)
        np.testing.assert_allclose(got, right, rtol=0, atol=1e-8)
    held = [(0.0, *effort), (0.01, *effort), (0.01, *(0.9 * effort)), (0.02, *(0.9 * effort))]
    columns = np.array(held, dtype=[(name, float) for name in ("time", *chains)])
    options = {"stop_time": 0.02, "output_interval": 0.01, "input": columns}
    got = asked(path, given, names, "CoSimulation", **options)
    middle = integrated(effort, start, 0.01, WRENCH)
    right = integrated(0.9 * effort, middle, 0.01, WRENCH)
    np.testing.assert_allclose(got, right, rtol=0, atol=1e-8)


def quiet(compiler: str, folder: Path) -> None:
    """An extracted unit compiles without a warning."""
    flags = "-std=c99 -pedantic -Wall -Wextra -Wshadow -Werror -fsyntax-only"
    run(compiler, *flags.split(), "sources/fmu.c", folder=folder)


class Unit:
    """A unit in co-simulation, whatever the version."""

    def __init__(self, path: Path, version: int, folder: Path) -> None:
        description = fmpy.read_model_description(str(path))
        self.variables = {v.name: v for v in description.modelVariables}
        two = version == 2
        self.unit = unit = (fmpy.fmi2.FMU2Slave if two else fmpy.fmi3.FMU3Slave)(
            guid=description.guid,
            unzipDirectory=fmpy.extract(str(path), unzipdir=str(folder)),
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName="x",
        )
        unit.instantiate()
        if two:
            unit.setupExperiment(startTime=0.0)
        unit.enterInitializationMode()
        unit.exitInitializationMode()
        state = "FMUstate" if two else "FMUState"
        self.keep, self.back, self.pack, self.unpack = (
            getattr(unit, f"{what}{state}")
            for what in ("get", "set", "serialize", "deSerialize" if two else "deserialize")
        )
        self._get = unit.getReal if two else unit.getFloat64
        self._set = unit.setReal if two else unit.setFloat64

    def step(self, now: float, span: float = 0.01) -> float:
        """Where it is after a step."""
        self.unit.doStep(currentCommunicationPoint=now, communicationStepSize=span)
        return self.read("q.X")

    def read(self, name: str) -> float:
        return self._get([self.variables[name].valueReference])[0]

    def write(self, name: str, value: float) -> None:
        self._set([self.variables[name].valueReference], [value])


LAW = {"kind": "computed_torque", "rate": 1000.0, "stiffness": 900.0, "delay": 1}
LOOP: dict[str, Any] = {
    "duration": 0.03, "rate": 1000.0, "rtol": 1e-12, "start": {"X": 5e-4, "beta": 0.05, "dX": 0.01},
    "controller": LAW, "sensors": {"encoder_resolution": 1e-5}, "observer": {"kind": "kalman"},
}  # fmt: skip


@pytest.fixture(scope="module", params=[pytest.param(2, marks=ci), 3])
def loop(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """The units of a scenario, with a zero of an encoder, and its simulation."""
    folder, machine = tmp_path_factory.mktemp("loop"), condyle.load_mechanism("masticatory")
    machine = machine.set({"chain.masseter_left.actuator.zero": 0.3})
    flags = tuple(f for f in target.FLAGS if f != "-O2")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(target, "FLAGS", flags)
        paths = condyle.export_fmu(
            machine, folder, kind=("plant", "controller"), fmi=request.param, scenario=LOOP
        )
    for path in paths:
        assert validate_fmu(str(path)) == []
    units = [Unit(path, request.param, folder / path.stem) for path in paths]
    quiet("gcc", folder / paths[1].stem)
    yield *units, condyle.simulate(condyle.derive(machine), LOOP)
    for one in units:
        one.unit.freeInstance()


@pytest.mark.parametrize("late", [0, 1])
def test_plant_and_controller_in_a_loop_are_the_simulation(loop: Any, late: int) -> None:
    """By a host that gives efforts to the plant at once, and by one that does so a step later."""
    plant, controller, own = loop
    pairs = [(n, controller, plant) for n in plant.variables if n.startswith("reading.")]
    back = [(n, plant, controller) for n in plant.variables if n.startswith("effort.")]

    def connect(pairs: Any) -> None:
        for name, to, source in pairs:
            to.write(name, source.read(name))

    for one in (plant, controller):
        one.unit.reset()
    plant.write("tolerance", 1e-12)
    controller.write("host_delay", late)
    connect(pairs)
    connect(back)
    right = own["pose"].sel(coordinate=list(Q)).values
    for k, row in enumerate(right[:-1]):
        got = [plant.read(f"q.{c}") for c in Q]
        np.testing.assert_allclose(got, row, rtol=0, atol=1e-12)
        connect(pairs)
        controller.step(1e-3 * k, 1e-3)
        if not late:
            connect(back)
        plant.step(1e-3 * k, 1e-3)
        connect(back)
    assert np.abs(np.diff(right, axis=0)).max() > 1e-4 and controller.read("state") == 3


def test_a_controller_keeps_states_and_says_why_it_stops(
    loop: Any, capfd: pytest.CaptureFixture[str]
) -> None:
    """Under a host that goes back, changes gains, and gives wrong steps, paths and wishes. The
    machine stands still while its path goes on."""
    plant, unit, *_ = loop
    for one in (plant, unit):
        one.unit.reset()
    names = [n for n in unit.variables if n.startswith(("reading.", "effort."))]
    for name in names[: len(names) // 2]:
        unit.write(name, plant.read(name))
    now = 0.0

    def ticks(count: int) -> list[float]:
        nonlocal now
        for _ in range(count):
            unit.step(now, 1e-3)
            now += 1e-3
        return [unit.read(name) for name in names[len(names) // 2 :]]

    ticks(5)
    kept, then = unit.keep(), now
    found = ticks(4)
    unit.back(unit.unpack(unit.pack(kept)))
    now = then
    assert ticks(4) == found
    unit.back(kept)
    now = then
    unit.write("stiffness.beta", 1200.0)
    assert np.abs(np.subtract(ticks(4), found)).max() > 1e-3

    capfd.readouterr()
    for span in (5e-4, 2e-3, 0.0):
        with pytest.raises(Exception, match=r"(?i)error"):
            unit.step(now, span)
        assert "must be one period of the ticks: 0.001 s" in capfd.readouterr().out
    for name, value in (("late", -1.0), ("stiffness.X", np.nan), ("state", 2.0)):
        with pytest.raises(Exception, match=r"(?i)error"):
            unit.write(name, value)
    for name, value in (("follow_path", 0.0), ("q_d.X", 5.0), ("wanted", np.nan)):
        unit.write(name, value)
    ticks(1)
    assert unit.read("state") == 4  # a wish that is no number is one to stop
    unit.unit.reset()
    now = 0.0
    for name in names[: len(names) // 2]:
        unit.write(name, plant.read(name))
    ticks(1)
    unit.write("follow_path", 0.0)
    unit.write("q_d.X", 5.0)
    ticks(1)
    assert unit.read("state") == 2  # of a reference out of reach: it holds
    unit.write("follow_path", 1.0)
    ticks(1)
    assert unit.read("state") == 3
    ticks(30)
    assert unit.read("state") == 2  # after the path
    unit.write("e_stop", 1.0)
    ticks(1)
    assert (unit.read("state"), unit.read("why")) == (4, [*CAUSES].index("E_STOP"))
    assert unit.read("faults") == 2 ** unit.read("why")


@pytest.fixture(params=VERSIONS)
def plant(fmu: Fmu, request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Unit]:
    found = Unit(fmu("plant", request.param), request.param, tmp_path)
    yield found
    found.unit.freeInstance()


def test_what_a_host_does_and_must_not_do(plant: Unit) -> None:
    """A state can be kept in memory and as bytes; a step from it is the same step again.

    Steps at another time, back, or of no number, strange states and outputs that are set are
    refused. Without efforts the jaw falls until a crank is in line; that step is refused, and said
    why; reset is the beginning.
    """
    first = plant.step(0.0)
    state = plant.keep()
    packed = plant.pack(state)
    second = plant.step(0.01)
    plant.back(state)
    assert plant.step(0.01) == second != first
    plant.back(plant.unpack(packed))

    outputs = [v.name for v in plant.variables.values() if v.causality == "output"]
    computed = [name for name in outputs if name.split(".")[0] not in ("q", "q1")]
    masses = ("platform.mass", "platform.inertia.yy", "tolerance")
    wrong = [(name, x) for name in masses for x in (0.0, -0.2, np.nan, np.inf)]
    wrong += [("crank_inertia.masseter_left", -1e-9), ("dq.X", 1.0), ("acceleration.X", 1.0)]
    steps = ((0.0, 0.01), (0.02, 0.01), (0.01, -0.001), (0.01, np.nan), (np.nan, 0.01))
    for call in (
        *(partial(plant.step, *step) for step in steps),
        *(partial(plant.unpack, strange) for strange in (bytes(len(packed)), packed[:-1])),
        *(partial(plant.write, name, 1.0) for name in computed),
        *(partial(plant.write, *one) for one in wrong),
    ):
        with pytest.raises(Exception, match=r"(?i)error"):
            call()
    assert computed and plant.step(0.01, 0.0) == first and plant.step(0.01) == second

    now = 0.02
    with pytest.raises(Exception, match=r"(?i)discard|failed|status"):
        while now < 2:
            plant.step(now)
            now += 0.01
    assert 0.05 < now < 1 and plant.read("status") in (1, 2)
    plant.unit.reset()
    assert plant.read("q.X") == 0.0
    plant.unit.guid = "of another unit"
    with pytest.raises(Exception, match="instantiate"):
        plant.unit.instantiate()


@pytest.mark.parametrize(("kind", "version"), [("plant", 2), ("plant", 3), ("inverse", 3)])
def test_casadi_takes_derivatives(fmu: Fmu, kind: str, version: int, tmp_path: Path) -> None:
    """Its DaeBuilder reads both versions; what the FMU says of slopes is how its values change."""
    fmpy.extract(str(fmu(kind, version)), unzipdir=str(tmp_path))
    dae = ca.DaeBuilder(kind, str(tmp_path))
    names = {name: own for name, own in (("x", dae.x()), ("u", dae.u())) if own}
    outs = ["ode", "y"] if kind == "plant" else ["y"]
    values = HERE | LOAD | row("q2", Q, AHEAD)
    f = dae.create("f", [*names], outs, {"verbose": False})
    at = [ca.DM([values.get(name, 0.01) for name in own]) for own in names.values()]
    pairs = [f"jac:{o}:{i}" for o in outs for i in names]
    J = dae.create("f", [*names], outs).factory("J", [*names], pairs)
    slopes = iter(J.call(at))
    for n, o in enumerate(outs):
        for k, own in enumerate(names):
            exact = np.array(next(slopes))
            found = np.zeros_like(exact)
            for j in range(exact.shape[1]):
                ends = []
                for h in (1e-5, -1e-5):
                    moved = [ca.DM(x) for x in at]
                    moved[k][j] += h
                    ends.append(np.array(f.call(moved)[n]).ravel())
                found[:, j] = (ends[0] - ends[1]) / 2e-5
            scale = np.abs(found).max(axis=1, keepdims=True) + 1e-6
            assert np.abs(exact - found).max() <= 2e-6 * scale.max(), (o, own)
            assert exact.any()


@pytest.mark.parametrize(("compiler", "version"), [("gcc", 2), ("clang", 3)])
def test_compilers_have_nothing_to_say(
    fmu: Fmu, compiler: str, version: int, tmp_path: Path
) -> None:
    need(compiler)
    for kind in ("plant", "inverse"):  # with states and without
        zipfile.ZipFile(fmu(kind, version)).extractall(tmp_path / kind)
        quiet(compiler, tmp_path / kind)


def test_units_are_powers_of_base_units() -> None:
    assert exponents("N m") == {"kg": 1, "m": 2, "s": -2}
    assert exponents("rad/s^2") == {"rad": 1, "s": -2}
    assert exponents("1/s") == {"s": -1} and exponents("1") == {}


def test_the_command(
    condyle_command: Callable[..., Any], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    with pytest.raises(InputError, match="name a folder for the FMUs of 3 kinds"):
        condyle.export_fmu("masticatory", tmp_path / "x.fmu")
    monkeypatch.setattr(target, "_built", lambda sources: None)
    outcome = condyle_command(
        "export", "fmu", "gough-stewart", "--out", "f", "--kind", "plant", "--fmi", "2"
    )
    assert outcome.status == 0 and "no binary" in outcome.err
    (path,) = tmp_path.rglob("*.fmu")
    assert path.name == "gough-stewart-plant.fmu"
    assert not any("binaries" in name for name in zipfile.ZipFile(path).namelist())
