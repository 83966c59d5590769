"""Mass centres of platform and cranks anywhere: every formulation, other engines, files."""

from __future__ import annotations

import numpy as np
import pytest
from oracles.digits import Machine
from oracles.forward_tree import forward_dynamics
from oracles.pinocchio_engine import PinocchioEngine
from oracles.random_mechanism import off_centre, random_mechanism
from support.families import Case, of_raw
from support.loads import parts
from support.speeds import few

import condyle
from condyle.dynamics import FORMULATIONS
from condyle.errors import CondyleError, MechanismError
from condyle.mechanism.files import parse
from condyle.model.model import Model

FAMILIES = ("RSS", "PSS", "SPS")
CRANK = {"inertia": 8e-5, "mass": 0.02, "com": -0.01}


def built(contacts: int = 2) -> Case:
    rng = np.random.default_rng(12)
    return of_raw(off_centre(rng, random_mechanism(rng, families=FAMILIES, contacts=contacts)))


def inverse(c: Case, **how: str) -> condyle.ModelResult:
    s, model = c.states, Model(c.mechanism, backend="numpy", **how)
    return model.inverse_dynamics(s["q"], s["qd"], s["qdd"], *parts(c.load))


WAYS = [f"{formulation} {route}" for formulation in FORMULATIONS for route in ("core", "direct")]


@pytest.mark.parametrize("way", few(WAYS, "newton_euler core"))
def test_every_formulation(way: str) -> None:
    c, (formulation, route) = built(), way.split()
    right, found = inverse(c), inverse(c, formulation=formulation, route=route)
    assert not found.status.any()
    for name in ("effort", "contact_force"):
        a, b = getattr(found, name), getattr(right, name)
        assert np.abs(a - b).max() <= 1e-11 * np.abs(b).max()
    balanced = c.raw | {"platform": {**c.raw["platform"], "com": [0.0, 0.0, 0.0]}}
    other = inverse(of_raw(balanced)).effort
    assert np.abs(other - right.effort).max() > 1e-3 * np.abs(right.effort).max()


@pytest.mark.slow
def test_sixty_digits() -> None:
    c = built()
    model = Model(c.mechanism, backend="numpy")
    machine, found, s = Machine(c.raw, model.independent), inverse(c), c.states
    state = s["q"], s["qd"], s["qdd"]
    back = model.forward_dynamics(*state[:2], found.effort, *parts(c.load))
    for i in range(2):
        near, given = s["pose"][i], [a[i] for a in state]
        load = c.load[i, :6], c.load[i, 6:]
        effort, force = machine.inverse(near, *given, *load)
        for ours, theirs in ((found.effort[i], effort), (found.contact_force[i], force)):
            right = np.array([float(x) for x in theirs])
            assert np.abs(ours - right).max() <= 1e-12 * np.abs(right).max()
        acceleration, _ = machine.forward(near, *given[:2], found.effort[i], *load)
        right = np.array([float(x) for x in acceleration])
        assert np.abs(back.acceleration[i] - right).max() <= 1e-11 * np.abs(right).max()


def test_pinocchio() -> None:
    c = built()
    model, s, found = Model(c.mechanism, backend="numpy"), c.states, inverse(c)
    ours = model.forward_dynamics(
        s["q"], s["qd"], found.effort, *parts(c.load), outputs="pose_acceleration"
    )
    for i in range(len(found.effort)):
        given = s["pose"][i], s["pose_rate"][i], found.effort[i], s["wrench"][i], s["load_point"]
        (theirs,) = forward_dynamics(PinocchioEngine(c.raw), c.raw, *given)
        right = theirs.acceleration
        assert np.abs(ours.pose_acceleration[i] - right).max() <= 1e-9 * np.abs(right).max()


def test_energy_is_the_work_of_efforts() -> None:
    c, h = built(contacts=1), 1e-4
    model, s = Model(c.mechanism, backend="numpy"), c.states
    q, v, a = s["q"], s["qd"], s["qdd"]
    found = model.inverse_dynamics(q, v, a, outputs="joint_rate")

    def energy(t: float) -> np.ndarray:
        ports = {"q": q + t * v + t * t / 2 * a, "q1": v + t * a}
        values = model.kernel("energy").run(ports).values
        return values["kinetic"] + values["potential"]

    power = (8 * (energy(h) - energy(-h)) - (energy(2 * h) - energy(-2 * h))) / (12 * h)
    right = (found.joint_rate * found.effort).sum(axis=1)
    assert np.abs(power - right).max() <= 1e-6 * np.abs(right).max()


def test_mass_matrix_and_coriolis() -> None:
    c = built(contacts=1)
    s = c.states
    first = Model(c.mechanism, backend="numpy")
    q, v = s["q"], s["qd"]
    M, b = first.mass_matrix(q), first.bias(q, v)
    assert np.abs(M - M.swapaxes(1, 2)).max() <= 1e-12 * np.abs(M).max()
    C = (first.coriolis(q, v) @ v[..., None])[..., 0]
    assert np.abs(C - b).max() <= 1e-10 * np.abs(b).max()


def test_files() -> None:
    plain = condyle.load_mechanism("masticatory")
    assert "com" not in condyle.dumps(plain).split("[[contact]]")[0]
    name = plain.chain_names[0]
    changed = plain.set({"platform.com": (1e-3, 2e-3, -3e-3), f"chain.{name}.crank": CRANK})
    text = condyle.dumps(changed)
    assert parse(text) == changed
    assert changed.get("platform.com") == (1e-3, 2e-3, -3e-3)
    assert changed.get(f"chain.{name}.crank.com") == -0.01
    with pytest.raises((CondyleError, MechanismError), match="about the shaft"):
        plain.set(f"chain.{name}.crank", {**CRANK, "inertia": 1e-6})


def test_mjcf_there_and_back(tmp_path) -> None:
    mujoco = pytest.importorskip("mujoco")
    plain = condyle.load_mechanism("masticatory")
    names = plain.chain_names
    machine = plain.set(
        {"platform.com": (1e-3, 2e-3, -3e-3)} | {f"chain.{n}.crank": CRANK for n in names}
    )
    condyle.export_mjcf(machine, tmp_path / "jaw")
    (path,) = (tmp_path / "jaw").glob("*.xml")
    model = mujoco.MjModel.from_xml_path(str(path))
    body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, "platform")
    assert model.body_ipos[body] == pytest.approx((1e-3, 2e-3, -3e-3))
    crank = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, f"{names[0]}_crank")
    assert model.body_mass[crank] == pytest.approx(0.02)
    assert np.linalg.norm(model.body_ipos[crank]) == pytest.approx(0.01)
