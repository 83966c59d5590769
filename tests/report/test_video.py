"""Films: as many frames as asked for, that move, and whole files or none."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import condyle
from condyle.motion import Motion, bundled_reference

Image = pytest.importorskip("PIL.Image")


@pytest.fixture(scope="module")
def chewing() -> xr.Dataset:
    motion = Motion.from_csv(bundled_reference()[0], rate=20)
    model = condyle.derive("masticatory", backend="numpy")
    return model.solve(motion, condyle.reference_load())


def frames(path: Path) -> list[np.ndarray]:
    film = Image.open(path)
    found = []
    for k in range(film.n_frames):
        film.seek(k)
        found.append(np.asarray(film.convert("RGB"), dtype=float))
    return found


def test_a_gif_moves_as_the_solution_does(chewing: xr.Dataset, tmp_path: Path) -> None:
    out = condyle.video(chewing, tmp_path / "film.gif", fps=4, width=200, speed=2.0)
    film = Image.open(out)
    assert film.n_frames == 11 and film.size[0] == 200 and film.info["duration"] == 250
    shown = frames(out)
    opened = int(np.argmax(np.abs(chewing["pose"].values[:, 4]).reshape(-1, 1)[::10][:11]))
    assert np.abs(shown[opened] - shown[0]).mean() > 1.0
    pink = [((f[..., 0] > 150) & (f[..., 1] < 80)).sum() for f in shown]
    load = np.linalg.norm(chewing["load"].values[::10, :3], axis=1)
    assert pink[int(np.argmax(load))] > pink[0]  # the arrow of the load
    assert [path.name for path in tmp_path.iterdir()] == ["film.gif"]


def test_an_mp4_lasts_as_long(chewing: xr.Dataset, tmp_path: Path) -> None:
    reader = pytest.importorskip("imageio_ffmpeg")
    chewing.condyle.save(tmp_path / "chewing.nc")
    out = condyle.video(
        tmp_path / "chewing.nc", tmp_path / "film.mp4", fps=10, width=320, view="Side"
    )
    count, seconds = reader.count_frames_and_secs(str(out))
    assert count == 51 and seconds == pytest.approx(5.1, abs=0.11)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"out": "film.avi"}, "ends in .gif or .mp4"),
        ({"fps": 0}, "fps: expected 1 to 60"),
        ({"speed": float("nan")}, "speed: expected"),
        ({"speed": 1e-4}, "frames, expected 3000 or fewer"),
        ({"view": "Back"}, "view: expected Front"),
        ({"width": 20}, "width: expected 160"),
    ],
)
def test_what_does_not_fit_is_said(
    chewing: xr.Dataset, tmp_path: Path, changes: dict[str, Any], said: str
) -> None:
    asked = {"solution": chewing, **changes}
    asked["out"] = tmp_path / changes.get("out", "film.gif")
    with pytest.raises(condyle.InputError, match=said):
        condyle.video(**asked)
    assert not [*tmp_path.iterdir()]


def test_a_package_that_is_missing_is_named(
    chewing: xr.Dataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("condyle.extras.find_spec", lambda name: None if "ffmpeg" in name else name)
    with pytest.raises(condyle.errors.MissingExtraError, match="video"):
        condyle.video(chewing, tmp_path / "film.mp4")
