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
from .description import load, read
from .mujoco_engine import MujocoEngine
from .pinocchio_engine import PinocchioEngine
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
    "k2": {"contacts": 2, "tilted_gravity": True},
    "symmetric": {"symmetric": True},
    "every_surface": {"surface": "mixed", "contacts": 3, "chains": 8},
    "balls": {"surface": ("ellipsoid", "quadratic", "cylinder"), "contacts": 3, "ball_radius": 4.0},
    "pss": {"families": ("PSS",), "rod_along_x": True},
    "mixed_n8_k0": {"families": MIXED, "chains": 8, "contacts": 0},
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
    """That they agree on random mechanisms follows from `dynamics/test_engines.py`."""
    c = REFERENCE["cases"][case]
    state = complete_state(MASTICATORY, REFERENCE["coordinates"], c["q"], c["qd"], c["qdd"])
    for got, name in zip(state, ("pose", "pose_d", "pose_dd"), strict=True):
        close(got, c[name], 1e-12)
    wrench = np.append(c["F"], np.zeros(3))
    engines = PinocchioEngine(MASTICATORY), MujocoEngine(MASTICATORY)
    results = [engine.inverse_dynamics(*state, wrench) for engine in engines]
    results.append(newton_euler.inverse_dynamics(MASTICATORY, *state, wrench))
    names = {"tau": "tau", "contact": "contact", "joint": "theta", "joint_rate": "theta_d"}
    names |= {"joint_acceleration": "theta_dd"}
    for result in results:
        for ours, theirs in names.items():
            close(result[ours], c[theirs], 1e-11)
    for name in ("beta_i", "gamma_i"):
        close(results[0][name], c[name], 1e-11)


def test_newton_euler_takes_given_efforts() -> None:
    """Any effort along the null space balances too; any other does not."""
    raw = mechanism("mixed_n8_k0")
    args = sample(random_state(np.random.default_rng(1), raw, 1), 0)
    result = newton_euler.inverse_dynamics(raw, *args)
    assert result["residual"] < 1e-12
    J = PinocchioEngine(raw).inverse_dynamics(*args)["J_theta"]
    inner = np.linalg.svd(J.T)[2][-1]
    for direction, balanced in ((inner, True), (np.eye(8)[0], False)):
        other = newton_euler.inverse_dynamics(raw, *args, tau=result["tau"] + 0.1 * direction)
        assert (other["residual"] < 1e-11) == balanced


@pytest.mark.parametrize("name", ["every_surface", "balls"])
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


def test_normals_point_up_or_outward_and_millimetres_are_read() -> None:
    above, centre = np.array([1.0, 2.0, 30.0]), [0.0, 0.0, 0.0]
    for table, wanted in (
        ({"kind": "plane", "slope": [-1.1, 0.2], "offset": 0.0}, [1.1, -0.2, 1.0]),
        ({"kind": "sphere", "centre": centre, "radius": 5.0}, above),
        ({"kind": "cylinder", "point": centre, "axis": [0, 0, 2.0], "radius": 5.0}, [1, 2, 0]),
    ):
        n = normal(read_surface({"surface": table}, 1.0), above)
        close(n, np.array(wanted) / np.linalg.norm(wanted), 1e-15)
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
    """And a seed gives always the same."""
    raw = mechanism(name)
    assert mechanism(name) == raw == tomllib.loads(toml_text(raw))
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
