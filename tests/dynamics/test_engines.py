"""Pinocchio, MuJoCo, plain Newton-Euler and sixty digits on randomly perturbed mechanisms."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from oracles import newton_euler
from oracles.digits import Machine
from oracles.random_mechanism import off_centre, random_mechanism
from support.families import MECHANISMS, MIXED, Case, close, of_raw
from support.loads import parts
from support.speeds import few

import condyle
from condyle.errors import CondyleError
from condyle.mechanism.files import parse

TOLERANCE = 1e-9
Engine = Callable[..., dict[str, Any]]
# tests/kinematics/chain holds cables, which have no bodies.
CASES: list[dict[str, Any]] = [
    *({"contacts": k, "chains": n} for k, n in ((0, 8), (2, 4), (2, 12), (5, 1))),
    {"families": ("PSS",), "contacts": 0, "rod_along_x": True},
    *(MECHANISMS[name] for name in ("rss_k3_n7", "pss_k1", "sps_k2_n7", "sps_k3", "mixed_k0_n8")),
    *({"surface": "quadratic", "contacts": k, "chains": n} for k, n in ((1, 6), (3, 8))),
    {"surface": "quadratic", "families": MIXED, "contacts": 2},
    {"surface": ("sphere", "cylinder", "ellipsoid"), "contacts": 3},
    {"surface": ("profile", "ellipsoid"), "families": MIXED, "chains": 8},
    {"surface": ("ellipsoid", "plane"), "ball_radius": 4.0},
    {"surface": ("ball", "plane"), "families": MIXED},
    {"surface": "ball", "families": MIXED, "contacts": 1, "tilted_gravity": True},
]
FEW = CASES[1], *(MECHANISMS[name] for name in ("pss_k1", "sps_k2_n7")), *CASES[14:]


def engines(raw: dict[str, Any]) -> list[Engine]:
    """Inverse dynamics of a raw mechanism by every engine that is installed."""
    found: list[Engine] = [lambda *state: newton_euler.inverse_dynamics(raw, *state)]
    if find_spec("pinocchio"):
        from oracles.pinocchio_engine import PinocchioEngine

        found.append(PinocchioEngine(raw).inverse_dynamics)
    if find_spec("mujoco"):
        from oracles.mujoco_engine import MujocoEngine

        found.append(MujocoEngine(raw).inverse_dynamics)
    return found


def check(c: Case, *engines: Engine, efforts: float = TOLERANCE, **given: Any) -> None:
    q = (c.states[key] for key in ("q", "qd", "qdd"))
    ours = c.model().inverse_dynamics(*q, *parts(c.load), outputs="all", **given)
    assert (ours.status == 0).all()
    for i in range(len(c.load)):
        # Joint coordinates, rod angles and poses are zero at home; contact forces are small
        # differences of large ones.
        of = ours.configuration
        floors = {"contact": np.abs(c.load[i, :3]).max()}
        floors |= dict.fromkeys(("joint", "beta_i", "gamma_i"), 1e-3)
        for engine in engines:
            theirs = engine(*c.sample(i))
            close(ours.effort[i], theirs["tau"], efforts)
            for key, value in (
                ("contact", ours.contact_force), ("joint", of.joint), ("beta_i", of.beta),
                ("gamma_i", of.gamma), ("joint_rate", ours.joint_rate),
                ("joint_acceleration", ours.joint_acceleration),
            ):  # fmt: skip
                if key in theirs:
                    close(value[i], theirs[key], TOLERANCE, floor=floors.get(key, 0.0))
        for key in ("pose", "pose_rate", "pose_acceleration"):
            close(getattr(ours, key)[i], c.states[key][i], 1e-11, floor=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("options", few(CASES, *FEW), ids=str)
def test_outside_engines_agree(options: dict[str, Any]) -> None:
    rng = np.random.default_rng(100 + len(str(options)))
    c = of_raw(random_mechanism(rng, **{"tilted_gravity": True, **options}))
    check(c, *engines(c.raw))


@pytest.mark.parametrize("module", ["pinocchio", "mujoco"])
def test_there_are_outside_engines(module: str) -> None:
    if find_spec(module) is None:
        pytest.skip(f"{module} is not installed (it is in the `test` extra)")


def test_a_robot_as_tall_as_a_tower() -> None:
    """The same numbers, in metres."""
    raw = random_mechanism(np.random.default_rng(0), contacts=1) | {"length_unit": "m"}
    check(of_raw(raw), *engines(raw)[:1])


def test_shafts_that_are_upright_or_nearly() -> None:
    """The cranks of two chains lie level, but for a tilt [rad] of their shafts."""
    for tilt in (0.0, 8e-10):
        raw = random_mechanism(np.random.default_rng(5))
        for chain, sign in zip(raw["chain"][:2], (1, -1), strict=True):
            tip = np.array(chain["crank_tip"])
            out = (np.array(chain["platform"]) - tip) * [1, 1, 0]
            out /= np.linalg.norm(out)
            crank = -25 * (0.9 * out + 0.4 * np.cross([0, 0, 1], out))
            lean = np.cross([0, 0, 1], crank / np.linalg.norm(crank))
            chain["base"] = (tip - crank).tolist()
            chain["axis"] = (sign * (np.array([0, 0, 1]) + tilt * lean)).tolist()
        check(of_raw(raw), *engines(raw)[:1], efforts=1e-12)


@pytest.fixture(scope="module")
def off_centred() -> Case:
    """Every family, and mass centres of platform and cranks anywhere."""
    rng = np.random.default_rng(12)
    return of_raw(off_centre(rng, random_mechanism(rng, families=MIXED, contacts=1)))


@pytest.mark.slow
@pytest.mark.parametrize(
    "options", [pytest.param(CASES[11], marks=pytest.mark.ci), None], ids=["k3 curved", "k1"]
)
def test_a_moving_base(options: dict[str, Any] | None, off_centred: Case) -> None:
    """Pinocchio's recursion with a free base that is led."""
    pytest.importorskip("pinocchio", reason="pinocchio is not installed (`test` extra)")
    from oracles.pinocchio_engine import OnMovingBase

    rng = np.random.default_rng(200)
    c = of_raw(random_mechanism(rng, **options)) if options else off_centred
    gravity, base = rng.normal(0, 9, (len(c.load), 3)), rng.normal(0, 6, (len(c.load), 9))
    led = zip(base, gravity, strict=True)

    def engine(*state: Any) -> dict[str, Any]:
        found = OnMovingBase(c.raw, *next(led)).inverse_dynamics(*state)
        return {key: found[key] for key in ("tau", "contact", "joint_rate", "joint_acceleration")}

    check(c, engine, gravity=gravity, base=base)


@pytest.mark.slow
def test_sixty_digits(off_centred: Case) -> None:
    """Inverse and forward dynamics; matrices; energy, whose rate is the power of the efforts."""
    c = off_centred
    model, s, load = c.model(), c.states, parts(c.load)
    machine = Machine(c.raw, model.independent)
    q, v, a = state = s["q"], s["qd"], s["qdd"]
    found = model.inverse_dynamics(*state, *load, outputs="joint_rate")
    back = model.forward_dynamics(q, v, found.effort, *load)
    for i in range(2):
        near, given, at = s["pose"][i], [x[i] for x in state], (c.load[i, :6], c.load[i, 6:])
        effort, contact, *_ = machine.inverse(near, *given, *at)
        accelerations, _ = machine.forward(near, *given[:2], found.effort[i], *at)
        for ours, right, bound in (
            (found.effort[i], effort, 1e-12),
            (found.contact_force[i], contact, 1e-12),
            (back.acceleration[i], accelerations, 1e-11),
        ):
            close(ours, [float(x) for x in right], bound)
    M, C = model.mass_matrix(q), model.coriolis(q, v)
    close(M, M.swapaxes(1, 2), 1e-12)
    close((C @ v[..., None])[..., 0], model.bias(q, v), 1e-10)

    def energy(t: float) -> np.ndarray:
        ports = {"q": q + t * v + t * t / 2 * a, "q1": v + t * a}
        values = model.kernel("energy").run(ports).values
        return values["kinetic"] + values["potential"]

    h, unloaded = 1e-4, model.inverse_dynamics(*state, outputs="joint_rate")
    power = (8 * (energy(h) - energy(-h)) - (energy(2 * h) - energy(-2 * h))) / (12 * h)
    close(power, (unloaded.joint_rate * unloaded.effort).sum(axis=1), 1e-6)


def test_files_and_mjcf_keep_mass_centres(tmp_path: Path) -> None:
    plain = condyle.load_mechanism("masticatory")
    assert "com" not in condyle.dumps(plain).split("[[contact]]")[0]
    name, centre = plain.chain_names[0], (1e-3, 2e-3, -3e-3)
    crank = {"inertia": 8e-5, "mass": 0.02, "com": -0.01}
    changed = plain.set({"platform.com": centre, f"chain.{name}.crank": crank})
    assert parse(condyle.dumps(changed)) == changed
    assert changed.get("platform.com") == centre and changed.get(f"chain.{name}.crank.com") == -0.01
    with pytest.raises(CondyleError, match="about the shaft"):
        plain.set(f"chain.{name}.crank", {**crank, "inertia": 1e-6})
    mujoco = pytest.importorskip("mujoco")
    condyle.export_mjcf(changed, tmp_path / "jaw")
    model = mujoco.MjModel.from_xml_path(str(next((tmp_path / "jaw").glob("*.xml"))))
    platform, first = (
        mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, body)
        for body in ("platform", f"{name}_crank")
    )
    assert model.body_ipos[platform] == pytest.approx(centre)
    assert model.body_mass[first] == pytest.approx(0.02)
    assert np.linalg.norm(model.body_ipos[first]) == pytest.approx(0.01)
