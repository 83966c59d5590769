"""FMUs: fmpy finds nothing to warn of, and they compute what condyle does."""

from __future__ import annotations

import shutil
import zipfile
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import casadi as ca
import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu
from scipy.integrate import solve_ivp
from support.loads import parts
from support.tools import need, run

import condyle
from condyle.errors import InputError
from condyle.export import fmu as target
from condyle.export.fmu import exponents

Array = np.ndarray
KINDS, VERSIONS = ("plant", "inverse", "controller", "bounded", "pose", "joints"), (2, 3)
Q = ("X", "Y", "alpha", "beta")
POINT = np.array([0.02, 0.01, 0.005])
FORCE, MOMENT = np.array([3.0, -2.0, 10.0]), np.array([0.01, 0.02, -0.03])
EXACT = 1e-9  # of the largest entry

pytestmark = pytest.mark.skipif(shutil.which("gcc") is None, reason="no C compiler")


@pytest.fixture(scope="module")
def fmus(tmp_path_factory: pytest.TempPathFactory) -> dict[tuple[str, int], Path]:
    """Every kind and version of the reference mechanism, compiled without optimising: quicker."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(target, "FLAGS", tuple(f for f in target.FLAGS if f != "-O2"))
        models = {
            kind: target.fmu_model(condyle.load_mechanism("masticatory"), kind) for kind in KINDS
        }
        patch.setattr(target, "fmu_model", lambda mechanism, kind: models[kind])
        folder, made = tmp_path_factory.mktemp("fmu"), {}
        for kind in KINDS:
            for version in VERSIONS:
                made[kind, version] = path = folder / f"{kind}{version}.fmu"
                assert condyle.export_fmu("masticatory", path, kind=kind, fmi=version).data[
                    "binary"
                ]
    return made


@pytest.fixture(scope="module")
def model() -> condyle.Model:
    return condyle.derive("masticatory", backend="numpy")


def row(name: str, labels: Any, values: Any) -> dict[str, float]:
    return {f"{name}.{label}": float(v) for label, v in zip(labels, values, strict=True)}


STATE = np.array([0.001, 0.0005, 0.01, 0.05]), np.array([0.01, -0.02, 0.1, 0.4])
AHEAD = np.array([0.3, 0.1, 1.0, -2.0])
LOAD = row("force", ("Fx", "Fy", "Fz"), FORCE) | row("moment", ("Mx", "My", "Mz"), MOMENT)
HERE = row("q", Q, STATE[0]) | row("q1", Q, STATE[1]) | row("point", "xyz", POINT)
ROW = np.concatenate([FORCE, MOMENT, POINT])[None]


def asked(path: Path, given: dict[str, float], wanted: list[str], how: str, **options: Any) -> Any:
    """Results of the last moment of a short simulation with inputs held."""
    options = {"stop_time": 1e-3, "output_interval": 1e-3} | options
    found = fmpy.simulate_fmu(str(path), start_values=given, output=wanted, fmi_type=how, **options)
    return np.array([found[name][-1] for name in wanted])


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("kind", KINDS)
def test_fmpy_has_nothing_to_say(
    fmus: dict[tuple[str, int], Path], kind: str, version: int
) -> None:
    path = fmus[kind, version]
    assert validate_fmu(str(path)) == []
    names = zipfile.ZipFile(path).namelist()
    assert "sources/fmu.c" in names and any(name.startswith("binaries/") for name in names)


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize(
    "kind, how",
    [("inverse", "ModelExchange"), ("inverse", "CoSimulation"), ("bounded", "CoSimulation")],
)
def test_inverse(
    fmus: dict[tuple[str, int], Path], model: condyle.Model, version: int, kind: str, how: str
) -> None:
    """Within limits where a load makes them count."""
    scale = 26.0 if kind == "bounded" else 1.0
    if kind == "bounded":
        model = condyle.derive(model.mechanism, backend="numpy", distribution="bounded")
    load = ROW * np.repeat([scale, 1.0], [6, 3])
    found = model.inverse_dynamics(
        STATE[0][None], STATE[1][None], AHEAD[None], *parts(load), outputs="all"
    )
    chains, contacts = model.mechanism.chain_names, model.mechanism.contact_names
    names = [f"effort.{c}" for c in chains] + [f"contact_force.{c}" for c in contacts]
    given = HERE | {name: scale * v for name, v in LOAD.items()} | row("q2", Q, AHEAD)
    got = asked(fmus[kind, version], given, names, how)
    right = np.concatenate([found.effort[0], found.contact_force[0]])
    np.testing.assert_allclose(got, right, rtol=0, atol=EXACT * np.abs(right).max())
    assert (kind == "bounded") == (np.abs(right[: len(chains)]).max() > 2.99)


@pytest.mark.parametrize("version", VERSIONS)
def test_controller(fmus: dict[tuple[str, int], Path], model: condyle.Model, version: int) -> None:
    gains, damping = np.array([100.0, 200, 300, 400]), np.array([10.0, 20, 30, 40])
    wanted = STATE[0] + 0.001, STATE[1] + 0.02
    q2 = AHEAD + damping * (wanted[1] - STATE[1]) + gains * (wanted[0] - STATE[0])
    right = model.inverse_dynamics(STATE[0][None], STATE[1][None], q2[None], *parts(ROW)).effort[0]
    given = HERE | LOAD | row("q_d", Q, wanted[0]) | row("q1_d", Q, wanted[1])
    given |= row("q2_d", Q, AHEAD) | row("kp", Q, gains) | row("kd", Q, damping)
    names = [f"effort.{c}" for c in model.mechanism.chain_names]
    got = asked(fmus["controller", version], given, names, "CoSimulation")
    np.testing.assert_allclose(got, right, rtol=0, atol=EXACT * np.abs(right).max())


def falling(model: condyle.Model, efforts: Array) -> Callable[[float, Array], Array]:
    """Rates of the state under efforts and the load, held."""

    def rate(_: float, x: Array) -> Array:
        found = model.forward_dynamics(x[None, :4], x[None, 4:], efforts[None], *parts(ROW))
        return np.concatenate([x[4:], found.acceleration[0]])

    return rate


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("how", ["ModelExchange", "CoSimulation"])
def test_plant(
    fmus: dict[tuple[str, int], Path], model: condyle.Model, version: int, how: str
) -> None:
    """Where it begins the accelerations are forward's; 20 ms later it is where scipy brings it."""
    chains = model.mechanism.chain_names
    efforts = model.inverse_dynamics(
        STATE[0][None], STATE[1][None], AHEAD[None], *parts(ROW)
    ).effort[0]
    given = HERE | LOAD | row("effort", chains, efforts)
    names = [f"q.{c}" for c in Q] + [f"q1.{c}" for c in Q]
    start = np.concatenate(STATE)
    if how == "ModelExchange":
        options = {"solver": "CVode", "relative_tolerance": 1e-10}
        at_first = partial(asked, fmus["plant", version], given, how=how, solver="Euler")
        rates = at_first([f"acceleration.{c}" for c in Q], stop_time=1e-15, output_interval=1e-15)
        np.testing.assert_allclose(rates, AHEAD, rtol=0, atol=EXACT * np.abs(AHEAD).max())
    else:
        options = {}
    right = solve_ivp(
        falling(model, efforts), (0, 0.02), start, method="DOP853", rtol=1e-11, atol=1e-13
    ).y[:, -1]
    got = asked(fmus["plant", version], given, names, how, stop_time=0.02, **options)
    assert np.abs(right - start).max() > 1e-3
    np.testing.assert_allclose(got, right, rtol=0, atol=1e-8)


def test_a_simulated_chew(fmus: dict[tuple[str, int], Path], model: condyle.Model) -> None:
    """The plant under the efforts of a chew, each held for 1 ms, as scipy integrates the same."""
    motion = condyle.reference_motion()
    states = model.poses.of_motion(motion)[0]
    solution = model.solve(motion)
    first, count = 1400, 30
    t, effort = solution["time"].values[first:], solution["effort"].values[first:]
    x = np.concatenate([states[0][first], states[1][first]])
    given = row("q", Q, x[:4]) | row("q1", Q, x[4:])
    chains = model.mechanism.chain_names
    columns = [("time", float)] + [(f"effort.{c}", float) for c in chains]
    signal = np.array([(t[i], *effort[i]) for i in range(count + 1)], dtype=columns)
    found = fmpy.simulate_fmu(
        str(fmus["plant", 3]),
        fmi_type="CoSimulation",
        start_time=t[0],
        stop_time=t[count],
        output_interval=t[1] - t[0],
        input=signal,
        start_values=given,
        output=[f"q.{c}" for c in Q],
    )
    free = np.zeros((1, 9))
    for i in range(count):

        def rate(_: float, x: Array, tau: Array = effort[i]) -> Array:
            ahead = model.forward_dynamics(
                x[None, :4], x[None, 4:], tau[None], *parts(free)
            ).acceleration[0]
            return np.concatenate([x[4:], ahead])

        x = solve_ivp(rate, (t[i], t[i + 1]), x, method="RK45", rtol=1e-10, atol=1e-12).y[:, -1]
    got = np.array([found[f"q.{c}"][-1] for c in Q])
    np.testing.assert_allclose(got, x[:4], rtol=0, atol=1e-8)
    assert np.abs(x[:4] - states[0][first]).max() > 1e-3


@pytest.mark.parametrize("version", VERSIONS)
def test_masses_can_be_tuned(fmus: dict[tuple[str, int], Path], version: int) -> None:
    """As in a mechanism that has them."""
    heavier = {"platform.mass": 0.3, "platform.inertia.xx": 2e-4, "gravity[2]": -3.0}
    heavier |= {f"chain.{c}.crank.inertia": 1e-4 for c in ("masseter_left", "masseter_right")}
    changed = condyle.load_mechanism("masticatory").set(heavier)
    states = (a[None] for a in (*STATE, AHEAD))
    right = (
        condyle.derive(changed, backend="numpy").inverse_dynamics(*states, *parts(ROW)).effort[0]
    )
    given = HERE | LOAD | row("q2", Q, AHEAD)
    given |= {"platform.mass": 0.3, "platform.inertia.xx": 2e-4, "gravity.z": -3.0}
    given |= {f"crank_inertia.{c}": 1e-4 for c in ("masseter_left", "masseter_right")}
    names = [f"effort.{c}" for c in changed.chain_names]
    got = asked(fmus["inverse", version], given, names, "CoSimulation")
    np.testing.assert_allclose(got, right, rtol=0, atol=EXACT * np.abs(right).max())


@pytest.mark.parametrize("version", VERSIONS)
def test_what_cannot_be_reached_is_said(fmus: dict[tuple[str, int], Path], version: int) -> None:
    """No value is made up: reading it is refused, and `status` says why."""
    far = row("q", Q, [0.5, 0, 0, 0])
    with pytest.raises(Exception, match=r"(?i)discard|failed"):
        asked(fmus["inverse", version], far, ["effort.masseter_left"], "ModelExchange")
    assert asked(fmus["inverse", version], far, ["status"], "ModelExchange") == [1]


class Unit:
    """A plant in co-simulation, whatever the version."""

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


@pytest.fixture(params=VERSIONS)
def plant(
    fmus: dict[tuple[str, int], Path], request: pytest.FixtureRequest, tmp_path: Path
) -> Iterator[Unit]:
    found = Unit(fmus["plant", request.param], request.param, tmp_path)
    yield found
    found.unit.freeInstance()


def test_a_state_can_be_kept_and_brought_back(plant: Unit) -> None:
    """In memory and as bytes; a step from it is the same step again, and reset is the beginning."""
    first = plant.step(0.0)
    state = plant.keep()
    packed = plant.pack(state)
    second = plant.step(0.01)
    plant.back(state)
    assert plant.step(0.01) == second != first
    plant.back(plant.unpack(packed))
    assert plant.step(0.01) == second
    plant.unit.reset()
    assert plant.read("q.X") == 0.0


def test_what_a_host_must_not_do_is_refused(plant: Unit) -> None:
    """Steps at another time, back, or of no number; strange states; outputs that are set."""
    before = plant.step(0.0)
    packed = plant.pack(plant.keep())
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
    assert computed and plant.step(0.01, 0.0) == before


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("kind", ["plant", "inverse", "controller"])
def test_casadi_takes_derivatives(
    fmus: dict[tuple[str, int], Path], kind: str, version: int, tmp_path: Path
) -> None:
    """Its DaeBuilder reads both versions; what the FMU says of slopes is how its values change."""
    fmpy.extract(str(fmus[kind, version]), unzipdir=str(tmp_path))
    dae = ca.DaeBuilder(kind, str(tmp_path))
    names = {"x": dae.x(), "u": dae.u()}
    ins = [name for name, own in names.items() if own]
    outs = ["ode", "y"] if kind == "plant" else ["y"]
    values = HERE | LOAD | row("q2", Q, AHEAD) | row("q_d", Q, STATE[0] + 0.002)
    f = dae.create("f", ins, outs, {"verbose": False})
    at = [ca.DM([values.get(name, 0.01) for name in names[i]]) for i in ins]
    J = dae.create("f", ins, outs).factory("J", ins, [f"jac:{o}:{i}" for o in outs for i in ins])
    slopes = [np.array(found) for found in J.call(at)]
    for n, o in enumerate(outs):
        for k in range(len(ins)):
            exact = slopes[n * len(ins) + k]
            found = np.zeros_like(exact)
            for j in range(exact.shape[1]):
                ends = []
                for h in (1e-5, -1e-5):
                    moved = [ca.DM(x) for x in at]
                    moved[k][j] += h
                    ends.append(np.array(f.call(moved)[n]).ravel())
                found[:, j] = (ends[0] - ends[1]) / 2e-5
            scale = np.abs(found).max(axis=1, keepdims=True) + 1e-6
            assert np.abs(exact - found).max() <= 2e-6 * scale.max(), (o, ins[k])
            assert exact.any()


def test_a_plant_stops_where_it_cannot_go_on(plant: Unit) -> None:
    """Without efforts the jaw falls until a crank is in line; the step is refused, and said why."""
    now = 0.0
    with pytest.raises(Exception, match=r"(?i)discard|failed|status"):
        while now < 2:
            plant.step(now)
            now += 0.01
    assert 0.05 < now < 1 and plant.read("status") in (1, 2)


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("compiler", ["gcc", "clang"])
def test_compilers_have_nothing_to_say(
    fmus: dict[tuple[str, int], Path], compiler: str, version: int, tmp_path: Path
) -> None:
    need(compiler)
    for kind in ("plant", "inverse"):  # with states and without
        zipfile.ZipFile(fmus[kind, version]).extractall(tmp_path / kind)
        flags = "-std=c99 -pedantic -Wall -Wextra -Wshadow -Werror -fsyntax-only"
        run(compiler, *flags.split(), "sources/fmu.c", folder=tmp_path / kind)


def test_units_are_powers_of_base_units() -> None:
    assert exponents("N m") == {"kg": 1, "m": 2, "s": -2}
    assert exponents("rad/s^2") == {"rad": 1, "s": -2}
    assert exponents("1/s") == {"s": -1} and exponents("1") == {}


def test_wrong_wishes(tmp_path: Path) -> None:
    for options, said in (
        ({"kind": "plants"}, "Did you mean"),
        ({"kind": "plant", "fmi": 1}, "fmi: expected 2 or 3, got 1"),
        ({}, "name a folder for the FMUs of 3 kinds"),
    ):
        with pytest.raises(InputError, match=said):
            condyle.export_fmu("masticatory", tmp_path / "x.fmu", **options)
    assert not list(tmp_path.iterdir())


def test_the_command(
    condyle_command: Callable[..., Any], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(target, "_built", lambda sources: None)
    outcome = condyle_command(
        "export", "fmu", "gough-stewart", "--out", "f", "--kind", "plant", "--fmi", "2"
    )
    assert outcome.status == 0 and "no binary" in outcome.err
    (path,) = (tmp_path / "f").iterdir()
    assert path.name == "gough-stewart-plant.fmu"
    assert not any("binaries" in name for name in zipfile.ZipFile(path).namelist())


@pytest.mark.parametrize("version", VERSIONS)
def test_joints_and_back(
    fmus: dict[tuple[str, int], Path], model: condyle.Model, version: int
) -> None:
    """Joints of a state, and the pose that these joints give."""
    chains = model.mechanism.chain_names
    found = model.inverse_kinematics(STATE[0][None], STATE[1][None], 0 * AHEAD[None])
    joints = [f"joint.{c}" for c in chains]
    state = row("q", Q, STATE[0]) | row("q1", Q, STATE[1])
    got = asked(fmus["joints", version], state, joints, "CoSimulation")
    np.testing.assert_allclose(got, found.joint[0], rtol=0, atol=1e-12)
    poses = [f"pose.{c}" for c in ("X", "Y", "Z", "alpha", "beta", "gamma")]
    back = asked(fmus["pose", version], row("joint", chains, got), poses, "CoSimulation")
    np.testing.assert_allclose(back, found.pose[0], rtol=0, atol=1e-10)
