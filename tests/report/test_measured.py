"""What was measured, on figures and page: markers, residuals, EMG under activations."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from matplotlib.collections import QuadMesh
from support.report_pages import column, payload

from condyle.markers import MeasuredChannels
from condyle.report.figures import PLOTS
from condyle.report.page import reduce as reducing
from condyle.report.page import report_html
from condyle.view.playback import Playback

NAMES, BODIES = ("Upper", "Lower", "Ear"), ("fixed", "platform", "")


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


def test_the_page_has_markers_and_their_residuals(seen: xr.Dataset) -> None:
    data = payload(report_html(seen))
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
    assert data["machine"]["scales"]["load"]["largest"] > 0
    # Played, they are there, too.
    playback = Playback(seen)
    playback.seek(float(seen["time"].values[12]))
    places = playback.snapshot().markers
    assert places is not None and np.isnan(places[1]).all()
    np.testing.assert_array_equal(places[0], seen["marker_place"].values[12, 0])
    # Without measurements there are none.
    plain = seen.drop_dims("marker").drop_vars("emg")
    data = payload(report_html(plain))
    assert data["machine"]["markers"] == []
    assert not [p for p in data["panels"] if p["section"] == "markers"]
    assert Playback(plain).snapshot().markers is None


def test_emg_stands_under_its_muscle(seen: xr.Dataset) -> None:
    data = payload(report_html(seen))
    (field,) = [p for p in data["panels"] if p["id"] == "activation"]
    labels = [line["label"] for line in field["sets"][0]["lines"]]
    for chain in ("deep_masseter_right", "geniohyoid_left"):
        assert labels[labels.index(chain) + 1] == f"{chain} EMG"
        line = field["sets"][0]["lines"][labels.index(chain) + 1]
        values = column(data, line["column"]) * line["scale"]
        of = seen["emg"].sel(chain=chain).values
        np.testing.assert_allclose(values, of, rtol=1e-6)
    assert len(labels) == 26 and "EMG" in field["note"]
    assert "deep_masseter_right EMG +50 ms" in field["note"]
    assert "geniohyoid_left EMG" not in field["note"]  # its largest correlation is beyond 0.3 s
    axes = PLOTS["activation"](seen).axes[0]
    rows = [label.get_text() for label in axes.get_yticklabels()]
    (mesh,) = [one for one in axes.collections if isinstance(one, QuadMesh)]
    drawn = np.ma.getdata(mesh.get_array()).reshape(26, -1)
    at = rows.index("deep masseter right EMG +50 ms")
    assert rows[at - 1] == "deep masseter right"
    np.testing.assert_allclose(drawn[at], seen["emg"].sel(chain="deep_masseter_right"), rtol=1e-12)


def test_peaks_of_residuals_stay_on_a_page_that_is_thinned(
    seen: xr.Dataset, monkeypatch: pytest.MonkeyPatch
) -> None:
    torn = seen.copy(deep=True)
    torn["marker_residual"].values[33, 1] = 0.02
    monkeypatch.setattr(reducing, "BUDGET", 4 * 400 * 40)
    data = payload(report_html(torn))
    assert data["columns"]["samples"] < data["columns"]["total"]
    (panel,) = [p for p in data["panels"] if p["section"] == "markers"]
    line = panel["sets"][1]["lines"][0]
    assert np.nanmax(column(data, line["column"])) == pytest.approx(0.02, rel=1e-6)


def test_joints_of_many_chains_are_small_multiples(seen: xr.Dataset) -> None:
    figure = PLOTS["joint"](seen)
    assert len(figure.axes) == 36  # 12 pairs, three columns
    first = figure.axes[0]
    assert [line.get_label() for line in first.get_lines()] == ["left", "right"]
    np.testing.assert_allclose(first.get_lines()[1].get_ydata(), 1e3 * seen["joint"].values[:, 1])
    assert first.get_ylabel() == "anterior\ntemporalis" and first.get_title() == ""
    scales = {axes.get_ylim() for axes in figure.axes[::3]}
    assert len(scales) == 1, "one scale a column"
    texts = {text.get_text() for text in figure.legends[0].get_texts()}
    assert texts == {"left", "right"}
