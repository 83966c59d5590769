"""The live view without its page: poses, loads and solutions in, snapshots out."""

from __future__ import annotations

import time

import numpy as np
import pytest
import xarray as xr

import condyle
from condyle.errors import InputError
from condyle.markers import MeasuredChannels
from condyle.mechanism.coordinates import bryant_angles
from condyle.motion import Load, Motion
from condyle.report.scene import (
    activation_colour,
    contact_patch,
    place,
    platform_hull,
    rotations,
)
from condyle.view import open_view
from condyle.view.playback import Playback
from condyle.view.readout import number, status_html, tables_html
from condyle.view.session import Session
from condyle.view.stage import matrix, quaternion, rgb, turn_onto, unit_rod

MECHANISMS = ["masticatory", "gough-stewart", "hexaglide", "human-jaw"]


@pytest.fixture
def session(reference: condyle.Mechanism) -> Session:
    return Session(reference)


def test_home_holds_the_platform_against_gravity(session: Session) -> None:
    home = session.snapshot()
    assert home.level == "ok" and home.messages == ()
    assert np.allclose(home.pose, 0, atol=1e-12) and np.allclose(home.joint, 0, atol=1e-9)
    motion = Motion.from_arrays(
        np.linspace(0, 1, 6),
        {n: np.zeros(6) for n in ("X", "Y")} | {"alpha": np.zeros(6), "beta": np.zeros(6)},
    )
    still = condyle.derive(session.mechanism, backend="interpreted").solve(motion)
    assert np.allclose(home.effort, still["effort"].values[0], rtol=1e-9)
    assert np.allclose(home.contact_force, still["contact_force"].values[0], rtol=1e-9)


def test_a_coordinate_moves_the_chains_and_the_numbers(session: Session) -> None:
    before = session.snapshot()
    session.set_coordinate("beta", np.radians(8))
    after = session.snapshot()
    assert after.pose[4] == pytest.approx(np.radians(8))
    assert np.all(np.abs(after.joint - before.joint) > 0.1)
    assert not np.allclose(after.effort, before.effort)
    tip = after.scene.chains["masseter_left"].points
    assert np.linalg.norm(tip["S"] - tip["M"]) == pytest.approx(0.06, abs=2e-4)


def test_load_changes_efforts_and_contact_forces(session: Session) -> None:
    before = session.snapshot()
    session.set_load(np.array([0.0, 0.0, -60.0]), "right_molar")
    after = session.snapshot()
    assert after.effort[5] > before.effort[5] + 0.1
    assert after.contact_force[1] < before.contact_force[1] - 1
    assert np.array_equal(after.load_at, session.mechanism.platform.points["right_molar"])
    with pytest.raises(InputError, match="left_molar"):
        session.set_load(np.zeros(3), "molar")


def test_out_of_bounds_is_a_warning(session: Session) -> None:
    session.set_coordinate("X", -0.003)
    found = session.snapshot()
    assert found.level == "warning"
    assert "left_condyle is 2 mm outside its bounds" in found.messages
    assert np.isfinite(found.effort).all()


def test_a_chain_out_of_reach_is_named_and_stays_drawn(session: Session) -> None:
    session.set_coordinate("X", 0.016)
    found = session.snapshot()
    assert found.level == "unreachable"
    assert 'chain "temporalis_left" cannot reach M' in found.messages[0]
    assert "temporalis_right" in found.messages[1]
    assert found.out_of_reach == ("temporalis_left", "temporalis_right")
    assert np.isnan(found.effort).all() and found.pose[0] == 0.016
    drawn = [p for d in found.scene.chains.values() for p in d.points.values()]
    assert all(np.isfinite(p).all() for p in drawn)
    session.go_home()
    assert session.snapshot().level == "ok"


def test_contacts_that_cannot_be_met_leave_the_last_pose_and_a_ghost(raw: dict) -> None:
    raw["contact"][0]["surface"] = SURFACES["sphere"]
    session = Session(condyle.mechanism.files.from_data(raw))
    session.set_coordinate("beta", 0.05)
    good = session.snapshot().pose
    session.set_coordinate("Y", 0.1)  # the ball's socket is 20 mm wide
    found = session.snapshot()
    assert found.level == "unreachable" and "left_condyle" in found.messages[0]
    assert np.array_equal(found.pose, good) and found.out_of_reach == ()
    assert found.wanted is not None and found.wanted[1] == 0.1 and found.wanted[4] == 0.05


def test_wild_poses_never_raise(session: Session) -> None:
    rng = np.random.default_rng(5)
    levels = set()
    for _ in range(200):
        session.q = rng.normal(size=4) * rng.choice([0.01, 0.1, 1.0, 1e3], 4)
        levels.add(session.snapshot().level)
    for q in ([np.nan] * 4, [np.inf, 0, 0, 0]):
        session.q = np.array(q)
        assert session.snapshot().level == "unreachable"
    assert "unreachable" in levels
    session.go_home()
    assert session.snapshot().level == "ok"


def test_dragging_goes_to_the_nearest_pose_on_the_contacts(session: Session) -> None:
    session.set_coordinate("beta", 0.06)
    session.set_coordinate("X", -0.001)
    target = session.snapshot().pose
    session.go_home()
    session.snapshot()
    session.drag_to(target)
    assert np.allclose(session.snapshot().pose, target, atol=1e-6)
    # Pulled straight down the platform opens, though Z is no independent coordinate.
    session.go_home()
    session.drag_to(np.array([0, 0, -0.004, 0, 0, 0]))
    assert session.snapshot().pose[2] < -0.002
    session.drag_to(np.array([0.5, 0, 0, 0, 0, 0]))
    assert session.snapshot().level == "unreachable"


@pytest.mark.parametrize("name", MECHANISMS)
def test_sliders_reach_from_home_and_a_little_beyond(name: str) -> None:
    session = Session(condyle.load_mechanism(name))
    found = session.coordinates()
    assert [c.name for c in found] == list(session.model.independent)
    for c in found:
        assert c.low < 0 < c.high
        session.go_home()
        session.set_coordinate(c.name, 0.1 * c.high)
        assert session.snapshot().level != "unreachable"


def test_unknown_coordinate_is_refused(session: Session) -> None:
    with pytest.raises(InputError, match="alpha"):
        session.set_coordinate("alhpa", 0.0)


@pytest.fixture(scope="module")
def chewing(reference: condyle.Mechanism) -> xr.Dataset:
    motion = Motion.from_csv(condyle.motion.bundled_reference()[0], rate=100)
    model = condyle.derive(reference, backend="interpreted")
    return model.solve(motion, condyle.reference_load())


def test_playback_shows_the_solutions_numbers(chewing: xr.Dataset) -> None:
    playback = Playback(chewing)
    playback.seek(1.634)
    assert playback.now == pytest.approx(1.63)
    found, at = playback.snapshot(), chewing.isel(time=163)
    assert np.array_equal(found.effort, at["effort"].values)
    assert np.array_equal(found.contact_force, at["contact_force"].values)
    assert np.array_equal(found.pose, at["pose"].values)
    assert found.time == playback.now and found.reach is None
    assert np.array_equal(found.rate, at["joint_rate"].values)
    balls = np.array([p[0] for p in found.scene.contacts.values()])
    assert np.allclose(balls, at["contact_point"].values, atol=1e-12)


def test_speeds_of_one_unit_have_it_in_the_heading(chewing: xr.Dataset) -> None:
    tables = tables_html(Playback(chewing).snapshot())
    assert tables.count("rad/s") == 1


def test_playback_runs_with_the_clock_and_stops_at_the_end(chewing: xr.Dataset) -> None:
    playback = Playback(chewing)
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


def test_play_begins_where_it_stands_however_long_it_stood(chewing: xr.Dataset) -> None:
    view = open_view(None, chewing, port=0)
    try:
        time.sleep(1.5)
        begun = time.monotonic()
        view.request("play", view.panel.toggle)
        assert view.playback is not None
        while not (now := view.playback.now):
            assert time.monotonic() < begun + 60, "it never began"
            time.sleep(0.02)
        assert now <= time.monotonic() - begun + 0.02
    finally:
        view.close()


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
        assert np.isnan(found.effort).all() and np.isnan(found.force_vector).all()
        assert np.isnan(found.load).all()
        assert "No result from 0.075 to 0.445 s: unreachable" in found.messages[0]
        assert "t = 0.07 s" in found.messages[1]


def test_a_stale_pose_is_drawn_grey_and_without_arrows(torn: xr.Dataset) -> None:
    view = open_view(solution=torn, port=0)
    try:
        assert view.playback is not None
        for when in (0.02, 0.3):
            view.playback.seek(when)
            for _ in range(100):  # the view draws meanwhile, perhaps the time before
                view.stage.show(view.playback.snapshot())
                parts = [view.stage._body, *view.stage._balls]
                parts += [node for _, _, node in view.stage._bars]
                tints = {tuple(part.color) for part in parts}
                arrows = any(arrow.visible for arrow in view.stage._arrows.values())
                if (arrows, len(tints) == 1) == (when == 0.02, when == 0.3):
                    break
                time.sleep(0.05)
            else:
                pytest.fail(f"t = {when}: {len(tints)} colours, arrows: {arrows}")
    finally:
        view.close()


def test_muscles_are_bands_that_move_and_take_their_activations_colour() -> None:
    view = open_view("human-jaw", port=0)
    try:
        assert not view.stage._bars and len(view.stage._bands) == 24
        view.session.set_load(np.array([0, 0, -300.0]), "right_molar")
        view.session.set_coordinate("beta", 0.1)
        snapshot = view.session.snapshot()
        view.stage.show(snapshot)
        greatest = [chain.actuator.effort_range[1] for chain in view.stage.mechanism.chains]
        assert np.allclose(snapshot.activation, snapshot.effort / greatest)
        for k, (band, node) in enumerate(view.stage._bands):
            end = view.stage.scale * snapshot.scene.chains[band.chain].points["M"][0]
            assert np.allclose(np.asarray(node.vertices)[-8:].mean(axis=0), end, atol=1e-6)
            assert tuple(node.color) == rgb(activation_colour(snapshot.activation[k]))
    finally:
        view.close()


def test_measured_markers_are_where_they_were_measured(chewing: xr.Dataset) -> None:
    t = chewing["time"].values
    places = np.stack([np.full((len(t), 3), 0.08), np.outer(t, [1e-3, 0, 0])], axis=1)
    places[50, 1] = np.nan
    nothing = np.full((len(t), 2), np.nan)
    measured = MeasuredChannels(t, ("Upper", "Lower"), ("fixed", "platform"), places, nothing)
    view = open_view(solution=chewing.condyle.with_measured(measured), port=0)
    try:
        assert view.playback is not None
        upper, lower = view.stage._markers
        assert tuple(upper.color) != tuple(lower.color)
        for sample in (20, 50):
            view.playback.seek(t[sample])
            view.stage.show(view.playback.snapshot())
            assert np.allclose(upper.position, view.stage.scale * 0.08)
            assert lower.visible == (sample == 20)
        assert np.allclose(lower.position, view.stage.scale * places[20, 1])
        view.stage.show(view.session.snapshot())
        assert not upper.visible, "moved by hand, there is no measurement"
    finally:
        view.close()


def test_readout_escapes_names_and_writes_the_numbers(reference: condyle.Mechanism) -> None:
    chains = [
        c.model_copy(update={"name": "<b>jaw</b>"}) if i == 0 else c
        for i, c in enumerate(reference.chains)
    ]
    session = Session(reference.replace(chains=tuple(chains)))
    session.set_coordinate("X", 0.016)
    found = session.snapshot()
    for text in (status_html(found), tables_html(found)):
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
        assert np.allclose(matrix(turn_onto(unit)) @ [0, 0, 1], unit)


def volume(vertices: np.ndarray, faces: np.ndarray) -> float:
    """Signed: positive for a closed surface whose faces look outwards."""
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    return float((a * np.cross(b, c)).sum() / 6)


@pytest.mark.parametrize("name", MECHANISMS)
def test_bodies_are_closed_and_look_outwards(name: str) -> None:
    mechanism = condyle.load_mechanism(name)
    vertices, faces = platform_hull(mechanism)
    assert volume(vertices, faces) > 0
    points = [np.asarray(c.platform) for c in mechanism.chains]
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    normal = np.cross(b - a, c - a)
    for point in points:
        assert ((point - a) * normal).sum(axis=1).max() < 1e-9, "no joint is outside"
    assert volume(*unit_rod(64)) == pytest.approx(np.pi, rel=2e-3)


@pytest.mark.parametrize("name", MECHANISMS)
def test_drawn_rods_join_the_platform_and_keep_their_length(name: str) -> None:
    mechanism = condyle.load_mechanism(name)
    model = condyle.derive(mechanism, backend="interpreted")
    t = np.linspace(0, 1, 31)
    motion = Motion.from_arrays(t, {n: 0.004 * np.sin(5 * t) for n in model.independent})
    found = model.solve(motion, Load.zero())
    scene = place(mechanism, found["pose"].values, found["joint"].values)
    for i, contact in enumerate(mechanism.contacts):
        assert np.allclose(scene.contacts[contact.name], found["contact_point"].values[:, i])
    for i, chain in enumerate(mechanism.chains):
        drawing = scene.chains[chain.name]
        last = drawing.rods[-1]
        assert last.end == "M"
        length = np.linalg.norm(drawing.points[last.end] - drawing.points[last.start], axis=1)
        if chain.kind not in ("SPS", "cable"):
            assert np.ptp(length) < 1e-12
        else:
            leg = np.linalg.norm(drawing.points["M"] - drawing.points["B"], axis=1)
            home = np.linalg.norm(np.subtract(chain.platform, chain.base))
            sign = -1 if chain.kind == "cable" else 1
            assert np.allclose(leg, home + sign * found["joint"].values[:, i])


SURFACES = {
    "sphere": {"kind": "sphere", "centre": [-26.65, 72, 62.53], "radius": 20},
    "cylinder": {"kind": "cylinder", "point": [0, 72, 62.53], "axis": [1, 0, 0], "radius": 20},
    "wall": {"kind": "sphere", "centre": [-26.65, 92, 42.53], "radius": 20},
}


@pytest.mark.parametrize("kind", SURFACES)
def test_patches_lie_on_their_surface_within_the_bounds(raw: dict, kind: str) -> None:
    raw["contact"][0]["surface"] = SURFACES[kind]
    if kind == "wall":
        del raw["contact"][0]["bounds"]
    contact = condyle.mechanism.files.from_data(raw).contacts[0]
    patch = contact_patch(contact, np.array([contact.point]), 0.06)
    assert len(patch.faces) > 100
    shown = patch.vertices[np.unique(patch.faces)]
    phi = [float(contact.surface.phi(p)) for p in shown]
    assert np.abs(phi).max() < 1e-9
    assert patch.bounded == (kind != "wall")
    if patch.bounded:
        assert shown[:, 0].min() == pytest.approx(-0.02765)
        assert shown[:, 1].max() == pytest.approx(0.075)
    assert patch.outline.shape[1:] == (2, 3)
