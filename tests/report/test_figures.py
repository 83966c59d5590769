"""The figures: the numbers drawn, labels with units, limits, and files."""

from __future__ import annotations

import ast
import inspect
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import matplotlib as mpl
import numpy as np
import pytest
import xarray as xr
from matplotlib._pylab_helpers import Gcf
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

import condyle
from condyle import accessors
from condyle.analysis.comparison import Comparison
from condyle.kinematics.rotation import rotation
from condyle.mechanism.surface import Plane, Quadratic
from condyle.motion import Motion, bundled_reference
from condyle.report import figures, panel
from condyle.report.figures import PLOTS, registry
from condyle.report.figures.drawing import looks
from condyle.report.figures.paper_figures import figure_5, figure_8, figure_9, track
from condyle.report.figures.style import new_figure
from condyle.report.naming import groups, heading
from condyle.report.panel import Curve, Panel

NOTHING = {"marker": "no markers", "reaction": "no reactions"}  # where a run has none


def curves(axes: Axes) -> dict[str, np.ndarray]:
    """Label -> values of the labelled curves."""
    found = {str(line.get_label()): np.asarray(line.get_ydata()) for line in axes.get_lines()}
    return {label: values for label, values in found.items() if not label.startswith("_")}


def words(figure: Figure) -> str:
    """All text of a figure."""
    return " | ".join(text.get_text() for text in figure.findobj(mpl.text.Text))


@pytest.mark.parametrize("name", PLOTS)
def test_every_plot_has_title_labels_units_and_provenance(name: str, solution: xr.Dataset) -> None:
    figure = PLOTS[name](solution)
    assert isinstance(figure, Figure)
    assert figure.get_suptitle()
    assert "stand-in" in words(figure) and "synthetic motion and load" in words(figure)
    for axes in figure.axes if NOTHING.get(name, "-") not in words(figure) else ():
        assert axes.get_ylabel().endswith("]") or not axes.get_subplotspec().is_first_col()
        assert axes.get_xlabel().endswith("]") or not axes.get_subplotspec().is_last_row()
    assert PLOTS[name].__doc__


@pytest.mark.parametrize("name", PLOTS)
def test_any_number_of_contacts(name: str, fewer_contacts: dict[int, xr.Dataset]) -> None:
    for k, solution in fewer_contacts.items():
        figure = PLOTS[name](solution)
        nothing = "no contacts" in words(figure)
        assert nothing == (k == 0 and name.startswith("contact"))


@pytest.mark.parametrize("name", PLOTS)
def test_mixed_units_never_share_axes(name: str, mixed: xr.Dataset) -> None:
    figure = PLOTS[name](mixed)
    for axes in figure.axes:
        kinds = {label.split()[0] for label in curves(axes) if label[:4] in ("cran", "rail")}
        assert len(kinds) <= 1 or name == "singularity"  # which is dimensionless
    figure.draw_without_rendering()


def test_torque_shows_the_torques_and_their_limits(solution: xr.Dataset) -> None:
    figure = PLOTS["effort"](solution)
    drawn = {k: v for axes in figure.axes for k, v in curves(axes).items()}
    for i, name in enumerate(solution["chain"].values):
        np.testing.assert_array_equal(
            drawn[name.replace("_", " ")], solution["effort"].values[:, i]
        )
    assert [axes.get_ylabel() for axes in figure.axes] == ["torque [N m]"] * 3
    assert all("limit ±3 N m is outside the view" in a.get_title("left") for a in figure.axes)
    assert len({axes.get_ylim() for axes in figure.axes}) == 1


def test_limit_near_the_data_is_a_line(solution: xr.Dataset) -> None:
    figure = PLOTS["joint"](solution)
    rate = figure.axes[1]
    assert rate.get_ylabel() == "rate [°/s]"
    levels = [float(np.ravel(line.get_ydata())[0]) for line in rate.get_lines()[-2:]]
    assert sorted(levels) == pytest.approx([-np.degrees(6.0), np.degrees(6.0)])
    assert rate.get_ylim()[1] > levels[0]
    assert "limit ±343.8 °/s" in words(figure)


def test_units_on_the_axes(solution: xr.Dataset, mixed: xr.Dataset) -> None:
    motion = PLOTS["motion"](solution).axes
    assert motion[0].get_ylabel() == "position [mm]"
    np.testing.assert_allclose(curves(motion[0])["Z"], solution["pose"].values[:, 2] * 1e3)
    assert motion[5].get_ylabel() == "angular acceleration [°/s²]"
    beta = np.degrees(solution["pose_acceleration"].values[:, 4])
    np.testing.assert_allclose(curves(motion[5])["β′′"], beta)

    crank, rail, _ = PLOTS["jacobian"](mixed).axes
    assert crank.get_ylabel() == "$J_A$ [mm²/rad]"
    np.testing.assert_allclose(curves(crank)["crank left"], solution["J_A"].values[:, 0] * 1e6)
    assert rail.get_ylabel() == "$J_A$ [mm]"
    np.testing.assert_allclose(curves(rail)["rail 1"], solution["J_A"].values[:, 2] * 1e3)

    labels = [axes.get_ylabel() for axes in PLOTS["effort"](mixed).axes]
    assert labels == ["torque [N m]", "force [N]", "force [N]"]


def test_path_of_the_landmark(solution: xr.Dataset) -> None:
    point = np.array([0.05, 0.01, -0.02])
    anywhere = solution.copy(deep=True)
    anywhere["pose"].values[:] = np.random.default_rng(5).uniform(-1, 1, anywhere["pose"].shape)
    for pose, place in zip(anywhere["pose"].values, track(anywhere, point), strict=True):
        expected = pose[:3] + np.asarray(rotation(pose[3:])) @ point
        np.testing.assert_allclose(place, expected, atol=1e-15)
    figure = PLOTS["path"](solution)
    assert "Path of incisor" in words(figure)
    sagittal = figure.axes[0].get_lines()[0]
    assert sagittal.get_xdata()[0] == pytest.approx(52.75)


def test_failed_samples_are_shaded_and_explained(solution: xr.Dataset, mixed: xr.Dataset) -> None:
    def shades(one: xr.Dataset) -> int:
        return len(PLOTS["effort"](one).axes[0].patches)

    assert (shades(solution), shades(mixed)) == (0, 1)
    text = words(PLOTS["effort"](mixed))
    assert "no result" in text and "Grey: no result (unreachable: " in text
    assert "no result" not in words(PLOTS["effort"](solution))


def test_a_limit_names_the_chains_that_have_it(solution: xr.Dataset) -> None:
    """One of two has it: the other is not said to."""
    machine = solution.condyle.mechanism
    first, *others = machine.chains
    free = first.model_copy(
        update={"actuator": first.actuator.model_copy(update={"torque_limit": None})}
    )
    partly = solution.copy(deep=True)
    partly.attrs["mechanism"] = condyle.dumps(machine.replace(chains=(free, *others)))
    titles = [axes.get_title("left") for axes in PLOTS["effort"](partly).axes]
    assert "limit ±3 N m (temporalis right) is outside the view" in titles[0]
    assert "(" not in titles[1]


def test_a_far_limit_flattens_no_curve(solution: xr.Dataset) -> None:
    """Of two limits, the near one is drawn."""
    peak = float(abs(solution["effort"].values).max())
    machine = solution.condyle.mechanism
    limits = (-2 * peak, 500.0)
    chains = tuple(
        c.model_copy(update={"actuator": c.actuator.model_copy(update={"torque_limit": limits})})
        for c in machine.chains
    )
    apart = solution.copy(deep=True)
    apart.attrs["mechanism"] = condyle.dumps(machine.replace(chains=chains))
    for axes in PLOTS["effort"](apart).axes:
        low, high = axes.get_ylim()
        assert -3 * peak < low < -2 * peak and high < 3 * peak


def test_no_load_no_share_of_it(solution: xr.Dataset) -> None:
    titles = [axes.get_title("left") for axes in PLOTS["share"](solution).axes[:4]]
    assert titles == ["platform", "couplers", "cranks", "load"]
    idle = solution.copy(deep=True)
    idle["share"].values[list(solution["part"].values).index("load")] = 0.0
    text = words(PLOTS["share"](idle))
    assert "platform" in text and "load" not in text.split("Mechanism")[0] and "bite" not in text
    named = solution.assign_coords(part=["platform", "couplers", "cranks", "load"])
    assert len(figure_9(named).axes) == len(figure_9(solution).axes)


def assert_whole(figure: Figure) -> None:
    """Nothing reaches over the figure's edge; what does is cut in the file."""
    figure.draw_without_rendering()
    box, (width, height) = figure.get_tightbbox(), figure.get_size_inches()
    assert min(box.x0, box.y0, width - box.x1, height - box.y1) > -0.01  # inch


@pytest.mark.slow
@pytest.mark.parametrize("style", ["journal", "journal-wide"])
def test_figures_of_24_muscles_are_whole_in_print(style: str) -> None:
    motion = Motion.from_csv(bundled_reference()[0], rate=10)
    model = condyle.derive("human-jaw", backend="numpy")
    jaw = model.solve(motion, condyle.reference_load(), reactions=True)
    for name in ("effort", "effort_speed", "reaction", "singularity", "path", "forces"):
        assert_whole(PLOTS[name](jaw, style=style))


@pytest.mark.parametrize("name", PLOTS)
def test_figures_for_a_journal(name: str, solution: xr.Dataset) -> None:
    figure = PLOTS[name](solution, style="journal", title=False, letters=True)
    assert figure.get_size_inches()[0] * 25.4 == pytest.approx(175 if name == "share" else 85)
    assert not figure.get_suptitle().strip() and "stand-in" not in words(figure)
    letters = [axes.get_title("left").split()[0] for axes in figure.axes]
    assert letters == [f"({chr(97 + i)})" for i in range(len(figure.axes))]
    assert figure.axes[0].xaxis.label.get_size() == 8
    for titled in (figure, PLOTS[name](solution, style="journal")):
        assert_whole(titled)
    wide = PLOTS[name](solution, style="journal-wide", figsize=(5, 4))
    assert tuple(wide.get_size_inches()) == (5, 4) and wide.get_suptitle()


def test_wishes_end_with_the_figure(solution: xr.Dataset) -> None:
    with pytest.raises(condyle.InputError, match="jurnal"):
        PLOTS["load"](solution, style="jurnal")
    solution.condyle.plot.load(style="journal", title=False)
    after = PLOTS["load"](solution)
    assert after.get_suptitle() and after.get_size_inches()[0] == 7


@pytest.mark.parametrize("name", [n for n in PLOTS if n not in ("path", "contact_track")])
def test_lines_differ_in_colour_and_in_dashes(name: str, solution: xr.Dataset) -> None:
    """Of any two lines in a panel; a left and a right one share the colour alone."""
    for axes in PLOTS[name](solution).axes:
        named = [line for line in axes.get_lines() if not str(line.get_label()).startswith("_")]
        dashes = [str(line._unscaled_dash_pattern) for line in named]  # type: ignore[attr-defined]
        assert len(set(dashes)) == len(dashes), axes.get_title("left")


def test_contact_track_fills_its_page(solution: xr.Dataset) -> None:
    figure = PLOTS["contact_track"](solution)
    figure.draw_without_rendering()
    boxes = [
        axes.get_tightbbox().transformed(figure.transFigure.inverted()) for axes in figure.axes
    ]
    assert min(box.x0 for box in boxes) < 0.06 and max(box.x1 for box in boxes) > 0.94


def test_panels_of_ones_own_are_a_figure_and_on_the_page(
    solution: xr.Dataset, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(panel, "PANEL_GROUPS", dict(panel.PANEL_GROUPS))
    monkeypatch.setitem(PLOTS, "power", None)

    @panel.panels("actuators", "Power of the actuators")
    def power(given: xr.Dataset) -> Iterator[Panel]:
        """Power of each actuator."""
        watts = given["effort"].values * given["joint_rate"].values
        yield Panel("power", "Power", "power", "W", panel.of_names(given, "power", "chain", watts))

    figure = solution.condyle.plot.power(figsize=(3, 2))
    assert figure.axes[0].get_ylabel() == "power [W]" and PLOTS["power"].__doc__ == power.__doc__
    watts = solution["effort"].values[:, 0] * solution["joint_rate"].values[:, 0]
    np.testing.assert_array_equal(curves(figure.axes[0])["temporalis left"], watts)
    assert [one.id for section, one in panel.panels_of(solution) if section == "actuators"] == [
        "activation", "load-on-joints", "plane-0", "plane-1", "plane-2", "power",
    ]  # fmt: skip


def test_a_figure_registers_itself(solution: xr.Dataset, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(registry, "PLOTS", PLOTS)
    monkeypatch.setitem(PLOTS, "power", None)

    @registry.plot()
    def power(given: xr.Dataset, factor: float = 1.0) -> Figure:
        """Power of each actuator."""
        made = new_figure("Power", "", 4, 3)
        axes = made.add_subplot()
        axes.plot(given["time"], factor * given["effort"] * given["joint_rate"])
        return made

    made = solution.condyle.plot.power(factor=2.0, figsize=(3, 2))
    assert tuple(made.get_size_inches()) == (3, 2)
    assert (
        "power" in dir(solution.condyle.plot)
        and solution.condyle.plot.power.__doc__ == power.__doc__
    )
    with pytest.raises(AttributeError, match="effort"):
        solution.condyle.plot.efort  # noqa: B018


def test_results_know_figures_by_name_alone(solution: xr.Dataset) -> None:
    """No file of results or analysis imports the report, which registers itself."""
    for room in ("results", "analysis"):
        for path in (Path(condyle.__file__).parent / room).glob("*.py"):
            imports = [node for node in ast.walk(ast.parse(path.read_text("utf-8")))]
            named = [n.module or "" for n in imports if isinstance(n, ast.ImportFrom)]
            assert not any("report" in name.split(".") for name in named), path
    with pytest.raises(condyle.UnsupportedError, match=r"solution\.plot"):
        accessors.extend("solution.nothing", solution)
    accessors.register("solution.size", "builtins:len")
    assert accessors.extend("solution.size", solution) == len(solution)


def test_a_ball_runs_on_the_line_of_its_centre(reference: condyle.Mechanism) -> None:
    """With a ball radius the file gives the wall; the track is a radius off it."""
    radius, lift = 0.004, 0.013215 + 0.004 * np.hypot(1.0, 1.1)
    for wall in (
        Plane(slope=(-1.1, 0.0), offset=lift),
        Quadratic(slope=(-1.1, 0.0), offset=lift),
    ):
        more = {"surface": wall, "side": "below", "ball_radius": radius}
        contacts = tuple(c.model_copy(update=more) for c in reference.contacts)
        model = condyle.derive(reference.replace(contacts=contacts), backend="interpreted")
        t = np.linspace(0, 1, 20)
        motion = condyle.Motion.from_arrays(
            t, {"X": 3e-3 * t, "Y": 0 * t, "alpha": 0 * t, "beta": 0 * t}
        )
        figure = PLOTS["contact_track"](model.solve(motion))
        axes = figure.axes[2]
        assert "left condyle, from the side" in axes.get_title("left")
        note = "surface at the home y, less the ball's radius"
        line = next(a for a in axes.get_lines() if a.get_label() == note).get_xydata()
        track = next(a for a in axes.get_lines() if a.get_label() == "contact point").get_xydata()
        off = track[:, 1] - np.interp(track[:, 0], *line[np.argsort(line[:, 0])].T)
        assert np.abs(off).max() < 1e-3  # mm
        assert note in words(figure)


def test_contact_track_against_bounds(solution: xr.Dataset) -> None:
    figure = PLOTS["contact_track"](solution)
    above = figure.axes[0]
    assert above.get_title("left") == "left condyle, from above"
    bounds = next(p for p in above.patches if isinstance(p, Rectangle))
    assert bounds.get_bbox().extents == pytest.approx([-27.65, 69, -14.65, 75])
    x = above.get_lines()[0].get_xdata()
    np.testing.assert_allclose(x, solution["contact_point"].values[:, 0, 0] * 1e3)
    assert "out of bounds" not in words(figure)
    outside = solution.copy(deep=True)
    outside["bound_margin"].values[50:, 0] = -1e-3
    assert "out of bounds" in words(PLOTS["contact_track"](outside))


def test_figure_8_shows_the_differences(comparison: Comparison) -> None:
    figure = figure_8(comparison)
    titles = [axes.get_title("left") for axes in figure.axes[:3]]
    assert titles == [
        "momentum direct",
        "momentum direct − momentum core",
        "momentum direct − lagrange direct",
    ]
    one, two = (comparison.run("momentum", route) for route in ("direct", "core"))
    assert one is not None and two is not None
    drawn = curves(figure.axes[1])["temporalis left"]
    np.testing.assert_array_equal(drawn, one.effort[:, 0] - two.effort[:, 0])


def test_figure_9_leaves_the_bite_out(solution: xr.Dataset) -> None:
    figure = figure_9(solution)
    titles = [axes.get_title("left") for axes in figure.axes[:3]]
    assert titles == ["platform", "cranks", "couplers"]
    cranks = solution["share"].sel(part="cranks").values[:, 1]
    np.testing.assert_array_equal(curves(figure.axes[1])["temporalis right"], cranks)


def test_pairs_share_a_panel_and_a_colour() -> None:
    names = ["jaw_left", "jaw_right", "a", "b", "leftover"]
    assert groups(names, ["N m"] * 5) == [[0, 1], [2, 3], [4]]
    assert groups(["jaw_left", "jaw_right"], ["N m", "N"]) == [[0], [1]]
    assert groups([f"leg_{i}" for i in range(5)], ["N"] * 5) == [[0, 1], [2, 3], [4]]
    assert heading(names[:2]) == "jaw" and heading(names[2:4]) == "a, b"

    def drawn(names: list[str]) -> list[dict[str, Any]]:
        curves = [Curve(name, name, np.zeros(2)) for name in names]
        return list(looks(Panel("a", "A", "a", "1", curves), curves))

    found = drawn(names)
    assert found[0]["color"] == found[1]["color"] != found[2]["color"]
    assert found[0]["linestyle"] != found[1]["linestyle"]
    assert len({str(look) for look in drawn([f"leg {i}" for i in range(20)])}) == 20


def test_accessor_has_every_plot(solution: xr.Dataset) -> None:
    plots = solution.condyle.plot
    for name, draw in PLOTS.items():
        assert inspect.getdoc(getattr(plots, name)) == inspect.getdoc(draw)
    for name in ("bite", "load"):  # as the file calls it, and as people do
        figure = plots.share(parts=[name])
        assert figure.axes[0].get_title("left") == "load"


def test_callers_settings_are_left_alone(solution: xr.Dataset) -> None:
    before, kept = dict(mpl.rcParams), dict(Gcf.figs)
    with mpl.rc_context({"font.size": 30}):
        figure = PLOTS["load"](solution)
        assert figure.axes[0].xaxis.label.get_size() == 9
    assert dict(mpl.rcParams) == before
    assert Gcf.figs == kept  # what pyplot would keep


def test_papers_figures_as_files(comparison: Comparison, tmp_path: Path) -> None:
    paths = figures.save_figures(comparison.solution, comparison, tmp_path)
    names = ["5-motion", "6-jacobian", "7-load", "8-torque", "9-share"]
    assert [p.name for p in paths] == [
        f"figure-{name}.{kind}" for name in names for kind in ("png", "svg")
    ]
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted(p.name for p in paths)
    for path in paths[::2]:
        assert path.read_bytes().startswith(b"\x89PNG")
    for path in paths[1::2]:
        assert ElementTree.parse(path).getroot().tag.endswith("svg")


def test_same_figure_same_file(solution: xr.Dataset, tmp_path: Path) -> None:
    first = figures.save(PLOTS["load"](solution), tmp_path, "first")
    second = figures.save(PLOTS["load"](solution), tmp_path, "second")
    for one, two in zip(first, second, strict=True):
        assert one.read_bytes() == two.read_bytes()


def test_whole_or_not_at_all(solution: xr.Dataset, tmp_path: Path) -> None:
    with pytest.raises(condyle.InputError, match="does not exist"):
        figures.save(PLOTS["load"](solution), tmp_path / "nowhere", "load")
    broken = PLOTS["load"](solution)
    broken.axes[0].set_title("$\\nosuch$")  # fails while it is being written
    with pytest.raises(ValueError):
        figures.save(broken, tmp_path, "load")
    assert not list(tmp_path.iterdir())


def test_figures_of_a_solution(
    fewer_contacts: dict[int, xr.Dataset], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    few = {name: PLOTS[name] for name in ("load", "contact_force")}
    monkeypatch.setattr(figures, "PLOTS", few)
    name = fewer_contacts[0].attrs["mechanism_name"]
    stale, other = tmp_path / f"{name}-contact_force.png", tmp_path / "other-contact_force.png"
    stale.touch()
    other.touch()
    paths = figures.save_solution_figures(fewer_contacts[0], tmp_path)
    assert [p.name for p in paths] == [f"{name}-load.png", f"{name}-load.svg"]
    assert {*tmp_path.iterdir()} == {*paths, other}


def test_figure_5_holds_path_and_coordinates(solution: xr.Dataset) -> None:
    figure = figure_5(solution)
    assert len(figure.axes) == 4 + 6
    assert [axes.name for axes in figure.axes].count("3d") == 1
