"""The scene of a solution without a server: what its page plays, read back from the page."""

from __future__ import annotations

import base64
import re
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
import xarray as xr
import zstandard
from support.machines import model

import condyle
from condyle.motion import Motion

T = np.linspace(0.0, 1.0, 21)


@pytest.fixture(scope="module")
def solution() -> xr.Dataset:
    path = {"X": 2e-3 * T, "Y": 0 * T, "alpha": 0 * T, "beta": 0.1 * T}
    return model("masticatory").solve(Motion.from_arrays(T, path))


def recording(page: str) -> dict[str, Any]:
    """Messages of a page with their times [s]."""
    found = re.search(r'__VISER_EMBED_DATA__="([^"]+)"', page)
    assert found is not None
    data = zstandard.ZstdDecompressor().decompress(base64.b64decode(found[1])[8:])
    size = int.from_bytes(data[:8], "little")
    return msgspec.msgpack.decode(data[8 : 8 + size])


def test_the_page_plays_the_solution(solution: xr.Dataset, tmp_path: Path) -> None:
    """At the pace that was asked for; nothing is taken from elsewhere."""
    scene = condyle.moving_scene(solution, fps=10, speed=0.5)
    played = recording(scene.html)
    assert played["durationSeconds"] == pytest.approx(21 / 10)
    moved = [
        (time, message["position"])
        for time, message in played["messages"]
        if message["type"] == "SetPositionMessage" and message["name"] == "/platform"
    ]
    times, places = np.array([t for t, _ in moved]), np.array([place for _, place in moved])
    at = np.array([np.interp(0.5 * times, T, c) for c in solution["pose"].values[:, :3].T]).T
    scale = places[-1, 0] / at[-1, 0]
    assert len(times) >= 20 and np.allclose(places, scale * at, atol=1e-6 * scale)
    assert scene.save(tmp_path / "scene.html").stat().st_size < 2_000_000
    assert "<iframe" in scene._repr_html_() and "<script" not in scene._repr_html_()


def test_wrong_frames_are_said(solution: xr.Dataset) -> None:
    for given, said in (({"fps": 0}, "fps"), ({"speed": 1e-6}, "frames, expected 3000 or fewer")):
        with pytest.raises(condyle.InputError, match=said):
            condyle.moving_scene(solution, **given)
