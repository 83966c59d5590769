"""Films: as many frames as asked for, that move, and whole files or none."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import condyle

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
