"""The three kinds of singularity of Section 3.3, at poses built to have them."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from oracles.closure import complete_state
from oracles.random_mechanism import random_mechanism, random_state, toml_text
from oracles.rotations import per_twist
from support.machines import model as shared

import condyle
from condyle import SingularError
from condyle.kinematics.causes import require_ok
from condyle.kinematics.free_motion import FreeMotion
from condyle.kinematics.singularities import KINDS, Singularity
from condyle.mechanism import bundled_text, parse
from condyle.mechanism.files import from_data
from condyle.status import STATUS_NAMES


def unit(v: np.ndarray) -> np.ndarray:
    return v / np.linalg.norm(v)


def spatial(kinks: tuple[float, ...] = (0.3,) * 6, meeting: bool = False) -> dict[str, Any]:
    """Six chains around the Z axis; each crank is its kink, in rad, off the line of its rod.

    meeting: whether the lines of all rods meet the Z axis.
    """
    chains = []
    for i, kink in enumerate(kinks):
        third, side = 2 * np.pi * (i // 2) / 3 + 0.5 * (i > 5), 0.35 * (-1) ** i
        out = np.array([np.cos(third + side), np.sin(third + side), 0])
        joint = np.array([50 * np.cos(third), 50 * np.sin(third), 10.0 + side])
        tip = 90 * out + [0, 0, 60]
        if meeting:
            tip = joint + 1.5 * (joint - [0, 0, -40.0 + 7 * i])
        axis = unit(np.cross(out, [0, 0, 1]) + 0.2 * out)
        across = unit(np.cross(axis, tip - joint))
        crank = 25 * (np.cross(across, axis) * np.cos(kink) + across * np.sin(kink))
        places = {"base": tip + crank, "axis": axis, "crank_tip": tip, "platform": joint}
        chains.append(
            {"name": f"c{i}", "kind": "RSS", "crank": {"inertia": 1e-5}}
            | {name: list(place) for name, place in places.items()}
            | {"coupler": {"mass": 0.01, "com": 0.5, "transverse": 1e-6, "axial": 1e-8}}
        )
    platform = {"mass": 0.3, "inertia": {"xx": 1e-4, "yy": 1e-4, "zz": 1e-4}}
    return {"name": "spatial", "length_unit": "mm", "platform": platform, "chain": chains}


def at_home(raw: dict[str, Any]) -> tuple[Singularity, str]:
    """Measures, and what kind they are."""
    model = condyle.derive(from_data(raw), backend="numpy")
    s = model.poses.configuration(np.zeros((1, 6))).singularity
    return s, KINDS[s.kind()[0]]


def test_homes_that_are_regular_or_not() -> None:
    """J_A tells how far a crank is from in line, as a sine; no force along rods that meet an axis
    turns the platform about it."""
    s, kind = at_home(spatial())
    assert (kind, s.rank[0]) == ("none", 6)
    assert s.condition[0] == pytest.approx(1 / s.direct_ratio[0]) and 1 < s.condition[0] < 100
    stretched = (0.3, 0.3, 1e-4, 0.3, 0.3, 0.3)
    s, kind = at_home(spatial(stretched))
    assert (kind, s.rank[0], np.abs(s.transmission[0]).argmin()) == ("inverse", 6, 2)
    assert s.inverse_ratio[0] == s.ratio[0] < 1e-3 < s.direct_ratio[0]
    s, kind = at_home(spatial(meeting=True))
    assert (kind, s.rank[0]) == ("direct", 5) and s.direct_ratio[0] < 1e-12
    assert at_home(spatial(stretched, meeting=True))[1] == "combined"
    J_A = np.array([[1, 1], [1, 1e-4], [1, 1], [1, -1e-4]])
    sigma = np.array([[1, 1], [1, 1], [1, 1e-4], [1, 1e-13]])
    s = Singularity.of(J_A, J_A, sigma, np.sort(np.abs(J_A), axis=1).T, 1.0)
    assert [KINDS[k] for k in s.kind()] == ["none", "inverse", "direct", "combined"]
    assert s.rank.tolist() == [2, 2, 2, 1] and (s.kind(threshold=1e-5) == [0, 0, 0, 2]).all()


def test_a_singular_pose_is_an_error_that_names_it() -> None:
    model = condyle.derive(from_data(spatial(meeting=True)), backend="numpy")
    q = np.random.default_rng(0).normal(0, 1e-4, (3, 6)) * [[1], [0], [1]]
    evaluation = model.inverse_dynamics(q, 0 * q, 0 * q, outputs="all")
    assert [STATUS_NAMES[k] for k in evaluation.status] == ["ok", "singular", "ok"]
    with pytest.raises(SingularError, match=r"singular at row 12: dimensionless ratio") as caught:
        require_ok(model.mechanism, evaluation, row_offset=10)
    assert caught.value.samples == [1]


@pytest.mark.parametrize("contacts", [0, 2, 5])
def test_measures_are_those_of_the_actuator_jacobian(contacts: int) -> None:
    """J_A theta' + J_W t = 0 on admissible twists [V; L omega], by Pinocchio's Jacobian."""
    pytest.importorskip("pinocchio", reason="pin is not installed (it is in the `test` extra)")
    from oracles.pinocchio_engine import PinocchioEngine

    raw = random_mechanism(np.random.default_rng(contacts), contacts=contacts)
    mechanism = parse(toml_text(raw))
    model, engine = condyle.derive(mechanism), PinocchioEngine(raw)
    states = random_state(np.random.default_rng(1), raw, 3)
    s = model.poses.configuration(states["pose"]).singularity
    length = model.characteristic_length
    for i, pose in enumerate(states["pose"]):
        zero = np.zeros(6)
        J_theta = engine.inverse_dynamics(pose, zero, zero, zero, None)["J_theta"]
        J_A = s.J_A[i]
        M_J = np.array(
            [
                complete_state(raw, states["names"], states["q"][i], unit, 0 * unit)[1]
                for unit in np.eye(6 - contacts)
            ]
        ).T
        rates = M_J @ per_twist(pose, M_J, length)
        rods = [2 * np.linalg.norm(np.subtract(c.platform, c.crank_tip)) for c in mechanism.chains]
        J_W = J_A[:, None] * (J_theta @ rates) / np.array(rods)[:, None]
        sigma = np.linalg.svd(J_W, compute_uv=False)
        np.testing.assert_allclose(s.J_W_sigma[i], sigma, rtol=1e-10)
        assert s.condition[i] == pytest.approx(sigma[0] / sigma[-1], rel=1e-10)
        for k, chain in enumerate(mechanism.chains):
            crank = np.linalg.norm(np.subtract(chain.crank_tip, chain.base))
            assert s.transmission[i, k] == pytest.approx(J_A[k] / (rods[k] * crank), rel=1e-12)
    assert (np.abs(s.transmission) <= 1).all() and (s.rank == 6 - contacts).all()


def test_the_measures_do_not_depend_on_the_unit_of_length(raw: dict[str, Any]) -> None:
    """A robot ten times as large has the same singular values."""
    large = from_data(raw | {"length_unit": "mm"})
    raw["length_unit"] = "m"
    huge = from_data(raw)
    pose = np.array([[0.002, 0.001, 0, 0.05, -0.1, 0.02]])
    scaled = pose * np.repeat([1000.0, 1.0], 3)
    a = condyle.derive(large).poses.configuration(pose).singularity
    b = condyle.derive(huge).poses.configuration(scaled).singularity
    np.testing.assert_allclose(a.J_W_sigma, b.J_W_sigma, rtol=1e-12)
    np.testing.assert_allclose(a.transmission, b.transmission, rtol=1e-12)
    assert b.length == pytest.approx(1000 * a.length)


def test_a_gimbal_lock_is_none_of_the_machine() -> None:
    """Near beta = 90 degrees the condition stays; only q'' is lost, with its own word."""
    model = shared("gough-stewart")
    q = np.array([[0, 0, 0, 0.1, np.pi / 2 - d, 0.2] for d in (1e-2, 1e-6, 1e-8, 0.0)])
    found = model.inverse_dynamics(q, 0 * q, 0 * q, outputs=("configuration", "condition"))
    at_lock = model.inverse_kinematics([0, 0, 0, 0.1, np.pi / 2, 0.2]).condition
    np.testing.assert_allclose(found.condition, at_lock, rtol=0.1)
    assert at_lock < 100
    assert (found.status == 0).all() and (found.configuration.singularity.kind() == 0).all()
    survey = model.poses.survey(q, ("ratio",))
    assert (survey.status == 0).all()
    np.testing.assert_allclose(survey.direct_ratio, 1 / found.condition, rtol=1e-6)
    ahead = model.forward_dynamics(q, 0 * q, found.effort, outputs="twist_rate")
    words = [STATUS_NAMES[k] for k in ahead.status]
    assert words == ["ok", "ok", "gimbal_lock", "gimbal_lock"]
    assert np.isfinite(ahead.acceleration).all(axis=1).tolist() == [True, True, False, False]
    assert np.abs(ahead.twist_rate).max() < 1e-11 and ahead.contact_force.shape == (4, 0)


@pytest.mark.parametrize("name", ["masticatory", "gough-stewart", "human-jaw"])
def test_sensitivity_to_the_characteristic_length(name: str) -> None:
    """Against differences, with the dimensionless J_W of two lengths."""
    model = shared(name)
    names = ("X", "Y", "Z", "alpha", "beta", "gamma")
    q = [0.002 if n in "XYZ" else 0.05 for n in names if n in model.independent]
    found = model.jacobians(q)
    at = model.inverse_kinematics(q).singularity
    if at.direct_ratio > at.inverse_ratio:
        assert found.length_sensitivity == 0.0
        return
    cranks = [chain.lengths.get("crank", 1.0) for chain in model.mechanism.chains]
    rows = found.J * (at.transmission * cranks)[:, None]
    step, logs = 1e-4, []
    for factor in (1 - step, 1 + step):
        scale = np.repeat([1.0, factor * model.characteristic_length], 3)
        basis = np.linalg.qr(scale[:, None] * found.twist_basis)[0]
        sigma = np.linalg.svd(rows / scale @ basis, compute_uv=False)
        logs.append(np.log(sigma[-1] / sigma[0]))
    assert found.length_sensitivity == pytest.approx((logs[1] - logs[0]) / (2 * step), rel=1e-5)


def determinants(raw: dict[str, Any], q: np.ndarray) -> np.ndarray:
    model = condyle.derive(from_data(raw), backend="numpy")
    return np.linalg.det(np.moveaxis(model.poses.survey(q, ("rows",)).values["rows"], -1, 0))


def test_the_determinant_changes_its_sign_at_singularities_alone() -> None:
    """Neither in a gimbal lock, nor where a contact's normal turns past an axis."""
    raw = tomllib.loads(condyle.dumps(condyle.load_mechanism("gough-stewart")))
    q = np.array([[0, 0, 0, 0.1, np.pi / 2 + d, 0.2] for d in (-1e-3, 1e-3)])
    ahead, behind = determinants(raw, q)
    assert ahead == pytest.approx(behind, rel=0.02)
    surface = {"kind": "sphere", "centre": [0.0, 0.0, -0.8], "radius": 0.8}
    ball = {"name": "ball", "point": [0, 0, 0], "surface": surface}
    five = raw | {"chain": raw["chain"][:5], "contact": [ball]}
    q = np.array([[x, 0.1, 0.1, 0.2, 0.1] for x in (-1e-3, 1e-3)])
    ahead, behind = determinants(five, q)
    assert ahead == pytest.approx(behind, rel=0.02)


@pytest.mark.parametrize("seed", [1, 2])
def test_a_singular_home_names_and_draws_the_motion_that_is_free(seed: int, tmp_path: Path) -> None:
    """Legs that all meet one line leave the platform to turn about it."""
    rng = np.random.default_rng(seed)
    tables = tomllib.loads(bundled_text("gough-stewart"))
    tip, axis = rng.normal(size=3), rng.normal(size=3)
    axis /= np.linalg.norm(axis) * np.sign(axis[np.argmax(np.abs(axis))])
    tables["platform"]["points"] = {"tip": tip.tolist()}
    for chain in tables["chain"]:
        base, met = rng.normal(size=3) - (0, 0, 5), tip + rng.normal() * axis
        chain |= {"base": base.tolist(), "platform": (base + 0.8 * (met - base)).tolist()}
    mechanism = from_data(tables)
    direction = ", ".join(f"{x:.4g}" for x in axis)
    said = rf'turns about the axis along \({re.escape(direction)}\) through "tip"'
    picture = tmp_path / "free.svg"
    with pytest.raises(SingularError, match=f"singular at home: .*{said}") as caught:
        condyle.check(mechanism, picture)
    assert "move the ends of chains" in caught.value.hint and "free.svg" in caught.value.hint
    drawn = picture.read_text("utf-8")
    assert re.search(said.replace('"', "&quot;"), re.sub("(</text>)?<text.*?>", " ", drawn))
    red = re.findall(r'fill="#[7-c].1.[2-6]."[^>]* d="(.*?)"', drawn)  # the axis
    dots = np.array(re.findall(r"M(\d+) (\d+)", "".join(red)), dtype=float)
    along = np.linalg.svd(dots - dots.mean(axis=0))[2][0]
    right, down = unit(np.array([1, 1, 0])), unit(np.array([0.6, -0.6, -2.3]))  # seen obliquely
    assert abs(along @ unit(axis @ np.column_stack([right, down]))) > 0.999
    with pytest.raises(SingularError, match=said):
        condyle.derive(mechanism).solve(condyle.trial_motion(mechanism))
    # Without a name for it, by its place; and a motion along a line, or along and about one.
    V = np.cross(tip, axis)
    assert FreeMotion(V, axis, 1.0).text({"other": 2 * tip, "tip": tip}).endswith('"tip"')
    assert "mm from the platform's origin" in FreeMotion(V, axis, 1.0).text({})
    assert FreeMotion(axis, 0 * axis, 1.0).text({}) == f"moves along ({direction})"
    along = FreeMotion(V + axis, axis, 1.0).text({"tip": tip})
    assert "moving along it by 6283 mm a turn" in along
