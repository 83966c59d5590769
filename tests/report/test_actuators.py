"""What actuators are asked for: duty, limits, activations and shares, on figures and page."""

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
from condyle.motion import Load, Motion, trial_motion
from condyle.report.actuators import DutyMeter, activations, duty, edges
from condyle.report.figures import PLOTS, save_solution_figures
from condyle.report.figures.style import EmptyFigureError
from condyle.report.naming import parts_in_use
from condyle.report.page import report_html
from condyle.report.page.page_columns import PageColumns, panel_data
from condyle.report.page.page_facts import alerts, chain_table
from condyle.report.panel import PANEL_GROUPS, panels_of
from condyle.report.panel_list import effort as effort_panels
from condyle.view.snapshot import state_messages

from .conftest import panels

INF = float("inf")
LOW, HIGH = -0.0005, 0.003  # N m, of efforts from -0.001 to 0.0036
FIRST, SECOND, THIRD = "pterygoid_left", "pterygoid_right", "masseter_left"


def changed(solution: xr.Dataset, **parts: Any) -> xr.Dataset:
    """A copy whose mechanism has other chains or contacts."""
    machine = solution.condyle.mechanism.replace(**parts)
    return solution.copy(deep=True).assign_attrs(mechanism=condyle.dumps(machine))


def drawn_rows(figure: Figure) -> tuple[list[str], np.ma.MaskedArray, tuple[float, float]]:
    """Names, values and scale of a picture of activations."""
    field = figure.axes[0]
    (mesh,) = [item for item in field.collections if isinstance(item, QuadMesh)]
    names = [label.get_text() for label in field.get_yticklabels()]
    return names, mesh.get_array().reshape(len(names), -1), mesh.get_clim()


def test_duty_by_hand_piece_by_piece_and_over_gaps(solution: xr.Dataset) -> None:
    holed = solution.copy(deep=True)
    holed["effort"].values[50:60] = np.nan
    for given, spans in ((solution, [slice(None)]), (holed, [slice(50), slice(60, None)])):
        t, effort = given["time"].values, given["effort"].values
        power = np.nanmax(abs(effort * given["joint_rate"].values), axis=0)
        meter = DutyMeter()
        for start in range(0, len(t), 17):
            meter.see(given.isel(time=slice(start, start + 17)))
        for i, (whole, pieces) in enumerate(zip(duty(given), meter.read(), strict=True)):
            squares = sum(trapezoid(effort[s, i] ** 2, t[s]) for s in spans)
            rms = np.sqrt(squares / sum(np.ptp(t[s]) for s in spans))
            for one in (whole, pieces):
                assert (one.rms, one.power) == pytest.approx((rms, power[i]), rel=1e-12)
            assert whole.text == f"rms {rms:.3g} N m, {power[i]:.3g} W"
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


def test_effort_over_speed_of_every_chain_in_its_limits(
    solution: xr.Dataset, jaw: xr.Dataset, jaw_page: str
) -> None:
    """On the figure, and a panel a pair on the page."""
    said = [("limits: ±3 N m, 6 rad/s", 3), ("limits: 0 to 158 N", 12)]
    for one, (limits, count) in zip((solution, jaw), said, strict=True):
        figure = PLOTS["effort_speed"](one)
        assert len(figure.axes) == count
        lines = [line for axes in figure.axes for line in axes.get_lines()]
        tracks = [line for line in lines if not str(line.get_label()).startswith("_")]
        found = {(tuple(line.get_xdata()), tuple(line.get_ydata())) for line in tracks}
        pairs = zip(one["joint_rate"].values.T, one["effort"].values.T, strict=True)
        assert found == {(tuple(rate), tuple(effort)) for rate, effort in pairs}
        assert len(tracks) == one.sizes["chain"]
        assert figure.axes[0].get_legend().get_title().get_text() == limits
        if one is solution:
            first = figure.axes[0]
            assert (first.get_xlabel(), first.get_ylabel()) == ("speed [rad/s]", "torque [N m]")
    data = payload(jaw_page)
    planes = [panel for panel in data["panels"] if panel["kind"] == "plane"]
    assert len(planes) == 12
    assert all(p["axes"] == ["speed [m/s]", "force"] and p["unit"] == "N" for p in planes)
    lines = [line for p in planes for line in p["sets"][0]["lines"]]
    for i, (name, line) in enumerate(zip(jaw["chain"].values, lines, strict=True)):
        for key, variable in (("across", "joint_rate"), ("column", "effort")):
            wanted = jaw[variable].values[:, i]
            np.testing.assert_allclose(column(data, line[key]), wanted, rtol=1e-6, atol=1e-9)
        assert str(name).endswith(line["label"])
    # Eleven limits would hide the curves; the table at the cursor needs each.
    force, torque = panels(jaw_page)["effort-N"], panels(report_html(solution))["effort-Nm"]
    assert not force["limitsDrawn"] and not force["limitsInView"]
    assert len(force["limits"]) == 11 and sum(len(one["of"]) for one in force["limits"]) == 24
    assert torque["limitsDrawn"] and len(torque["limits"]) == 1


def test_activations_are_effort_over_greatest_effort(
    solution: xr.Dataset, jaw: xr.Dataset, jaw_page: str
) -> None:
    """In rows by pairs, over the joints' loads; beyond the limit is said, failed is blank."""
    figure = PLOTS["activation"](jaw)
    rows, values, scale = drawn_rows(figure)
    greatest = [c.actuator.effort_range[1] for c in jaw.condyle.mechanism.chains]
    activation = jaw["effort"].values / greatest
    expected = dict(zip(map(str, jaw["chain"].values), activation.T, strict=True))
    sides = [row.rpartition(" ")[0] for row in rows]
    assert sides[::2] == sides[1::2] and 0.2 < values.max() <= 0.5 == scale[1]
    for row, drawn in zip(rows, values, strict=True):
        np.testing.assert_allclose(drawn, expected[row.replace(" ", "_")], atol=1e-15)
    loads = -jaw["contact_force"].values
    assert (loads >= 0).all(), "the fossa pushes downwards, along -n"
    curves = [line.get_ydata() for line in figure.axes[1].get_lines()]
    np.testing.assert_array_equal(np.transpose(curves), loads)
    data, found = payload(jaw_page), panels(jaw_page)
    field = found["activation"]
    assert field["kind"] == "field" and len(field["sets"][0]["lines"]) == 24
    for line in field["sets"][0]["lines"]:
        drawn = column(data, line["column"]) * line["scale"]
        np.testing.assert_allclose(drawn, expected[line["label"]], rtol=1e-6, atol=1e-9)
    drawn = column(data, found["load-on-joints"]["sets"][0]["lines"][0]["column"])
    np.testing.assert_allclose(drawn, loads[:, 0], rtol=1e-6)
    # Free movement takes some thousandths: on a scale up to 1 it was blank.
    free = jaw.copy(deep=True)
    free["effort"].values *= 0.004 / activation.max()
    for one, top in ((free, 0.005), (jaw, 0.5)):
        assert drawn_rows(PLOTS["activation"](one))[2] == (0.0, top)
        assert next(iter(PANEL_GROUPS["activation"].panels(one))).top == top
    # A pair that is apart in the file stands together.
    order, chains = [0, 2, 4, 1, 3, 5], solution.condyle.mechanism.chains
    apart = changed(solution.isel(chain=order), chains=tuple(chains[i] for i in order))
    names = [str(name) for name in solution["chain"].values]
    assert list(activations(apart)) == names
    second = np.abs(solution["effort"].values[:, 1]) / 3.0
    np.testing.assert_allclose(activations(apart)[names[1]], second)
    strong = solution.copy(deep=True)
    strong["effort"].values[5, 0] = 4.5
    strong["effort"].values[9] = np.nan
    figure = PLOTS["activation"](strong)
    _, values, _ = drawn_rows(figure)
    assert np.ma.getmaskarray(values)[:, 9].all() and values[0, 5] == pytest.approx(1.5)
    assert "beyond" in figure.axes[0].get_title("left")
    assert "beyond" not in PLOTS["activation"](solution).axes[0].get_title("left")


def test_without_limits_there_is_no_activation(
    solution: xr.Dataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    chains = solution.condyle.mechanism.chains
    bare = tuple(c.model_copy(update={"actuator": type(c.actuator)()}) for c in chains)
    free = changed(solution, chains=bare)
    with pytest.raises(EmptyFigureError, match="no actuator"):
        PLOTS["activation"](free)
    assert activations(free) == {}
    few = {name: PLOTS[name] for name in ("activation", "load")}
    monkeypatch.setattr("condyle.report.figures.PLOTS", few)
    names = {path.stem for path in save_solution_figures(free, tmp_path)}
    assert names == {"masticatory-load"}
    ids = {panel.id for _, panel in panels_of(free)}
    assert "activation" not in ids and "contact-force" in ids


def test_loads_on_joints_and_platform(
    solution: xr.Dataset, fewer_contacts: dict[int, xr.Dataset]
) -> None:
    """Of contacts without a side along the normal; the platform's where there are any."""
    assert not any(contact.side for contact in solution.condyle.mechanism.contacts)
    force, shown = solution["contact_force"].values, {p.id: p for _, p in panels_of(solution)}
    for name in ("load-on-joints", "contact-force"):
        np.testing.assert_array_equal(np.transpose([c.values for c in shown[name].curves]), force)
        assert shown[name].note == "Positive: along the normal of the surface."
    loaded = fewer_contacts[0]
    idle = loaded.assign(load=0.0 * loaded["load"])
    for one, there in ((loaded, {"load", "moment"}), (idle, set())):
        assert {p.id for _, p in panels_of(one)} & {"load", "moment"} == there


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
    assert "actuators" in [axes.get_title("left") for axes in PLOTS["share"](rubbing).axes]
    page = report_html(rubbing)
    lines = panels(page)["share-Nm"]["sets"][1]["lines"]
    assert "actuators" in {line["label"] for line in lines}
    drawn = sum(column(payload(page), line["column"]) for line in lines)
    np.testing.assert_allclose(drawn, rubbing["effort"].values[:, 0], rtol=1e-5, atol=1e-6)


def test_limits_that_differ_by_direction_are_told_of_on_their_side() -> None:
    """Where one motor pushes little, one may only pull and one has no limit: notices, panels,
    tables, figures and the live view.
    """
    machine = condyle.load_mechanism("masticatory").set(
        {
            f"chain.{FIRST}.actuator.torque_limit": [LOW, HIGH],
            f"chain.{SECOND}.actuator.torque_limit": [0, np.inf],
            f"chain.{THIRD}.actuator": {},
        }
    )
    given = condyle.derive(machine, backend="numpy").solve(trial_motion(machine, rate=40))
    told = {(n.owner, n.bound): n for n in given.condyle.notices if n.kind == "effort_limit"}
    first, second = (given["effort"].sel(chain=name).values for name in (FIRST, SECOND))
    wanted = {
        (FIRST, LOW): (first < LOW, first.min()),
        (FIRST, HIGH): (first > HIGH, first.max()),
        (SECOND, 0.0): (second < 0, second.min()),
    }
    wanted = {key: value for key, value in wanted.items() if value[0].any()}
    assert {(FIRST, LOW), (SECOND, 0.0)} <= set(wanted) == set(told)
    for key, (where, worst) in wanted.items():
        assert (told[key].count, told[key].value) == (where.sum(), worst)
        assert ("below its minimum" in told[key].text) == (key[1] <= 0)
    [panel] = effort_panels(given)
    columns = PageColumns(given["time"].values)
    found = {one["of"]: one for one in panel_data("chains", panel, columns, {})["limits"]}
    for name, low, high, label in (
        (FIRST, LOW, HIGH, f"limit -0.0005 to 0.003 N m ({FIRST})"),
        (SECOND, 0.0, None, f"limit at least 0 N m ({SECOND})"),
    ):
        one = found[(name,)]
        assert (one["low"], one["high"], one["label"]) == (low, high, label)
    texts = {one["text"] for one in alerts(given, columns)}
    assert {f"{one} is beyond its effort limit" for one in (FIRST, SECOND)} <= texts
    assert not any(THIRD in chains for chains in found)
    assert not any(text.startswith(THIRD) for text in texts)
    # The table of peaks names the limit on its side.
    text = str(chain_table(given))
    peak = first[np.abs(first).argmax()]
    bound = HIGH if peak > 0 else LOW
    assert f"{peak / bound:.0%} of {abs(bound):g} N m" in text and "no limit" in text
    slack = given.copy(deep=True)
    slack["effort"].loc[{"chain": SECOND}] = -1.0
    assert "beyond at least 0 N m" in str(chain_table(slack))
    lines = [line for axes in PLOTS["effort"](given).axes for line in axes.get_lines()]
    limits = [line for line in lines if str(line.get_label()).startswith("_")]
    assert {float(np.ravel(line.get_ydata())[0]) for line in limits} == {LOW, HIGH}
    efforts = np.array([0.0, 3.1, 9.0, 0.0, -0.01, -0.01])
    assert state_messages(machine, np.full(2, np.inf), np.zeros(2), efforts, None) == [
        "temporalis_right is above its effort limit of 3",
        f"{FIRST} is below its minimum effort of -0.0005",
        f"{SECOND} is below its minimum effort of 0",
    ]
