"""What was measured, on figures and page: markers, residuals, EMG under activations."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from matplotlib.collections import QuadMesh
from support.report_pages import column, payload

import condyle
from condyle.markers import MeasuredChannels
from condyle.motion import Motion, bundled_reference
from condyle.report.figures import PLOTS
from condyle.report.page import reduce as reducing
from condyle.report.page import report_html
from condyle.view.playback import Playback

NAMES = ("Upper", "Lower", "Ear")


@pytest.fixture(scope="module")
def jaw() -> xr.Dataset:
    """With a marker of each body, one of them unseen for a while, and EMG of two muscles."""
    model = condyle.derive("human-jaw", backend="numpy")
    motion = Motion.from_csv(bundled_reference()[0], rate=20)
    solution = model.solve(motion, condyle.reference_load())
    t = solution["time"].values
    points = np.stack([np.full((len(t), 3), 0.08), np.outer(np.sin(t), [0, 0, 0.01])], axis=1)
    points = np.concatenate([points, points[:, :1] + 0.02], axis=1)
    points[10:14, 1] = np.nan
    residual = np.outer(1e-4 * (1 + np.sin(3 * t)), [1, 2, np.nan])
    biter = solution["activation"].sel(chain="deep_masseter_right").values
    emg = {
        "deep_masseter_right": np.interp(t + 0.05, t, biter),  # 50 ms ahead
        "geniohyoid_left": np.abs(np.cos(t)),
    }
    bodies = ("fixed", "platform", "")
    return solution.condyle.with_measured(MeasuredChannels(t, NAMES, bodies, points, residual, emg))


def test_the_page_has_markers_and_their_residuals(jaw: xr.Dataset) -> None:
    data = payload(report_html(jaw))
    markers = data["machine"]["markers"]
    assert [(m["name"], m["body"]) for m in markers] == list(
        zip(NAMES, ("fixed", "platform", ""), strict=True)
    )
    for i, marker in enumerate(markers):
        drawn = np.column_stack([column(data, c) for c in marker["columns"]])
        np.testing.assert_allclose(drawn, jaw["marker_place"].values[:, i], atol=1e-8)
    (panel,) = [p for p in data["panels"] if p["section"] == "markers"]
    assert (
        panel["unit"] == "mm"
        and [s["label"].split(":")[0] for s in panel["sets"]]
        == [
            "base",
            "platform",
        ]
        * 2
    )
    assert [[line["label"] for line in s["lines"]] for s in panel["sets"][:2]] == [
        ["Upper"],
        ["Lower"],
    ]
    line = panel["sets"][1]["lines"][0]
    shown = column(data, line["column"]) * line["scale"]
    np.testing.assert_allclose(shown, 1e3 * jaw["marker_residual"].values[:, 1], rtol=1e-6)
    low, high = np.array(data["machine"]["range"]).T
    assert (low <= 0.08).all() and (high >= 0.1).all(), "markers are within the picture"
    assert data["machine"]["scales"]["load"]["largest"] > 0


def test_emg_stands_under_its_muscle(jaw: xr.Dataset) -> None:
    data = payload(report_html(jaw))
    (field,) = [p for p in data["panels"] if p["id"] == "activation"]
    labels = [line["label"] for line in field["sets"][0]["lines"]]
    for chain in ("deep_masseter_right", "geniohyoid_left"):
        assert labels[labels.index(chain) + 1] == f"{chain} EMG"
        line = field["sets"][0]["lines"][labels.index(chain) + 1]
        values = column(data, line["column"]) * line["scale"]
        of = jaw["emg"].sel(chain=chain).values
        np.testing.assert_allclose(values, of, rtol=1e-6)
    assert len(labels) == 26 and "EMG" in field["note"]
    assert "deep_masseter_right EMG +50 ms" in field["note"]
    assert "geniohyoid_left EMG" not in field["note"]  # its largest correlation is beyond 0.3 s
    axes = PLOTS["activation"](jaw).axes[0]
    rows = [label.get_text() for label in axes.get_yticklabels()]
    (mesh,) = [one for one in axes.collections if isinstance(one, QuadMesh)]
    drawn = np.ma.getdata(mesh.get_array()).reshape(26, -1)
    at = rows.index("deep masseter right EMG +50 ms")
    assert rows[at - 1] == "deep masseter right"
    np.testing.assert_allclose(drawn[at], jaw["emg"].sel(chain="deep_masseter_right"), rtol=1e-12)


def test_without_measurements_the_page_is_as_before(jaw: xr.Dataset) -> None:
    plain = jaw.drop_dims("marker").drop_vars("emg")
    data = payload(report_html(plain))
    assert data["machine"]["markers"] == []
    assert not [p for p in data["panels"] if p["section"] == "markers"]
    assert Playback(plain).snapshot().markers is None


def test_peaks_of_residuals_stay_on_a_page_that_is_thinned(
    jaw: xr.Dataset, monkeypatch: pytest.MonkeyPatch
) -> None:
    torn = jaw.copy(deep=True)
    torn["marker_residual"].values[33, 1] = 0.02
    monkeypatch.setattr(reducing, "BUDGET", 4 * 400 * 40)
    data = payload(report_html(torn))
    assert data["columns"]["samples"] < data["columns"]["total"]
    (panel,) = [p for p in data["panels"] if p["section"] == "markers"]
    line = panel["sets"][1]["lines"][0]
    assert np.nanmax(column(data, line["column"])) == pytest.approx(0.02, rel=1e-6)


def test_playback_knows_where_the_markers_are(jaw: xr.Dataset) -> None:
    playback = Playback(jaw)
    playback.seek(float(jaw["time"].values[12]))
    markers = playback.snapshot().markers
    assert markers is not None and np.isnan(markers[1]).all()
    np.testing.assert_array_equal(markers[0], jaw["marker_place"].values[12, 0])


def test_joints_of_many_chains_are_small_multiples(jaw: xr.Dataset) -> None:
    figure = PLOTS["joint"](jaw)
    assert len(figure.axes) == 36  # 12 pairs, three columns
    first = figure.axes[0]
    assert [line.get_label() for line in first.get_lines()] == ["left", "right"]
    np.testing.assert_allclose(first.get_lines()[1].get_ydata(), 1e3 * jaw["joint"].values[:, 1])
    assert first.get_ylabel() == "anterior\ntemporalis" and first.get_title() == ""
    scales = {axes.get_ylim() for axes in figure.axes[::3]}
    assert len(scales) == 1, "one scale a column"
    texts = {text.get_text() for text in figure.legends[0].get_texts()}
    assert texts == {"left", "right"}
