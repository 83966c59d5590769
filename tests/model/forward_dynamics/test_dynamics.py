"""Forward dynamics against engines, free bodies, energy and inverse dynamics; statuses, slopes."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from oracles.closure import residuals
from oracles.description import load as raw_file
from oracles.description import read
from oracles.energy import energy
from oracles.forward_tree import forward_dynamics
from oracles.mujoco_engine import MujocoEngine
from oracles.pinocchio_engine import PinocchioEngine
from oracles.random_mechanism import random_mechanism, random_state, toml_text
from oracles.rotations import platform_motion
from oracles.rubbing import balance
from scipy.integrate import solve_ivp
from support import families
from support.cases import BUNDLED, BUNDLED_FOLDER
from support.families import close
from support.rubbing import Rubbing, drawn
from support.speeds import first

from condyle.dynamics import FORMULATIONS
from condyle.errors import InputError
from condyle.mechanism import parse
from condyle.model.model import Model
from condyle.status import Status

pytestmark = pytest.mark.slow

Array = np.ndarray
FAMILIES = ("RSS", "PSS", "SPS")
# Of `drawn`: friction at every contact and losses in every actuator, unless it says otherwise.
DRAWN: dict[str, dict[str, Any]] = {
    "RSS k1 n8": {"contacts": 1, "chains": 8, "seed": 3},
    "RSS k2 n8 quadratic": {"surface": "quadratic", "chains": 8, "seed": 4},
    "PSS k1 ball": {"families": ("PSS",), "contacts": 1, "ball_radius": 3.0, "seed": 6},
    "mixed k3": {"families": FAMILIES, "contacts": 3, "surface": "quadratic", "seed": 8},
    "PSS k4": {"families": ("PSS",), "contacts": 4, "seed": 9},
    "RSS k5": {"contacts": 5, "seed": 10},
    "every family": {"families": (*FAMILIES, "cable"), "chains": 8, "limit": 1.0, "seed": 11},
}
# Without friction, by options of `random_mechanism`.
SURFACES: dict[str, dict[str, Any]] = {
    "every kind": {"surface": "mixed", "contacts": 5, "chains": 8},
    "balls": {"surface": ("ellipsoid", "quadratic"), "ball_radius": 4.0},
    "profile": {"surface": "profile", "contacts": 1},
}
MOTION = ("pose", "pose_rate", "pose_acceleration", "joint_rate", "joint_acceleration")


@cache
def case(name: str) -> Rubbing:
    if name in DRAWN:
        return drawn(**{"count": 3, **DRAWN[name]})
    if name in families.ALL:
        return Rubbing(families.case(name).raw, families.case(name).states)
    rng = np.random.default_rng(7)
    if name in BUNDLED:
        raw = raw_file(BUNDLED_FOLDER / f"{name}.toml")
    else:
        raw = random_mechanism(rng, condition=100.0, **SURFACES[name])
    return Rubbing(raw, random_state(rng, raw, 3))


@cache
def by_numpy(name: str) -> Model:
    several = name == "every family"  # other efforts of mixed units have no least norm
    distribution = "minimax" if several else None
    return Model(case(name).mechanism, distribution=distribution, backend="numpy")


def given_to(c: Rubbing, m: Model) -> list[Array]:
    """q and q' in the order of the model, efforts of sizes that the joints know, and the load."""
    rng, s = np.random.default_rng(1), c.states
    order = [s["names"].index(name) for name in m.independent]
    sizes = [0.2 if chain["kind"] == "RSS" else 10.0 for chain in c.raw["chain"]]
    effort = rng.normal(0, 1, (len(s["q"]), len(sizes))) * sizes
    point = c.mechanism.platform.points[s["load_point"]] if s["load_point"] else np.zeros(3)
    load = s["wrench"], point + 0 * s["wrench"][:, :3]
    return [s["q"][:, order], s["qd"][:, order], effort, *load]


def tree(engine: Any, c: Rubbing, effort: Array, i: int) -> list[Any]:
    s = c.states
    given = s["pose"][i], s["pose_rate"][i], effort[i], s["wrench"][i], s["load_point"]
    return forward_dynamics(engine, c.raw, *given)


IN_ENGINES = ["RSS k1 n8", "mixed k3", "masticatory-curved", "PSS k1 ball", "RSS k5", "hexaglide"]


@pytest.mark.parametrize("name", first(IN_ENGINES, 3))
def test_tree_with_its_loops_closed(name: str) -> None:
    """Pinocchio and MuJoCo know nothing of condyle."""
    c, model = case(name), by_numpy(name)
    engines = [PinocchioEngine(c.raw)]
    engines += [MujocoEngine(c.raw)] if name in BUNDLED or "n8" in name else []
    given = given_to(c, model)
    ours = model.forward_dynamics(*given, outputs=("pose_acceleration",))
    assert not ours.status.any()
    for i in range(len(given[0])):
        for engine in engines:
            (theirs,) = tree(engine, c, given[2], i)
            close(ours.pose_acceleration[i], theirs.acceleration, 1e-9)
            close(ours.contact_force[i], theirs.force, 1e-9)


@pytest.mark.parametrize(("contacts", "mu", "seed"), [(2, 6.0, 1), (3, 2.0, 2)])
def test_patterns_are_those_of_the_tree(contacts: int, mu: float, seed: int) -> None:
    """Friction so strong that no motion, or more than one, is consistent with it."""
    c = drawn(seed, count=25, mu=mu, lossy=False, contacts=contacts)
    model = Model(c.mechanism, backend="numpy")
    given = given_to(c, model)
    found = model.forward_dynamics(*given, outputs=("pose_acceleration",))
    engine, counts = PinocchioEngine(c.raw), []
    for i in range(len(given[0])):
        patterns = tree(engine, c, given[2], i)
        counts.append(len(patterns))
        assert found.status[i] == (Status.jammed, Status.ok, *[Status.ambiguous] * 7)[len(patterns)]
        if len(patterns) == 1:
            close(found.pose_acceleration[i], patterns[0].acceleration, 1e-8)
            close(found.contact_force[i], patterns[0].force, 1e-8)
        else:
            assert np.isnan([*found.acceleration[i], *found.contact_force[i]]).all()
    assert 1 in counts and {0, 2} & {*counts}


BALANCED = ["every family", "every kind", "profile", "muscle_k0"]
MORE = ["mixed_k1_n7", "rss_k3_n7", "sps_along_x", "balls"]


@pytest.mark.parametrize("name", first([*BALANCED, *MORE], 4))
def test_free_bodies_are_in_balance(name: str) -> None:
    """Six equations of free bodies a sample, by the accelerations that come out."""
    c, model = case(name), by_numpy(name)
    given, s = given_to(c, model), c.states
    found = model.forward_dynamics(*given, outputs="all")
    assert not found.status.any()
    for i in range(0, len(given[0]), 2):
        state = s["pose"][i], s["pose_rate"][i], found.pose_acceleration[i]
        b, force = balance(c.raw, *state, s["wrench"][i], s["load_point"]), found.contact_force[i]
        terms = [b.C @ given[2][i], b.N @ force, -b.T @ np.abs(force), -b.b]
        close(sum(terms), np.zeros(6), 1e-10, np.abs(terms).max())
        rubs = b.rubbing()
        close(found.slip[i, rubs], b.slip[rubs], 1e-11)
        close(found.friction_force[i], -np.abs(force)[:, None] * b.drag, 1e-10)


def test_energy_of_a_fall_stays_and_contacts_are_kept() -> None:
    """Four freedoms for 10 ms; the integrator keeps 1e-11 a step, of tens."""
    raw = random_mechanism(np.random.default_rng(6), surface="quadratic", condition=100.0)
    d, model = read(raw), Model(parse(toml_text(raw)), backend="numpy")
    effort, one = np.zeros(len(d.chains)), model.unchecked().forward_dynamics

    def slope(t: float, x: Array) -> Array:
        return np.r_[x[4:], one(x[:4], x[4:], effort)]

    begin, t = np.r_[np.zeros(4), 0.02, -0.03, 0.5, -0.4], np.linspace(0, 0.01, 9)
    x = solve_ivp(slope, (0, t[-1]), begin, "DOP853", t, rtol=1e-11, atol=1e-13).y.T
    states = model.forward_dynamics(x[:, :4], x[:, 4:], 0 * x[:, :1] + effort, outputs="all")
    motions = map(platform_motion, states.pose, states.pose_rate)
    kinetic, potential = np.array([energy(d, motion) for motion in motions]).T
    assert np.ptp(kinetic) > 0.01 * kinetic.max()
    assert np.ptp(kinetic + potential) < 1e-9 * kinetic.max()
    assert max(np.abs(residuals(d, pose)).max() for pose in states.pose) < 1e-13


# Least norms of three contacts and more with friction take their time.
UNDONE = ["RSS k2 n8 quadratic", "masticatory", "PSS k1 ball", "mixed k3", "gough-stewart"]


@pytest.mark.parametrize("name", first(UNDONE, 2))
def test_inverse_undoes_forward(name: str) -> None:
    """Of the efforts that make a motion, the motion; with friction, and the same forces."""
    c, model = case(name), by_numpy(name)
    q, q1, _, *load = given_to(c, model)
    q2 = c.states["qdd"][:, [c.states["names"].index(x) for x in model.independent]]
    efforts = model.inverse_dynamics(q, q1, q2, *load, outputs=MOTION)
    found = model.forward_dynamics(q, q1, efforts.effort, *load, outputs=MOTION)
    good = efforts.status == 0
    assert good.any() and not found.status[good].any()
    close(found.acceleration[good], q2[good], 1e-10)
    for result in ("contact_force", *MOTION):
        close(getattr(found, result)[good], getattr(efforts, result)[good], 1e-10)


def test_formulations_the_robust_path_and_backends_agree(compiler_command: object) -> None:
    """The robust path: samples that a kernel would doubt, by singular values and all patterns."""
    c, model = case("RSS k1 n8"), by_numpy("RSS k1 n8")
    given = given_to(c, model)
    wanted = model.forward_dynamics(*given, outputs=("joint_acceleration",))
    assert not wanted.status.any()
    for formulation in FORMULATIONS:
        other = Model(c.mechanism, formulation=formulation, backend="numpy")
        found = other.forward_dynamics(*given, outputs=("joint_acceleration",))
        for result in ("acceleration", "contact_force", "joint_acceleration"):
            close(getattr(found, result), getattr(wanted, result), 1e-10)
    own = model._arguments
    _, inputs = own.samples((own.q, own.v, own.effort), given[:3], *given[3:])
    answer = model.kernel("forward", ("contact", "motion", "joint", "sliding")).run(inputs)
    robust, status = model.system.robust.forward(inputs)
    assert not answer.status.any() and not status.any()
    for result, value in answer.values.items():
        close(robust[result], value, 1e-9)
    compiled = Model(c.mechanism, backend="compiled")
    found = compiled.forward_dynamics(*given)
    close(found.acceleration, wanted.acceleration, 1e-12)
    close(found.contact_force, wanted.contact_force, 1e-12)
    ones = [compiled.unchecked().forward_dynamics(*sample) for sample in zip(*given, strict=True)]
    close(ones, wanted.acceleration, 1e-12)
    close(model.unchecked().forward_dynamics(*(a[0] for a in given)), wanted.acceleration[0], 1e-15)


@pytest.mark.parametrize("name", ["masticatory", "PSS k1 ball"])
def test_slopes_of_the_state(name: str) -> None:
    """A and B are derivatives of the accelerations, which `test_digits` holds to 60 digits."""
    c, model = case(name), by_numpy(name)
    q, q1, effort, *load = given_to(c, model)
    about, (N, m), n = model.linearise(q, q1, effort, *load), q.shape, effort.shape[1]
    assert about.A.shape == (N, 2 * m, 2 * m) and about.B.shape == (N, 2 * m, n)
    found = np.concatenate([about.A, about.B], axis=2)
    above = np.hstack([np.zeros((m, m)), np.eye(m), np.zeros((m, n))])
    np.testing.assert_array_equal(found[:, :m], np.broadcast_to(above, (N, *above.shape)))
    given = dict(zip(("q", "v", "effort", "wrench", "at"), (q, q1, effort, *load), strict=True))
    d = model.derivatives("acceleration", ("q", "v", "effort"), **given)
    slopes = [d["acceleration", by] for by in ("q", "v", "effort")]
    close(found[:, m:], np.concatenate(slopes, axis=2), 1e-12)


def test_statuses_and_what_does_not_fit() -> None:
    c, model = case("masticatory"), by_numpy("masticatory")
    given = given_to(c, model)
    with pytest.raises(InputError, match=r"unknown output 'joints'.* joint"):
        model.forward_dynamics(*given, outputs=("joints",))
    wanted = r"effort: expected numbers in an array of shape \(..., 6\): temporalis"
    with pytest.raises(InputError, match=wanted):
        model.forward_dynamics(*given[:2], given[2][:, :4], *given[3:])
    given = [np.repeat(a[:1], 3, axis=0) for a in given]
    given[0][1, 0], given[2][2, 1] = 0.5, np.nan  # metres
    found = model.forward_dynamics(*given)
    assert [*found.status] == [Status.ok, Status.unreachable, Status.overflow]
    assert np.isnan(found.acceleration[1:]).all()
    assert np.isnan(model.unchecked().forward_dynamics(*(a[1] for a in given))).all()
    about = model.linearise(*given)
    for matrix in (about.A, about.B):
        assert np.isfinite(matrix[0]).all() and np.isnan(matrix[1:]).all()
    # Without motion and weight no force has a sign: all patterns say the same, it is not jammed.
    light = Model(case("RSS k1 n8").mechanism.replace(gravity=(0.0, 0.0, 0.0)), backend="numpy")
    found = light.forward_dynamics(np.zeros(5), np.zeros(5), np.zeros(8))
    assert not found.status.any()
    assert np.abs(found.acceleration).max() == 0 == np.abs(found.contact_force).max()
