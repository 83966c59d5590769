"""The figures: the numbers drawn, labels with units, limits, and files."""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pytest
import xarray as xr
from matplotlib._pylab_helpers import Gcf
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from support.machines import model

import condyle
from condyle.kinematics.rotation import rotation
from condyle.mechanism.surface import Plane
from condyle.motion import Motion, bundled_reference
from condyle.report import figures, panel
from condyle.report.figures import PLOTS, registry
from condyle.report.figures.drawing import looks
from condyle.report.figures.paper_figures import figure_9, track
from condyle.report.figures.style import EmptyFigureError, new_figure
from condyle.report.naming import groups, heading
from condyle.report.panel import Panel, Series
from condyle.report.scene import styles

from .conftest import renamed

PLAIN = ("activation", "bound", "condition", "ratio", "transmission", "σ")  # without a unit
EMPTY = (
    "forces",
    "marker",
    "modes",
    "pressure",
    "reaction",
)  # the reference motion has nothing for them


def curves(axes: Axes) -> dict[str, np.ndarray]:
    """Label -> values of the labelled curves."""
    found = {str(line.get_label()): np.asarray(line.get_ydata()) for line in axes.get_lines()}
    return {label: values for label, values in found.items() if not label.startswith("_")}


def titles(figure: Figure) -> list[str]:
    return [axes.get_title("left") for axes in figure.axes]


def words(figure: Figure) -> str:
    """All text of a figure."""
    return " | ".join(text.get_text() for text in figure.findobj(mpl.text.Text))


def assert_whole(figure: Figure) -> None:
    """Nothing reaches over the figure's edge; what does is cut in the file."""
    figure.draw_without_rendering()
    box, (width, height) = figure.get_tightbbox(), figure.get_size_inches()
    assert min(box.x0, box.y0, width - box.x1, height - box.y1) > -0.01  # inch


@pytest.fixture(scope="module")
def drawn(solution: xr.Dataset) -> dict[str, Figure]:
    """Every figure of the reference motion, which no test changes."""
    return {name: draw(solution) for name, draw in PLOTS.items() if name not in EMPTY}


@pytest.fixture(scope="module")
def mixed(solution: xr.Dataset) -> xr.Dataset:
    """Two cranks and four sliders by name and unit, with samples that failed."""
    names = ["crank_left", "crank_right", "rail_1", "rail_2", "rail_3", "rail_4"]
    found = renamed(solution.copy(deep=True), names).assign_coords(
        effort_unit=("chain", ["N m"] * 2 + ["N"] * 4),
        joint_unit=("chain", ["rad"] * 2 + ["m"] * 4),
    )
    found["status"].values[10:15] = 1
    found["effort"].values[10:15] = np.nan
    return found


def limited(solution: xr.Dataset, limit: object, count: int = 6) -> Figure:
    """Efforts with another limit of the first actuators."""
    machine = solution.condyle.mechanism
    names = machine.chain_names[:count]
    changed = machine.set({f"chain.{name}.actuator.torque_limit": limit for name in names})
    return PLOTS["effort"](solution.assign_attrs(mechanism=condyle.dumps(changed)))


def test_a_low_limit_has_its_name_inside_the_axes(drawn: dict[str, Figure]) -> None:
    """Near 0 it stood across the axis; elsewhere, below its line, as a title may be above."""
    for name, text in (("singularity", "near: 0.001"), ("joint", "limit ±343.8 °/s")):
        drawn[name].draw_without_rendering()
        [said] = [one for one in drawn[name].findobj(mpl.text.Text) if one.get_text() == text]
        assert said.axes is not None
        box, axes = said.get_window_extent(), said.axes.get_window_extent()
        assert axes.y0 <= box.y0 and box.y1 <= axes.y1, name


def test_a_transmission_that_is_always_one_is_not_drawn(jaw: xr.Dataset) -> None:
    """Muscles act along their lines."""
    assert np.abs(jaw["transmission"].values).min() > 1 - 1e-15
    shown = titles(PLOTS["singularity"](jaw))
    assert len(shown) == 3 and not any("Transmission" in title for title in shown)


def test_every_plot(
    solution: xr.Dataset,
    drawn: dict[str, Figure],
    mixed: xr.Dataset,
    fewer_contacts: dict[int, xr.Dataset],
) -> None:
    """Title, units and provenance; lines differ in dashes, too; units never share axes."""
    for name, figure in drawn.items():
        assert isinstance(figure, Figure) and figure.get_suptitle() and PLOTS[name].__doc__
        assert "stand-in" in words(figure) and "synthetic motion and load" in words(figure)
        for axes in figure.axes:
            what = axes.get_ylabel()
            assert what.endswith("]") or what in PLAIN or not axes.get_subplotspec().is_first_col()
            assert axes.get_xlabel().endswith("]") or not axes.get_subplotspec().is_last_row()
        for axes in figure.axes if name not in ("path", "contact_track") else ():
            # A left and a right one share the colour alone.
            named = [line for line in axes.get_lines() if not str(line.get_label()).startswith("_")]
            dashes = [str(line._unscaled_dash_pattern) for line in named]  # type: ignore[attr-defined]
            assert len(set(dashes)) == len(dashes), axes.get_title("left")
        for axes in PLOTS[name](mixed).axes if name != "singularity" else ():  # dimensionless
            kinds = {label.split()[0] for label in curves(axes) if label[:4] in ("cran", "rail")}
            assert len(kinds) <= 1, name
        if name.startswith("contact"):
            with pytest.raises(EmptyFigureError, match="no contacts"):
                PLOTS[name](fewer_contacts[0])
        assert PLOTS[name](fewer_contacts[name.startswith("contact")])
    for name in EMPTY:
        with pytest.raises(EmptyFigureError, match=rf"no figure {name}: .*\bno "):
            PLOTS[name](solution)
    with pytest.raises(EmptyFigureError, match="nothing loads"):
        PLOTS["load"](solution.assign(load=0.0 * solution["load"]))


def test_torques_and_their_limits(solution: xr.Dataset, drawn: dict[str, Figure]) -> None:
    """A limit far from the data is named and flattens no curve; near it is a line."""
    figure = drawn["effort"]
    lines = {k: v for axes in figure.axes for k, v in curves(axes).items()}
    for i, name in enumerate(solution["chain"].values):
        given = solution["effort"].values[:, i]
        np.testing.assert_array_equal(lines[name.replace("_", " ")], given)
    assert [axes.get_ylabel() for axes in figure.axes] == ["torque [N m]"] * 3
    assert figure.get_supxlabel().endswith(" Outside the view: limit ±3 N m.")
    assert titles(figure) == ["temporalis", "masseter", "pterygoid"]
    assert len({axes.get_ylim() for axes in figure.axes}) == 1
    rate = drawn["joint"].axes[1]
    assert rate.get_ylabel() == "rate [°/s]"
    levels = [float(np.ravel(line.get_ydata())[0]) for line in rate.get_lines()[-2:]]
    assert sorted(levels) == pytest.approx([-np.degrees(6.0), np.degrees(6.0)])
    assert rate.get_ylim()[1] > levels[0]
    assert "limit ±343.8 °/s" in words(drawn["joint"])
    # It names the chains that have it: one of two has it, the other is not said to.
    less = limited(solution, None, count=1).get_supxlabel()
    assert "limit ±3 N m (temporalis right, masseter left, " in less
    # Of a near one and a far one, the near one is drawn.
    peak = float(abs(solution["effort"].values).max())
    for axes in limited(solution, [-2 * peak, 500.0]).axes:
        low, high = axes.get_ylim()
        assert -3 * peak < low < -2 * peak and high < 3 * peak


def test_units_on_the_axes(
    solution: xr.Dataset, mixed: xr.Dataset, drawn: dict[str, Figure]
) -> None:
    crank, rail, _ = PLOTS["jacobian"](mixed).axes
    pose, motion, J_A = solution["pose"].values, drawn["motion"].axes, solution["J_A"].values
    beta = np.degrees(solution["pose_acceleration"].values[:, 4])
    for axes, unit, curve, values in (
        (motion[0], "position [mm]", "Z", pose[:, 2] * 1e3),
        (motion[5], "angular acceleration [°/s²]", "β′′", beta),
        (crank, "$J_A$ [mm²/rad]", "crank left", J_A[:, 0] * 1e6),
        (rail, "$J_A$ [mm]", "rail 1", J_A[:, 2] * 1e3),
    ):
        assert axes.get_ylabel() == unit
        np.testing.assert_allclose(curves(axes)[curve], values)
    # Samples that failed are shaded and explained.
    effort = PLOTS["effort"](mixed)
    labels = [axes.get_ylabel() for axes in effort.axes]
    assert labels == ["torque [N m]", "force [N]", "force [N]"]
    assert (len(drawn["effort"].axes[0].patches), len(effort.axes[0].patches)) == (0, 1)
    assert "Grey: no result (unreachable: " in words(effort)
    assert "no result" not in words(drawn["effort"])


def test_a_scale_is_logarithmic_over_decades_alone(
    solution: xr.Dataset, drawn: dict[str, Figure]
) -> None:
    assert {axes.get_yscale() for axes in drawn["singularity"].axes} == {"linear"}
    near = solution.assign(condition=solution["condition"] ** 100)
    assert PLOTS["singularity"](near).axes[3].get_yscale() == "log"


def test_path_of_the_landmark(solution: xr.Dataset, drawn: dict[str, Figure]) -> None:
    point = np.array([0.05, 0.01, -0.02])
    anywhere = solution.copy(deep=True)
    anywhere["pose"].values[:] = np.random.default_rng(5).uniform(-1, 1, anywhere["pose"].shape)
    for pose, place in zip(anywhere["pose"].values, track(anywhere, point), strict=True):
        expected = pose[:3] + np.asarray(rotation(pose[3:])) @ point
        np.testing.assert_allclose(place, expected, atol=1e-15)
    assert "Path of incisor" in words(drawn["path"])
    assert drawn["path"].axes[0].get_lines()[0].get_xdata()[0] == pytest.approx(52.75)


def test_shares_and_none_of_an_absent_load(solution: xr.Dataset, drawn: dict[str, Figure]) -> None:
    parts = ["platform", "couplers", "cranks", "load"]
    assert titles(drawn["share"])[:4] == parts
    idle = solution.copy(deep=True)
    idle["share"].values[list(solution["part"].values).index("load")] = 0.0
    text = words(PLOTS["share"](idle))
    assert "platform" in text and "load" not in text.split("Mechanism")[0] and "bite" not in text
    assert len(figure_9(solution.assign_coords(part=parts)).axes) == len(figure_9(solution).axes)
    for name in ("bite", "load"):  # as older files call it, and as people do
        assert titles(solution.condyle.plot.share(parts=[name]))[0] == "load"


def journal(name: str, solution: xr.Dataset) -> None:
    """A figure in a journal's style is whole, has its size, and letters in the place of titles."""
    figure = PLOTS[name](solution, style="journal", title=False, letters=True)
    assert figure.get_size_inches()[0] * 25.4 == pytest.approx(85)
    assert not figure.get_suptitle().strip() and "stand-in" not in words(figure)
    letters = [title.split()[0] for title in titles(figure)]
    assert letters == [f"({chr(97 + i)})" for i in range(len(figure.axes))]
    assert figure.axes[0].xaxis.label.get_size() == 8
    assert_whole(figure)


def test_figures_for_a_journal(solution: xr.Dataset) -> None:
    """Sizes, styles and the caller's settings hold for one figure."""
    for name in ("effort", "contact_track", "load"):
        journal(name, solution)
    wide = PLOTS["load"](solution, style="journal-wide", figsize=(5, 4))
    assert tuple(wide.get_size_inches()) == (5, 4) and wide.get_suptitle()
    with pytest.raises(condyle.InputError, match="jurnal"):
        PLOTS["load"](solution, style="jurnal")
    solution.condyle.plot.load(style="journal", title=False)
    before, kept = dict(mpl.rcParams), dict(Gcf.figs)
    with mpl.rc_context({"font.size": 30}):
        after = PLOTS["load"](solution)
    assert after.get_suptitle() and after.get_size_inches()[0] == 7
    assert after.axes[0].xaxis.label.get_size() == 9
    assert dict(mpl.rcParams) == before
    assert Gcf.figs == kept  # what pyplot would keep


@pytest.mark.ci
def test_all_figures_are_whole_in_print(solution: xr.Dataset) -> None:
    """Of six chains, and the crowded ones of 24 muscles."""
    for name in PLOTS.keys() - {"effort", "contact_track", "load", *EMPTY}:
        journal(name, solution)
    motion = Motion.from_csv(bundled_reference()[0], rate=5)
    jaw = model("human-jaw").solve(motion, condyle.reference_load(), reactions=True)
    for name in ("effort", "effort_speed", "reaction", "singularity", "path", "forces"):
        assert_whole(PLOTS[name](jaw, style="journal"))
    for name in ("effort", "reaction"):
        assert_whole(PLOTS[name](jaw, style="journal-wide"))


def test_panels_and_figures_of_ones_own(
    solution: xr.Dataset, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A panel is a figure and on the page; a figure has its own and every figure's options."""
    monkeypatch.setattr(panel, "PANEL_GROUPS", dict(panel.PANEL_GROUPS))
    monkeypatch.setattr(registry, "PLOTS", PLOTS)
    for name in ("power", "twice"):
        monkeypatch.setitem(PLOTS, name, None)
    watts = solution["effort"].values * solution["joint_rate"].values

    @panel.panels("actuators", "Power of the actuators")
    def power(given: xr.Dataset) -> Iterator[Panel]:
        """Power of each actuator."""
        yield Panel("power", "Power", "power", "W", panel.of_names(given, "power", "chain", watts))

    @registry.plot()
    def twice(given: xr.Dataset, factor: float = 1.0) -> Figure:
        """Power of each actuator, more of it."""
        made = new_figure("Power", "", 4, 3)
        made.add_subplot().plot(given["time"], factor * watts)
        return made

    plots = solution.condyle.plot
    figure, made = plots.power(figsize=(3, 2)), plots.twice(factor=2.0, figsize=(3, 2))
    assert figure.axes[0].get_ylabel() == "power [W]" and PLOTS["power"].__doc__ == power.__doc__
    np.testing.assert_array_equal(curves(figure.axes[0])["temporalis left"], watts[:, 0])
    np.testing.assert_array_equal(made.axes[0].get_lines()[0].get_ydata(), 2 * watts[:, 0])
    assert tuple(made.get_size_inches()) == (3, 2) and {"power", "twice"} <= {*dir(plots)}
    assert [one.id for section, one in panel.panels_of(solution) if section == "actuators"] == [
        "activation", "load-on-joints", "plane-0", "plane-1", "plane-2", "power",
    ]  # fmt: skip
    for name, draw in PLOTS.items():
        assert inspect.getdoc(getattr(plots, name)) == inspect.getdoc(draw)
    with pytest.raises(AttributeError, match="effort"):
        plots.efort  # noqa: B018


def test_a_ball_runs_on_the_line_of_its_centre(reference: condyle.Mechanism) -> None:
    """With a ball radius the file gives the wall; the track is a radius off it."""
    radius, lift = 0.004, 0.013215 + 0.004 * np.hypot(1.0, 1.1)
    wall = Plane(slope=(-1.1, 0.0), offset=lift)
    more = {"surface": wall, "side": "below", "ball_radius": radius}
    contacts = tuple(c.model_copy(update=more) for c in reference.contacts)
    ball = condyle.derive(reference.replace(contacts=contacts), backend="numpy")
    t = np.linspace(0, 1, 20)
    motion = Motion.from_arrays(t, {n: 3e-3 * t * (n == "X") for n in ball.independent})
    axes = PLOTS["contact_track"](ball.solve(motion)).axes[2]
    assert "left condyle, from the side" in axes.get_title("left")
    lines = {line.get_label(): line.get_xydata() for line in axes.get_lines()}
    line = lines["surface at the home y, less the ball's radius"]
    x, z = lines["contact point"].T
    off = z - np.interp(x, *line[np.argsort(line[:, 0])].T)
    assert np.abs(off).max() < 1e-3, "mm, of the interpolation along the line"


def test_contact_track_against_bounds(solution: xr.Dataset, drawn: dict[str, Figure]) -> None:
    """It fills its page, too."""
    figure = drawn["contact_track"]
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
    figure.draw_without_rendering()
    inverse = figure.transFigure.inverted()
    boxes = [axes.get_tightbbox().transformed(inverse) for axes in figure.axes]
    assert min(box.x0 for box in boxes) < 0.06 and max(box.x1 for box in boxes) > 0.94


def test_pairs_share_a_panel_and_a_colour_and_no_look_repeats() -> None:
    """On figures and on the page."""
    names, legs = ["jaw_left", "jaw_right", "a", "b", "leftover"], [f"leg_{i}" for i in range(20)]
    assert groups(names, ["N m"] * 5) == [[0, 1], [2, 3], [4]]
    assert groups(names[:2], ["N m", "N"]) == [[0], [1]]
    assert groups(legs[:5], ["N"] * 5) == [[0, 1], [2, 3], [4]]
    assert heading(names[:2]) == "jaw" and heading(names[2:4]) == "a, b"

    def lines(names: list[str]) -> list[dict[str, Any]]:
        curves = [Series(name, name, np.zeros(2)) for name in names]
        return list(looks(Panel("a", "A", "a", "1", curves), curves))

    found = lines(names)
    assert found[0]["color"] == found[1]["color"] != found[2]["color"]
    assert found[0]["linestyle"] != found[1]["linestyle"]
    assert len({str(look) for look in lines(legs)}) == 20
    pairs = styles(["jaw_left", "jaw_right", "lid_left", "lid_right"])
    assert [s.colour for s in pairs] == [0, 0, 1, 1]
    assert pairs[0].dash == pairs[2].dash != pairs[1].dash
    alone = styles(["left_condyle", "right_condyle"])
    assert [(s.colour, s.dash) for s in alone] == [(0, "solid"), (1, "dash")]
    assert len({(s.colour, s.dash) for s in styles(legs)}) == 20


def test_files_are_whole_or_not_there(
    solution: xr.Dataset,
    fewer_contacts: dict[int, xr.Dataset],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """One figure is one file, the same each time; those of an earlier solution are removed."""
    with pytest.raises(condyle.InputError, match="does not exist"):
        figures.save(PLOTS["load"](solution), tmp_path / "nowhere", "load")
    broken = PLOTS["load"](solution)
    broken.axes[0].set_title("$\\nosuch$")  # fails while it is being written
    with pytest.raises(ValueError):
        figures.save(broken, tmp_path, "load")
    assert not list(tmp_path.iterdir())
    name = fewer_contacts[0].attrs["mechanism_name"]
    again = figures.save(PLOTS["load"](fewer_contacts[0]), tmp_path, "again")
    stale, other = tmp_path / f"{name}-contact_force.png", tmp_path / "other-contact_force.png"
    stale.touch()
    other.touch()
    few = {name: PLOTS[name] for name in ("load", "contact_force")}
    monkeypatch.setattr(figures, "PLOTS", few)
    paths = figures.save_solution_figures(fewer_contacts[0], tmp_path)
    assert [p.name for p in paths] == [f"{name}-load.png", f"{name}-load.svg"]
    assert {*tmp_path.iterdir()} == {*paths, *again, other}
    for one, two in zip(paths, again, strict=True):
        assert one.read_bytes() == two.read_bytes()


def test_names_are_no_formulas(solution: xr.Dataset, tmp_path: Path) -> None:
    """A $ in a name is printed, in the caption too."""
    chains = ["$\\frac{$", "cost $5$", *map(str, solution["chain"].values[2:])]
    odd = renamed(solution, chains, ["$x^$", "right"]).assign_attrs(mechanism_name=chains[0])
    for name in ("effort", "contact_force", "effort_speed"):
        figures.save(PLOTS[name](odd), tmp_path, name)
    assert not {text for text in PLOTS["effort"](odd).findobj(mpl.text.Text) if is_formula(text)}


def is_formula(text: mpl.text.Text) -> bool:
    return text.get_parse_math() and bool(mpl.cbook.is_math_text(text.get_text()))


@pytest.mark.slow
def test_modes_are_drawn_at_both_ends_of_their_swing(solution: xr.Dataset) -> None:
    """Frequencies as bars, and two mechanisms apart, one of them pale."""
    machine = condyle.load_mechanism("masticatory")
    soft = machine.set({f"chain.{n}.actuator.stiffness": 400.0 for n in machine.chain_names})
    made = solution.assign_attrs(mechanism=condyle.dumps(soft))
    figure = PLOTS["modes"](made)
    hertz = condyle.derive(soft, backend="numpy").modes(np.zeros(4)).frequency
    bars, *pictures = figure.axes
    np.testing.assert_allclose([bar.get_width() for bar in bars.patches], hertz)
    assert [axes.get_title(loc="left") for axes in pictures] == [
        f"{i}: {value:.4g} Hz" for i, value in enumerate(hertz, 1)
    ]
    for axes in pictures:
        pale, bright = axes.collections
        assert np.abs(pale.get_facecolors()[:, 3]).max() < bright.get_facecolors()[:, 3].max()
        ends = [np.vstack([p.vertices for p in one.get_paths()]) for one in (pale, bright)]
        moved = [[end.min(axis=0), end.max(axis=0)] for end in ends]
        assert 1.0 < np.abs(np.subtract(*moved)).max() < 100.0  # mm
    with pytest.raises(EmptyFigureError, match="no part of this mechanism gives"):
        PLOTS["modes"](solution)
