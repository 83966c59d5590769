"""Ligaments, against their forces as wrenches on the same machine without them.

The oracle has lines, tensions and speeds from the points of the file by itself, the speeds by
central differences.
"""

import numpy as np
import pytest

import condyle
from condyle.dynamics import FORMULATIONS
from condyle.errors import CondyleWarning
from condyle.export.mjcf import mjcf
from condyle.mechanism import parse
from condyle.mechanism.coordinates import rotations
from condyle.report.scene import parts_of, place

STEP = 1e-6  # s, of central differences
TABLE = ((0.0, 0.0), (0.01, 4.0), (0.05, 30.0), (0.2, 200.0))


def with_ligaments(name="masticatory", slack=(0.97, 0.98, 1.3)):
    """Two that are taut at home, one by a table, and one that is slack; scaled by their lines."""
    bare = condyle.load_mechanism(name)
    found = []
    for i, (part, stiffness) in enumerate(zip(slack, (2500.0, TABLE, 4000.0), strict=True)):
        insertion = np.array(bare.chains[i].platform) * [0.9, 1.0, 1.1]
        base = insertion + np.array([0.004 * i - 0.01, 0.003, 0.03])
        found.append(
            {
                "name": f"ligament_{i}",
                "base": base.tolist(),
                "platform": insertion.tolist(),
                "slack_length": part * float(np.linalg.norm(insertion - base)),
                "stiffness": stiffness,
                "damping": 12.0 * i,
            }
        )
    return bare, bare.replace(ligaments=tuple(found))


def lines(mechanism, pose):
    """From base to insertion, (N, L, 3)."""
    R = rotations(pose[:, 3:])
    ends = [pose[:, :3] + R @ np.array(one.platform) - one.base for one in mechanism.ligaments]
    return np.stack(ends, axis=1)


def tensions(mechanism, pose, rate):
    """Lengths and forces, (N, L) each."""
    length, ahead, before = (
        np.linalg.norm(lines(mechanism, pose + s * STEP * rate), axis=2) for s in (0, 1, -1)
    )
    speed, force = (ahead - before) / (2 * STEP), np.zeros_like(length)
    for i, one in enumerate(mechanism.ligaments):
        beyond = length[:, i] - one.slack_length
        if isinstance(one.stiffness, tuple):
            strain, known = np.transpose(one.stiffness)
            strain, known = (np.append(x, 2 * x[-1] - x[-2]) for x in (strain, known))
            elastic = np.interp(beyond / one.slack_length, strain, known)
        else:
            elastic = one.stiffness * beyond
        damped = np.clip(one.damping * speed[:, i], -np.abs(elastic), np.abs(elastic))
        force[:, i] = np.where(beyond > 0, elastic + damped, 0)
    return length, force


def wrench(mechanism, pose, rate):
    """Of all ligaments on the platform about O_M, (N, 6)."""
    d, (length, force) = lines(mechanism, pose), tensions(mechanism, pose, rate)
    pull = -d / length[..., None] * force[..., None]
    R = rotations(pose[:, 3:])
    arms = np.stack([R @ np.array(one.platform) for one in mechanism.ligaments], axis=1)
    return np.concatenate([pull.sum(axis=1), np.cross(arms, pull).sum(axis=1)], axis=1)


def states(model, count, seed=3, size=1.0):
    rng = np.random.default_rng(seed)
    sizes = np.where([name in "XYZ" for name in model.independent], 0.002, 0.03)
    return (size * rng.normal(size=(count, len(sizes))) * sizes * k for k in (1, 10, 100))


@pytest.mark.parametrize("route", ["core", "direct"])
@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_they_are_a_part_of_the_balance(formulation: str, route: str) -> None:
    bare, mechanism = with_ligaments()
    choice = {"formulation": formulation, "route": route, "backend": "numpy"}
    model, without = condyle.Model(mechanism, **choice), condyle.Model(bare, **choice)
    q, v, a = states(model, 20)
    found = model.inverse_dynamics(q, v, a, outputs="all")
    assert (found.status == 0).all()
    own = wrench(mechanism, found.pose, found.pose_rate)
    _, force = tensions(mechanism, found.pose, found.pose_rate)
    assert (force[:, :2] > 0.1).mean() > 0.3 and (force[:, 2] == 0).all()
    expected = without.inverse_dynamics(q, v, a, own, at=(0, 0, 0))
    scale = np.abs(expected.effort).max()
    np.testing.assert_allclose(found.effort, expected.effort, atol=1e-8 * scale)
    np.testing.assert_allclose(found.contact_force, expected.contact_force, atol=1e-6)
    shares = dict(zip(model.parts, found.share.swapaxes(0, 1), strict=True))
    np.testing.assert_allclose(sum(shares.values()), found.effort, atol=1e-9 * scale)
    alone = expected.effort - without.inverse_dynamics(q, v, a).effort
    np.testing.assert_allclose(shares["passive"], alone, atol=1e-8 * scale)
    back = model.forward_dynamics(q, v, found.effort)
    np.testing.assert_allclose(back.acceleration, a, rtol=1e-8, atol=1e-7)


def test_lengths_and_forces_are_results(tmp_path) -> None:
    _, mechanism = with_ligaments()
    motion = condyle.reference_motion()
    solution = condyle.Model(mechanism, backend="numpy").solve(motion)
    pose, rate = solution["pose"].values, solution["pose_rate"].values
    length, force = tensions(mechanism, pose, rate)
    np.testing.assert_allclose(solution["ligament_length"], length, rtol=1e-12)
    np.testing.assert_allclose(solution["ligament_force"], force, atol=1e-5)
    assert "passive" in solution["part"].values
    solution.condyle.save(tmp_path / "s.nc")
    solution.condyle.save(tmp_path / "s.csv")
    again = condyle.open_solution(tmp_path / "s.nc")
    np.testing.assert_array_equal(again["ligament_force"], solution["ligament_force"])
    assert "ligament_ligament_1" in (tmp_path / "s.csv").read_text().partition("\n")[0]
    bare = condyle.Model("masticatory", backend="numpy").solve(motion)
    assert "ligament_force" not in bare and "ligament" not in bare.dims


def test_the_regressor_has_them_in_its_load() -> None:
    bare, mechanism = with_ligaments()
    model, without = (condyle.Model(m, backend="numpy") for m in (mechanism, bare))
    q, v, a = states(model, 5)
    pose = model.inverse_dynamics(q, v, a, outputs="all")
    own = wrench(mechanism, pose.pose, pose.pose_rate)
    found, expected = model.regressor(q, v, a), without.regressor(q, v, a, own, at=(0, 0, 0))
    for name in ("Y", "load"):
        np.testing.assert_allclose(
            getattr(found, name), getattr(expected, name), rtol=1e-7, atol=1e-7
        )


def test_derivatives_where_smooth() -> None:
    _, mechanism = with_ligaments()
    model = condyle.Model(mechanism, backend="numpy")
    q, v, a = (x[0] for x in states(model, 1))
    paths = [
        "ligament.ligament_0.stiffness",
        "ligament.ligament_1.stiffness",
        "ligament.ligament_1.slack_length",
        "ligament.ligament_1.damping",
        "ligament.ligament_0.base",
        "ligament.ligament_0.platform",
    ]
    found = model.derivatives("effort", ["q", "v", *paths], q=q, v=v, a=a)
    h = 1e-6
    for name, given in (("q", q), ("v", v)):
        for i in range(len(q)):
            ends = []
            for sign in (1, -1):
                moved = given.copy()
                moved[i] += sign * h
                there = (moved, v, a) if name == "q" else (q, moved, a)
                ends.append(model.inverse_dynamics(*there).effort)
            slope = (ends[0] - ends[1]) / (2 * h)
            np.testing.assert_allclose(found["effort", name][..., i], slope, rtol=2e-5, atol=1e-5)
    for path in paths:
        value = np.array(mechanism.get(path), dtype=float)
        for entry in [(2, 0), (1, 1)] if value.ndim == 2 else list(np.ndindex(value.shape))[:1]:
            ends = []
            step = 1e-6 * max(abs(value[entry]), 1e-2)
            for sign in (1, -1):
                moved = value.copy()
                moved[entry] += sign * step
                there = condyle.Model(mechanism.set(path, moved), backend="numpy")
                ends.append(there.inverse_dynamics(q, v, a).effort)
            slope = (ends[0] - ends[1]) / (2 * step)
            got, floor = found["effort", path][(..., *entry)], 1e-6 * np.abs(slope).max() + 1e-7
            np.testing.assert_allclose(got, slope, rtol=1e-4, atol=floor)


@pytest.mark.parametrize(
    ("stiffness", "text"),
    [
        (-1.0, "a value above 0"),
        ([[0, 0], [0.1, -1]], "forces that do not fall"),
        ([[0, 1], [0.1, 2]], r"begins with \[0, 0\]"),
        ([[0, 0]], "2 to 50 rows"),
        ([[0, 0, 1], [1, 2, 3]], r"rows of \[strain, force in N\]"),
        ([[0, 0], [0.1, "x"]], "every entry is a number"),
    ],
)
def test_bad_stiffnesses_are_refused(stiffness, text: str) -> None:
    _, mechanism = with_ligaments()
    with pytest.raises(condyle.MechanismError, match=text):
        mechanism.set("ligament.ligament_0.stiffness", stiffness)


def test_files_names_and_pictures_have_them() -> None:
    bare, mechanism = with_ligaments()
    assert parse(condyle.dumps(mechanism)) == mechanism
    assert "ligament" not in condyle.dumps(bare)
    assert "3 (ligament_0, ligament_1, ligament_2)" in str(mechanism)
    twice = mechanism.ligaments[0]
    with pytest.raises(condyle.MechanismError, match=r'"ligament_0" is given 2 times'):
        mechanism.replace(ligaments=(twice, twice))
    with pytest.warns(CondyleWarning, match="slack length too short"):
        mechanism.set("ligament.ligament_0.slack_length", 0.001)


def test_recruitment_of_muscles_bears_them() -> None:
    bare, mechanism = with_ligaments("human-jaw-muscles")
    model, without = (condyle.Model(m, backend="numpy") for m in (mechanism, bare))
    q, v, a = (x / 3 for x in states(model, 6))
    found = model.inverse_dynamics(q, v, a, outputs="all")
    own = wrench(mechanism, found.pose, found.pose_rate)
    expected = without.inverse_dynamics(q, v, a, own, at=(0, 0, 0))
    np.testing.assert_array_equal(found.status, expected.status)
    assert (found.status == 0).sum() > 2
    np.testing.assert_allclose(found.effort, expected.effort, atol=1e-4)


def test_pictures_draw_them() -> None:
    _, mechanism = with_ligaments("human-jaw-muscles")
    pose = np.zeros((1, 6))
    scene = place(mechanism, pose, np.zeros((1, len(mechanism.chains))))
    bars = [bar.chain for bar in parts_of(mechanism, scene).bars]
    assert bars == [f'ligament "ligament_{i}"' for i in range(3)]
    ends = scene.chains[bars[0]].points
    np.testing.assert_allclose(ends["B"], mechanism.ligaments[0].base)
    np.testing.assert_allclose(ends["M"][0], mechanism.ligaments[0].platform)


def test_mujoco_has_the_same_pull() -> None:
    mujoco = pytest.importorskip("mujoco", reason="mujoco is in the `bench` extra")
    _, mechanism = with_ligaments()
    one = mechanism.ligaments[0]
    made = mjcf(mechanism.replace(ligaments=(one,)))
    model = mujoco.MjModel.from_xml_string(made.text)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    at = model.tendon("ligament_0").id
    assert data.ten_length[at] == pytest.approx(one.length, rel=1e-9)
    held = model.tendon_lengthspring[at]
    pull = model.tendon_stiffness[at] * (data.ten_length[at] - held[1])
    assert pull == pytest.approx(tensions(mechanism, np.zeros((1, 6)), np.zeros((1, 6)))[1][0, 0])


@pytest.mark.slow
@pytest.mark.usefixtures("compiler_command")
def test_compiled() -> None:
    _, mechanism = with_ligaments()
    model = condyle.Model(mechanism, backend="compiled")
    q, v, a = states(model, 9)
    wanted = condyle.Model(mechanism, backend="numpy").inverse_dynamics(q, v, a).effort
    size = np.abs(wanted).max()
    np.testing.assert_allclose(model.inverse_dynamics(q, v, a).effort, wanted, atol=1e-11 * size)


@pytest.mark.slow
def test_exported_code_has_them(tmp_path) -> None:
    """The package compares its own functions with recorded samples."""
    _, mechanism = with_ligaments()
    made = condyle.export_c(mechanism, tmp_path, question="inverse", constants="struct", lanes=0)
    assert not made.notes
    assert "ligament_1: N/m, or strain" in next(tmp_path.glob("*.h")).read_text()


def test_variants_differ_by_them() -> None:
    _, mechanism = with_ligaments()
    model = condyle.Model(mechanism, backend="numpy")
    path, values = "ligament.ligament_0.stiffness", [500.0, 3000.0, -1.0]
    q, v, a = states(model, 4)
    found = model.variants({path: values}).inverse_dynamics(q, v, a)
    for i, value in enumerate(values[:2]):
        alone = condyle.Model(mechanism.set(path, value), backend="numpy")
        wanted = alone.inverse_dynamics(q, v, a).effort
        np.testing.assert_allclose(found.effort[i], wanted, rtol=1e-9, atol=1e-9)
    assert np.isnan(found.effort[2]).all()
