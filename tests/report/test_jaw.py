"""A jaw on figures and page: bone, bands coloured by activation, markers, EMG, and its words."""

from __future__ import annotations

from typing import Any

import matplotlib as mpl
import numpy as np
import pytest
import xarray as xr
from matplotlib.collections import QuadMesh
from matplotlib.text import Annotation
from scipy.spatial.transform import Rotation
from support.machines import model
from support.report_pages import Elements, column, payload

import condyle
from condyle.analysis.session.cycle_measures import measured_columns
from condyle.markers import MeasuredChannels
from condyle.mechanism.vocabulary import of_muscles, words_of
from condyle.motion import Load, Motion
from condyle.report.figures import PLOTS
from condyle.report.figures.style import EmptyFigureError
from condyle.report.naming import bite_sides
from condyle.report.page import report_html
from condyle.report.panel import PANEL_GROUPS
from condyle.report.scene import activation_colour, activation_of, band, parts_of, place
from condyle.report.scene.jaw_mesh import jaw_body
from condyle.report.scene.parts import platform_body
from condyle.report.scene.solids import swept
from condyle.results.summary import summarize
from condyle.view.playback import Playback
from condyle.view.readout import number, tables_html
from condyle.view.session import Session

from .conftest import panels

JAWS = ("human-jaw", "human-jaw-curved", "human-jaw-nurbs", "human-jaw-muscles")
MACHINES = ("masticatory", "masticatory-curved", "gough-stewart", "hexaglide")
SOLIDS = ("chains", "joints")
FOREIGN = ("chain", "actuator", "motor", "effort", "contact", "platform", "singularit")
NAMES, BODIES = ("Upper", "Lower", "Ear"), ("fixed", "platform", "")


def at_rest(name: str) -> xr.Dataset:
    """A bite of 100 N at home."""
    machine, t = model(name), np.linspace(0.0, 1.0, 6)
    still = Motion.from_arrays(t, {n: 0 * t for n in machine.independent})
    return machine.solve(still, Load.constant([0, 0, -100], point="right_molar"))


@pytest.fixture(scope="module")
def biting() -> xr.Dataset:
    return at_rest("human-jaw-muscles")


@pytest.fixture(scope="module")
def biting_page(biting: xr.Dataset) -> str:
    return report_html(biting)


@pytest.fixture(scope="module")
def seen(jaw: xr.Dataset) -> xr.Dataset:
    """With a marker of each body, one of them unseen for a while, and EMG of two muscles."""
    t = jaw["time"].values
    points = np.stack([np.full((len(t), 3), 0.08), np.outer(np.sin(t), [0, 0, 0.01])], axis=1)
    points = np.concatenate([points, points[:, :1] + 0.02], axis=1)
    points[10:14, 1] = np.nan
    residual = np.outer(1e-4 * (1 + np.sin(3 * t)), [1, 2, np.nan])
    biter = jaw["activation"].sel(chain="deep_masseter_right").values
    emg = {
        "deep_masseter_right": np.interp(t + 0.05, t, biter),  # 50 ms ahead
        "geniohyoid_left": np.abs(np.cos(t)),
    }
    return jaw.condyle.with_measured(MeasuredChannels(t, NAMES, BODIES, points, residual, emg))


@pytest.fixture(scope="module")
def seen_page(seen: xr.Dataset) -> str:
    return report_html(seen)


def volume(vertices: np.ndarray, faces: np.ndarray) -> float:
    """Signed: positive for a closed surface whose faces look outwards."""
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    return float((a * np.cross(b, c)).sum() / 6)


def assert_closed(faces: np.ndarray) -> None:
    """Each edge belongs to two triangles, which run along it in opposite ways."""
    edges = [tuple(edge) for edge in faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)]
    assert len({*edges}) == len(edges)
    assert {*edges} == {(b, a) for a, b in edges}


def with_points(mechanism: condyle.Mechanism, points: dict[str, Any]) -> condyle.Mechanism:
    return mechanism.replace(platform=mechanism.platform.model_copy(update={"points": points}))


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
    ends = [(mechanism.platform.points["incisor"], 2e-3)]
    ends += [(contact.point, 1e-2) for contact in mechanism.contacts]
    for end, near in ends:
        assert np.linalg.norm(body.vertices - np.array(end), axis=1).min() < near
    for chain in mechanism.chains:  # attachments took no part in making it
        centres = body.vertices[bone].mean(axis=1)
        assert np.linalg.norm(centres - chain.platform, axis=1).min() < 1e-2, chain.name
    # One with its left side stretched is closed, too, and follows its landmarks.
    points = {n: np.array(p) for n, p in mechanism.platform.points.items()}
    points["left_canine"] += [0.002, 0.003, 0.001]
    points["left_molar"] += [0.003, 0.006, -0.002]
    moved = {name: tuple(map(float, point)) for name, point in points.items()}
    uneven = jaw_body(with_points(mechanism, moved))
    assert uneven is not None
    assert_closed(uneven.faces)
    assert volume(uneven.vertices, uneven.faces) > volume(body.vertices, body.faces)
    right = body.vertices[:, 1] < -0.035
    assert np.abs(uneven.vertices[right] - body.vertices[right]).max() < 3e-3
    assert np.abs(uneven.vertices - body.vertices).max() > 6e-3
    # Without a chin, or with one inside out, it is drawn as any platform.
    few = {k: v for k, v in mechanism.platform.points.items() if k != "chin"}
    for given in (few, {**mechanism.platform.points, "chin": (0.03, 0.0, 0.05)}):
        assert platform_body(with_points(mechanism, given)).teeth is None


def test_machines_of_muscles_and_others() -> None:
    """By their parts and their words."""
    assert all(of_muscles(condyle.load_mechanism(name)) for name in JAWS)
    for name in MACHINES:
        mechanism = condyle.load_mechanism(name)
        home = place(mechanism, np.zeros((1, 6)), np.zeros((1, len(mechanism.chains))))
        parts = parts_of(mechanism, home)
        assert not of_muscles(mechanism)
        assert "activation" not in {solid.colour for solid in parts.of_group("chains")}
        assert platform_body(mechanism).teeth is None
        text = "Efforts of the actuators; Contact, chain, joint"
        assert words_of(mechanism)(text) is text
    say = words_of(condyle.load_mechanism("human-jaw"))
    assert say("Efforts of the actuators") == "Forces of the muscles"
    assert say("Contact forces on the platform") == "Joint loads on the jaw"
    assert say('An actuator of "chain": singular values, a singularity; --contact-weight') == (
        'A muscle of "chain": singular values, a loss of lever arms; --contact-weight'
    )
    assert say("Joint coordinates") == "Shortening" and say("joint") == "shortening"
    assert say("left_contact and chain_2") == "left_contact and chain_2", "parts of a name"


def test_bands_are_closed_and_run_along_their_line() -> None:
    for count in (2, 3, 4):
        line = np.cumsum(np.random.default_rng(count).uniform(0.01, 0.03, (count, 3)), axis=0)
        mesh, faces = band(line, 0.01)
        vertices = swept(line, mesh, np.array([0.2, 0.0, 0.0]))
        assert_closed(faces)
        assert volume(vertices, faces) > 0
        rings = vertices.reshape(-1, 8, 3)
        middle = rings.mean(axis=1)
        assert np.allclose(middle[[0, -1]], line[[0, -1]])
        for point in line:
            assert np.linalg.norm(middle - point, axis=1).min() < 1e-12
        spread = np.linalg.norm(rings - middle[:, None], axis=2)
        assert spread.max() == pytest.approx(0.005, rel=1e-9) and spread[0].max() < 0.002


def test_bands_are_as_strong_as_the_results_say(
    jaw: xr.Dataset, jaw_page: str, biting: xr.Dataset, biting_page: str
) -> None:
    for solution, page in ((jaw, jaw_page), (biting, biting_page)):
        mechanism, machine = solution.condyle.mechanism, payload(page)["machine"]
        numbers = (solution[v].values for v in ("effort", "joint", "joint_rate"))
        found = activation_of(mechanism, *numbers)
        assert np.allclose(found, solution["activation"].values, atol=1e-9)
        drawn = {name: [s for s in machine["solids"] if s["group"] == name] for name in SOLIDS}
        muscles = [one for one in drawn["chains"] if one["colour"] == "activation"]
        assert [one["owner"] for one in muscles] == list(mechanism.chain_names)
        rods = [one["owner"] for one in drawn["chains"] if one not in muscles]
        assert rods == [f'ligament "{one}"' for one in mechanism.ligament_names]
        assert not drawn["joints"]
        width = {one["owner"]: np.max(one["vertices"], axis=0)[0] for one in muscles}
        by_width = sorted(width, key=lambda name: width[name])
        assert by_width[-1].startswith("superficial_masseter")
        assert 0 < width[by_width[0]] < width[by_width[-1]]
        assert machine["activationTop"] == panels(page)["activation"]["top"] < 1
    # Colours run one way on both grounds.
    for dark, way in ((False, -1), (True, 1)):
        tints = [activation_colour(v, dark) for v in np.linspace(0, 1, 11)]
        parts = [[int(tint[i : i + 2], 16) for i in (1, 3, 5)] for tint in tints]
        assert (way * np.diff(np.array(parts) @ [0.3, 0.6, 0.1]) > 0).all()
        assert activation_colour(1.2, dark) not in tints
        assert activation_colour(np.nan, dark) == tints[0]


def test_forces_are_arrows_from_the_front_and_the_side() -> None:
    solution = at_rest("human-jaw")
    figure = PLOTS["forces"](solution)
    normal = np.array([0.8391, 0.0, 1.0]) / np.linalg.norm([0.8391, 0.0, 1.0])  # of both planes
    left, right = solution["contact_force"].values[0]
    expected = np.array([left * normal, right * normal, [0.0, 0.0, -100.0]])
    for axes, across in zip(figure.axes[:2], (1, 0), strict=True):  # Y, X to the right
        notes = [one for one in axes.texts if isinstance(one, Annotation) and one.arrow_patch]
        ways = [np.subtract(one.xy, one.xyann) for one in notes]
        scale = np.linalg.norm(ways[2]) / 100.0
        assert np.allclose(ways, scale * expected[:, [across, 2]], atol=1e-6 * scale)
        said = [one.get_text() for one in axes.texts if one.get_text()]
        assert said[0] == f"left condyle\n{abs(left):.3g} N" and "right molar" in said[2]
        low, high = np.transpose([axes.get_xlim(), axes.get_ylim()])
        ends = np.array([end for one in notes for end in (one.xy, one.xyann)])
        assert (low <= ends).all() and (ends <= high).all(), "an arrow is cut"
    # At a time, and where there is no result.
    failed = solution.copy(deep=True)
    assert "0.4 s" in failed.condyle.plot.forces(time=0.45).get_suptitle()
    failed["status"].values[:] = 1
    with pytest.raises(condyle.InputError, match="no sample with a result"):
        PLOTS["forces"](failed)
    robot = at_rest("masticatory")
    with pytest.raises(EmptyFigureError, match="no muscles"):
        PLOTS["forces"](robot)


def test_pages_and_figures_speak_of_muscles_and_joints(
    biting: xr.Dataset, biting_page: str, page: str
) -> None:
    """Where muscles drive; a machine's keep its words."""
    drawn, text = payload(biting_page), Elements(biting_page).text
    assert "left_condyle (balancing side), t = " in text
    said = [str(condyle.check("human-jaw")), str(summarize(biting))]
    said += [f"{p['title']} {p['note']} {p['axes'][1]}" for p in drawn["panels"]]
    for name in ("activation", "contact_force", "share"):
        texts = [text.get_text() for text in PLOTS[name](biting).findobj(mpl.text.Text)]
        said += [one for one in texts if "Mechanism" not in one]
    assert not [one for one in said if any(word in one.lower() for word in FOREIGN)]
    shown = text.split("What was run")[0]
    for word in ("Muscles", "Activation", "Joints and load", "Peaks of each muscle", "Peak force"):
        assert word in shown
    assert all(f'aria-label="{word}s at the cursor"' in biting_page for word in ("Muscle", "Joint"))
    tables = tables_html(Session(condyle.load_mechanism("human-jaw")).snapshot())
    for word in ("Muscle", "shortening", "force", "Joint"):
        assert f">{word}</th>" in tables
    assert ">Chain</th>" not in tables
    drawn, text = payload(page), Elements(page).text
    assert all(f'aria-label="{word}s at the cursor"' in page for word in ("Chain", "Contact"))
    for word in ("Chains", "Actuators", "Contacts and load", "Contact tracks", "Peak effort"):
        assert word in text
    assert {"Contact force along the normal", "Actuator torque", "Platform position"} <= {
        panel["title"] for panel in drawn["panels"]
    }


def test_a_jaw_is_read_as_clinicians_do(jaw: xr.Dataset) -> None:
    """Gape, protrusion and excursion of the incisal point; errors; sides of a bite."""
    shown = {panel.id: panel for panel in PANEL_GROUPS["motion"].of(jaw)}
    names = [curve.label for curve in shown["incisal-point"].curves]
    assert names == ["protrusion", "excursion to the left", "gape"]
    incisor = np.array(jaw.condyle.mechanism.platform.points["incisor"])
    pose = jaw["pose"].values
    turned = Rotation.from_euler("XYZ", pose[:, 3:]).apply(incisor)
    way = (turned + pose[:, :3] - incisor) * [1, 1, -1]
    curves = [curve.values for curve in shown["incisal-point"].curves]
    np.testing.assert_allclose(np.transpose(curves), way, atol=1e-12)
    assert shown["pose-angles"].curves[1].label == "opening (beta)"
    opening = shown["pose-angles"].curves[1].values
    assert opening[way[:, 2].argmax()] > 0.9 * opening.max() > 0.1
    machine = model("human-jaw")
    left = Load.constant([0, 0, -100], point="left_molar")
    still = Motion.from_arrays(t := np.linspace(0, 1, 6), {n: 0 * t for n in machine.independent})
    assert bite_sides(machine.solve(still, left))["left_condyle"] == "working side"
    middle = Load.constant([0, 0, -100], point="incisor")
    assert not bite_sides(machine.solve(still, middle))
    too_hard = Load.constant([0, 0, -1e5], point="right_molar")
    with pytest.raises(condyle.InfeasibleError, match="no forces within the limits"):
        machine.solve(still, too_hard)


def test_joint_loads_are_positive_where_the_skull_pushes(
    biting: xr.Dataset, biting_page: str
) -> None:
    """In every output for people; the variable contact_force is along the normal, which is up."""
    push = -biting["contact_force"].values
    assert (push > 1).all() and condyle.load_mechanism("human-jaw").contacts[0].side == "below"
    data, found = payload(biting_page), panels(biting_page)
    for panel in ("contact-force", "load-on-joints"):
        for k, line in enumerate(found[panel]["sets"][0]["lines"]):
            drawn = column(data, line["column"])
            np.testing.assert_allclose(drawn, push[:, k], rtol=1e-6)
    least, greatest = push[:, 0].min(), push[:, 0].max()
    assert f"{least:.5g} to {greatest:.5g} N" in str(summarize(biting))
    assert f"{push.max():.4g} N" in Elements(biting_page).text
    np.testing.assert_array_equal(measured_columns(biting)["contact_left_condyle"], push[:, 0])
    pulled = biting.assign(contact_force=-biting["contact_force"])
    assert measured_columns(pulled)["contact_left_condyle"].max() < 0
    session = Session(condyle.load_mechanism("human-jaw"))
    session.set_load(np.array([0.0, 0.0, -100.0]), "right_molar")
    snapshot = session.snapshot()
    size = number(-float(snapshot.contact_force[0]), 3, "N")
    assert size[0].isdigit() and f">{size}</td>" in tables_html(snapshot)
    bands = np.sort(
        biting["contact_force"].values + np.array([-1.0, 0.0, 2.0])[:, None, None], axis=0
    )
    banded = biting.assign(contact_force_quantile=(("quantile", "time", "contact"), bands))
    curve = next(iter(PANEL_GROUPS["contact_force"].of(banded))).curves[0]
    assert curve.bands is not None
    np.testing.assert_array_equal(curve.bands, -bands[::-1, :, 0])


def test_the_page_has_markers_and_their_residuals(
    jaw: xr.Dataset, jaw_page: str, seen: xr.Dataset, seen_page: str
) -> None:
    """Played, they are there, too; without measurements there are none."""
    data = payload(seen_page)
    markers = data["machine"]["markers"]
    assert [(m["name"], m["body"]) for m in markers] == [*zip(NAMES, BODIES, strict=True)]
    for i, marker in enumerate(markers):
        drawn = np.column_stack([column(data, c) for c in marker["columns"]])
        np.testing.assert_allclose(drawn, seen["marker_place"].values[:, i], atol=1e-8)
    (panel,) = [p for p in data["panels"] if p["section"] == "markers"]
    sets = [(s["label"].split(":")[0], [one["label"] for one in s["lines"]]) for s in panel["sets"]]
    assert panel["unit"] == "mm" and sets[:2] == [("base", ["Upper"]), ("platform", ["Lower"])]
    assert [label for label, _ in sets] == ["base", "platform"] * 2
    line = panel["sets"][1]["lines"][0]
    shown = column(data, line["column"]) * line["scale"]
    np.testing.assert_allclose(shown, 1e3 * seen["marker_residual"].values[:, 1], rtol=1e-6)
    low, high = np.array(data["machine"]["range"]).T
    assert (low <= 0.08).all() and (high >= 0.1).all(), "markers are within the picture"
    assert [force["kind"] for force in data["machine"]["forces"]][-1] == "load"
    playback = Playback(seen)
    playback.seek(float(seen["time"].values[12]))
    places = playback.snapshot().markers
    assert places is not None and np.isnan(places[1]).all()
    np.testing.assert_array_equal(places[0], seen["marker_place"].values[12, 0])
    data = payload(jaw_page)
    assert data["machine"]["markers"] == []
    assert not [p for p in data["panels"] if p["section"] == "markers"]
    assert Playback(jaw).snapshot().markers is None


def test_emg_stands_under_its_muscle(seen: xr.Dataset, seen_page: str) -> None:
    """With the time by which it leads, where that is found: within 0.3 s."""
    data, field = payload(seen_page), panels(seen_page)["activation"]
    lines = field["sets"][0]["lines"]
    labels = [line["label"] for line in lines]
    for chain in ("deep_masseter_right", "geniohyoid_left"):
        at = labels.index(chain) + 1
        assert labels[at] == f"{chain} EMG"
        values = column(data, lines[at]["column"]) * lines[at]["scale"]
        np.testing.assert_allclose(values, seen["emg"].sel(chain=chain).values, rtol=1e-6)
    assert len(labels) == 26 and "EMG" in field["note"]
    assert "deep_masseter_right EMG +50 ms" in field["note"]
    assert "geniohyoid_left EMG" not in field["note"]
    axes = PLOTS["activation"](seen).axes[0]
    rows = [label.get_text() for label in axes.get_yticklabels()]
    at = rows.index("deep masseter right EMG +50 ms")
    assert len(rows) == 26 and rows[at - 1] == "deep masseter right"
    (mesh,) = [one for one in axes.collections if isinstance(one, QuadMesh)]
    drawn = np.ma.getdata(mesh.get_array()).reshape(26, -1)[at]
    np.testing.assert_allclose(drawn, seen["emg"].sel(chain="deep_masseter_right"), rtol=1e-12)


def test_joints_of_many_chains_are_small_multiples(jaw: xr.Dataset) -> None:
    figure = PLOTS["joint"](jaw)
    assert len(figure.axes) == 36  # 12 pairs, three columns
    first = figure.axes[0]
    assert [line.get_label() for line in first.get_lines()] == ["left", "right"]
    np.testing.assert_allclose(first.get_lines()[1].get_ydata(), 1e3 * jaw["joint"].values[:, 1])
    assert first.get_ylabel() == "anterior\ntemporalis" and first.get_title() == ""
    assert len({axes.get_ylim() for axes in figure.axes[::3]}) == 1, "one scale a column"
    assert {text.get_text() for text in figure.legends[0].get_texts()} == {"left", "right"}


def test_activation_and_force_over_greatest_are_two_figures(biting: xr.Dataset) -> None:
    """Of muscles by length and speed; fibres at home are short, so that forces are less."""
    from condyle.report.panel_list import activation

    shown = {panel.id: panel.curves for panel in activation(biting)}
    chains = biting.condyle.mechanism.chains
    greatest = {chain.name: chain.muscle.max_force for chain in chains}
    effort, own = biting["effort"], biting["activation"]
    for row in shown["force-used"]:
        expected = effort.sel(chain=row.label).values / greatest[row.label]
        np.testing.assert_allclose(row.values * row.scale, expected, rtol=1e-12)
    for row in shown["activation"]:
        np.testing.assert_allclose(row.values, own.sel(chain=row.label).values, rtol=1e-12)
    most = own.max("time").idxmax("chain").item()
    force = effort.sel(chain=most).max().item() / greatest[most]
    assert own.sel(chain=most).max().item() > 1.1 * force
