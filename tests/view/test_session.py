"""The live view without its page: poses, loads and solutions in, snapshots and drawings out."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache

import numpy as np
import pytest
import xarray as xr
from support.machines import model

import condyle
from condyle.errors import InputError
from condyle.markers import MeasuredChannels
from condyle.mechanism.coordinates import bryant_angles
from condyle.motion import Load, Motion
from condyle.report.scene import (
    activation_colour,
    contact_patch,
    parts_of,
    place,
    platform_hull,
    rotations,
)
from condyle.report.scene.solids import across, arrow, ball, tube
from condyle.view import View, open_view
from condyle.view.playback import Playback
from condyle.view.readout import effects_html, internal_text, number, status_html, tables_html
from condyle.view.session import MOST_INTERNAL, Session
from condyle.view.stage import matrix, quaternion, rgb

MECHANISMS = ("masticatory", "gough-stewart", "hexaglide", "human-jaw")
CENTRE = [-26.65, 72, 62.53]
SURFACES = {
    "sphere": {"kind": "sphere", "centre": CENTRE, "radius": 20},
    "cylinder": {"kind": "cylinder", "point": [0, 72, 62.53], "axis": [1, 0, 0], "radius": 20},
    "wall": {"kind": "sphere", "centre": [-26.65, 92, 42.53], "radius": 20},
}


@cache
def _session(name: str) -> Session:
    return Session(condyle.load_mechanism(name))


def at_home(name: str = "masticatory") -> Session:
    """The one session of a machine, without loads."""
    session = _session(name)
    session.go_home()
    session.set_load(np.zeros(3))
    session.internal[:] = 0
    session.snapshot()
    return session


def test_home_coordinates_and_loads() -> None:
    """At home the platform is held against gravity; a slider or a load changes that."""
    session = at_home()
    home = session.snapshot()
    assert home.level == "ok" and home.messages == ()
    assert np.allclose(home.pose, 0, atol=1e-12) and np.allclose(home.joint, 0, atol=1e-9)
    names = session.model.independent
    still = model("masticatory").solve(Motion.from_arrays(np.arange(6), np.zeros((6, 4)), names))
    assert np.allclose(home.effort, still["effort"].values[0], rtol=1e-9)
    assert np.allclose(home.contact_force, still["contact_force"].values[0], rtol=1e-9)
    session.set_coordinate("beta", np.radians(8))
    after = session.snapshot()
    assert after.pose[4] == pytest.approx(np.radians(8))
    assert np.all(np.abs(after.joint - home.joint) > 0.1)
    session.go_home()
    session.set_load(np.array([0.0, 0.0, -60.0]), "right_molar")
    after = session.snapshot()
    assert after.effort[5] > home.effort[5] + 0.1
    assert after.contact_force[1] < home.contact_force[1] - 1
    assert np.array_equal(after.load_at, session.mechanism.platform.points["right_molar"])
    session.set_coordinate("X", -0.003)
    found = session.snapshot()
    assert found.level == "warning" and np.isfinite(found.effort).all()
    assert "left_condyle is 2 mm outside its bounds" in found.messages
    with pytest.raises(InputError, match="left_molar"):
        session.set_load(np.zeros(3), "molar")
    with pytest.raises(InputError, match="alpha"):
        session.set_coordinate("alhpa", 0.0)


def test_poses_out_of_reach_are_named_and_never_raise(raw: dict) -> None:
    """Chains stay drawn; contacts that cannot be met leave the last pose, and a ghost."""
    session, rng = at_home(), np.random.default_rng(5)
    for _ in range(12):
        session.q = rng.normal(size=4) * rng.choice([0.01, 0.1, 1.0, 1e3], 4)
        session.snapshot()
    for q in ([np.nan] * 4, [np.inf, 0, 0, 0]):
        session.q = np.array(q)
        assert session.snapshot().level == "unreachable"
    session.go_home()
    assert session.snapshot().level == "ok"
    session.set_coordinate("X", 0.016)
    found = session.snapshot()
    assert found.level == "unreachable"
    assert 'chain "temporalis_left" cannot reach M' in found.messages[0]
    assert "temporalis_right" in found.messages[1]
    assert found.out_of_reach == ("temporalis_left", "temporalis_right")
    assert np.isnan(found.effort).all() and found.pose[0] == 0.016
    drawn = [p for d in found.scene.chains.values() for p in d.points.values()]
    assert all(np.isfinite(p).all() for p in drawn)
    raw["contact"][0]["surface"] = SURFACES["sphere"]
    session = Session(condyle.mechanism.files.from_data(raw))
    session.set_coordinate("beta", 0.05)
    good = session.snapshot().pose
    session.set_coordinate("Y", 0.1)  # the ball's socket is 20 mm wide
    found = session.snapshot()
    assert found.level == "unreachable" and "left_condyle" in found.messages[0]
    assert np.array_equal(found.pose, good) and found.out_of_reach == ()
    assert found.wanted is not None and found.wanted[1] == 0.1 and found.wanted[4] == 0.05


def test_dragging_goes_to_the_nearest_pose_on_the_contacts() -> None:
    session = at_home()
    session.set_coordinate("beta", 0.06)
    session.set_coordinate("X", -0.001)
    target = session.snapshot().pose
    session = at_home()
    session.drag_to(target)
    assert np.allclose(session.snapshot().pose, target, atol=1e-6)
    # Pulled straight down the platform opens, though Z is no independent coordinate.
    session.go_home()
    session.drag_to(np.array([0, 0, -0.004, 0, 0, 0]))
    assert session.snapshot().pose[2] < -0.002
    session.drag_to(np.array([0.5, 0, 0, 0, 0, 0]))
    assert session.snapshot().level == "unreachable"


def test_sliders_reach_from_home_and_a_little_beyond() -> None:
    for name in MECHANISMS:
        session = at_home(name)
        found = session.coordinates()
        assert [c.name for c in found] == list(session.model.independent)
        for c in found:
            assert c.low < 0 < c.high
            session.go_home()
            session.set_coordinate(c.name, 0.1 * c.high)
            assert session.snapshot().level != "unreachable"


# -- internal efforts ---------------------------------------------------------------------------


def test_internal_efforts_balance_by_hand() -> None:
    """Pulls along the lines of the muscles, and pushes along the normals, add up to nothing."""
    session = at_home("human-jaw")
    found, jaw = session.directions(), session.mechanism
    assert found.effort.shape == (24, 20) and found.contact.shape == (2, 20)
    total = np.zeros((6, 20))
    for i, chain in enumerate(jaw.chains):
        at = np.array(chain.platform)
        pull = np.subtract(chain.base, at) / np.linalg.norm(np.subtract(chain.base, at))
        total += np.outer([*pull, *np.cross(at, pull)], found.effort[i])
    for k, contact in enumerate(jaw.contacts):
        slope = contact.surface.slope
        normal = np.array([-slope[0], -slope[1], 1.0])
        normal /= np.linalg.norm(normal)
        total += np.outer([*normal, *np.cross(contact.point, normal)], found.contact[k])
    assert abs(total).max() < 1e-10
    assert np.linalg.matrix_rank(found.effort) == 20
    assert np.allclose(abs(found.effort).max(axis=0), 1.0)
    # Two contacts: two directions load them, the others leave them alone.
    assert (abs(found.contact[:, :2]) > 1).all() and not found.contact[:, 2:].any()
    # Sliders keep their meaning along a motion.
    before = found
    for beta in np.linspace(0, 0.1, 11)[1:]:
        session.set_coordinate("beta", beta)
        session.snapshot()
        now = session.directions()
        assert abs(now.effort - before.effort).max() < 0.15
        before = now


def test_internal_efforts_do_no_work_and_add_to_the_others() -> None:
    for name, count in (("hexaglide", 1), ("gough-stewart", 0), ("masticatory", 2)):
        session = at_home(name)
        session.set_coordinate("beta", 0.08)
        before, found = session.snapshot(), session.directions()
        J = session.model.jacobians(session.q[None])
        A = (J.J_theta @ J.M_J)[0]
        assert found.count == len(session.internal) == count == len(A) - A.shape[1]
        assert abs(A.T @ found.effort).max(initial=0) < 1e-9 * abs(A).max()
    session.set_internal(0, 0.5)
    after = session.snapshot()
    assert np.allclose(after.effort - before.effort, 0.5 * found.effort[:, 0], atol=1e-12)
    assert np.allclose(after.contact_force - before.contact_force, 0.5 * found.contact[:, 0])
    parts = parts_of(session.mechanism, after.scene)
    contacts = [force for force in after.forces(parts) if force.into]
    assert [one.largest for one in contacts] == pytest.approx(abs(after.contact_force))
    assert after.over == () and np.array_equal(after.pose, before.pose)
    session.set_internal(0, 3.5)
    beyond = session.snapshot()
    assert beyond.level == "warning" and len(beyond.over) >= 1
    assert any(f"{beyond.over[0]} is above its effort limit" in m for m in beyond.messages)
    assert "⚠" in tables_html(beyond) and "⚠" not in tables_html(after)
    with pytest.raises(InputError, match="has 2, counted from 0"):
        session.set_internal(2, 1.0)


def test_a_muscle_that_would_push_is_named() -> None:
    """And what no muscles can hold is called infeasible; words say what has no slider."""
    session = at_home("human-jaw")
    jaw = session.mechanism
    session.set_internal(0, 20.0)
    snapshot = session.snapshot()
    pushing = {name for name, t in zip(jaw.chain_names, snapshot.effort, strict=True) if t < 0}
    assert pushing and pushing <= set(snapshot.over)
    [told] = [message for message in snapshot.messages if message.startswith("Slack")]
    assert told.endswith(f"and {len(pushing) - 4} more") and told.count(" N)") == 4
    assert tables_html(snapshot).count("slack") == len(pushing)
    html = effects_html(jaw, session.directions(), session.internal, MOST_INTERNAL)
    assert html.count("<tr>") == 1 + MOST_INTERNAL + 1 + 24
    pressed = -float(session.directions().contact[0, 0])  # the skull is above the ball
    assert html.index(f">{number(pressed, 3)}<") < html.index(">2<")
    session = at_home("human-jaw")
    session.set_load(np.array([0.0, 0.0, -5000.0]), "right_molar")
    snapshot = session.snapshot()
    assert np.isnan(snapshot.effort).all() and snapshot.over == ()
    assert snapshot.messages == ("Infeasible: no forces within the limits balance the load",)
    assert "20 directions" in internal_text(20, MOST_INTERNAL)
    assert "of which 6 have a slider" in internal_text(20, MOST_INTERNAL)
    assert internal_text(2, 2).startswith("2 directions") and "of which" not in internal_text(2, 2)
    assert "No actuation redundancy" in internal_text(0, 0)


# -- solutions ----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def chewing() -> xr.Dataset:
    motion = Motion.from_csv(condyle.motion.bundled_reference()[0], rate=100)
    return model("masticatory").solve(motion, condyle.reference_load())


def test_playback_shows_the_solutions_numbers_with_the_clock(chewing: xr.Dataset) -> None:
    playback = Playback(chewing)
    playback.seek(1.634)
    assert playback.now == pytest.approx(1.63)
    found, at = playback.snapshot(), chewing.isel(time=163)
    for name in ("effort", "contact_force", "pose"):
        assert np.array_equal(getattr(found, name), at[name].values)
    assert found.time == playback.now and found.reach is None
    assert np.array_equal(found.rate, at["joint_rate"].values)
    assert tables_html(found).count("rad/s") == 1, "of one unit, it stands in the heading"
    balls = np.array([p[0] for p in found.scene.contacts.values()])
    assert np.allclose(balls, at["contact_point"].values, atol=1e-12)
    playback.seek(0)
    assert not playback.advance(1.0), "it is not playing"
    playback.play()
    for _ in range(1000):
        playback.advance(0.001)  # ten steps a sample
    assert playback.now == pytest.approx(1.0, abs=0.011)
    playback.speed = 2.0
    assert playback.advance(0.5)
    assert playback.now == pytest.approx(2.0, abs=0.011)
    assert playback.advance(100.0) and not playback.playing
    assert playback.now == chewing["time"].values[-1]
    playback.play()
    assert playback.index == 0, "from the end, play starts over"


def test_playback_of_failed_samples_keeps_the_pose_and_shows_no_force(torn: xr.Dataset) -> None:
    """The pose before in time, wherever one came from; why, since when; and neither load."""
    first = int(np.flatnonzero(torn["status"].values)[0])
    playback = Playback(torn)
    good = playback.snapshot()
    assert good.level != "unreachable" and not good.stale and good.load[2] == -30
    for before in (0.0, 0.6):  # 0.6 s has a result
        playback.seek(before)
        playback.snapshot()
        playback.seek(0.3)
        found = playback.snapshot()
        assert found.stale and found.level == "unreachable"
        np.testing.assert_array_equal(found.pose, torn["pose"].values[first - 1])
        for forces in (found.effort, found.contact_force, found.load):
            assert np.isnan(forces).all()
        assert "No result from 0.075 to 0.445 s: unreachable" in found.messages[0]
        assert "t = 0.07 s" in found.messages[1]


# -- the stage ----------------------------------------------------------------------------------


@contextmanager
def opened(*what: object, **how: object) -> Iterator[View]:
    view = open_view(*what, port=0, **how)
    try:
        yield view
    finally:
        view.close()


def test_a_played_solution_is_drawn(torn: xr.Dataset) -> None:
    """Markers are where they were measured; a stale pose is grey and without arrows; play begins
    where it stands, however long it stood.
    """
    t = torn["time"].values
    places = np.stack([np.full((len(t), 3), 0.08), np.outer(t, [1e-3, 0, 0])], axis=1)
    places[2, 1] = np.nan
    nothing = np.full((len(t), 2), np.nan)
    measured = MeasuredChannels(t, ("Upper", "Lower"), ("fixed", "platform"), places, nothing)
    with opened(solution=torn.condyle.with_measured(measured)) as view:
        assert view.playback is not None
        stage, (upper, lower) = view.stage, view.stage._markers
        assert tuple(upper.color) != tuple(lower.color)
        for sample in (4, 60, 2):
            view.playback.seek(t[sample])
            for _ in range(100):  # the view draws meanwhile, perhaps the time before
                stage.show(view.playback.snapshot())
                parts = [n for s, n in stage.nodes if s.group in ("platform", "balls", "chains")]
                tints = {tuple(part.color) for part in parts}
                arrows = any(one.visible for one in stage._arrows.values())
                drawn = (arrows, len(tints) == 1, lower.visible)
                if drawn == (sample != 60, sample == 60, sample != 2):
                    break
                time.sleep(0.05)
            else:
                pytest.fail(f"t = {t[sample]}: {len(tints)} colours; {drawn}")
            assert np.allclose(upper.position, stage.scale * 0.08)
            if sample == 4:
                assert np.allclose(lower.position, stage.scale * places[4, 1])
        stage.show(view.session.snapshot())
        assert not upper.visible, "moved by hand, there is no measurement"
        view.playback.seek(0)
        time.sleep(0.5)
        begun = time.monotonic()
        view.request("play", view.panel.toggle)
        while not (now := view.playback.now):
            assert time.monotonic() < begun + 60, "it never began"
            time.sleep(0.02)
        assert now <= time.monotonic() - begun + 0.02


def test_muscles_are_bands_that_move_and_take_their_activations_colour() -> None:
    with opened("human-jaw") as view:
        bands = [one for one in view.stage.nodes if one[0].group == "chains"]
        assert {solid.colour for solid, _ in bands} == {"activation"} and len(bands) == 24
        view.session.set_load(np.array([0, 0, -300.0]), "right_molar")
        view.session.set_coordinate("beta", 0.1)
        snapshot = view.session.snapshot()
        view.stage.show(snapshot)
        greatest = [chain.actuator.effort_range[1] for chain in view.stage.mechanism.chains]
        assert np.allclose(snapshot.activation, snapshot.effort / greatest)
        for k, (band, node) in enumerate(bands):
            end = view.stage.scale * snapshot.scene.chains[band.owner].points["M"][0]
            assert np.allclose(np.asarray(node.vertices)[-8:].mean(axis=0), end, atol=1e-6)
            assert tuple(node.color) == rgb(activation_colour(snapshot.activation[k]))


def test_readout_escapes_names_and_writes_the_numbers(reference: condyle.Mechanism) -> None:
    first, *others = reference.chains
    odd = first.model_copy(update={"name": "<b>jaw</b>"})
    session = Session(reference.replace(chains=(odd, *others)))
    session.set_coordinate("X", 0.016)
    for text in (status_html(session.snapshot()), tables_html(session.snapshot())):
        assert "<b>jaw" not in text and "&lt;b&gt;jaw" in text
    assert number(-0.0001, 2) == "0.00" and number(np.nan, 2, "N") == "–"
    assert number(-1.5, 1, "N m") == "-1.5 N m"
    assert number(-4078.78431, 4, "N") == "-4078.78 N" and number(298452.0, 4) == "298452"


def test_turns_agree_with_each_other() -> None:
    rng = np.random.default_rng(3)
    angles = rng.uniform(-1.4, 1.4, (50, 3))
    for R, expected in zip(rotations(angles), angles, strict=True):
        assert np.allclose(R @ R.T, np.eye(3)) and np.linalg.det(R) == pytest.approx(1)
        assert np.allclose(bryant_angles(R), expected)
        assert np.allclose(matrix(quaternion(R)), R)
    for direction in (*rng.normal(size=(20, 3)), [0, 0, 1], [0, 0, -1]):
        unit = np.asarray(direction) / np.linalg.norm(direction)
        turn = np.column_stack([*across(np.outer([0, 1], unit), 0.3 * unit), unit])
        assert np.allclose(turn @ turn.T, np.eye(3)) and np.linalg.det(turn) == pytest.approx(1)


def volume(vertices: np.ndarray, faces: np.ndarray) -> float:
    """Signed: positive for a closed surface whose faces look outwards."""
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    return float((a * np.cross(b, c)).sum() / 6)


def test_drawn_rods_join_the_platform_and_keep_their_length() -> None:
    """The body is closed and looks outwards."""
    assert volume(*tube([1.0, 1.0], [0.0, 1.0], sides=64)) == pytest.approx(np.pi, rel=2e-3)
    assert volume(*ball(1.0, 64)) == pytest.approx(4 / 3 * np.pi, rel=5e-3)
    tip = np.array([0.1, -0.2, 0.5])
    assert volume(*arrow(np.zeros(3), tip, 0.01)) == pytest.approx(1.8e-4, rel=0.1)
    for name in MECHANISMS:
        mechanism, t = model(name).mechanism, np.linspace(0, 1, 31)
        vertices, faces = platform_hull(mechanism)
        assert volume(vertices, faces) > 0
        a, b, c = (vertices[faces[:, i]] for i in range(3))
        normal = np.cross(b - a, c - a)
        motion = Motion.from_arrays(t, {n: 0.004 * np.sin(5 * t) for n in model(name).independent})
        found = model(name).solve(motion, Load.zero())
        scene = place(mechanism, found["pose"].values, found["joint"].values)
        for i, contact in enumerate(mechanism.contacts):
            assert np.allclose(scene.contacts[contact.name], found["contact_point"].values[:, i])
        for i, chain in enumerate(mechanism.chains):
            beyond = ((np.asarray(chain.platform) - a) * normal).sum(axis=1).max()
            assert beyond < 1e-9, "no joint is outside"
            drawing = scene.chains[chain.name]
            last, home = drawing.rods[-1], np.subtract(chain.platform, chain.base)
            assert last.end == "M"
            if chain.kind not in ("SPS", "cable"):
                rod = drawing.points[last.end] - drawing.points[last.start]
                assert np.ptp(np.linalg.norm(rod, axis=1)) < 1e-12
            else:
                leg = np.linalg.norm(drawing.points["M"] - drawing.points["B"], axis=1)
                sign = -1 if chain.kind == "cable" else 1
                longer = sign * found["joint"].values[:, i]
                assert np.allclose(leg, np.linalg.norm(home) + longer)


def test_patches_lie_on_their_surface_within_the_bounds(raw: dict) -> None:
    for kind in SURFACES:
        raw["contact"][0]["surface"] = SURFACES[kind]
        if kind == "wall":
            del raw["contact"][0]["bounds"]
        contact = condyle.mechanism.files.from_data(raw).contacts[0]
        patch = contact_patch(contact, np.array([contact.point]), 0.06)
        assert len(patch.faces) > 100
        shown = patch.vertices[np.unique(patch.faces)]
        assert max(abs(float(contact.surface.phi(p))) for p in shown) < 1e-9
        assert patch.bounded == (kind != "wall")
        if patch.bounded:
            assert shown[:, 0].min() == pytest.approx(-0.02765)
            assert shown[:, 1].max() == pytest.approx(0.075)
        assert patch.outline.shape[1:] == (2, 3)
