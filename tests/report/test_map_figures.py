"""What is on the pictures of maps."""

from __future__ import annotations

import warnings

import numpy as np
import xarray as xr
from support.machines import model

import condyle
from condyle.analysis.map.lines import slices_of
from condyle.report.figures.map_figures import LINES, drawn, grown, map_figure


def mapped(over: list[str], quantity: str | list[str]) -> xr.Dataset:
    return condyle.workspace_map(model("masticatory"), over, quantity)


def titles(figure: object) -> list[str]:
    return [title for axes in figure.axes if (title := axes.get_title(loc="left"))]


def test_two_coordinates() -> None:
    """The border, the bounds and the motion stand where they are, in the units of the axes."""
    over = ["X=-5:15:9 mm", "beta=-15:45:8 deg"]
    dataset = mapped(over, ["reachable", "ratio", "transmission"])
    assert drawn(dataset) == ["cause", "ratio", "transmission"]
    slices = [*slices_of(dataset, model("masticatory"))]
    (one,) = slices
    run, units = np.array([[0.0, 0.0], [0.001, 0.02]]), [1e3, 180 / np.pi]
    figure = map_figure(dataset, "ratio", slices, run)
    place = figure.axes[0]
    assert (place.get_xlabel(), place.get_ylabel()) == ("X [mm]", "β [°]")
    np.testing.assert_allclose(place.get_xlim() + place.get_ylim(), (-5, 15, -15, 45))
    paths = [line.get_xydata() for line in place.lines]
    np.testing.assert_allclose(paths[-1], run * units)
    for line, path in zip(one.lines, paths, strict=False):
        np.testing.assert_allclose(path, line.points * units)
    assert {line.kind for line in one.lines} == {"reach", "bounds"} <= LINES.keys()
    labels = {text.get_text() for text in figure.legends[0].get_texts()}
    assert {"reach of a chain", "bounds of a contact", "motion of the run"} <= labels
    six = titles(map_figure(dataset, "transmission", slices))
    assert six[0] == "temporalis left" and len(six) == 6
    reach = map_figure(dataset, "cause", slices)
    assert any("temporalis" in text.get_text() for text in reach.legends[0].get_texts())


def test_slices_of_three_coordinates_and_lines_of_one() -> None:
    dataset = mapped(["X=-3:8:6 mm", "beta=-8:14:5 deg", "Y=-2:2:4 mm"], "ratio")
    slices = [*slices_of(dataset, model("masticatory"))]
    assert len(slices) == 2 and all(s.at == dataset.Y[s.index] for s in slices)
    found = titles(map_figure(dataset, "ratio", slices))
    assert found[:2] == [f"Y = {s.at * 1e3:.3g} mm" for s in slices]
    lines = map_figure(mapped(["X=-5:30:30 mm"], ["ratio", "pose"]), "pose").axes[0].lines
    assert [line.get_label() for line in lines] == ["Z", "γ"]  # what the contacts determine
    assert np.isnan(lines[0].get_ydata()).any()
    # Reached everywhere: nothing to name, and matplotlib does not complain of an empty legend.
    everywhere = mapped(["beta=1:3:3 deg"], "ratio")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert map_figure(everywhere, "ratio").axes[0].get_legend() is None


def test_a_map_of_a_jaw_has_its_words_and_joint_loads() -> None:
    """Positive where the skull pushes the condyle; the variable is along the normal, upwards."""
    jaw = model("human-jaw")
    dataset = condyle.workspace_map(jaw, ["beta=0:3:4 deg"], "contact_force", load="Fz=-50")
    figure = map_figure(dataset, "contact_force")
    assert figure.get_suptitle().startswith("Joint load at rest, positive: the")
    drawn_loads = np.array([line.get_ydata() for line in figure.axes[0].lines])
    assert (drawn_loads > 0).all()
    np.testing.assert_allclose(drawn_loads, -dataset["contact_force"].values.T)


def test_fields_grow_over_the_border() -> None:
    field = np.full((5, 5), np.nan)
    field[2, 2] = 3.0
    assert (grown(field, 1)[1:4, 1:4] == 3.0).all() and np.isnan(grown(field, 1)[0]).all()
    assert (grown(field, 2) == 3.0).all()
