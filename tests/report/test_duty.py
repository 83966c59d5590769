"""What actuators are asked for: duty, limits as a box, activations, on figures and page."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from matplotlib.collections import QuadMesh
from matplotlib.figure import Figure
from scipy.integrate import trapezoid
from support.report_pages import column, payload

import condyle
from condyle.mechanism.actuator import Limits
from condyle.motion import Load, Motion
from condyle.report.actuators import DutyMeter, activations, duty, edges, joint_loads
from condyle.report.figures import PLOTS, save_solution_figures
from condyle.report.naming import parts_in_use
from condyle.report.page import report_html
from condyle.report.panel import PANEL_GROUPS

INF = float("inf")


@pytest.fixture(scope="module")
def page(jaw: xr.Dataset) -> dict[str, Any]:
    return payload(report_html(jaw))


def panels(solution: xr.Dataset) -> dict[str, dict]:
    return {panel["id"]: panel for panel in payload(report_html(solution))["panels"]}


def changed(solution: xr.Dataset, **parts: Any) -> xr.Dataset:
    """A copy whose mechanism has other chains or contacts."""
    machine = solution.condyle.mechanism.replace(**parts)
    return solution.copy(deep=True).assign_attrs(mechanism=condyle.dumps(machine))


def mesh_of(figure: Figure) -> QuadMesh:
    (mesh,) = [item for item in figure.axes[0].collections if isinstance(item, QuadMesh)]
    return mesh


def test_duty_by_hand_piece_by_piece_and_over_gaps(solution: xr.Dataset) -> None:
    t, effort = solution["time"].values, solution["effort"].values
    for i, one in enumerate(duty(solution)):
        mean = trapezoid(effort[:, i] ** 2, t) / (t[-1] - t[0])
        power = abs(effort[:, i] * solution["joint_rate"].values[:, i]).max()
        assert (one.rms, one.power) == pytest.approx((np.sqrt(mean), power), rel=1e-12)
        assert one.text == f"rms {one.rms:.3g} N m, {one.power:.3g} W"
    holed = solution.copy(deep=True)
    holed["effort"].values[50:60] = np.nan
    meter = DutyMeter()
    for start in range(0, holed.sizes["time"], 17):
        meter.see(holed.isel(time=slice(start, start + 17)))
    for one, whole in zip(meter.read(), duty(holed), strict=True):
        assert (one.rms, one.power) == pytest.approx((whole.rms, whole.power), rel=1e-12)
    square = effort[:, 0] ** 2
    parts = [(t[:50], square[:50]), (t[60:], square[60:])]
    mean = sum(trapezoid(y, x) for x, y in parts) / sum(x[-1] - x[0] for x, _ in parts)
    assert duty(holed)[0].rms == pytest.approx(np.sqrt(mean), rel=1e-12)
    holed["effort"].values[:] = np.nan
    assert {one.text for one in duty(holed)} == {"no result"}


def test_edges_of_the_box_near_the_data() -> None:
    assert edges(Limits(-3.0, 3.0, 6.0), speed=5.0, effort=2.0) == [
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


def test_effort_speed_draws_every_chain_in_its_limits(
    solution: xr.Dataset, jaw: xr.Dataset
) -> None:
    figures = [PLOTS["effort_speed"](one) for one in (solution, jaw)]
    for figure, one, count in zip(figures, (solution, jaw), (3, 12), strict=True):
        assert len(figure.axes) == count
        lines = [line for axes in figure.axes for line in axes.get_lines()]
        tracks = [line for line in lines if not str(line.get_label()).startswith("_")]
        found = {(tuple(line.get_xdata()), tuple(line.get_ydata())) for line in tracks}
        pairs = zip(one["joint_rate"].values.T, one["effort"].values.T, strict=True)
        assert found == {(tuple(rate), tuple(effort)) for rate, effort in pairs}
        assert len(tracks) == one.sizes["chain"]
    first = figures[0].axes[0]
    assert (first.get_xlabel(), first.get_ylabel()) == ("speed [rad/s]", "torque [N m]")
    titles = [figure.axes[0].get_legend().get_title().get_text() for figure in figures]
    assert titles == ["limits: ±3 N m, 6 rad/s", "limits: 0 to 158 N"]


def test_activation_rows_are_effort_over_greatest_effort(
    solution: xr.Dataset, jaw: xr.Dataset, page: dict[str, Any]
) -> None:
    figure = PLOTS["activation"](jaw)
    field, loads = figure.axes
    rows = [label.get_text() for label in field.get_yticklabels()]
    names = [str(name) for name in jaw["chain"].values]
    greatest = [c.actuator.effort_range[1] for c in jaw.condyle.mechanism.chains]
    expected = dict(zip(names, (jaw["effort"].values / greatest).T, strict=True))
    sides = [row.rpartition(" ")[0] for row in rows]
    assert sides[::2] == sides[1::2]
    values = np.ma.getdata(mesh_of(figure).get_array()).reshape(len(rows), -1)
    for row, drawn in zip(rows, values, strict=True):
        np.testing.assert_allclose(drawn, expected[row.replace(" ", "_")], atol=1e-15)
    assert 0.2 < values.max() <= 0.5
    curves = [line.get_ydata() for line in loads.get_lines()]
    np.testing.assert_array_equal(np.transpose(curves), -jaw["contact_force"].values)
    assert (jaw["contact_force"].values <= 0).all(), "the fossa pushes downwards, along -n"
    # On the page, too.
    (field,) = [p for p in page["panels"] if p["id"] == "activation"]
    assert field["kind"] == "field" and len(field["sets"][0]["lines"]) == 24
    for line in field["sets"][0]["lines"]:
        drawn = column(page, line["column"]) * line["scale"]
        np.testing.assert_allclose(drawn, expected[line["label"]], rtol=1e-6, atol=1e-9)
    (load,) = [p for p in page["panels"] if p["id"] == "load-on-joints"]
    drawn = column(page, load["sets"][0]["lines"][0]["column"])
    np.testing.assert_allclose(drawn, -jaw["contact_force"].values[:, 0], rtol=1e-6)
    # Free movement takes some thousandths: on a scale up to 1 it was blank.
    free = jaw.copy(deep=True)
    free["effort"].values *= 0.004 / max(float(row.max()) for row in activations(jaw).values())
    for one, top in ((free, 0.005), (jaw, 0.5)):
        assert mesh_of(PLOTS["activation"](one)).get_clim() == (0.0, top)
        assert next(iter(PANEL_GROUPS["activation"].panels(one))).top == top
    # A pair that is apart in the file stands together.
    order = [0, 2, 4, 1, 3, 5]
    chains = solution.condyle.mechanism.chains
    found = activations(changed(solution.isel(chain=order), chains=tuple(chains[i] for i in order)))
    assert list(found) == [str(name) for name in solution["chain"].values]
    second = np.abs(solution["effort"].values[:, 1]) / 3.0
    np.testing.assert_allclose(found[str(solution["chain"].values[1])], second)


def test_beyond_the_limit_is_said_and_failed_samples_are_blank(solution: xr.Dataset) -> None:
    strong = solution.copy(deep=True)
    strong["effort"].values[5, 0] = 4.5
    strong["effort"].values[9] = np.nan
    figure = PLOTS["activation"](strong)
    assert "beyond" in figure.axes[0].get_title("left")
    drawn = mesh_of(figure).get_array().reshape(6, -1)
    assert np.ma.getmaskarray(drawn)[:, 9].all() and drawn[0, 5] == pytest.approx(1.5)
    assert "beyond" not in PLOTS["activation"](solution).axes[0].get_title("left")


def test_without_limits_there_is_no_activation(
    solution: xr.Dataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    chains = solution.condyle.mechanism.chains
    bare = tuple(c.model_copy(update={"actuator": type(c.actuator)()}) for c in chains)
    free = changed(solution, chains=bare)
    text = " ".join(t.get_text() for t in PLOTS["activation"](free).axes[0].texts)
    assert "no actuator" in text and activations(free) == {}
    few = {name: PLOTS[name] for name in ("activation", "effort_speed")}
    monkeypatch.setattr("condyle.report.figures.PLOTS", few)
    names = {path.stem for path in save_solution_figures(free, tmp_path)}
    assert names == {"masticatory-effort_speed"}
    ids = {*panels(free)}
    assert "activation" not in ids and "contact-force" in ids


def test_joint_loads_of_contacts_that_may_pull_are_shown_once(solution: xr.Dataset) -> None:
    """They have no sign."""
    machine, force = solution.condyle.mechanism, solution["contact_force"].values
    for i, contact in enumerate(machine.contacts):
        expected = contact.push * force[:, i] if contact.one_sided else abs(force[:, i])
        np.testing.assert_array_equal(joint_loads(solution)[contact.name], expected)
    free = tuple(c.model_copy(update={"one_sided": False}) for c in machine.contacts)
    same = changed(solution, contacts=free)
    same["contact_force"].values[:] = abs(same["contact_force"].values)
    assert "load-on-joints" not in panels(same)


def test_page_has_every_plane_and_limit(
    page: dict[str, Any], jaw: xr.Dataset, solution: xr.Dataset
) -> None:
    names = [str(name) for name in jaw["chain"].values]
    planes = [panel for panel in page["panels"] if panel["kind"] == "plane"]
    assert len(planes) == 12
    assert all(p["axes"] == ["speed [m/s]", "force"] and p["unit"] == "N" for p in planes)
    lines = [line for p in planes for line in p["sets"][0]["lines"]]
    for i, (name, line) in enumerate(zip(names, lines, strict=True)):
        speed, effort = (column(page, line[key]) for key in ("across", "column"))
        np.testing.assert_allclose(speed, jaw["joint_rate"].values[:, i], rtol=1e-6, atol=1e-9)
        np.testing.assert_allclose(effort, jaw["effort"].values[:, i], rtol=1e-6, atol=1e-9)
        assert name.endswith(line["label"])
    # Eleven limits would hide the curves; the table at the cursor needs each.
    (force,) = [p for p in page["panels"] if p["id"] == "effort-N"]
    assert not force["limitsDrawn"] and not force["limitsInView"]
    assert len(force["limits"]) == 11 and sum(len(one["of"]) for one in force["limits"]) == 24
    torque = panels(solution)["effort-Nm"]
    assert torque["limitsDrawn"] and len(torque["limits"]) == 1


def test_a_thinned_page_keeps_tracks_and_the_duty_of_every_sample(jaw: xr.Dataset) -> None:
    count = 6000
    index = np.linspace(0, jaw.sizes["time"] - 1, count).astype(int)
    long = jaw.isel(time=index).assign_coords(time=np.linspace(0, 5, count))
    data = payload(report_html(long))
    assert data["columns"]["total"] == count
    assert 500 < data["columns"]["samples"] < count
    planes = [panel for panel in data["panels"] if panel["kind"] == "plane"]
    texts = [line["text"] for plane in planes for line in plane["sets"][0]["lines"]]
    assert texts == [one.text for one in duty(long)]


def test_shares_of_friction_have_figures_and_panels(solution: xr.Dataset) -> None:
    """Parts of no consequence are left out."""
    parts = [str(part) for part in solution["part"].values]
    more = solution.isel(part=[*range(len(parts)), 0, 0]).copy(deep=True)
    more = more.assign_coords(part=[*parts, "friction", "internal"])
    more["share"].values[-2] = 0.0
    shown = parts_in_use(more)
    assert "friction" not in shown and "internal" in shown
    machine = condyle.load_mechanism("masticatory")
    lossy = machine.set({f"chain.{c}.actuator.coulomb": 0.05 for c in machine.chain_names})
    t = np.linspace(0, 1, 20)
    size = {"X": 1e-3, "Y": 0.0, "alpha": 0.0, "beta": 0.05}
    motion = Motion.from_arrays(t, {name: a * np.sin(6 * t) for name, a in size.items()})
    rubbing = condyle.derive(lossy, backend="numpy").solve(motion, Load.constant((0, 0, -10)))
    titles = [axes.get_title("left") for axes in PLOTS["share"](rubbing).axes]
    assert "actuators" in titles
    data = payload(report_html(rubbing))
    (panel,) = [p for p in data["panels"] if p["id"] == "share-Nm"]
    lines = {line["label"]: line["column"] for line in panel["sets"][1]["lines"]}
    assert "actuators" in lines
    drawn = sum(column(data, number) for number in lines.values())
    np.testing.assert_allclose(drawn, rubbing["effort"].values[:, 0], rtol=1e-5, atol=1e-6)
