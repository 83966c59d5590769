"""The curve between least effort and least load on the contacts."""

from __future__ import annotations

import numpy as np
import pytest

import condyle
from condyle.analysis.comparison import compare
from condyle.analysis.weight_curve import Tradeoff, tradeoff
from condyle.model.distributing import Distribution
from condyle.motion import Motion
from condyle.report.figures.tradeoff_figure import apart, tradeoff_figure
from condyle.report.tables.comparison_tables import tradeoff_table

WEIGHTS = (0.0, 0.1, 1.0, 10.0, 1e3)


@pytest.fixture(scope="module")
def motion() -> Motion:
    return condyle.trial_motion(condyle.load_mechanism("masticatory"), rate=10)


@pytest.fixture(scope="module")
def curve(motion: Motion) -> Tradeoff:
    return tradeoff(condyle.load_mechanism("masticatory"), motion, weights=WEIGHTS, backend="numpy")


def test_more_effort_buys_less_load(curve: Tradeoff) -> None:
    assert (np.diff(curve.effort) > 0).all() and (np.diff(curve.load) < 0).all()
    assert curve.samples == curve.solution.sizes["time"] and curve.solution["status"].sum() == 0
    assert curve.mean.shape == curve.peak.shape == (5, 2) and (curve.peak >= curve.mean).all()
    assert curve.load[-1] < 0.1 * curve.load[0]


def test_every_point_is_the_least_of_all_efforts(curve: Tradeoff, motion: Motion) -> None:
    """Efforts that balance form a plane here, which three of them span; its least is algebra."""
    model = condyle.derive("masticatory", backend="numpy", distribution="weighted")
    unit = model.reference_force**2
    weighted = (Distribution("weighted", 0, w) for w in (0.0, 1.0, 30.0))
    found = [model.with_distribution(one).solve(motion) for one in weighted]
    limit, rows = 3.0, found[0].sizes["time"]
    for w, weight in enumerate(curve.weights):
        squares = 0.0
        for i in range(rows):
            scaled = [
                np.concatenate([
                    one["effort"].values[i] / limit,
                    np.sqrt(weight / unit) * one["contact_force"].values[i],
                ])
                for one in found
            ]  # fmt: skip
            G = np.column_stack([scaled[1] - scaled[0], scaled[2] - scaled[0]])
            z = np.linalg.lstsq(G, -scaled[0], rcond=None)[0]
            squares += float(((scaled[0] + G @ z)[:6] ** 2).sum())
        assert curve.effort[w] == pytest.approx(np.sqrt(squares / rows), rel=1e-7)


def test_the_first_is_weighted_without_a_weight(curve: Tradeoff, motion: Motion) -> None:
    model = condyle.derive("masticatory", backend="numpy", distribution="weighted")
    efforts = model.solve(motion)["effort"].values
    assert curve.activation[0] == pytest.approx(np.abs(efforts).max() / 3)
    np.testing.assert_allclose(curve.solution["effort"], efforts)


def test_table_and_figure(curve: Tradeoff) -> None:
    table = tradeoff_table(curve)
    assert [record["weight"] for record in table.records] == list(WEIGHTS)
    assert all(len(row) == len(table.columns) == 6 for row in table.rows)
    assert table.records[2]["mean_left_condyle"] == curve.mean[2, 0]
    figure = tradeoff_figure(curve)
    line = figure.axes[0].get_lines()[0]
    np.testing.assert_array_equal(line.get_xydata(), np.column_stack([curve.effort, curve.load]))
    assert apart(curve)[0] == 0 and apart(curve, least=2.0) == [0]


def test_what_has_no_curve(motion: Motion) -> None:
    with pytest.raises(condyle.InputError, match="has no contacts"):
        tradeoff(condyle.load_mechanism("gough-stewart"), motion)
    with pytest.raises(condyle.InputError, match="strictly increasing"):
        tradeoff(condyle.load_mechanism("masticatory"), motion, weights=(1.0, 0.5))
    jaw = condyle.load_mechanism("human-jaw")
    first = jaw.chains[0]
    free = first.model_copy(
        update={"actuator": first.actuator.model_copy(update={"force_limit": None})}
    )
    with pytest.raises(condyle.InputError, match=f"{first.name} has none"):
        tradeoff(jaw.replace(chains=(free, *jaw.chains[1:])), condyle.trial_motion(jaw))


@pytest.mark.slow
def test_models_agree_under_every_distribution(motion: Motion) -> None:
    for name in ("bounded", "weighted"):
        found = compare(
            condyle.load_mechanism("masticatory"),
            motion,
            formulations=["momentum"],
            distribution=name,
        )
        assert max(pair.effort for pair in found.differences()) < 1e-9
        assert found.solution.condyle.options["distribution"] == name
