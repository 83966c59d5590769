"""A jaw as it is drawn: bone from landmarks, muscles as bands coloured by activation."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.text import Annotation, Text
from support.report_pages import payload

import condyle
from condyle.motion import Load, Motion
from condyle.report.figures import PLOTS, plots_of, save_solution_figures
from condyle.report.naming import of_muscles
from condyle.report.page import report_html
from condyle.report.scene import activation_colour, activation_of, band_mesh, parts_of, place
from condyle.report.scene.jaw_mesh import jaw_body
from condyle.report.scene.parts import platform_body

JAWS = ("human-jaw", "human-jaw-curved", "human-jaw-muscles")


def at_rest(name: str, **policy: str) -> xr.Dataset:
    model = condyle.derive(name, backend="numpy", **policy)
    t = np.linspace(0.0, 1.0, 6)
    still = Motion.from_arrays(t, {n: 0 * t for n in model.independent})
    return model.solve(still, Load.constant([0, 0, -100], point="right_molar"))


def volume(vertices: np.ndarray, faces: np.ndarray) -> float:
    """Signed: positive for a closed surface whose faces look outwards."""
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    return float((a * np.cross(b, c)).sum() / 6)


def assert_closed(faces: np.ndarray) -> None:
    """Each edge belongs to two triangles, which run along it in opposite ways."""
    edges = [tuple(edge) for edge in faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)]
    assert len({*edges}) == len(edges)
    assert {*edges} == {(b, a) for a, b in edges}


def wide(mechanism: condyle.Mechanism) -> condyle.Mechanism:
    """The jaw with its left side stretched."""
    points = {n: np.array(p) for n, p in mechanism.platform.points.items()}
    points["left_canine"] += [0.002, 0.003, 0.001]
    points["left_molar"] += [0.003, 0.006, -0.002]
    moved = {name: tuple(map(float, point)) for name, point in points.items()}
    platform = mechanism.platform.model_copy(update={"points": moved})
    return mechanism.replace(platform=platform)


def test_a_jaw_is_closed_symmetric_and_reaches_its_landmarks() -> None:
    mechanism = condyle.load_mechanism("human-jaw")
    body = jaw_body(mechanism)
    assert body is not None and body.teeth is not None
    assert_closed(body.faces)
    bone, teeth = body.faces[: body.teeth], body.faces[body.teeth :]
    assert volume(body.vertices, bone) > 0
    assert all(volume(body.vertices, one) > 0 for one in np.split(teeth, 14))
    mirrored = np.linalg.norm(body.vertices[:, None] * [1, -1, 1] - body.vertices, axis=2)
    assert mirrored.min(axis=1).max() < 1e-12
    incisor = np.array(mechanism.platform.points["incisor"])
    assert np.linalg.norm(body.vertices - incisor, axis=1).min() < 2e-3
    for contact in mechanism.contacts:
        assert np.linalg.norm(body.vertices - contact.point, axis=1).min() < 1e-2
    for chain in mechanism.chains:  # attachments took no part in making it
        centres = body.vertices[bone].mean(axis=1)
        assert np.linalg.norm(centres - chain.platform, axis=1).min() < 1e-2, chain.name


def test_an_uneven_jaw_is_closed_and_follows_its_landmarks() -> None:
    mechanism = condyle.load_mechanism("human-jaw")
    even, uneven = jaw_body(mechanism), jaw_body(wide(mechanism))
    assert even is not None and uneven is not None
    assert_closed(uneven.faces)
    assert volume(uneven.vertices, uneven.faces) > volume(even.vertices, even.faces)
    right = even.vertices[:, 1] < -0.035
    assert np.abs(uneven.vertices[right] - even.vertices[right]).max() < 3e-3
    assert np.abs(uneven.vertices - even.vertices).max() > 6e-3


def test_machines_of_muscles_and_others() -> None:
    names = ("masticatory", "masticatory-curved", "gough-stewart", "hexaglide")
    assert all(of_muscles(condyle.load_mechanism(name)) for name in JAWS)
    for name in names:
        mechanism = condyle.load_mechanism(name)
        home = place(mechanism, np.zeros((1, 6)), np.zeros((1, len(mechanism.chains))))
        parts = parts_of(mechanism, home)
        assert not of_muscles(mechanism) and not parts.bands and parts.bars
        assert platform_body(mechanism).teeth is None
    jaw = condyle.load_mechanism("human-jaw")
    few = {k: v for k, v in jaw.platform.points.items() if k != "chin"}
    without = jaw.replace(platform=jaw.platform.model_copy(update={"points": few}))
    assert platform_body(without).teeth is None
    down = {**jaw.platform.points, "chin": (0.03, 0.0, 0.05)}
    turned = jaw.replace(platform=jaw.platform.model_copy(update={"points": down}))
    assert platform_body(turned).teeth is None


@pytest.mark.parametrize("count", [2, 3, 4])
def test_bands_are_closed_and_run_along_their_line(count: int) -> None:
    line = np.cumsum(np.random.default_rng(count).uniform(0.01, 0.03, (count, 3)), axis=0)
    vertices, faces = band_mesh(line, np.array([0.2, 0.0, 0.0]), 0.01)
    assert_closed(faces)
    assert volume(vertices, faces) > 0
    rings = vertices.reshape(-1, 8, 3)
    middle = rings.mean(axis=1)
    assert np.allclose(middle[[0, -1]], line[[0, -1]])
    for point in line:
        assert np.linalg.norm(middle - point, axis=1).min() < 1e-12
    spread = np.linalg.norm(rings - middle[:, None], axis=2)
    assert spread.max() == pytest.approx(0.005, rel=1e-9) and spread[0].max() < 0.002


@pytest.mark.parametrize("name", ["human-jaw", "human-jaw-muscles"])
def test_bands_are_as_strong_as_the_results_say(name: str) -> None:
    solution = at_rest(name, distribution="cubic")
    mechanism = solution.condyle.mechanism
    found = activation_of(
        *[mechanism, *(solution[v].values for v in ("effort", "joint", "joint_rate"))]
    )
    assert np.allclose(found, solution["activation"].values, atol=1e-9)
    drawn = payload(report_html(solution))
    muscles = drawn["machine"]["muscles"]
    assert [one["chain"] for one in muscles] == list(mechanism.chain_names)
    rods = [one["chain"] for one in drawn["machine"]["rods"]]
    assert rods == [f'ligament "{one}"' for one in mechanism.ligament_names]
    assert not drawn["machine"]["joints"]
    by_width = sorted(muscles, key=lambda one: one["width"])
    assert by_width[-1]["chain"].startswith("superficial_masseter")
    assert 0 < by_width[0]["width"] < by_width[-1]["width"]
    panel = next(p for p in drawn["panels"] if p["id"] == "activation")
    assert drawn["machine"]["band"]["top"] == panel["top"] < 1


def test_colours_of_activation_run_one_way_on_both_grounds() -> None:
    for dark, way in ((False, -1), (True, 1)):
        tints = [activation_colour(v, dark) for v in np.linspace(0, 1, 11)]
        grey = [
            sum(w * int(t[i : i + 2], 16) for w, i in ((0.3, 1), (0.6, 3), (0.1, 5))) for t in tints
        ]
        assert (way * np.diff(grey) > 0).all()
        assert activation_colour(1.2, dark) not in tints
        assert activation_colour(np.nan, dark) == tints[0]


def test_forces_are_arrows_from_the_front_and_the_side(tmp_path: Path) -> None:
    solution = at_rest("human-jaw", distribution="cubic")
    figure = PLOTS["forces"](solution)
    normal = np.array([0.8391, 0.0, 1.0]) / np.linalg.norm([0.8391, 0.0, 1.0])  # of both planes
    left, right = solution["contact_force"].values[0]
    expected = [left * normal, right * normal, np.array([0.0, 0.0, -100.0])]
    for axes, across in zip(figure.axes[:2], (1, 0), strict=True):  # Y, X to the right
        notes = [one for one in axes.texts if isinstance(one, Annotation) and one.arrow_patch]
        ways = [np.subtract(one.xy, one.xyann) for one in notes]
        flat = [force[[across, 2]] for force in expected]
        scale = np.linalg.norm(ways[2]) / 100.0
        assert np.allclose(ways, scale * np.array(flat), atol=1e-6 * scale)
        said = [one.get_text() for one in axes.texts if one.get_text()]
        assert said[0] == f"left condyle\n{abs(left):.3g} N" and "right molar" in said[2]
        low, high = np.transpose([axes.get_xlim(), axes.get_ylim()])
        for one in notes:
            for end in (one.xy, one.xyann):
                assert (low <= end).all() and (end <= high).all(), "an arrow is cut"
    assert "muscles" in words_of_figure(PLOTS["forces"](at_rest_robot()))
    names = {path.stem for path in save_solution_figures(solution, tmp_path)}
    assert "human-jaw-forces" in names


def at_rest_robot() -> xr.Dataset:
    model = condyle.derive("masticatory", backend="numpy")
    t = np.linspace(0.0, 1.0, 6)
    return model.solve(Motion.from_arrays(t, {n: 0 * t for n in model.independent}))


def words_of_figure(figure: Figure) -> str:
    return " | ".join(text.get_text() for text in figure.findobj(Text))


def test_machines_without_muscles_have_no_figure_of_forces() -> None:
    assert "forces" not in plots_of(at_rest_robot())
    assert "forces" in plots_of(at_rest("human-jaw-muscles"))


def test_forces_at_a_time_and_where_there_is_no_result() -> None:
    solution = at_rest("human-jaw").copy(deep=True)
    figure = solution.condyle.plot.forces(time=0.45)
    assert "0.4 s" in figure.get_suptitle()
    solution["status"].values[:] = 1
    with pytest.raises(condyle.InputError, match="no sample with a result"):
        PLOTS["forces"](solution)
