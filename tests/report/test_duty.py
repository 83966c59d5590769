"""What actuators are asked for: duty, limits as a box, activations, on figures and page."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from matplotlib.collections import QuadMesh
from scipy.integrate import trapezoid
from support.report_pages import column, payload

import condyle
from condyle.mechanism.actuator import Limits
from condyle.motion import Load, Motion, bundled_reference
from condyle.report.actuators import DutyMeter, activations, duty, edges, joint_loads
from condyle.report.figures import PLOTS, save_solution_figures
from condyle.report.naming import parts_in_use
from condyle.report.page import report_html
from condyle.report.panel import PANEL_GROUPS

INF = float("inf")


def chewed(name: str, rate: float, **policy: Any) -> xr.Dataset:
    motion = Motion.from_csv(bundled_reference()[0], rate=rate)
    model = condyle.derive(name, backend="numpy", **policy)
    return model.solve(motion, condyle.reference_load())


@pytest.fixture(scope="module")
def robot() -> xr.Dataset:
    return chewed("masticatory", 40)


@pytest.fixture(scope="module")
def jaw() -> xr.Dataset:
    return chewed("human-jaw", 20)


@pytest.fixture(scope="module")
def page(jaw: xr.Dataset) -> dict[str, Any]:
    return payload(report_html(jaw))


def test_rms_and_power_by_hand(robot: xr.Dataset) -> None:
    t, effort = robot["time"].values, robot["effort"].values
    for i, one in enumerate(duty(robot)):
        mean = trapezoid(effort[:, i] ** 2, t) / (t[-1] - t[0])
        assert one.rms == pytest.approx(np.sqrt(mean), rel=1e-12)
        power = abs(effort[:, i] * robot["joint_rate"].values[:, i]).max()
        assert one.power == pytest.approx(power, rel=1e-12)
        assert one.text == f"rms {one.rms:.3g} N m, {one.power:.3g} W"


def test_duty_is_the_same_piece_by_piece_and_skips_gaps(robot: xr.Dataset) -> None:
    holed = robot.copy(deep=True)
    holed["effort"].values[50:60] = np.nan
    meter = DutyMeter()
    for start in range(0, holed.sizes["time"], 17):
        meter.see(holed.isel(time=slice(start, start + 17)))
    for one, whole in zip(meter.read(), duty(holed), strict=True):
        assert (one.rms, one.power) == pytest.approx((whole.rms, whole.power), rel=1e-12)
    t, square = holed["time"].values, holed["effort"].values[:, 0] ** 2
    parts = [(t[:50], square[:50]), (t[60:], square[60:])]
    mean = sum(trapezoid(y, x) for x, y in parts) / sum(x[-1] - x[0] for x, _ in parts)
    assert duty(holed)[0].rms == pytest.approx(np.sqrt(mean), rel=1e-12)
    holed["effort"].values[:] = np.nan
    assert {one.text for one in duty(holed)} == {"no result"}


def test_edges_of_the_box_near_the_data() -> None:
    box = edges(Limits(-3.0, 3.0, 6.0), speed=5.0, effort=2.0)
    assert box == [
        ([-6.0, 6.0], [3.0, 3.0]),
        ([-6.0, 6.0], [-3.0, -3.0]),
        ([-6.0, -6.0], [-3.0, 3.0]),
        ([6.0, 6.0], [-3.0, 3.0]),
    ]
    # A cable without a limit of speed: far above the data there is its floor alone.
    assert edges(Limits(0.0, 190.0, INF), 0.5, 10.0) == [([-0.5, 0.5], [0.0, 0.0])]
    assert edges(Limits(-INF, INF, INF), 1.0, 1.0) == []
    # An idle muscle shows what it could do.
    assert edges(Limits(0.0, 40.0, INF), 0.5, 0.0)[0] == ([-0.5, 0.5], [40.0, 40.0])
    assert edges(Limits(-3.0, 3.0, 6.0), 0.0, 0.0)[-1] == ([6.0, 6.0], [-3.0, 3.0])


def test_effort_speed_draws_every_chain_in_its_limits(robot: xr.Dataset, jaw: xr.Dataset) -> None:
    for solution, count in ((robot, 3), (jaw, 12)):
        figure = PLOTS["effort_speed"](solution)
        assert len(figure.axes) == count
        drawn = [line for axes in figure.axes for line in axes.get_lines()]
        tracks = [line for line in drawn if not str(line.get_label()).startswith("_")]
        assert len(tracks) == solution.sizes["chain"]
        found = {(tuple(line.get_xdata()), tuple(line.get_ydata())) for line in tracks}
        for i in range(solution.sizes["chain"]):
            pair = solution["joint_rate"].values[:, i], solution["effort"].values[:, i]
            assert (tuple(pair[0]), tuple(pair[1])) in found
    first = PLOTS["effort_speed"](robot).axes[0]
    assert first.get_legend().get_title().get_text() == "limits: ±3 N m, 6 rad/s"
    assert (first.get_xlabel(), first.get_ylabel()) == ("speed [rad/s]", "torque [N m]")
    titles = [axes.get_legend().get_title().get_text() for axes in figure.axes]
    assert titles[0] == "limits: 0 to 158 N"


def test_activation_rows_are_effort_over_greatest_effort(jaw: xr.Dataset) -> None:
    figure = PLOTS["activation"](jaw)
    field, loads = figure.axes
    [mesh] = [item for item in field.collections if isinstance(item, QuadMesh)]
    rows = [label.get_text() for label in field.get_yticklabels()]
    names = [str(name) for name in jaw["chain"].values]
    greatest = {c.name: c.actuator.effort_range[1] for c in jaw.condyle.mechanism.chains}
    assert [row.rpartition(" ")[0] for row in rows[::2]] == [
        r.rpartition(" ")[0] for r in rows[1::2]
    ]
    values = np.ma.getdata(mesh.get_array()).reshape(len(rows), -1)
    for row, drawn in zip(rows, values, strict=True):
        i = names.index(row.replace(" ", "_"))
        np.testing.assert_allclose(
            drawn, jaw["effort"].values[:, i] / greatest[names[i]], atol=1e-15
        )
    assert mesh.get_clim() == (0.0, 0.5) and 0.2 < values.max() <= 0.5
    curves = [line.get_ydata() for line in loads.get_lines()]
    np.testing.assert_array_equal(np.transpose(curves), -jaw["contact_force"].values)
    assert (jaw["contact_force"].values <= 0).all(), "the fossa pushes downwards, along -n"


def test_small_activations_have_a_scale_of_their_own(jaw: xr.Dataset) -> None:
    """Free movement takes some thousandths: on a scale up to 1 it was blank."""
    free = jaw.copy(deep=True)
    free["effort"].values *= 0.004 / activation_of(free)
    for changed, top in ((free, 0.005), (jaw, 0.5)):
        [mesh] = [
            item
            for item in PLOTS["activation"](changed).axes[0].collections
            if isinstance(item, QuadMesh)
        ]
        assert mesh.get_clim() == (0.0, top)
        page = next(iter(PANEL_GROUPS["activation"].panels(changed)))
        assert page.top == top


def activation_of(solution: xr.Dataset) -> float:
    return max(float(row.max()) for row in activations(solution).values())


def test_a_pair_apart_in_the_file_stands_together(robot: xr.Dataset) -> None:
    machine = robot.condyle.mechanism
    order = [0, 2, 4, 1, 3, 5]
    shuffled = robot.isel(chain=order)
    shuffled.attrs["mechanism"] = condyle.dumps(
        machine.replace(chains=tuple(machine.chains[i] for i in order))
    )
    found = activations(shuffled)
    assert list(found) == [str(name) for name in robot["chain"].values]
    expected = np.abs(robot["effort"].values[:, 1]) / 3.0
    np.testing.assert_allclose(found[str(robot["chain"].values[1])], expected)


def test_beyond_the_limit_is_said_and_failed_samples_are_blank(robot: xr.Dataset) -> None:
    strong = robot.copy(deep=True)
    strong["effort"].values[5, 0] = 4.5
    strong["effort"].values[9] = np.nan
    axes = PLOTS["activation"](strong).axes[0]
    assert "beyond" in axes.get_title("left")
    [mesh] = [item for item in axes.collections if isinstance(item, QuadMesh)]
    drawn = mesh.get_array().reshape(6, -1)
    assert np.ma.getmaskarray(drawn)[:, 9].all() and drawn[0, 5] == pytest.approx(1.5)
    assert "beyond" not in PLOTS["activation"](robot).axes[0].get_title("left")


def test_without_limits_there_is_no_activation(robot: xr.Dataset, tmp_path: Path) -> None:
    free = robot.copy(deep=True)
    machine = robot.condyle.mechanism
    bare = tuple(c.model_copy(update={"actuator": type(c.actuator)()}) for c in machine.chains)
    free.attrs["mechanism"] = condyle.dumps(machine.replace(chains=bare))
    text = " ".join(t.get_text() for t in PLOTS["activation"](free).axes[0].texts)
    assert "no actuator" in text and activations(free) == {}
    names = {path.stem for path in save_solution_figures(free, tmp_path)}
    assert "masticatory-activation" not in names and "masticatory-effort_speed" in names
    ids = {panel["id"] for panel in payload(report_html(free))["panels"]}
    assert "activation" not in ids and "contact-force" in ids


def test_joint_load_of_a_contact_that_may_pull_has_no_sign(robot: xr.Dataset) -> None:
    force = robot["contact_force"].values
    for i, contact in enumerate(robot.condyle.mechanism.contacts):
        expected = contact.push * force[:, i] if contact.one_sided else abs(force[:, i])
        np.testing.assert_array_equal(joint_loads(robot)[contact.name], expected)


def test_page_has_every_plane_and_activation(page: dict[str, Any], jaw: xr.Dataset) -> None:
    names = [str(name) for name in jaw["chain"].values]
    planes = [panel for panel in page["panels"] if panel["kind"] == "plane"]
    assert len(planes) == 12
    lines = [(p, line) for p in planes for line in p["sets"][0]["lines"]]
    assert len(lines) == 24
    for i, (plane, line) in enumerate(lines):
        speed, effort = (column(page, line[key]) for key in ("across", "column"))
        np.testing.assert_allclose(speed, jaw["joint_rate"].values[:, i], rtol=1e-6, atol=1e-9)
        np.testing.assert_allclose(effort, jaw["effort"].values[:, i], rtol=1e-6, atol=1e-9)
        assert (
            plane["axes"] == ["speed [m/s]", "force"]
            and plane["unit"] == "N"
            and names[i].endswith(line["label"])
        )
    field = next(p for p in page["panels"] if p["id"] == "activation")
    greatest = {c.name: c.actuator.effort_range[1] for c in jaw.condyle.mechanism.chains}
    assert field["kind"] == "field" and len(field["sets"][0]["lines"]) == 24
    for line in field["sets"][0]["lines"]:
        expected = jaw["effort"].values[:, names.index(line["label"])] / greatest[line["label"]]
        drawn = column(page, line["column"]) * line["scale"]
        np.testing.assert_allclose(drawn, expected, rtol=1e-6, atol=1e-9)
    load = next(p for p in page["panels"] if p["id"] == "load-on-joints")
    drawn = column(page, load["sets"][0]["lines"][0]["column"])
    np.testing.assert_allclose(drawn, -jaw["contact_force"].values[:, 0], rtol=1e-6)


def test_many_limits_are_kept_but_not_drawn(page: dict[str, Any], robot: xr.Dataset) -> None:
    """Eleven lines would hide the curves; the table at the cursor needs each."""
    force = next(p for p in page["panels"] if p["id"] == "effort-N")
    assert not force["limitsDrawn"] and not force["limitsInView"]
    assert len(force["limits"]) == 11 and sum(len(one["of"]) for one in force["limits"]) == 24
    torque = next(p for p in payload(report_html(robot))["panels"] if p["id"] == "effort-Nm")
    assert torque["limitsDrawn"] and len(torque["limits"]) == 1


def test_a_thinned_page_keeps_tracks_and_the_duty_of_every_sample(jaw: xr.Dataset) -> None:
    count = 6000
    index = np.linspace(0, jaw.sizes["time"] - 1, count).astype(int)
    long = jaw.isel(time=index).assign_coords(time=np.linspace(0, 5, count))
    long = long
    data = payload(report_html(long))
    assert data["columns"]["total"] == count
    assert 500 < data["columns"]["samples"] < count
    planes = [panel for panel in data["panels"] if panel["kind"] == "plane"]
    texts = [line["text"] for plane in planes for line in plane["sets"][0]["lines"]]
    assert texts == [one.text for one in duty(long)]


def test_parts_of_no_consequence_are_left_out(robot: xr.Dataset) -> None:
    parts = [str(part) for part in robot["part"].values]
    more = robot.isel(part=[*range(len(parts)), 0, 0]).copy(deep=True)
    more = more.assign_coords(part=[*parts, "friction", "internal"])
    more["share"].values[-2] = 0.0
    shown = parts_in_use(more)
    assert "friction" not in shown and "internal" in shown


def test_shares_of_actuators_and_friction_have_figures_and_panels() -> None:
    machine = condyle.load_mechanism("masticatory")
    lossy = machine.replace(
        chains=tuple(
            c.model_copy(update={"actuator": c.actuator.model_copy(update={"coulomb": 0.05})})
            for c in machine.chains
        )
    )
    t = np.linspace(0, 1, 20)
    motion = Motion.from_arrays(t, {"X": 1e-3 * np.sin(6 * t), "beta": 0.05 * np.sin(6 * t)} | {
        name: 0 * t for name in ("Y", "alpha")
    })  # fmt: skip
    solution = condyle.derive(lossy, backend="numpy").solve(motion, Load.constant((0, 0, -10)))
    titles = [axes.get_title("left") for axes in PLOTS["share"](solution).axes]
    assert "actuators" in titles
    panel = next(p for p in payload(report_html(solution))["panels"] if p["id"] == "share-Nm")
    lines = {line["label"]: line for line in panel["sets"][1]["lines"]}
    data = payload(report_html(solution))
    drawn = sum(column(data, line["column"]) for line in lines.values())
    np.testing.assert_allclose(drawn, solution["effort"].values[:, 0], rtol=1e-5, atol=1e-6)
    assert "actuators" in lines


def test_joint_loads_that_are_contact_forces_are_shown_once(robot: xr.Dataset) -> None:
    same = robot.copy(deep=True)
    machine = robot.condyle.mechanism
    free = tuple(c.model_copy(update={"one_sided": False}) for c in machine.contacts)
    same.attrs["mechanism"] = condyle.dumps(machine.replace(contacts=free))
    same["contact_force"].values[:] = abs(same["contact_force"].values)
    assert "load-on-joints" not in {p["id"] for p in payload(report_html(same))["panels"]}
