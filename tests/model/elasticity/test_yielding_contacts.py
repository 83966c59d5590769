"""Stiffness with contacts that yield against the curvature of all six coordinates' energy."""

from copy import deepcopy
from typing import Any

import numpy as np
import pytest
from oracles.description import COORDINATES
from oracles.random_mechanism import random_mechanism, random_state, toml_text
from oracles.rotations import platform_motion
from oracles.springs import YieldingMachine

import condyle
from condyle.errors import InputError
from condyle.mechanism import parse
from condyle.model.contact_patches import surfaces_at
from condyle.model.model import Model
from condyle.model.yielding import place_by_coordinates
from condyle.results.vibrations import home_modes

from .test_stiffness import sprung

LAWS: tuple[dict[str, Any], ...] = (
    {"kind": "linear", "stiffness": 4e4, "damping": 0.3},
    {"kind": "hertz", "modulus": 2e6, "poisson": 0.4, "radius": 9, "damping": 0.2},
    {"kind": "foundation", "modulus": 4e5, "poisson": 0.3, "thickness": 3, "radius": 8},
)
SURFACES = ("sphere", "plane", "cylinder")  # whose curvatures are the same everywhere


def sample(k: int, laws: Any = LAWS) -> tuple[dict[str, Any], Model, dict[str, Any]]:
    rng = np.random.default_rng([5, k])
    raw = random_mechanism(rng, ("RSS", "PSS", "SPS"), contacts=k, surface=SURFACES)
    raw = sprung(rng, raw, "both")
    for contact, law in zip(raw["contact"], laws, strict=False):
        contact["compliance"] = deepcopy(law)
    return raw, Model(parse(toml_text(raw)), backend="numpy"), random_state(rng, raw)


def held(model: Model, q: np.ndarray, *load: Any) -> Any:
    still = np.zeros_like(q)
    return model.inverse_dynamics(q, still, still, *load, contacts="compliant", outputs="pose")


def point_rates(pose: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Rates of a point and of turning, (6, 6), by those of the pose."""
    motion = platform_motion(pose)
    return np.vstack([motion.jacobian(point), np.hstack([np.zeros((3, 3)), motion.axes])])


@pytest.mark.slow
@pytest.mark.parametrize("k", [1, 2, 3])
def test_is_the_curvature_of_the_energy_with_depths_free(k: int) -> None:
    """u K v is that of the energy along the motions that q brings, across which nothing pulls;
    and the compliance leads to where the energy's slope is the load."""
    raw, model, state = sample(k)
    q, at, rng = state["q"][0], state["load_point"], np.random.default_rng(k)
    wrench = state["wrench"][0]
    pose = held(model, q, wrench, at)
    point = np.array(model.mechanism.platform.points[at])
    found = model.stiffness(q, None, wrench, at, contacts="compliant")
    modes = model.modes(q, None, wrench, at, contacts="compliant")
    machine = YieldingMachine(raw, pose.pose, pose.effort, wrench, point, pose.contact_force)
    assert (np.abs(pose.indentation) > 1e-5).all()

    E = point_rates(pose.pose, point)
    twist = np.linalg.solve(modes.shape, modes.displacement).T
    V = np.linalg.solve(E, twist)
    free = [COORDINATES.index(name) for name in model.independent]
    np.testing.assert_allclose(V[free], np.eye(len(q)), atol=1e-9)
    size = np.where(np.array(COORDINATES) < "a", 0.1, 1.0)
    u, v = rng.normal(size=(2, len(q))) * size[free]
    scale = np.abs(np.outer(u, v) * found.K).max()
    assert abs(u @ found.K @ v - float(machine.curvature(V @ u, V @ v))) < 1e-8 * scale
    across = rng.normal(size=6) * size
    across[free] = 0.0
    assert abs(float(machine.curvature(across, V @ v))) < 1e-8 * scale
    further = rng.normal(size=6)
    moved, along = np.linalg.solve(E, found.compliance @ further), rng.normal(size=6) * size
    work = along @ E.T @ further
    assert abs(float(machine.curvature(along, moved)) - work) < 1e-8 * np.abs(E.T @ further).max()


@pytest.mark.slow
def test_masses_and_dampers_move_by_the_same_motions() -> None:
    """M is that of the machine without contacts, along them; D what the contacts lose."""
    raw, _, state = sample(2)
    for chain in raw["chain"]:
        del chain["actuator"]["damping"]
    model = Model(parse(toml_text(raw)), backend="numpy")
    q, load = state["q"][0], (np.append(state["wrench"][0, :3], np.zeros(3)), "incisor")
    at = held(model, q, *load)
    modes = model.modes(q, None, *load, contacts="compliant")
    free = Model(parse(toml_text(raw | {"contact": []})), backend="numpy")
    alone = free.modes(at.pose, at.effort)
    own = np.linalg.inv(alone.shape)
    E = point_rates(at.pose, np.array(model.mechanism.platform.points["incisor"]))
    X = np.linalg.solve(E, modes.displacement.T)
    np.testing.assert_allclose(X.T @ own @ own.T @ X, np.eye(4), atol=1e-9)
    machine = YieldingMachine(raw, at.pose, at.effort, np.zeros(6), np.zeros(3), at.contact_force)
    h, loss, damping = 1e-6, [], [law["damping"] for law in LAWS[:2]]
    for x in X.T:
        ends = [
            machine._depths([a + s * h * b for a, b in zip(machine.q, x, strict=True)])
            for s in (1, -1)
        ]
        rates = [float(a - b) / (2 * h) for a, b in zip(*ends, strict=True)]
        loss.append(sum(np.abs(at.contact_force) * damping * np.square(rates)))
    np.testing.assert_allclose(modes.damping * 4 * np.pi * modes.frequency, loss, rtol=1e-7)


def test_slopes_of_gaps_are_differences() -> None:
    """On surfaces whose levels are not parallel, where a depth that is held still changes a gap."""
    rng, h = np.random.default_rng(9), 1e-5
    raw = random_mechanism(rng, ("RSS", "SPS"), contacts=2, surface=("quadratic", "ellipsoid"))
    raw = sprung(rng, raw, "drives")
    for contact in raw["contact"]:
        contact["compliance"] = {"kind": "linear", "stiffness": 3e3}
    model, q = Model(parse(toml_text(raw)), backend="numpy"), random_state(rng, raw)["q"][:1]
    system = model.system
    _, here = model._elasticity.equilibrium(q, None, None, None, compliant=True)
    level, pose = here.ports["level"], here.ports["pose"]
    slope = system.kernel("elastic_yielding").run(here.ports).values["gap_slope"][..., 0]
    closure, still = system.closure(system.independent, None).followed, np.zeros_like(q)
    for j, axis in enumerate(h * np.eye(4)):
        ends = []
        for s in (1, -1):
            place = place_by_coordinates(closure, q + s * axis, still, still)
            moved = place(level, pose, np.zeros(1, dtype=int)).motion["pose"]
            ends.append(surfaces_at(model.mechanism, moved)["gap"][:, 0])
        wanted = (ends[0] - ends[1]) / (2 * h)
        np.testing.assert_allclose(slope[:, j], wanted, atol=1e-8)
    assert np.abs(slope[:, :4]).max() > 1e-5


@pytest.mark.slow
def test_efforts_may_be_given_and_stiff_contacts_are_rigid_ones() -> None:
    _, model, state = sample(2)
    q, load = state["q"][:2], (state["wrench"][:2], state["load_point"])
    effort = held(model, q, *load).effort
    chosen, given = (model.stiffness(q, tau, *load, contacts="compliant") for tau in (None, effort))
    assert (given.status == chosen.status).all() and (chosen.status == 0).all()
    for name in ("K", "geometric", "compliance"):
        size = np.abs(getattr(chosen, name)).max()
        difference = getattr(given, name) - getattr(chosen, name)
        assert np.abs(difference).max() < 1e-9 * size
    errors = []
    for stiffness in (1e8, 1e9):
        _, stiff, _ = sample(2, [{"kind": "linear", "stiffness": stiffness}] * 2)
        one = stiff.stiffness(q, None, *load, contacts="compliant")
        other = stiff.stiffness(q, None, *load)
        names = ("K", "compliance", "geometric")
        errors.append([np.abs(getattr(one, n) - getattr(other, n)).max() for n in names])
    assert np.abs(np.divide(*errors) - 10).max() < 0.1  # as 1 / stiffness


@pytest.mark.slow
def test_contacts_without_compliance_stay_rigid() -> None:
    """One that yields, of two: the other holds the compliance back by one."""
    _, model, state = sample(2, LAWS[:1])
    q = state["q"][0]
    found, kept = (model.stiffness(q, contacts=how) for how in ("compliant", "kept"))
    size = np.repeat([1.0, 0.1], 3)
    for one, rank in ((found, 5), (kept, 4)):
        sizes = np.linalg.svd(one.compliance * np.outer(size, size), compute_uv=False)
        assert np.count_nonzero(sizes > 1e-10 * sizes[0]) == rank
    assert found.K.shape == (4, 4)


def test_says_what_compliant_contacts_take() -> None:
    _, model, state = sample(2)
    q = state["q"][0]
    name = model.mechanism.chain_names[0]
    paths = {f"chain.{name}.actuator.stiffness": None}
    axial = {"RSS": "coupler", "PSS": "rod", "SPS": "leg"}[model.mechanism.chains[0].kind]
    paths[f"chain.{name}.{axial}.stiffness"] = None
    stiff = Model(model.mechanism.set(paths), backend="numpy")
    with pytest.raises(InputError, match=f"{name} are rigid"):
        stiff.modes(q, contacts="compliant")
    with pytest.raises(InputError, match="no contact of this mechanism has compliance"):
        sample(2, [])[1].stiffness(q, contacts="compliant")
    variants = model.variants({"platform.mass": np.array([0.2, 0.3])})
    (group,) = variants.groups
    with pytest.raises(condyle.UnsupportedError, match="several variants"):
        group.model.stiffness(np.zeros((2, 1, 4)), contacts="compliant")


def test_check_and_modes_say_what_gives_at_home() -> None:
    """Pressure by the closed form of a sphere on a thin layer, and the softest directions."""
    jaw = condyle.load_mechanism("human-jaw")
    E, nu, h, R = 5e6, 0.3, 2e-3, 8e-3
    law = {"kind": "foundation", "modulus": E, "poisson": nu, "thickness": h, "radius": R}
    left, right = jaw.contact_names
    jaw = jaw.set({f"contact.{left}.compliance": law})
    found = condyle.check(jaw)
    assert found.data["contacts"][right]["held"]["indentation"] is None
    held, modulus = found.data["contacts"][left]["held"], (1 - nu) * E / ((1 + nu) * (1 - 2 * nu))
    depth = np.sqrt(abs(held["force"]) * h / (np.pi * modulus * R))
    np.testing.assert_allclose(held["indentation"], depth, rtol=1e-10)
    np.testing.assert_allclose(held["peak_pressure"], modulus * depth / h, rtol=1e-10)
    said = f"{held['contact_area'] * 1e6:.3g} mm^2, peak pressure {modulus * depth / h * 1e-6:.3g}"
    assert said in str(found) and held["force"] < 0

    soft = jaw.set({f"chain.{name}.actuator.stiffness": 1e4 for name in jaw.chain_names})
    model = condyle.derive(soft, backend="numpy")
    kept, yielding = (home_modes(model, "incisor", how) for how in ("kept", "compliant"))
    assert str(kept).count("held about") == 1 and "that yield" in str(yielding)
    assert yielding.data["frequency"][0] < kept.data["frequency"][0]
    least = yielding.data["translation"][0]
    assert "softest along" in str(yielding) and f"{least:.3g} m/N, stiffest" in str(yielding)
