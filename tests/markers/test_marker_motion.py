"""Poses from markers: the motion that was recorded comes back, or what is wrong is said."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.recorded_jaw import FIXED, LOWER, PLATFORM, UPPER, Jaw, on_contacts, record

import condyle
from condyle.errors import InputError
from condyle.markers import MarkerFile, MarkerMotion, motion_from_c3d, motions_of, read_c3d
from condyle.markers.marker_bodies import home_frames
from condyle.markers.registration import register

# Single precision of some 1.5 m, over the least breadth of a brace, 15 mm.
ROUNDING = np.array([1e-6] * 3 + [2e-5] * 3)


def measured(jaw: Jaw, folder: Path, per_metre: float = 1e3, **options: Any) -> MarkerMotion:
    tables = options.pop("tables", None) or jaw.tables()
    mechanism = options.pop("mechanism", "masticatory")
    write = {k: options.pop(k) for k in ("units", "first_frame", "missing") if k in options}
    path = jaw.write(folder / "a.c3d", per_metre, **write)
    return motion_from_c3d(path, tables, mechanism, **options)


def refused(said: str, jaw: Jaw, folder: Path, **options: Any) -> None:
    with pytest.raises(InputError, match=said):
        measured(jaw, folder, **options)


def same(got: MarkerMotion, jaw: Jaw, of: float = 1.0) -> MarkerMotion:
    """The recorded motion came back, to `of` times the rounding."""
    off = np.abs(got.motion.value - jaw.pose[: len(got.motion)]).max(axis=0)
    assert (off < of * ROUNDING).all(), off
    return got


def jaw_without(frames: slice, *names: str, **options: Any) -> Jaw:
    """A recording in which markers are not seen for some frames."""
    jaw = record(**options)
    for name in names:
        jaw.at(name)[frames] = np.nan
    return jaw


def test_the_motion_comes_back(tmp_path: Path) -> None:
    """In laboratories of any axes, with a head that moves."""
    jaw = record(seconds=1.2)
    got = same(measured(jaw, tmp_path, cutoff=None), jaw)
    assert got.motion.smoothing is None and got.motion.sha256 is not None
    assert got.motion.kind == "pose" and got.gaps == () and got.warnings == ()
    assert got.measured.all() and got.load is None
    assert max(r.largest for r in got.residuals) < 1e-6
    assert [(r.name, r.body, r.seen) for r in got.residuals] == [
        *((name, "fixed", 1.0) for name in FIXED),
        *((name, "platform", 1.0) for name in PLATFORM),
    ]
    assert max(got.registration.residual.values()) < 1e-9
    for name, place in UPPER.items():
        np.testing.assert_allclose(got.markers[name], np.tile(place, (len(jaw.t), 1)), atol=2e-6)
    np.testing.assert_allclose(got.markers["Lower_FL"][0], LOWER["Lower_FL"], atol=2e-6)
    jaw = record(seed=1, seconds=1.2)
    assert measured(jaw, tmp_path, cutoff="auto").motion.smoothing is not None


def test_without_noise_to_the_last_digits(tmp_path: Path) -> None:
    """A recording in double precision, on planes and curved surfaces."""
    for mechanism in ("masticatory", "masticatory-curved", "human-jaw"):
        jaw = record(mechanism=mechanism, seconds=1.0)
        recording = replace(read_c3d(jaw.write(tmp_path / "a.c3d")), points=jaw.points)
        (got,) = motions_of(
            recording, MarkerFile.read(jaw.tables()), condyle.load_mechanism(mechanism)
        )
        np.testing.assert_allclose(got.motion.value, jaw.pose, rtol=0, atol=1e-9)
        assert got.markers_moved["all"]["after_largest"] < 1e-9


@pytest.mark.slow
def test_other_units(tmp_path: Path) -> None:
    for unit, units in ((1.0, "m"), (100.0, "cm"), (1e3, None)):
        jaw = record(unit=unit, seconds=0.8)
        got = same(measured(jaw, tmp_path, unit, units=units), jaw)
        assert len(got.warnings) == (units is None)
    jaw = record(unit=100.0, seconds=0.8)
    same(measured(jaw, tmp_path, 100.0, units="m", unit="cm"), jaw)  # the file's own is wrong
    got = measured(record(unit=1.0, seconds=0.8), tmp_path, 1.0, units=None, max_residual=1.0)
    assert "mm was assumed" in got.warnings[0]
    assert "fixed markers are 0.0" in got.warnings[1] and "--units" in got.warnings[1]


@pytest.mark.slow
def test_noise_within_the_bound_of_cramer_and_rao(tmp_path: Path) -> None:
    """The head's six unknowns and the jaw's four of every frame, by differences."""
    noise, h = 2e-4, 1e-6
    jaw = record(noise=noise, seconds=6, seed=3, head=0.0)
    got = measured(jaw, tmp_path)
    frames = np.arange(60, 600, 6)
    upper, lower = (np.array(list(body.values())) for body in (UPPER, LOWER))
    free = [0, 1, 3, 4]
    bound = []
    for pose in jaw.pose[frames]:
        ways = np.zeros((8, 6))
        ways[range(4), free], ways[range(4, 8), free] = h, -h
        near = on_contacts("masticatory", pose + ways)
        slope = (near[:4] - near[4:]).T / (2 * h)
        turns = _rotations(near[:, 3:])
        places = lower @ turns.transpose(0, 2, 1) + near[:, None, :3]
        J_q = ((places[:4] - places[4:]) / (2 * h)).reshape(4, -1).T
        there = lower @ _rotations(pose[None, 3:])[0].T + pose[:3]
        J_h = np.concatenate([_rigid(upper), _rigid(there)])
        J = np.hstack([np.concatenate([np.zeros((12, 4)), J_q]), J_h])
        covariance = np.linalg.inv(J.T @ J)[:4, :4] * noise**2
        bound.append(np.sqrt(np.diag(slope @ covariance @ slope.T)))
    ratio = ((got.motion.value - jaw.pose)[frames] / np.array(bound)).std(axis=0)
    # 90 frames tell a deviation to 7 %. The head is fitted to its own markers alone.
    assert (ratio < 1.3).all() and (ratio > 0.8).all()
    # Of 12 coordinates a frame of each body 6 are left over.
    rms = np.sqrt(np.mean([r.rms**2 for r in got.residuals]))
    assert rms == pytest.approx(noise * np.sqrt(6 / 4), rel=0.05)
    # Of the platform's, 8 once it is on the contacts.
    assert got.markers_moved["all"]["after_rms"] > got.markers_moved["all"]["before_rms"]
    assert got.gaps == ()


def _rotations(angles: np.ndarray) -> np.ndarray:
    return Rotation.from_euler("XYZ", angles).as_matrix()


def _rigid(points: np.ndarray) -> np.ndarray:
    """Derivatives of points, (3 n, 6), by a body's translation and turn."""
    turns = [np.cross(axis, points).ravel() for axis in np.eye(3)]
    moves = [np.tile(axis, len(points)) for axis in np.eye(3)]
    return np.array([*moves, *turns]).T


@pytest.mark.slow
def test_home_is_one_time_or_later(tmp_path: Path) -> None:
    """One frame; the numbers of the register are of that frame. Frames that begin later."""
    jaw = record(head=0.0, seconds=1.2)
    got = same(measured(jaw, tmp_path, tables=jaw.tables(home=0.204)), jaw)
    assert np.flatnonzero(home_frames(got.recording, (0.204, 0.204))).tolist() == [20]
    later = jaw.tables(home=[5.0, 5.5])
    got = same(measured(jaw, tmp_path, first_frame=501, tables=later), jaw)
    assert got.motion.t[0] == 5.0
    refused(r"runs from 5 to 6.19 s; its first frame is number 501", jaw, tmp_path, first_frame=501)
    got = measured(jaw, tmp_path, tables=jaw.tables(home=[0.0, 0.9]))
    assert "the platform moves by" in got.warnings[0]


@pytest.mark.slow
def test_registered_by_markers_or_directions(tmp_path: Path) -> None:
    """Markers that stand at points of the mechanism at home, on either body, or numbers; an origin
    that is a point, a place or a marker, and `forward`, which need not be square to `up`."""
    jaw = jaw_without(slice(20, 22), "Lower_FL", seconds=0.8)  # not seen at all times of home
    points = {"chin": LOWER["Lower_FL"], "brow": UPPER["Upper_BR"]}
    machine = condyle.load_mechanism("masticatory")
    marked = machine.set({f"platform.points.{name}": point for name, point in points.items()})
    register = {"chin": "Lower_FL", "brow": "upper br", "incisor": jaw.register["incisor"]}
    same(measured(jaw, tmp_path, tables=jaw.tables(register=register), mechanism=marked), jaw)
    jaw = record(head=0.0, seconds=0.8)
    forward, up = jaw.A[:, 0], jaw.A[:, 2]
    ways = {"forward": (7 * forward + 3 * up).tolist(), "up": (2 * up).tolist()}
    place = {"origin": (jaw.b * 1e3).tolist()}
    point = {"origin": "incisor", "incisor": jaw.register["incisor"]}
    got = same(measured(jaw, tmp_path, tables=jaw.tables(register=ways | point)), jaw)
    assert got.registration.residual == {}
    outside = {k: v for k, v in jaw.tables().items() if k != "register"} | ways | place
    same(measured(jaw, tmp_path, tables=outside), jaw)
    jaw.labels[jaw.labels.index("Lower_FR")] = "chin"  # a marker of the name of the point
    platform = ["chin" if name == "Lower_FR" else name for name in PLATFORM]
    tables = jaw.tables(register=ways | {"origin": "chin"}, platform=platform)
    marked = machine.set("platform.points.chin", LOWER["Lower_FR"])
    same(measured(jaw, tmp_path, tables=tables, mechanism=marked), jaw)


def test_points_of_another_jaw_or_exchanged_are_told_by_residuals(tmp_path: Path) -> None:
    jaw = record(head=0.0, seconds=0.8)
    right = dict(jaw.register)
    for name in jaw.register:
        jaw.register[name] = ((np.array(jaw.register[name]) - jaw.b * 1e3) * 1.1).tolist()
    points = np.array([[52.75, 0, 4.63], [-26.65, 72, 42.53], [-26.65, -72, 42.53]]) * 1e-3
    want = 0.1 * np.linalg.norm(points - points.mean(axis=0), axis=1)
    found = measured(jaw, tmp_path)
    np.testing.assert_allclose(list(found.registration.residual.values()), want, rtol=1e-3)
    assert found.registration.size == pytest.approx(1 / 1.1, rel=1e-5)
    np.testing.assert_allclose(list(found.registration.sized.values()), 0, atol=1e-6)
    (warning,) = found.warnings
    assert "far from their places in the mechanism: incisor 5.87 mm" in warning
    assert "the same in the size that fits best: " in str(found)
    jaw.register |= {"incisor": right["left_condyle"], "left_condyle": right["incisor"]}
    jaw.register["right_condyle"] = right["right_condyle"]
    with pytest.raises(InputError) as caught:  # it is upside down so
        measured(jaw, tmp_path)
    for words in ("fit much better with their places exchanged", "incisor at left_condyle"):
        assert words in str(caught.value)


@pytest.mark.parametrize(
    "pair", [*combinations(["incisor", "chin", "left_condyle", "left_molar"], 2)]
)
def test_two_landmarks_of_another_person_exchanged_are_named(pair: tuple[str, str]) -> None:
    """Nine tenths of the size, 3 mm off each, in any two of seven."""
    jaw = condyle.load_mechanism("human-jaw")
    places = {c.name: c.point for c in jaw.contacts} | dict(jaw.platform.points)
    del places["left_canine"], places["right_canine"]
    rng = np.random.default_rng(4)
    given = {n: (900 * np.array(p) + rng.normal(0, 1.7, 3)).tolist() for n, p in places.items()}
    roles = {"fixed": ["a", "b", "c"], "platform": ["d", "e", "f"], "home": 0.0}
    a, b = pair
    for mixed in (given, given | {a: given[b], b: given[a]}):
        file = MarkerFile.read(roles | {"register": mixed})
        found = register(file, jaw, lambda place, _: np.array(place) / 1e3, any_size=True)
        said = f"{a} at {b}" in str(found.warnings) or f"{b} at {a}" in str(found.warnings)
        assert said == (mixed is not given), found.warnings


def test_markers_that_are_not_seen(tmp_path: Path) -> None:
    """One is no gap; three are enough, as long as these are seen at home."""
    jaw = record(seconds=1.8)
    for i, name in enumerate([*FIXED, *PLATFORM]):
        jaw.at(name)[60 + 14 * i : 70 + 14 * i] = np.nan
    got = same(measured(jaw, tmp_path), jaw, 2)
    assert got.gaps == () and got.measured.all()
    assert got.residuals[0].seen == pytest.approx(1 - 10 / 180)
    jaw = jaw_without(slice(60), "Upper_FL", seconds=1.2)
    tables = jaw.tables(fixed=FIXED[1:], platform=PLATFORM[1:])
    same(measured(jaw, tmp_path, tables=tables), jaw, 3)
    got = same(measured(jaw, tmp_path), jaw, 3)
    assert len(got.residuals) == 7
    assert '"Upper_FL" (fixed) not seen at home and left out' in got.warnings[0]
    jaw = jaw_without(slice(60), *FIXED[:3], seconds=0.8)
    refused("1 of 4 fixed markers are seen while", jaw, tmp_path)


def test_short_gaps_are_filled_and_listed(tmp_path: Path) -> None:
    jaw = jaw_without(slice(150, 158), *PLATFORM[:2], seconds=2.5)
    for name in FIXED:
        jaw.at(name)[230:232] = np.nan
    jaw.at("Upper_BR")[200] += 0.02
    got = measured(jaw, tmp_path)
    assert [(g.start, g.end, g.frames, g.made) for g in got.gaps] == [
        (1.5, 1.57, 8, "filled"),
        (2.0, 2.0, 1, "filled"),
        (2.3, 2.31, 2, "filled"),
    ]
    reasons = ("2 of 4 platform", "Upper_BR is 34.6 mm", "0 of 4 fixed")
    assert all(said in gap.reason for gap, said in zip(got.gaps, reasons, strict=True))
    assert np.flatnonzero(~got.measured).tolist() == [*range(150, 158), 200, 230, 231]
    off = np.abs(got.motion.value - jaw.pose)
    assert (off[:, :3] < 5e-5).all() and (off[:, 3:] < 1e-3).all()
    assert (off[got.measured] < 2 * ROUNDING).all()
    assert np.isnan(got.markers["Lower_FL"][150:158]).all()
    strict = measured(jaw, tmp_path, max_residual=0.1)  # then the bad marker is believed
    assert len(strict.gaps) == 2


@pytest.mark.slow
def test_longer_gaps_are_errors_that_name_them(tmp_path: Path) -> None:
    jaw = jaw_without(slice(80, 90), *PLATFORM[:2], seconds=1.2)
    assert [g.frames for g in measured(jaw, tmp_path, max_gap=0.1).gaps] == [10]
    refused(r"longer than 0\.099 s: 0\.8 to 0\.89 s", jaw, tmp_path, max_gap=0.099)
    jaw = jaw_without(slice(60, 80), *PLATFORM[1:], seconds=2.0)
    for name in PLATFORM[1:]:
        jaw.at(name)[180:] = np.nan
    jaw.at("Upper_FL")[120:123] += 0.02
    with pytest.raises(InputError, match=r"no pose for longer than 0\.1 s") as caught:
        measured(jaw, tmp_path)
    assert "0.6 to 0.79 s (1 of 4 platform markers seen, not Lower_BL" in str(caught.value)
    assert "1.8 to 1.99 s" in str(caught.value) and "--longest" in caught.value.hint
    assert "1.22" not in str(caught.value)
    got = measured(jaw, tmp_path, longest=True)
    assert got.motion.t[0] == 0.8 and got.motion.t[-1] == 1.79
    assert [g.made for g in got.gaps] == ["cut", "filled", "cut"]
    assert np.abs(got.motion.value - jaw.pose[80:180])[:, 0].max() < 5e-5
    got = measured(jaw, tmp_path, max_gap=0.2)
    assert got.motion.t[-1] == 1.79 and [g.made for g in got.gaps] == ["filled", "filled", "cut"]


@pytest.mark.slow
def test_exchanged_labels_are_named(tmp_path: Path) -> None:
    """To the end they are refused, for four frames left out; a ring of three is named too."""
    jaw = record(noise=1e-4, seconds=1.5)
    kept = jaw.points.copy()
    for pair in (("Upper_FL", "Upper_BR"), ("Upper_FL", "Lower_FL")):
        said = f"{pair[0]} and {pair[1]} look exchanged"
        a, b = (jaw.labels.index(name) for name in pair)
        jaw.points[90:, [a, b]] = kept[90:, [b, a]]
        refused(f"from 0.9 to 1.49 s {said}", jaw, tmp_path)
        jaw.points[94:] = kept[94:]
        got = measured(jaw, tmp_path)
        assert [g.frames for g in got.gaps] == [4] and len(got.warnings) == 1
        assert f"from 0.9 to 0.93 s {said}" in got.warnings[0]
        jaw.points[:] = kept
    jaw.points[90:, [0, 1, 2]] = kept[90:, [1, 2, 0]]
    refused("Upper_FL, Upper_BL, Upper_FR look exchanged", jaw, tmp_path)


@pytest.mark.slow
def test_markers_that_move_against_their_body_are_named(tmp_path: Path) -> None:
    """A brace comes loose: the marker's own distances vary, the others' do not. Lists of bodies
    that are wrong look the same."""
    jaw = record(noise=1e-4, seconds=2.0)
    tables = jaw.tables(platform=[*PLATFORM, "Nasion"])
    refused("Nasion moves against", jaw, tmp_path, tables=tables)
    tables = jaw.tables(fixed=["Lower_FL", *FIXED[1:]], platform=["Upper_FL", *PLATFORM[1:]])
    refused(r"Lower_FL moves against .* Upper_FL moves against", jaw, tmp_path, tables=tables)
    since = np.clip(jaw.t - 0.6, 0, None)
    jaw.at("Lower_FR")[:] += np.outer(5e-3 * np.sin(6 * since), [1, 0.5, -0.3])
    (warning,) = measured(jaw, tmp_path, max_residual=0.02).warnings
    assert warning.startswith("Lower_FR moves against")
    refused("^Lower_FR moves against the markers it is listed with", jaw, tmp_path)


def test_what_the_contacts_take_away(tmp_path: Path) -> None:
    """The distance from the bundled planes z = -1.1 x + 13.215 mm, by school geometry."""
    jaw = record(push=0.004, seconds=1.2)
    got = measured(jaw, tmp_path)
    balls = Rotation.from_euler("XYZ", jaw.pose[:, 3:]).apply([-0.02665, 0.072, 0.04253])
    x, _, z = (balls + jaw.pose[:, :3]).T
    away = np.abs(z + 1.1 * x - 0.013215) / np.hypot(1, 1.1)
    rms, largest = got.off_contacts["left_condyle"]
    assert rms == pytest.approx(np.sqrt(np.mean(away**2)), abs=1e-6)
    assert largest == pytest.approx(away.max(), abs=1e-6)
    moved = got.markers_moved["all"]
    assert moved["before_largest"] < 1e-6 < 1e-4 < moved["after_rms"] < largest
    free = jaw.tables(register={"forward": [1, 0, 0], "up": [0, 0, 1], "origin": [0, 0, 0]})
    assert measured(jaw, tmp_path, tables=free, mechanism="gough-stewart").off_contacts == {}


GOOD = """
fixed = ["A", "B", "C"]
platform = ["D", "E", "F"]
home = [0.0, 0.5]
[register]
incisor = [1, 2, 3]
left_condyle = "TMJ_L"
right_condyle = [4.5, 5, 6]
"""


WRONG = [
    ('["A", "B", "C"]', '["A", "B"]', "fixed: expected at least 3 entries, got 2"),
    ('["A", "B", "C"]', '["A", "B", "B"]', "fixed: B is listed more than once"),
    ('["A", "B", "C"]', '["A", "B", "D"]', "D is listed in fixed and in platform"),
    ('["A", "B", "C"]', '["A", "B", 3]', "fixed[2]: expected text in quotes, got 3"),
    ('["A", "B", "C"]', '"ABC"', "fixed: expected a list"),
    ("fixed = ", "fixd = ", "fixd: is not a key of the file format; remove it or correct its "),
    ('platform = ["D", "E", "F"]', "", "platform: is missing"),
    ("[0.0, 0.5]", "[0.5, 0.0]", "home: expected [from, to] or one time, got [0.5, 0]"),
    ("[0.0, 0.5]", "[0.0, nan]", "home[1]: expected a finite number"),
    ("[0.0, 0.5]", "true", "home: expected a list"),
    ("[0.0, 0.5]", "[0, 1, 2]", "home: expected at most 2 entries"),
    ("home = [0.0, 0.5]", "", "home: is missing; name a stretch"),
    ("[1, 2, 3]", '""', "incisor: expected the label of a marker, or three numbers"),
    ("[1, 2, 3]", "[1, 2, inf]", "incisor: expected the label of a marker, or three numbers"),
    ("incisor = [1, 2, 3]", "", "got 2 points of the mechanism, expected 3 or more"),
    ("[register]", "[registr]", "registr: is not a key"),
    ("incisor =", "up =", "forward, origin missing: directions need forward, up and origin"),
    (GOOD[GOOD.index("inc") :], "up=[0,0,0]\nforward=[1,0,0]\norigin='x'", "up: a direction"),
    ("right_con", "forward=[1,0,0]\nup=[0,0,1]\norigin=[0,0,0]\nx", "beside forward and up"),
    ("[register]", "[vertical]\nup=[0,0,0]\n[register]", "vertical.up: expected three numbers"),
    ("[register]", "[weights]\nUper=2.0\n[register]", "weights: Uper is not listed in platform"),
    ("[register]", "[register", "is not TOML"),
]


def test_marker_files_that_are_wrong(tmp_path: Path) -> None:
    assert MarkerFile.read(tomllib.loads(GOOD)).home == (0.0, 0.5)
    path = tmp_path / "m.toml"
    for old, new, said in WRONG:
        path.write_text(GOOD.replace(old, new, 1))
        with pytest.raises(InputError) as caught:
            MarkerFile.read(path)
        assert said in str(caught.value), str(caught.value)
    path.write_text('fixed = ["A"]\nplatform = 3\nhome = "x"\nrate = 5\n[register]\nincisor = 1\n')
    with pytest.raises(InputError) as caught:
        MarkerFile.read(path)
    head, *lines = str(caught.value).splitlines()  # all at once
    assert head.endswith("m.toml: 5 problems") and len(lines) == 5
    path.write_bytes(b"\xff\xfe\x00")
    for given, said in {
        path: "not a text file",
        tmp_path / "n.toml": "no such file",
        5: "the path",
    }.items():
        with pytest.raises(InputError, match=said):
            MarkerFile.read(given)  # type: ignore[arg-type]


FORWARD = {"forward": [1, 0, 0], "up": [0, 0, 1]}
ON_ONE_LINE = {"incisor": [0] * 3, "left_molar": [1] * 3, "right_molar": [2] * 3}
TWO = ["Upper_FL", "Upper_BL"]
MISSING: list[tuple[dict[str, Any], str]] = [
    ({"fixed": [*TWO, "Uper_FR"]}, 'has no marker "Uper_FR". Did you mean'),
    ({"fixed": [*TWO, "upper fl"]}, "do not name different markers"),
    ({"fixed": [*TWO, "Nasion"]}, "are on one line, so rotation about it is"),
    ({"home": [0.5, 9.0]}, "home: 0.5 to 9 s is not within a.c3d, which runs from 0 to 0.79"),
    ({"register": dict.fromkeys("abc", "TMJ_L")}, 'has no point or contact "a"'),
    ({"register": ON_ONE_LINE | {"incisor": "TMJ"}}, 'incisor: a.c3d: has no marker "TMJ"'),
    ({"register": ON_ONE_LINE}, "on one line in the laboratory"),
    ({"register": FORWARD | {"up": [2, 0, 0.01], "origin": [0, 0, 0]}}, "along one line"),
    ({"register": FORWARD | {"origin": "chin"}}, 'has no point or contact "chin"'),
    ({"register": FORWARD | {"origin": "incisor"}}, 'a.c3d: has no marker "incisor"'),
]


def test_markers_and_points_that_are_not_there(tmp_path: Path) -> None:
    """And options that are wrong."""
    jaw = record(seconds=0.8)
    for option in ({"max_gap": -1.0}, {"max_residual": float("nan")}):
        refused("expected a number of at least 0", jaw, tmp_path, **option)
    said = "frames have a pose, expected at least 6"
    refused(said, jaw, tmp_path, max_residual=0.0, max_gap=100.0)
    jaw.at("Nasion")[:] = (jaw.at("Upper_FL") + jaw.at("Upper_BL")) / 2
    for changes, said in MISSING:
        with pytest.raises(InputError) as caught:
            measured(jaw, tmp_path, tables=jaw.tables(**changes))
        assert said in str(caught.value) and "\n" not in str(caught.value), str(caught.value)
