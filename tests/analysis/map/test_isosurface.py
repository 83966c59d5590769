"""Skins of sets that are known, sheets, rays, and maps in files."""

from math import pi
from pathlib import Path

import numpy as np
import pytest
from support.machines import model as model_from

import condyle
from condyle.analysis.map.isosurface import first_hit, isosurface, sheet
from condyle.analysis.map.map_files import grid_and_reach


def ball(n: int = 31, radius: float = 0.3, centre: float = 0.5) -> np.ndarray:
    u = np.linspace(0, 1, n)
    at = np.stack(np.meshgrid(u, u, u, indexing="ij"), axis=-1) - centre
    return radius - np.linalg.norm(at, axis=-1)


def volume_and_area(vertices: np.ndarray, faces: np.ndarray) -> tuple[float, float]:
    """By the divergence theorem, with normals turned away from the middle."""
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    normal = np.cross(b - a, c - a) / 2
    middle = vertices.mean(axis=0)
    signed = np.einsum("ij,ij->i", a - middle, normal) / 3
    return float(np.abs(signed).sum()), float(np.linalg.norm(normal, axis=1).sum())


def test_skin_of_a_ball() -> None:
    vertices, faces = isosurface(ball())
    volume, area = volume_and_area(vertices, faces)
    assert volume == pytest.approx(4 / 3 * pi * 0.027, rel=0.01)
    assert area == pytest.approx(4 * pi * 0.09, rel=0.01)
    assert np.abs(np.linalg.norm(vertices - 0.5, axis=1) - 0.3).max() < 2e-3


def test_skin_is_closed() -> None:
    """Each edge has two faces, also where the range cuts the set, and where there is no number."""
    cut = ball(15, 0.4, 0.3)
    cut[:, :, 10:] = np.nan
    for margin in (ball(12), cut):
        _, faces = isosurface(margin)
        edges = np.sort(np.vstack([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
        _, count = np.unique(edges, axis=0, return_counts=True)
        assert (count % 2 == 0).all() and (count == 2).mean() > 0.98
    assert len(isosurface(np.full((4, 4, 4), -1.0))[1]) == 0


def test_rays_meet_surfaces() -> None:
    vertices, faces = isosurface(ball())
    hit = first_hit(np.array([0.5, 0.5, -1.0]), np.array([0, 0, 1.0]), vertices, faces)
    assert hit is not None
    np.testing.assert_allclose(hit, [0.5, 0.5, 0.2], atol=2e-3)
    assert first_hit(np.array([2, 2, -1.0]), np.array([0, 0, 1.0]), vertices, faces) is None


def test_sheet_has_the_whole_cells() -> None:
    good = np.ones((4, 5), dtype=bool)
    good[0, 0] = False
    vertices, faces = sheet(good)
    _, area = volume_and_area(vertices, faces)
    assert area == pytest.approx(11 / 12) and (vertices[:, 1] == 0.5).all()


def test_files_bring_all_that_was_asked(tmp_path: Path) -> None:
    model = model_from("masticatory")
    made = condyle.workspace_map(
        model, "X=-2:5:4 mm", hold="beta=2 deg", stroke="masseter_*=-0.5:0.4"
    )
    made.condyle.save(tmp_path / "a.nc")
    found = condyle.open_map(tmp_path / "a.nc")
    assert found.equals(made) and found.condyle.mechanism == model.mechanism
    grid, reach = grid_and_reach(found, model)
    assert (grid.axes[0].name, grid.axes[0].count) == ("X", 4)
    assert grid.held == (0.0, 0.0, 0.0, pytest.approx(np.radians(2)))
    assert reach.high[2] == 0.4 and np.isinf(reach.low[0])
    (tmp_path / "b.nc").write_text("no")
    for name, words in (("b.nc", "is not a NetCDF map"), ("c.nc", "no such file")):
        with pytest.raises(condyle.InputError, match=words):
            condyle.open_map(tmp_path / name)
