"""The oracles meet given numbers, each other, and the laws: so what they say of condyle counts."""

from __future__ import annotations

import json
import re
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from . import newton_euler
from .closure import complete_state, dependent_coordinates, independent_coordinates, residuals
from .description import COORDINATES, load, read
from .mujoco_engine import MujocoEngine
from .pinocchio_engine import PinocchioEngine, pin
from .random_mechanism import SURFACES, random_mechanism, random_state, random_surface, toml_text
from .surfaces import Offset, normal, read_surface

Array = np.ndarray
HERE = Path(__file__).parent
REFERENCE = json.loads((HERE / "reference_cases.json").read_text())
MASTICATORY = load(HERE / "masticatory.toml")
IMPORTS = re.compile(r"^\s*(?:from|import)\s+(?:condyle|support|\.\.)\S*", re.MULTILINE)


def test_they_share_nothing_with_the_library() -> None:
    found = {path.name: IMPORTS.findall(path.read_text()) for path in HERE.glob("*.py")}
    assert not {name: lines for name, lines in found.items() if lines}


MIXED = ("RSS", "PSS", "SPS")
MECHANISMS: dict[str, dict[str, Any]] = {
    "k0": {"contacts": 0},
    "k1": {"contacts": 1},
    "k2": {"contacts": 2, "tilted_gravity": True},
    "k3": {"contacts": 3},
    "k5": {"contacts": 5},
    "n4": {"chains": 4},
    "n8": {"chains": 8},
    "symmetric": {"symmetric": True},
    "quadratic": {"surface": "quadratic"},
    "quadratic_k3": {"surface": "quadratic", "contacts": 3},
    "every_surface": {"surface": "mixed", "contacts": 3, "chains": 8},
    "balls": {"surface": ("ellipsoid", "quadratic", "cylinder"), "contacts": 3, "ball_radius": 4.0},
    "pss": {"families": ("PSS",)},
    "sps_k0": {"families": ("SPS",), "contacts": 0},
    "sps": {"families": ("SPS",), "contacts": 1},
    "mixed": {"families": MIXED},
    "mixed_n8_k0": {"families": MIXED, "chains": 8, "contacts": 0},
    "along_x": {"rod_along_x": True},
    "along_x_sps": {"rod_along_x": True, "families": ("SPS",)},
}


def mechanism(name: str) -> dict[str, Any]:
    return random_mechanism(np.random.default_rng(sum(map(ord, name))), **MECHANISMS[name])


def sample(states: dict[str, Any], i: int) -> tuple[Any, ...]:
    keys = ("pose", "pose_rate", "pose_acceleration", "wrench")
    return (*(states[key][i] for key in keys), states["load_point"])


def close(got: Array, wanted: Array, tolerance: float, floor: float = 0.0) -> None:
    """Equal relative to the largest component (or `floor`)."""
    scale = max(np.abs(wanted).max(initial=0), floor)
    np.testing.assert_allclose(got, wanted, rtol=0, atol=tolerance * scale)


@pytest.mark.parametrize("case", range(len(REFERENCE["cases"])))
def test_engines_meet_the_reference_cases(case: int) -> None:
    c = REFERENCE["cases"][case]
    state = complete_state(MASTICATORY, REFERENCE["coordinates"], c["q"], c["qd"], c["qdd"])
    for got, name in zip(state, ("pose", "pose_d", "pose_dd"), strict=True):
        close(got, c[name], 1e-12)
    wrench = np.append(c["F"], np.zeros(3))
    results = [
        PinocchioEngine(MASTICATORY).inverse_dynamics(*state, wrench),
        MujocoEngine(MASTICATORY).inverse_dynamics(*state, wrench),
        newton_euler.inverse_dynamics(MASTICATORY, *state, wrench),
    ]
    names = {"tau": "tau", "contact": "contact", "joint": "theta", "joint_rate": "theta_d"}
    names |= {"joint_acceleration": "theta_dd"}
    for result in results:
        for ours, theirs in names.items():
            close(result[ours], c[theirs], 1e-11)
    for name in ("beta_i", "gamma_i"):
        close(results[0][name], c[name], 1e-11)


@pytest.mark.parametrize("name", MECHANISMS)
def test_engines_agree_on_random_mechanisms(name: str) -> None:
    raw = mechanism(name)
    rng = np.random.default_rng(7)
    pinocchio, mujoco = PinocchioEngine(raw), MujocoEngine(raw)
    for scale in (0.0, 0.05, 1.0):
        states = random_state(rng, raw, 2, scale)
        for i in range(2):
            args = sample(states, i)
            wanted = pinocchio.inverse_dynamics(*args)
            force = np.linalg.norm(wanted["Q"][:3])
            for got in (mujoco.inverse_dynamics(*args), newton_euler.inverse_dynamics(raw, *args)):
                for key in ("tau", "joint", "joint_rate", "joint_acceleration"):
                    close(got[key], wanted[key], 1e-11, floor=1e-14)
                close(got["contact"], wanted["contact"], 1e-10, floor=force)


@pytest.mark.parametrize("name", ["k2", "mixed", "every_surface"])
def test_power_balance(name: str) -> None:
    """Power of the actuators and the load = rate of the tree's energy; contacts do no work."""
    raw = mechanism(name)
    d, engine = read(raw), PinocchioEngine(raw)
    states = random_state(np.random.default_rng(3), raw, 1)
    names, q, qd, qdd = (states[key] for key in ("names", "q", "qd", "qdd"))
    pose, rate, second, wrench, where = sample(states, 0)
    result = engine.inverse_dynamics(pose, rate, second, wrench, where)
    unloaded = engine.inverse_dynamics(pose, rate, second, 0 * wrench, where)
    load = (unloaded["Q"] - result["Q"]) @ rate

    def energy(t: float) -> float:
        moved, moving = q[0] + qd[0] * t + qdd[0] * t * t / 2, qd[0] + qdd[0] * t
        state = complete_state(d, names, moved, moving, qdd[0])
        tree = engine.inverse_dynamics(*state, 0 * wrench, None)
        q_tree, v_tree = tree["tree_q"], tree["tree_v"]
        kinetic = pin.computeKineticEnergy(engine.model, engine.data, q_tree, v_tree)
        return kinetic + pin.computePotentialEnergy(engine.model, engine.data, q_tree)

    h = 2e-5
    slope = (8 * (energy(h) - energy(-h)) - (energy(2 * h) - energy(-2 * h))) / (12 * h)
    power = result["tau"] @ result["joint_rate"] + load
    assert abs(power - slope) < 1e-8 * np.abs(result["tau"] * result["joint_rate"]).sum()


@pytest.mark.parametrize("name", ["n8", "mixed_n8_k0"])
def test_newton_euler_takes_given_efforts(name: str) -> None:
    """Any effort along the null space balances too; any other does not."""
    raw = mechanism(name)
    args = sample(random_state(np.random.default_rng(1), raw, 1), 0)
    result = newton_euler.inverse_dynamics(raw, *args)
    assert result["residual"] < 1e-12
    J, N = (PinocchioEngine(raw).inverse_dynamics(*args)[key] for key in ("J_theta", "C_normal"))
    free = np.linalg.svd(N)[2][len(N) :] if len(N) else np.eye(6)
    inner = np.linalg.svd(free @ J.T)[2][-1]
    for direction, balanced in ((inner, True), (np.eye(8)[0], False)):
        other = newton_euler.inverse_dynamics(raw, *args, tau=result["tau"] + 0.1 * direction)
        assert (other["residual"] < 1e-11) == balanced


@pytest.mark.parametrize("name", ["k2", "quadratic_k3", "every_surface", "balls"])
def test_derivatives_of_the_pose_along_a_path(name: str) -> None:
    """Rates and accelerations against central differences of the pose."""
    raw = mechanism(name)
    states = random_state(np.random.default_rng(2), raw, 1, 0.5)
    names, q, qd, qdd = (states[key] for key in ("names", "q", "qd", "qdd"))

    def pose(t: float) -> Array:
        return complete_state(raw, names, q[0] + qd[0] * t + qdd[0] * t * t / 2, qd[0], qdd[0])[0]

    h = 2e-4
    left2, left, middle, right, right2 = (pose(k * h) for k in (-2, -1, 0, 1, 2))
    first = (8 * (right - left) - (right2 - left2)) / (12 * h)
    second = (16 * (right + left) - (right2 + left2) - 30 * middle) / (12 * h * h)
    close(states["pose_rate"][0], first, 1e-7)
    close(states["pose_acceleration"][0], second, 1e-6)
    assert np.abs(residuals(read(raw), middle)).max() < 1e-13


@pytest.mark.parametrize("ball", [0.0, 4.0])
@pytest.mark.parametrize("kind", SURFACES)
def test_surface_derivatives(kind: str, ball: float) -> None:
    """Gradient and Hessian against central differences, on and off the surface."""
    rng = np.random.default_rng(5)
    p, slope = np.array([20.0, -12.0, 8.0]), np.array([-0.7, 0.3])
    closed = kind in ("sphere", "cylinder", "ellipsoid")
    side = {"ball_radius": ball, "side": "outside" if closed else "above"} if ball else {}
    s = read_surface({"surface": random_surface(rng, kind, p, slope)} | side, 1e-3)
    h = 1e-6
    for x in (p * 1e-3, p * 1e-3 + rng.normal(0, 1e-3, 3)):
        steps = h * np.eye(3)
        gradient = [(s.value(x + e) - s.value(x - e)) / (2 * h) for e in steps]
        hessian = [(s.gradient(x + e) - s.gradient(x - e)) / (2 * h) for e in steps]
        close(s.gradient(x), np.array(gradient), 1e-7)
        close(s.hessian(x), np.array(hessian), 1e-6, floor=1.0)
    wall = s.wall if isinstance(s, Offset) else s
    assert abs(wall.value(p * 1e-3)) < 1e-15
    n = np.array([-slope[0], -slope[1], 1.0]) / np.linalg.norm([*slope, 1.0])
    if kind != "profile":
        assert abs(abs(normal(wall, p * 1e-3) @ n) - 1) < 1e-14


def test_normals_point_up_or_outward() -> None:
    above, centre = np.array([1.0, 2.0, 30.0]), [0.0, 0.0, 0.0]
    plane = {"kind": "plane", "slope": [-1.1, 0.2], "offset": 0.0}
    wanted = np.array([1.1, -0.2, 1.0]) / np.sqrt(1.1**2 + 0.2**2 + 1)
    close(normal(read_surface({"surface": plane}, 1.0), above), wanted, 1e-15)
    sphere = {"kind": "sphere", "centre": centre, "radius": 5.0}
    outward = above / np.linalg.norm(above)
    close(normal(read_surface({"surface": sphere}, 1.0), above), outward, 1e-15)
    cylinder = {"kind": "cylinder", "point": centre, "axis": [0, 0, 2.0], "radius": 5.0}
    across = np.array([1, 2, 0]) / np.sqrt(5)
    close(normal(read_surface({"surface": cylinder}, 1.0), above), across, 1e-15)


def test_quadratic_in_millimetres() -> None:
    table = {"kind": "quadratic", "offset": 2.0, "slope": [0.1, -0.2]}
    table |= {"xx": 0.01, "xy": -0.02, "yy": 0.03}
    x, y, z = 3.0, -4.0, 7.0
    wanted = z - (2.0 + 0.1 * x - 0.2 * y + 0.01 * x * x - 0.02 * x * y + 0.03 * y * y)
    got = read_surface({"surface": table}, 1e-3).value(1e-3 * np.array([x, y, z]))
    assert got == pytest.approx(1e-3 * wanted, rel=1e-14)


def test_surfaces_that_must_coincide() -> None:
    p = np.array([0.3, -0.2, 0.5])

    def value(**contact: Any) -> float:
        return read_surface(contact, 1.0).value(p)

    plane = {"kind": "plane", "slope": [0.4, -0.3], "offset": 0.2}
    assert value(surface=plane) == value(surface=plane | {"kind": "quadratic"})
    points = [[-1, -0.3], [0, 0.2], [0.1, 0.25]]
    line = {"kind": "profile", "direction": [0.8, -0.6], "points": points}
    assert value(surface=line) == pytest.approx(value(surface=plane), abs=1e-15)
    lifted = plane | {"offset": 0.2 - 0.1 * np.sqrt(1.25)}
    steep = np.sqrt(1.25)  # |(-dz/dx, -dz/dy, 1)|: from vertical to shortest distance
    below = value(surface=plane, ball_radius=0.1, side="below")
    assert below == pytest.approx(value(surface=lifted) / steep, abs=1e-15)
    sphere = {"kind": "sphere", "centre": [0, 0, 0], "radius": 2.0}
    on = p / np.linalg.norm(p) * 1.9
    inside = read_surface({"surface": sphere, "ball_radius": 0.1, "side": "inside"}, 1.0)
    assert abs(inside.value(on)) < 1e-15
    ellipsoid = {"kind": "ellipsoid", "centre": [0, 0, 0], "semi_axes": [2.0, 2.0, 2.0]}
    assert value(surface=sphere) == pytest.approx(value(surface=ellipsoid), abs=1e-15)


def test_dependent_coordinates_rule() -> None:
    assert dependent_coordinates(MASTICATORY) == ("Z", "gamma")
    assert independent_coordinates(MASTICATORY) == ("X", "Y", "alpha", "beta")
    assert dependent_coordinates(MASTICATORY | {"dependent": ["X", "alpha"]}) == ("X", "alpha")
    assert dependent_coordinates(mechanism("k0")) == ()
    # two level planes: gamma does nothing, so the rule goes on to the next
    level = {"kind": "plane", "slope": [0, 0], "offset": 42.53}
    contacts = [c | {"surface": level} for c in MASTICATORY["contact"]]
    assert dependent_coordinates(MASTICATORY | {"contact": contacts}) == ("Z", "alpha")


@pytest.mark.parametrize("name", MECHANISMS)
def test_random_mechanisms_obey_the_format(name: str) -> None:
    raw = mechanism(name)
    assert tomllib.loads(toml_text(raw)) == raw
    d = read(raw)
    assert len({c.name for c in (*d.chains, *d.contacts)}) == len(d.chains) + len(d.contacts)
    assert np.abs(residuals(d, np.zeros(6))).max(initial=0) < 1e-13
    moments = np.linalg.eigvalsh(d.inertia)
    assert moments[0] > 0 and moments[2] < moments[0] + moments[1]
    for chain, table in zip(d.chains, raw["chain"], strict=True):
        assert all(0 < rod.axial <= 2 * rod.transverse for rod in chain.rods)
        if chain.kind == "RSS":
            crank = np.subtract(table["crank_tip"], table["base"])
            assert abs(crank @ table["axis"]) < 1e-9 * np.linalg.norm(crank)


def test_the_same_seed_gives_the_same_mechanism() -> None:
    first, second = (random_mechanism(np.random.default_rng(4)) for _ in range(2))
    assert first == second
    states = [random_state(np.random.default_rng(4), first, 2)["q"] for _ in range(2)]
    assert states[0].shape == (2, 4) and (states[0] == states[1]).all()
    assert set(independent_coordinates(first)) < set(COORDINATES)
