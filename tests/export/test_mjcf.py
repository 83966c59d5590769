"""The model for MuJoCo: it loads, it is the same mechanics, and MuJoCo plays it."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from oracles.rotations import turn
from support.cases import case
from support.loads import parts
from support.machines import model as model_of
from support.mujoco_player import Player
from support.surfaces import contact, table

import condyle
from condyle.errors import UnsupportedError
from condyle.export.mjcf import mjcf
from condyle.export.mjcf_tracks import track
from condyle.export.mjcf_xml import Document
from condyle.mechanism import bundled_mechanisms

AT_REST = 1e-9  # of the largest generalized force: MuJoCo and condyle share the poses
# Name -> largest difference in motion: that of finite differences, a coupler that spins with its
# crank, and, where a contact needs one, a runner of 0.1 % of the platform's mass.
CASES = {
    "masticatory": 1e-4,
    "hexaglide": 1e-5,
    "gough-stewart": 1e-5,
    "masticatory-curved": 1e-2,
    "mixed_k0_n7": 1e-4,
}


@cache
def made(name: str) -> Document:
    return mjcf(
        condyle.load_mechanism(name) if name in bundled_mechanisms() else case(name).mechanism
    )


@pytest.mark.parametrize("name", CASES)
def test_efforts_are_those_of_mj_inverse(name: str) -> None:
    """A^T tau of both, along all that the loops and contacts leave free: at rest, and in motion."""
    c, player = case(name), Player(made(name).text)
    m = c.mechanism.degrees_of_freedom
    model = model_of(name)
    for i in (4, 7):
        t, z = 1e-4 * np.arange(-1, 2)[:, None], np.zeros((1, m))
        q, q1, q2 = (np.repeat(a[i : i + 1], 3, axis=0) for a in (c.q, c.q1, c.q2))
        q = q + q1 * t + q2 * t**2 / 2
        poses = model.inverse_dynamics(q, q1 + q2 * t, q2, outputs="all").pose
        places = []
        for pose in poses:
            places.append(player.place(pose))
            assert player.off < 1e-12
        rate = np.zeros((2, player.model.nv))
        for k in (0, 1):
            mujoco.mj_differentiatePos(player.model, rate[k], 1e-4, places[k], places[k + 1])
        player.data.qpos[:] = places[1]
        free = player.free()
        assert free.shape[1] == m
        moving = (rate.mean(axis=0), (rate[1] - rate[0]) / 1e-4)
        both = (AT_REST, (z, z), ()), (CASES[name], (q1[1:2], q2[1:2]), moving)
        for bound, states, motion in both:
            efforts = model.inverse_dynamics(q[1:2], *states).effort[0]
            needed = free.T @ player.needed(*motion)
            given = free.T @ player.given(efforts)
            scale = np.abs(free.T @ player.needed()).max() + np.abs(needed).max()
            np.testing.assert_allclose(given, needed, rtol=0, atol=bound * scale)


def test_cables_pull_and_real_contacts_push() -> None:
    """Weight and a load at home are balanced by the tensions and the contact forces."""
    name = "human-jaw"
    mechanism = condyle.load_mechanism(name)
    player, model = Player(made(name).text), model_of(name)
    load = np.array([[0, 0, -50.0, 0, 0, 0, *mechanism.platform.points["incisor"]]])
    z = np.zeros((1, mechanism.degrees_of_freedom))
    found = model.inverse_dynamics(z, z, z, *parts(load), outputs="all")
    player.equations()
    given = player.given(found.effort[0]) + player.jacobian(load[0, 6:])[:3].T @ load[0, :3]
    for one, force in zip(mechanism.contacts, found.contact_force[0], strict=True):
        normal = np.array([-one.surface.slope[0], -one.surface.slope[1], 1.0])
        rows = player.jacobian(np.array(one.point))[:3]
        given += force * rows.T @ normal / np.linalg.norm(normal)
    np.testing.assert_allclose(given, player.needed(), rtol=0, atol=1e-6 * np.abs(given).max())


def test_mujoco_holds_it_without_a_warning() -> None:
    """At home, by the efforts of the keyframe and weak springs and dampers at the joints.

    But the resected jaw: most of its muscles are slack at home, and cannot steady it.
    """
    for name in sorted({*bundled_mechanisms()} - {"human-jaw-resected"}):
        player = Player(made(name).text)
        m, d = player.model, player.data
        if m.nkey:
            mujoco.mj_resetDataKeyframe(m, d, 0)
        hold = d.ctrl.copy()
        mujoco.mj_forward(m, d)
        home = d.actuator_length.copy()
        turning = condyle.load_mechanism(name).chains[0].kind == "RSS"
        stiff, damped = (1.0, 0.01) if turning else (np.linalg.norm(hold) * np.array([1e3, 10.0]))

        def control() -> None:
            d.ctrl[:] = hold - stiff * (d.actuator_length - home) - damped * d.actuator_velocity  # noqa: B023

        assert not any(player.play(1.0, control)), name
        assert np.linalg.norm(player.position()) < 1e-4, name


def test_mujoco_follows_the_reference_motion() -> None:
    """For 3 s, two of them moving, under our efforts and the bite: with weak joint control to
    0.01 mm, alone to 1 mm, since without control what MuJoCo's soft equations let go is never
    brought back."""
    mechanism = condyle.load_mechanism("masticatory")
    solution = model_of("masticatory").solve(condyle.reference_motion(), condyle.reference_load())
    rows = {name: solution[name].values for name in ("time", "effort", "joint", "load", "pose")}
    t, point = rows["time"], np.array(mechanism.platform.points["right_molar"])
    rows["speed"] = np.gradient(rows["joint"], t, axis=0)
    for gain, bound in ((1.0, 1e-5), (0.0, 1e-3)):
        player = Player(made("masticatory").text)
        assert max(followed(player, mechanism, rows, point, gain)) < bound


def followed(
    player: Player,
    mechanism: condyle.Mechanism,
    rows: dict[str, np.ndarray],
    point: np.ndarray,
    gain: float,
) -> list[float]:
    """How far off the platform is at each step."""
    m, d, t, off = player.model, player.data, rows["time"], []
    player.place(rows["pose"][0])
    d.time = t[0]
    places = [m.joint(chain) for chain in mechanism.chain_names]
    q_at, v_at = [p.qposadr[0] for p in places], [p.dofadr[0] for p in places]

    def now(name: str) -> np.ndarray:
        part, k = np.modf((d.time - t[0]) / (t[1] - t[0]) + 1e-9)
        k = min(int(k), len(t) - 2)
        return (1 - part) * rows[name][k] + part * rows[name][k + 1]

    def control() -> None:
        d.ctrl[:] = now("effort") + gain * (now("joint") - d.qpos[q_at])
        d.ctrl[:] += 0.01 * gain * (now("speed") - d.qvel[v_at])
        mujoco.mj_kinematics(m, d)
        where = player.position() + d.xmat[player.platform].reshape(3, 3) @ point
        force, moment = np.split(now("load"), 2)
        d.qfrc_applied[:] = 0
        mujoco.mj_applyFT(m, d, force, moment, where, player.platform, d.qfrc_applied)
        off.append(float(np.linalg.norm(player.position() - now("pose")[:3])))

    assert not any(player.play(3.0 - 2 * m.opt.timestep, control))
    return off


@pytest.mark.parametrize("name", ["rss_k2_n6_sphere", "pss_k2_n6_cylinder"])
def test_the_seat_keeps_the_platform_on_a_curved_surface(
    monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    """However its joints are turned: the first contact cannot be left, the runner's neither."""
    monkeypatch.setattr("condyle.export.mjcf._home", lambda *_: [])  # derives all the dynamics
    mechanism = case(name).mechanism
    player = Player(mjcf(mechanism).text)
    m, d = player.model, player.data
    first, second = mechanism.contacts
    turned = 0.0
    for k, value in enumerate(np.linspace(-0.1, 0.1, 5)):
        for one in mechanism.contacts:
            for letter in "ab":
                joint = m.joint(f"{one.name}_1{letter}")
                d.qpos[joint.qposadr[0]] = value * (0.01 if joint.type == 2 else 1) * (1 + k)
        mujoco.mj_kinematics(m, d)
        ball = d.site(f"{first.name}_contact").xpos
        assert abs(float(first.offset_surface.phi(ball))) < 1e-12
        turned = max(turned, float(np.linalg.norm(ball - first.point)))
        runner = d.body(f"{second.name}_runner")
        at = runner.xpos + runner.xmat.reshape(3, 3) @ second.point
        assert abs(float(second.offset_surface.phi(at))) < 1e-12
    assert turned > 1e-3


@pytest.mark.parametrize(
    "kind", ["plane", "sphere", "cylinder", "quadratic", "profile", "ellipsoid"]
)
def test_a_track_stays_on_its_surface(kind: str) -> None:
    """Within its bounds: by as much as it says, or to rounding where it says nothing."""
    bounds = {"x": [-28.0, -24.0], "y": [5.0, 9.0]}
    on = contact(table(kind), bounds=bounds)
    found = track(on, 0.1)
    assert (found.error > 0) == (kind in ("profile", "ellipsoid")) and found.error < 1e-4
    rng = np.random.default_rng(5)
    seen = 0
    for _ in range(60):
        p, turned = np.array(on.point), np.eye(3)
        for stage in found.stages:
            values = rng.uniform(-0.002, 0.002, len(stage.freedoms))
            values /= [0.02 if f.kind == "hinge" else 1.0 for f in stage.freedoms]
            if stage.law is not None:
                values[1] = np.polynomial.Polynomial(stage.law)(values[0])
            # The last joint is nearest to the point; each turns or shifts all that hangs on it.
            for freedom, value in reversed(list(zip(stage.freedoms, values, strict=True))):
                if freedom.kind == "slide":
                    p = p + value * freedom.axis
                else:
                    turned = turn(freedom.axis, value)
                    p = freedom.point + turned @ (p - freedom.point)
        inside = all(
            low <= v <= high
            for v, (low, high) in zip(p[:2], (on.bounds.x, on.bounds.y), strict=True)
        )
        seen += inside
        if inside:
            assert abs(float(on.offset_surface.phi(p))) <= 2 * found.error + 1e-9
    assert seen > 5


def test_what_the_file_has() -> None:
    """Losses, limits, landmarks, contacts; home is where all joints are zero. Where MuJoCo has
    nothing that is the same, the file and the caller are told."""
    jaw = condyle.load_mechanism("masticatory")
    losses = {"rotor_inertia": 1e-6, "gear": 10.0, "viscous": 0.004, "coulomb": 0.03}
    changes = {"torque_limit": (-1.0, 3.0), **losses}.items()
    changed = jaw.set({f"chain.masseter_left.actuator.{k}": v for k, v in changes})
    exported = mjcf(changed.set("contact.left_condyle.friction", {"coefficient": 0.1}))
    m = mujoco.MjModel.from_xml_string(exported.text)
    dof = m.joint("masseter_left").dofadr[0]
    assert m.dof_armature[dof] == pytest.approx(1e-4)
    assert m.dof_damping[dof] == pytest.approx(0.004)
    assert m.dof_frictionloss[dof] == pytest.approx(0.03)
    assert m.actuator("masseter_left").ctrlrange == pytest.approx([-1, 3])
    assert m.actuator("masseter_right").ctrlrange == pytest.approx([-3, 3])
    assert m.numeric("speed_limit_masseter_left").data == pytest.approx(6.0)
    for name, point in jaw.platform.points.items():
        assert m.site(name).pos == pytest.approx(point)
    assert m.site("left_condyle_contact").pos == pytest.approx(jaw.contacts[0].point)
    assert any("frictionloss" in note for note in exported.notes)
    assert any('"left_condyle": its friction is left out' in note for note in exported.notes)
    assert all(note in exported.text for note in exported.notes)
    assert not made("gough-stewart").notes
    (note,) = (n for n in made("human-jaw-curved").notes if "left" in n and "polynomials" in n)
    assert "within its bounds" in note
    player = Player(made("hexaglide").text)
    assert np.abs(player.equations()[0]).max() < 1e-12
    assert np.abs(player.position()).max() == 0

    friction = ("contact.left_condyle.friction", {"coefficient": 0.1})  # of a real contact
    m = mujoco.MjModel.from_xml_string(
        mjcf(condyle.load_mechanism("human-jaw").set(*friction)).text
    )
    assert list(m.pair_dim) == [3, 1]
    assert m.pair_friction[0, :2] == pytest.approx([0.1, 0.1])
    points = dict(jaw.platform.points) | {"left_condyle_contact": (0.0, 0.0, 0.0)}
    with pytest.raises(UnsupportedError, match="left_condyle_contact"):
        mjcf(jaw.set("platform.points", points))


def test_the_command_writes_the_file_and_says_what_is_approximate(
    condyle_command: Callable[..., Any], tmp_path: Path
) -> None:
    outcome = condyle_command("export", "mjcf", "masticatory-curved", "--out", "models")
    assert outcome.status == 0 and "0.1 %" in outcome.err
    root = ElementTree.parse(tmp_path / "models" / "masticatory-curved.xml").getroot()
    assert root.get("model") == "masticatory-curved"
