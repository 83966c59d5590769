"""Walls: forces in reach of inverse dynamics, springs of a simulation.

The oracle has places, normals and wrenches from the file by itself, and recruitment by its
conditions of optimality.
"""

import numpy as np
import pytest
from distribution.oracle import unexplained

import condyle
from condyle.errors import UnsupportedError
from condyle.mechanism import parse
from condyle.mechanism.coordinates import rotations
from condyle.status import Status

from .test_muscles import MOMENTS, equations

pytestmark = pytest.mark.slow
STRENGTH = 20_000.0  # N
LOAD = [5.0, 40.0, -60.0, 0, 0, 0]


def with_walls(name="human-jaw", **changes):
    """A medial and a posterior wall of the left condyle, and a medial one of the right."""
    bare = condyle.load_mechanism(name)
    walls = []
    for contact, slope, side, gap in (
        (bare.contacts[0], (0.0, 57.29), "above", 1e-4),
        (bare.contacts[0], (57.29, 0.0), "below", 1e-4),
        (bare.contacts[1], (0.0, -57.29), "above", 5e-3),
    ):
        x, y, z = contact.point
        push = 1 if side == "above" else -1
        steep = np.hypot(1, np.linalg.norm(slope))
        offset = z - slope[0] * x - slope[1] * y - push * gap * steep
        surface = {"kind": "plane", "slope": slope, "offset": float(offset)}
        wall = {"name": f"wall_{len(walls)}", "point": contact.point, "surface": surface}
        wall |= {"side": side, "reach": 4e-4, "stiffness": 2e4, "damping": 5.0}
        walls.append(wall | changes)
    return bare, bare.replace(walls=tuple(walls))


def gaps_and_wrenches(mechanism, pose):
    """(N, W) and (N, W, 6), the latter about O_M."""
    R, gaps, wrenches = rotations(pose[:, 3:]), [], []
    for wall in mechanism.walls:
        arm = R @ np.array(wall.point)
        a, b = wall.surface.slope
        normal = np.array([-a, -b, 1]) * (1 if wall.side == "above" else -1)
        normal /= np.linalg.norm(normal)
        gaps.append((pose[:, :3] + arm - [0, 0, wall.surface.offset]) @ normal)
        both = np.broadcast_to(normal, arm.shape)
        wrenches.append(np.hstack([both, np.cross(arm, both)]))
    return np.stack(gaps, axis=1), np.stack(wrenches, axis=1)


def states(count, seed=2):
    rng = np.random.default_rng(seed)
    q = rng.uniform([-5e-4, -5e-4, -0.01, 0], [5e-4, 5e-4, 0.01, 0.02], (count, 4))
    return q, rng.normal(size=(count, 4)) * 0.01, rng.normal(size=(count, 4)) * 0.1


@pytest.mark.parametrize(
    ("name", "distribution"),
    [("human-jaw", "bounded"), ("human-jaw", "weighted"), ("human-jaw-muscles", "cubic")],
)
def test_they_are_recruited_and_their_forces_are_a_load(name: str, distribution: str) -> None:
    bare, mechanism = with_walls(name)
    choice = {"distribution": distribution, "backend": "numpy"}
    model, without = condyle.Model(mechanism, **choice), condyle.Model(bare, **choice)
    q, v, a = states(16)
    found = model.inverse_dynamics(q, v, a, LOAD, at="right_molar", outputs="all")
    gap, wrench = gaps_and_wrenches(mechanism, found.pose)
    near = gap < 4e-4
    good = found.status == Status.ok
    assert good.sum() > 6
    force = found.wall_force
    assert (force[good] >= 0).all() and (force[good][~near[good]] == 0).all()
    assert (force[good].max(axis=0)[:2] > 1).any()
    np.testing.assert_allclose(found.share[good].sum(axis=1), found.effort[good], atol=1e-7)
    # On the machine without walls their forces are a load, and its efforts are the same.
    own = np.einsum("nw,nwi->ni", np.where(good[:, None], force, 0.0), wrench)
    arm = rotations(found.pose[:, 3:]) @ np.array(bare.platform.points["right_molar"])
    own += np.hstack([np.broadcast_to(LOAD[:3], arm.shape), np.cross(arm, LOAD[:3])])
    other = without.inverse_dynamics(q, v, a, own, at=(0, 0, 0))
    np.testing.assert_allclose(found.effort[good], other.effort[good], atol=1e-5)
    if name != "human-jaw":
        return
    s = equations(without, found, LOAD)
    n, greatest = 24, np.array([chain.actuator.effort_range[1] for chain in bare.chains])
    measure = greatest if distribution == "weighted" else np.ones(n)
    push = np.array([float(c.push) for c in bare.contacts])
    for i in np.flatnonzero(good):
        w = int(near[i].sum())
        # Efforts, walls and contact forces, 100 N of these.
        parts = s["J"][i] * measure, STRENGTH * wrench[i][near[i]].T, 100 * s["normal"][i].T
        x = np.r_[found.effort[i] / measure, force[i][near[i]] / STRENGTH]
        x = np.r_[x, found.contact_force[i] / 100]
        C = np.hstack(parts) * MOMENTS[:, None]
        assert np.abs(C @ x - s["Q"][i] * MOMENTS).max() < 1e-8 * np.abs(s["Q"][i]).max()
        low = np.r_[np.zeros(n + w), np.where(push > 0, 0.0, -np.inf)]
        high = np.r_[greatest / measure, np.full(w, np.inf), np.where(push > 0, np.inf, 0.0)]
        gradient = np.r_[x[: n + w], np.zeros(len(push))]
        assert unexplained(C, x, gradient, low, high) < 1e-7


def test_they_are_off_and_refused_where_nothing_knows_them() -> None:
    bare, off = with_walls(enabled=False)
    q, v, a = states(5)
    plain, same = (condyle.Model(m, backend="numpy") for m in (bare, off))
    np.testing.assert_array_equal(
        same.inverse_dynamics(q, v, a).effort, plain.inverse_dynamics(q, v, a).effort
    )
    assert "3 (wall_0, wall_1, wall_2); off" in str(off)
    assert parse(condyle.dumps(off)) == off
    enabled = off.set({f"wall.{name}.enabled": True for name in off.wall_names})
    on = condyle.Model(enabled, backend="numpy")
    least = on.with_distribution("minimum_norm")
    assert (least.inverse_dynamics(q, v, a, outputs="all").wall_force == 0).all()
    with pytest.raises(UnsupportedError, match="enabled to false"):
        on.derivatives("effort", "q", q=q, v=v, a=a)
    told = condyle.check("human-jaw-muscles")
    assert told.data["walls"]["medial_left"]["enabled"] is False
    assert told.data["ligaments"]["capsule_left"]["strain"] < 0
    assert "line 10.77 mm, slack at home" in str(told)
    assert "gap 0 mm at home, reach 0.2 mm, off" in str(told)


def test_a_simulation_has_springs_in_their_place(compiler_command: object) -> None:
    bare, mechanism = with_walls()
    mechanism = mechanism.set({f"contact.{c.name}.one_sided": False for c in bare.contacts})
    push = {"kind": "constant", "point": "left_molar", "force": [-6.0, 3.0, 2.0]}
    scenario = {"duration": 0.04, "rate": 5000, "rtol": 1e-9, "load": [push]}
    found = condyle.simulate(condyle.Model(mechanism), scenario)
    gap, _ = gaps_and_wrenches(mechanism, found["pose"].values)
    np.testing.assert_allclose(found["wall_gap"], gap, atol=1e-12)
    force = found["wall_force"].values
    assert (force >= 0).all() and (force[gap >= 0] == 0).all() and force.max() > 1
    rate = np.gradient(gap, found["time"].values, axis=0)
    elastic = np.maximum(-2e4 * gap, 0)
    wanted = elastic + np.clip(-5.0 * rate, -elastic, elastic)
    np.testing.assert_allclose(force, wanted, atol=0.02 * force.max())
    energy = found["energy"]
    kept = energy.sel(account="kinetic") + energy.sel(account="potential")
    work = energy.sel(account="load") + energy.sel(account="actuators")
    left = (kept - kept[0] - work).values
    assert np.abs(left).max() < 1e-6 * float(energy.sel(account="kinetic").max())
