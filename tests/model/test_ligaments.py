"""Ligaments, against their forces as wrenches on the same machine without them.

The oracle has lines, tensions and speeds from the points of the file by itself, the speeds by
central differences.
"""

from functools import cache

import numpy as np
import pytest
from support.families import close
from support.speeds import first

import condyle
from condyle.dynamics import FORMULATIONS
from condyle.errors import CondyleWarning
from condyle.export.mjcf import mjcf
from condyle.mechanism import parse
from condyle.mechanism.coordinates import rotations

pytestmark = pytest.mark.slow
STEP = 1e-6  # s, of central differences
TABLE = ((0.0, 0.0), (0.01, 4.0), (0.05, 30.0), (0.2, 200.0))


@cache
def with_ligaments(name="masticatory", slack=(0.97, 0.98, 1.3)):
    """Two that are taut at home, one by a table, and one that is slack; scaled by their lines."""
    bare, made = condyle.load_mechanism(name), []
    for i, (part, stiffness) in enumerate(zip(slack, (2500.0, TABLE, 4000.0), strict=True)):
        insertion = np.array(bare.chains[i].platform) * [0.9, 1.0, 1.1]
        base = insertion + np.array([0.004 * i - 0.01, 0.003, 0.03])
        ligament = {"name": f"ligament_{i}", "base": base.tolist(), "platform": insertion.tolist()}
        length = part * float(np.linalg.norm(insertion - base))
        own = {"slack_length": length, "stiffness": stiffness, "damping": 12.0 * i}
        made.append(ligament | own)
    return bare, bare.replace(ligaments=tuple(made))


@cache
def models(name="masticatory"):
    """Without ligaments and with."""
    return tuple(condyle.Model(m, backend="numpy") for m in with_ligaments(name))


def tensions(mechanism, pose, rate):
    """Lengths and forces, (N, L) each, and the wrench of all on the platform about O_M, (N, 6)."""

    def lines(pose):
        R = rotations(pose[:, 3:])
        arms = np.stack([R @ np.array(one.platform) for one in mechanism.ligaments], axis=1)
        return arms, pose[:, None, :3] + arms - [one.base for one in mechanism.ligaments]

    length, ahead, before = (
        np.linalg.norm(lines(pose + s * STEP * rate)[1], axis=2) for s in (0, 1, -1)
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
    arms, d = lines(pose)
    pull = -d / length[..., None] * force[..., None]
    wrench = np.concatenate([pull.sum(axis=1), np.cross(arms, pull).sum(axis=1)], axis=1)
    return length, force, wrench


def states(model, count, seed=3, size=1.0):
    rng = np.random.default_rng(seed)
    sizes = np.where([name in "XYZ" for name in model.independent], 0.002, 0.03)
    return (size * rng.normal(size=(count, len(sizes))) * sizes * k for k in (1, 10, 100))


CHOICES = [(f, ("core", "direct")[i % 2]) for i, f in enumerate(FORMULATIONS)]


@pytest.mark.parametrize(("formulation", "route"), first(CHOICES, 2))
def test_they_are_a_part_of_the_balance(formulation: str, route: str) -> None:
    choice = {"formulation": formulation, "route": route, "backend": "numpy"}
    (without, _), mechanism = models(), with_ligaments()[1]
    model = condyle.Model(mechanism, **choice)
    q, v, a = states(model, 20)
    found = model.inverse_dynamics(q, v, a, outputs="all")
    assert (found.status == 0).all()
    _, force, own = tensions(mechanism, found.pose, found.pose_rate)
    assert (force[:, :2] > 0.1).mean() > 0.3 and (force[:, 2] == 0).all()
    expected = without.inverse_dynamics(q, v, a, own, at=(0, 0, 0))
    close(found.effort, expected.effort, 1e-8)
    np.testing.assert_allclose(found.contact_force, expected.contact_force, atol=1e-6)
    shares = dict(zip(model.parts, found.share.swapaxes(0, 1), strict=True))
    close(sum(shares.values()), found.effort, 1e-9)
    alone = expected.effort - without.inverse_dynamics(q, v, a).effort
    close(shares["passive"], alone, 1e-8, np.abs(expected.effort).max())
    back = model.forward_dynamics(q, v, found.effort)
    np.testing.assert_allclose(back.acceleration, a, rtol=1e-8, atol=1e-7)


def test_the_regressor_has_them_in_its_load_and_muscles_bear_them() -> None:
    without, model = models()
    q, v, a = states(model, 5)
    pose = model.inverse_kinematics(q, v)
    own = tensions(model.mechanism, pose.pose, pose.pose_rate)[2]
    found, expected = model.regressor(q, v, a), without.regressor(q, v, a, own, at=(0, 0, 0))
    for name in ("Y", "load"):
        theirs = getattr(expected, name)
        np.testing.assert_allclose(getattr(found, name), theirs, rtol=1e-7, atol=1e-7)
    without, model = models("human-jaw-muscles")
    q, v, a = (x / 3 for x in states(model, 6))
    found = model.inverse_dynamics(q, v, a, outputs="all")
    own = tensions(model.mechanism, found.pose, found.pose_rate)[2]
    expected = without.inverse_dynamics(q, v, a, own, at=(0, 0, 0))
    np.testing.assert_array_equal(found.status, expected.status)
    assert (found.status == 0).sum() > 2
    np.testing.assert_allclose(found.effort, expected.effort, atol=1e-4)


def test_lengths_and_forces_are_results(tmp_path) -> None:
    bare, model = models()
    motion = condyle.Motion.from_csv(condyle.motion.bundled_reference()[0], rate=20)
    solution = model.solve(motion)
    pose, rate = (solution[name].values for name in ("pose", "pose_rate"))
    length, force, _ = tensions(model.mechanism, pose, rate)
    np.testing.assert_allclose(solution["ligament_length"], length, rtol=1e-12)
    np.testing.assert_allclose(solution["ligament_force"], force, atol=1e-5)
    assert "passive" in solution["part"].values
    solution.condyle.save(tmp_path / "s.nc")
    solution.condyle.save(tmp_path / "s.csv")
    again = condyle.open_solution(tmp_path / "s.nc")
    np.testing.assert_array_equal(again["ligament_force"], solution["ligament_force"])
    assert "ligament_ligament_1" in (tmp_path / "s.csv").read_text().partition("\n")[0]
    plain = bare.solve(motion)
    assert "ligament_force" not in plain and "ligament" not in plain.dims


def test_derivatives_and_variants_where_smooth() -> None:
    """Central differences by states, and by numbers of the file between variants."""
    _, model = models()
    q, v, a = (x[0] for x in states(model, 1))
    paths = {  # and of each which entry
        "ligament_0.stiffness": (), "ligament_1.stiffness": (2, 0), "ligament_1.slack_length": (),
        "ligament_1.damping": (), "ligament_0.base": (0,), "ligament_0.platform": (0,),
    }  # fmt: skip
    paths = {f"ligament.{path}": entry for path, entry in paths.items()}
    found = model.derivatives("effort", ["q", "v", *paths], q=q, v=v, a=a)
    h = 1e-6 * np.vstack([np.eye(4), -np.eye(4)])
    for name, moved in (("q", (q + h, v, a)), ("v", (q, v + h, a))):
        effort = model.inverse_dynamics(*moved).effort
        slope = (effort[:4] - effort[4:]).T / 2e-6
        np.testing.assert_allclose(found["effort", name], slope, rtol=2e-5, atol=1e-5)
    for path, entry in paths.items():
        value = np.array(model.mechanism.get(path), dtype=float)
        step, ends = 1e-6 * max(abs(value[entry]), 1e-2), np.stack([value, value])
        ends[(slice(None), *entry)] += [step, -step]
        effort = model.variants({path: ends}).inverse_dynamics(q, v, a).effort
        slope = (effort[0] - effort[1]) / (2 * step)
        got, floor = found["effort", path][(..., *entry)], 1e-6 * np.abs(slope).max() + 1e-7
        np.testing.assert_allclose(got, slope, rtol=1e-4, atol=floor)
    first = next(iter(paths))
    many = model.variants({first: [500.0, -1.0]}).inverse_dynamics(q, v, a).effort
    alone = condyle.Model(model.mechanism.set(first, 500.0), backend="numpy")
    wanted = alone.inverse_dynamics(q, v, a).effort
    np.testing.assert_allclose(many[0], wanted, rtol=1e-9, atol=1e-9)
    assert np.isnan(many[1]).all()


WRONG = [
    (-1.0, "a value above 0"),
    ([[0, 0], [0.1, -1]], "forces that do not fall"),
    ([[0, 1], [0.1, 2]], r"begins with \[0, 0\]"),
    ([[0, 0]], "2 to 50 rows"),
    ([[0, 0, 1], [1, 2, 3]], r"rows of \[strain, force in N\]"),
    ([[0, 0], [0.1, "x"]], "every entry is a number"),
]


def test_files_and_names() -> None:
    bare, mechanism = with_ligaments()
    assert parse(condyle.dumps(mechanism)) == mechanism
    assert "ligament" not in condyle.dumps(bare)
    assert "3 (ligament_0, ligament_1, ligament_2)" in str(mechanism)
    twice = mechanism.ligaments[0]
    with pytest.raises(condyle.MechanismError, match=r'"ligament_0" is given 2 times'):
        mechanism.replace(ligaments=(twice, twice))
    with pytest.warns(CondyleWarning, match="slack length too short"):
        mechanism.set("ligament.ligament_0.slack_length", 0.001)
    for stiffness, text in WRONG:
        with pytest.raises(condyle.MechanismError, match=text):
            mechanism.set("ligament.ligament_0.stiffness", stiffness)


def test_mujoco_has_the_same_pull() -> None:
    mujoco = pytest.importorskip("mujoco", reason="mujoco is in the `bench` extra")
    _, mechanism = with_ligaments()
    one = mechanism.ligaments[0]
    model = mujoco.MjModel.from_xml_string(mjcf(mechanism.replace(ligaments=(one,))).text)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    at = model.tendon("ligament_0").id
    assert data.ten_length[at] == pytest.approx(one.length, rel=1e-9)
    stretch = data.ten_length[at] - model.tendon_lengthspring[at][1]
    pull = tensions(mechanism, np.zeros((1, 6)), np.zeros((1, 6)))[1][0, 0]
    assert model.tendon_stiffness[at] * stretch == pytest.approx(pull)


def test_compiled_and_exported_code_has_them(tmp_path, compiler_command) -> None:
    """The package compares its own functions with recorded samples."""
    _, model = models()
    compiled = condyle.Model(model.mechanism, backend="compiled")
    q, v, a = states(model, 9)
    wanted = model.inverse_dynamics(q, v, a).effort
    close(compiled.inverse_dynamics(q, v, a).effort, wanted, 1e-11)
    choice = {"question": "inverse", "constants": "struct", "lanes": 0}
    assert not condyle.export_c(model.mechanism, tmp_path, **choice).notes
    assert "ligament_1: strain and force [N]" in next(tmp_path.glob("*.h")).read_text()
