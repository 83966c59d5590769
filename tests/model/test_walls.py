"""Walls: forces in reach of inverse dynamics, springs of a simulation.

The oracle has places, normals and wrenches from the file by itself, and quadprog for recruitment.
"""

import numpy as np
import pytest

import condyle
from condyle.errors import UnsupportedError
from condyle.mechanism import parse
from condyle.mechanism.coordinates import rotations
from condyle.status import Status

STRENGTH = 20_000.0  # N


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
    [("human-jaw", "bounded"), ("human-jaw", "weighted"), ("human-jaw-muscles", "weighted")],
)
def test_they_are_recruited_as_by_another_solver(name: str, distribution: str) -> None:
    quadprog = pytest.importorskip("quadprog", reason="quadprog is in the `bench` extra")
    bare, mechanism = with_walls(name)
    choice = {"distribution": distribution, "backend": "numpy"}
    model, without = condyle.Model(mechanism, **choice), condyle.Model(bare, **choice)
    q, v, a = states(25)
    load = [5.0, 40.0, -60.0, 0, 0, 0]
    found = model.inverse_dynamics(q, v, a, load, at="right_molar", outputs="all")
    gap, wrench = gaps_and_wrenches(mechanism, found.pose)
    near = gap < 4e-4
    good = found.status == Status.ok
    assert good.sum() > 10
    force = found.wall_force
    assert (force[good] >= 0).all() and (force[good][~near[good]] == 0).all()
    assert (force[good].max(axis=0)[:2] > 1).any()
    # On the machine without walls their forces are a load, and its efforts are the same.
    own = np.einsum("nw,nwi->ni", np.where(good[:, None], force, 0.0), wrench)
    arm = rotations(found.pose[:, 3:]) @ np.array(bare.platform.points["right_molar"])
    own += np.hstack([np.broadcast_to(load[:3], arm.shape), np.cross(arm, load[:3])])
    other = without.inverse_dynamics(q, v, a, own, at=(0, 0, 0))
    np.testing.assert_allclose(found.effort[good], other.effort[good], atol=1e-5)
    if name != "human-jaw":
        return
    ports = {n: getattr(found, n) for n in ("pose", "pose_rate", "pose_acceleration")}
    ports |= {"force": np.broadcast_to(load[:3], arm.shape), "moment": 0 * arm}
    ports |= {"point": np.broadcast_to(bare.platform.points["right_molar"], arm.shape)}
    s = {n: np.moveaxis(x, -1, 0) for n, x in without.kernel("balance").run(ports).values.items()}
    greatest = np.array([chain.actuator.effort_range[1] for chain in bare.chains])
    n, scale = len(greatest), np.array([1, 1, 1, 50, 50, 50.0])[:, None]
    measure = greatest if distribution == "weighted" else np.ones(n)
    for i in np.flatnonzero(good):
        walls = STRENGTH * (near[i][:, None] * wrench[i]).T
        C = np.hstack([s["J"][i] * measure, walls, s["normal"][i].T]) * scale
        w, k = walls.shape[1], s["normal"].shape[1]
        pushes = np.diag([float(c.push) for c in bare.contacts])
        rows = [C, np.eye(n + w, n + w + k), -np.eye(n, n + w + k)]
        rows = np.vstack([*rows, np.hstack([np.zeros((k, n + w)), pushes])])
        right = [s["Q"][i] * scale[:, 0], np.zeros(n + w), -greatest / measure, np.zeros(k)]
        G = np.diag(np.r_[np.ones(n + w), np.full(k, 1e-13)])
        x = quadprog.solve_qp(G, np.zeros(n + w + k), rows.T, np.concatenate(right), 6)[0]
        np.testing.assert_allclose(found.effort[i], measure * x[:n], atol=1e-5)
        np.testing.assert_allclose(force[i], STRENGTH * x[n : n + w] * near[i], atol=1e-5)


def test_cubic_with_muscles_and_shares_add_up() -> None:
    _, mechanism = with_walls("human-jaw-muscles")
    model = condyle.Model(mechanism, backend="numpy")
    q, v, a = states(8)
    found = model.inverse_dynamics(q, v, a, [5, 40, -60, 0, 0, 0], at="right_molar", outputs="all")
    good = found.status == Status.ok
    assert model.distribution.name == "cubic" and good.sum() > 3
    assert found.wall_force[good].max() > 1
    np.testing.assert_allclose(found.share[good].sum(axis=1), found.effort[good], atol=1e-7)


def test_they_are_off_and_refused_where_nothing_knows_them() -> None:
    bare, off = with_walls(enabled=False)
    q, v, a = states(5)
    plain, same = (condyle.Model(m, backend="numpy") for m in (bare, off))
    np.testing.assert_array_equal(
        same.inverse_dynamics(q, v, a).effort, plain.inverse_dynamics(q, v, a).effort
    )
    assert "3 (wall_0, wall_1, wall_2); off" in str(off)
    assert parse(condyle.dumps(off)) == off
    on = condyle.Model(off.set({f"wall.{name}.enabled": True for name in off.wall_names}),
                       backend="numpy")  # fmt: skip
    least = on.with_distribution("minimum_norm")
    assert (least.inverse_dynamics(q, v, a, outputs="all").wall_force == 0).all()
    with pytest.raises(UnsupportedError, match="enabled to false"):
        on.derivatives("effort", "q", q=q, v=v, a=a)


@pytest.mark.slow
@pytest.mark.usefixtures("compiler_command")
def test_a_simulation_has_springs_in_their_place() -> None:
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


def test_check_says_what_is_there() -> None:
    told = condyle.check("human-jaw-muscles")
    assert told.data["walls"]["medial_left"]["enabled"] is False
    assert told.data["ligaments"]["capsule_left"]["strain"] < 0
    text = str(told)
    assert "line 10.77 mm, slack at home" in text
    assert "gap 0 mm at home, reach 0.2 mm, off" in text
