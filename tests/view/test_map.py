"""Maps in the live page: where a hand clicks, the mechanism goes."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import pytest
from support.browser import PATIENCE, Tab
from support.machines import model

import condyle
from condyle.errors import InputError
from condyle.view import View, open_view
from condyle.view.map_layer import BESIDE, SIDE

OVER = ["X=-5:12:12 mm", "beta=-15:30:12 deg", "Y=-6:6:5 mm"]


@pytest.fixture(scope="module")
def view() -> Iterator[View]:
    running = open_view(
        map=condyle.workspace_map(model("masticatory"), OVER, hold="alpha=1 deg"), port=0
    )
    yield running
    running.close()


def test_rays_become_poses(view: View) -> None:
    """A ray through the cube from the front: reachable, on the ray, the held coordinate held."""
    layer = view.map
    assert layer is not None
    corner = view.stage.centre + np.array(BESIDE) - SIDE / 2
    target = corner + SIDE * np.array([0.4, 0.2, 0.5])
    q = layer.state_at(target - [0, 9, 0], np.array([0.0, 2.0, 0.0]))
    assert q is not None
    X, Y, alpha, beta = q
    assert (X, Y, alpha) == pytest.approx((-5e-3 + 0.4 * 17e-3, 0, np.radians(1)), abs=1e-12)
    assert np.radians(-15.001) < beta < np.radians(-5)
    assert model("masticatory").poses.survey(q[None]).reached.all()
    assert layer.state_at(target + 9, np.array([0.0, 1.0, 0.0])) is None
    with pytest.raises(InputError, match="one coordinate"):
        open_view(map=condyle.workspace_map(model("masticatory"), "X=0:5:3 mm"), port=0)


def test_a_click_moves_the_mechanism(open_tab: Callable[..., Tab], view: View) -> None:
    tab = open_tab(view.url)
    tab.page.wait_for_selector("[data-level]")

    def isosurface(pixels: np.ndarray) -> np.ndarray:
        blue = pixels[..., 2].astype(int)
        return (blue > 150) & (blue - pixels[..., 0] > 50) & (pixels[..., 1] > 120)

    pixels = tab.picture_where("canvas", lambda p: isosurface(p).sum() > 500, "the map")
    rows, columns = np.nonzero(isosurface(pixels))
    middle = np.hypot(rows - np.median(rows), columns - np.median(columns)).argmin()
    box = tab.page.locator("canvas").first.bounding_box()
    assert box is not None
    tab.page.mouse.click(box["x"] + float(columns[middle]), box["y"] + float(rows[middle]))
    tab.page.wait_for_function(
        "() => [...document.querySelectorAll('input')].some(i => Number(i.value) === 1)",
        timeout=PATIENCE,
    )
    assert view.session.q[2] == pytest.approx(np.radians(1))
