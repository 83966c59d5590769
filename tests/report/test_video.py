"""Films: as many frames as asked for, that move, and whole files or none."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.text import Annotation, Text

import condyle
from condyle.report.film_frame import FilmFrame, draw_colours, draw_floor, draw_scale, draw_skull
from condyle.report.scene import VIEWS, Camera, place
from condyle.report.scene.floor import floor_below, round_below
from condyle.report.scene.patches import Patch, contact_patch
from condyle.report.scene.skull import skull_of

Image = pytest.importorskip("PIL.Image")


def test_a_gif_moves_as_the_solution_does(solution: xr.Dataset, tmp_path: Path) -> None:
    out = condyle.video(solution, tmp_path / "film.gif", fps=4, width=200, speed=2.0)
    film, shown = Image.open(out), []
    assert film.n_frames == 11 and film.size[0] == 200 and film.info["duration"] == 250
    for k in range(film.n_frames):
        film.seek(k)
        shown.append(np.asarray(film.convert("RGB"), dtype=float))
    at = solution.isel(time=slice(None, None, 10))
    opened = int(np.abs(at["pose"].values[:, 4]).argmax())
    assert np.abs(shown[opened] - shown[0]).mean() > 1.0
    pink = [((f[..., 0] > 150) & (f[..., 1] < 80)).sum() for f in shown]
    load = np.linalg.norm(at["load"].values[:, :3], axis=1)
    assert pink[int(np.argmax(load))] > pink[0]  # the arrow of the load
    assert [*tmp_path.iterdir()] == [out]


def test_an_mp4_lasts_as_long(solution: xr.Dataset, tmp_path: Path) -> None:
    reader = pytest.importorskip("imageio_ffmpeg")
    solution.condyle.save(tmp_path / "run.nc")
    film = tmp_path / "film.mp4"
    condyle.video(tmp_path / "run.nc", film, fps=2, width=160, view="Side")
    count, seconds = reader.count_frames_and_secs(str(film))
    assert count == 11 and seconds == pytest.approx(5.5, abs=0.51), "to a frame"


WRONG: list[tuple[dict[str, Any], str]] = [
    ({"out": "film.avi"}, "ends in .gif or .mp4"),
    ({"fps": 0}, "fps: expected 1 to 60"),
    ({"speed": float("nan")}, "speed: expected"),
    ({"speed": 1e-4}, "frames, expected 3000 or fewer"),
    ({"view": "Back"}, "view: expected Front"),
    ({"width": 20}, "width: expected 160"),
]


def test_what_does_not_fit_is_said(
    solution: xr.Dataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for changes, said in WRONG:
        asked = {"solution": solution, "out": "film.gif", **changes}
        with pytest.raises(condyle.InputError, match=said):
            condyle.video(**{**asked, "out": tmp_path / asked["out"]})
    monkeypatch.setattr("condyle.extras.find_spec", lambda name: None if "ffmpeg" in name else name)
    with pytest.raises(condyle.errors.MissingExtraError, match="video"):
        condyle.video(solution, tmp_path / "film.mp4")
    assert not [*tmp_path.iterdir()]


def test_a_machine_without_contacts_is_filmed(tmp_path: Path) -> None:
    rest = condyle.trial_motion("gough-stewart", rate=5.0)
    out = condyle.video(condyle.run("gough-stewart", rest), tmp_path / "film.gif", fps=1, width=161)
    assert Image.open(out).size == (160, 90), "a slide's shape, of even sides"


def test_corners_say_what_is_drawn(solution: xr.Dataset) -> None:
    """Forces of a round size as long as the scale has them, the floor's step, colours, frames."""
    mechanism = solution.condyle.mechanism
    scene = place(mechanism, solution["pose"].values, solution["joint"].values)
    camera, axes = Camera.of(*VIEWS["Oblique"]), Figure().add_subplot()
    axes.set(xlim=(0.0, 1.0))
    floor = floor_below(np.array([[0.0, 0.0, 0.0], [0.3, 0.2, 0.1]]))
    assert floor.step == 0.02 and floor.lines[..., 2].max() < 0.0
    assert np.ptp(floor.lines[..., 0]) > 0.3
    frame = FilmFrame(axes, camera, scene, 0.1)
    draw_floor(axes, camera, floor)
    draw_scale(axes, {"load": 70.0, "contact": 0.0}, {"load": 1e-3, "contact": 0.0})
    draw_colours(axes, mechanism, 1.0, muscles=False)
    frame.show(50, "t = 2.5 s")
    said = [text.get_text() for text in axes.findobj(Text)]
    assert {"t = 2.5 s", "grid 20 mm", "50 N load", "temporalis", "{M}", "{S} "} <= {*said}
    [shown] = [one for one in axes.findobj(Annotation) if one.arrow_patch is not None]
    assert shown.xy[0] - shown.xyann[0] == pytest.approx(0.05)
    moved = [one.get_segments()[0][0] for one in axes.collections[:2]]
    np.testing.assert_allclose(moved[0], camera.flat(scene.position[50]))
    np.testing.assert_allclose(moved[1], 0.0, atol=1e-15)
    assert [round_below(value) for value in (0.99, 1.0, 4.9, 730.0)] == [0.5, 1.0, 2.0, 500.0]


def test_a_jaw_has_a_skull_of_what_its_file_knows() -> None:
    """Its shell holds every origin above the teeth and the joints; the row meets the landmarks."""

    def walls(machine: condyle.Mechanism) -> list[Patch]:
        return [contact_patch(c, np.array([c.point]), 0.05) for c in machine.contacts]

    jaw = condyle.load_mechanism("human-jaw")
    skull = skull_of(jaw, walls(jaw))
    assert skull is not None
    a, b, c = np.moveaxis(skull.vertices[skull.faces], 1, 0)
    outwards = np.cross(b - a, c - a)
    origins = {chain.name: np.array(chain.base) for chain in jaw.chains}
    points = [*origins.values(), *(x for wall in walls(jaw) for x in wall.vertices)]
    inside = [bool((((x - a) * outwards).sum(axis=1) <= 1e-12).all()) for x in points]
    below = {name for name, seen in zip(origins, inside, strict=False) if not seen}
    assert {name.rsplit("_", 1)[0] for name in below} == {
        "anterior_digastric",
        "geniohyoid",
        "anterior_mylohyoid",
        "posterior_mylohyoid",
    }
    assert all(inside[len(origins) :])
    for name in ("incisor", "left_canine", "right_molar"):
        apart = np.linalg.norm(skull.teeth - jaw.platform.points[name], axis=1)
        assert apart.min() < 1e-9, name
    axes = Figure().add_subplot()
    draw_skull(axes, Camera.of(*VIEWS["Side"]), skull)
    assert any("upper teeth" in text.get_text() for text in axes.findobj(Text))
    machine = condyle.load_mechanism("masticatory")
    assert skull_of(machine, walls(machine)) is None
